//! How the print system calls a backend, and what the backend's exit code tells it.
//!
//! Source: backend(7).

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::{options, uri};
use device::connection::Destination;
use device::transit::journal::{Journal, JournalError};

/// What the print system should do next. The numbers are defined by CUPS.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Exit {
    /// The job is printed.
    Ok = 0,
    /// The job failed; the policy of the queue decides.
    Failed = 1,
    /// The job is held until somebody releases it.
    Hold = 3,
    /// The queue stops until the administrator has acted.
    Stop = 4,
    /// The job is invalid and is cancelled.
    Cancel = 5,
}

/// A call of the print system: `URI job user title copies options [file]`.
#[derive(Clone, Debug)]
pub struct Call {
    /// What the user calls the job.
    pub title: String,
    /// The job's identity, the same when it is started again.
    pub identity: String,
    /// Number of copies to print; 1 when filters have made the copies.
    pub copies: u32,
    /// The file; standard input without one.
    pub file: Option<PathBuf>,
    /// Where the queue leads.
    pub to: Destination,
    /// Folder for data that must outlive the process.
    pub journal: PathBuf,
    /// Whether to wait for each sheet until the printer says that it is out.
    pub awaits_sheets: bool,
    /// Whether another printer of a class may do the job.
    pub in_class: bool,
    /// The queue, and the job as the print system lists it there.
    pub listed: (String, String),
    /// The program that lists the jobs of a queue: `lpstat`.
    pub lister: PathBuf,
}

/// Why a call cannot be understood.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// Too few or too many arguments.
    #[error(
        "expected job-id user title copies options [file], found {0} arguments; only the print system calls this"
    )]
    Arguments(usize),
    /// No URI.
    #[error("DEVICE_URI is not set; only the print system calls this")]
    NoUri,
    /// No destination.
    #[error(transparent)]
    Uri(#[from] uri::UriError),
    /// No folder for the journal.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// A text reduced to a safe file name.
fn file_name(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').take(64).collect()
}

impl Call {
    /// Reads a call from its arguments (without the program's name) and the environment.
    pub fn read(arguments: &[OsString], var: &dyn Fn(&str) -> Option<OsString>) -> Result<Call, CallError> {
        let (job, title, copies, options, file) = match arguments {
            [job, _user, title, copies, options] => (job, title, copies, options, None),
            [job, _user, title, copies, options, file] => {
                (job, title, copies, options, Some(PathBuf::from(file)))
            }
            other => return Err(CallError::Arguments(other.len())),
        };
        let text = |name: &str| var(name).map(|value| value.to_string_lossy().into_owned());
        let to = uri::parse(&text("DEVICE_URI").ok_or(CallError::NoUri)?)?;
        let options = options::parse(&options.to_string_lossy());
        let uuid = options.iter().find(|(name, _)| name == "job-uuid").map(|(_, value)| value.as_str());
        // A user may give any option, the scheduler's own among them, but not another one's number. A job without an identity is
        // known by its title, too.
        let number = file_name(&job.to_string_lossy());
        let identity = match uuid.map(|uuid| file_name(uuid.strip_prefix("urn:uuid:").unwrap_or(uuid))) {
            Some(uuid) if !uuid.is_empty() => format!("{uuid}-{number}"),
            _ => format!("job-{number}-{}", file_name(&title.to_string_lossy())),
        };
        let queue = text("PRINTER").unwrap_or_default();
        let listed = (queue.clone(), format!("{queue}-{}", job.to_string_lossy()));
        let queue = file_name(&queue);
        let folder = match (var("FOILPRESS_JOBS"), var("CUPS_CACHEDIR")) {
            (Some(jobs), _) => PathBuf::from(jobs),
            (None, Some(cache)) => Path::new(&cache).join("foilpress"),
            (None, None) => Journal::of_user()?.folder().join("queues"),
        };
        Ok(Call {
            title: title.to_string_lossy().into_owned(),
            identity,
            copies: match file {
                Some(_) => copies.to_string_lossy().parse().unwrap_or(1).clamp(1, 1000),
                None => 1,
            },
            file,
            to,
            journal: folder.join(if queue.is_empty() { "queue" } else { &queue }),
            awaits_sheets: false,
            in_class: var("CLASS").is_some_and(|class| !class.is_empty()),
            listed,
            lister: "lpstat".into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_is_read_as_the_print_system_makes_it() {
        let arguments = |list: &[&str]| list.iter().map(OsString::from).collect::<Vec<_>>();
        let environment = |name: &str| -> Option<OsString> {
            Some(match name {
                "DEVICE_URI" => "foilpress:/serial/dev/ttyACM0".into(),
                "PRINTER" => "Alps".into(),
                "CUPS_CACHEDIR" => "/var/cache/cups".into(),
                _ => return None,
            })
        };
        let options = "media=A4 job-uuid=urn:uuid:0f0e-/../x copies=3";
        let call = Call::read(&arguments(&["7", "me", "My title", "3", options, "/spool/d7"]), &environment)
            .unwrap();
        assert_eq!((call.identity.as_str(), call.copies, call.in_class), ("0f0e-x-7", 3, false));
        assert_eq!(call.journal, Path::new("/var/cache/cups/foilpress/Alps"));
        assert_eq!(call.listed, ("Alps".into(), "Alps-7".into()));
        // Another user's option is not another user's job.
        let other =
            Call::read(&arguments(&["8", "you", "My title", "3", options, "/spool/d8"]), &environment);
        assert_ne!(other.unwrap().identity, call.identity);
        // On standard input the filters have made the copies.
        let call = Call::read(&arguments(&["7", "me", "../t", "3", ""]), &environment).unwrap();
        assert_eq!((call.identity.as_str(), call.copies), ("job-7-t", 1));
        assert!(matches!(Call::read(&arguments(&["7"]), &environment), Err(CallError::Arguments(1))));
        assert!(matches!(Call::read(&arguments(&["7", "", "", "", ""]), &|_| None), Err(CallError::NoUri)));
    }
}
