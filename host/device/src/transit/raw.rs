//! A job to a device that takes the printer's bytes as they are, such as `/dev/usb/lp0` behind a USB-to-parallel cable.
//!
//! Limits: such a device says only that the system took the bytes, not that the printer did, and after an interruption
//! nobody knows which it got. So a job cannot be resumed here, and ended early only by the process that sends it; that is
//! what the bridge is for.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use observe::Observer;
use press::inspect::ending;

/// Bytes handed over at once.
const PIECE: usize = 4096;
/// A device that takes nothing for this long is worth a word.
const STILL: Duration = Duration::from_secs(15);

/// Why a job did not get to the device whole.
#[derive(Debug, thiserror::Error)]
pub enum RawError {
    /// It cannot be opened; nothing was sent.
    #[error("{} cannot be opened; `foilpress doctor` says what to set up", path.display())]
    Open {
        /// The device.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// It is a file, which this would write over.
    #[error("{} is a file and no device; `file:{}` writes a job into a file", path.display(), path.display())]
    NoDevice {
        /// The file.
        path: PathBuf,
    },
    /// It failed in the middle.
    #[error(
        "{} failed after {taken} of {length} bytes; the sheet is lost. Switch the printer off and on before the next job",
        path.display()
    )]
    Write {
        /// The device.
        path: PathBuf,
        /// Bytes the system had taken.
        taken: usize,
        /// Bytes of the job.
        length: usize,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}

/// What a device was given.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Sent {
    /// Bytes the system took.
    pub(crate) taken: usize,
    /// Whether they are the whole job; otherwise it was ended early.
    pub(crate) whole: bool,
}

fn open(path: &Path) -> Result<File, RawError> {
    let cannot = |source| RawError::Open { path: path.to_path_buf(), source };
    let device = OpenOptions::new().write(true).open(path).map_err(cannot)?;
    match device.metadata().map_err(cannot)?.is_file() {
        true => Err(RawError::NoDevice { path: path.to_path_buf() }),
        false => Ok(device),
    }
}

/// Whether the device can be opened now.
pub(crate) fn try_open(path: &Path) -> Result<(), RawError> {
    open(path).map(drop)
}

/// Hands a job over, waiting for the operator as long as it takes. The job must have been
/// [checked](crate::encodings::check()). When `stop` says so the job is brought to an [early
/// end](press::inspect::ending), as soon as the device takes bytes.
pub(crate) fn send_while(
    job: &[u8],
    path: &Path,
    observer: &dyn Observer,
    stop: &dyn Fn() -> bool,
) -> Result<Sent, RawError> {
    let mut device = open(path)?;
    observer.begin("to the printer", job.len() as u64);
    let (tell, told) = mpsc::channel();
    let result = std::thread::scope(|scope| {
        // A write to such a device may wait for hours inside the system; the words come from beside it.
        scope.spawn(move || {
            let mut waiting = false;
            loop {
                match told.recv_timeout(STILL) {
                    Ok(()) => waiting = false,
                    Err(RecvTimeoutError::Timeout) if !waiting => {
                        observer.note(
                            "the printer takes no bytes at the moment: it is busy with what it has, or is waiting for paper, \
                             a cartridge or its cover",
                        );
                        waiting = true;
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            }
        });
        let mut taken = 0;
        let mut cut: Option<Vec<u8>> = None;
        loop {
            if cut.is_none() && stop() {
                let mut shorter = job[..taken].to_vec();
                shorter.extend(ending(job, taken));
                cut = Some(shorter);
            }
            let job = cut.as_deref().unwrap_or(job);
            if taken == job.len() {
                break;
            }
            match device.write(&job[taken..(taken + PIECE).min(job.len())]) {
                Ok(0) => return Err((taken, io::ErrorKind::WriteZero.into())),
                Ok(count) => {
                    taken += count;
                    observer.advance(count as u64);
                    // The listener ends only after us.
                    let _ = tell.send(());
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err((taken, error)),
            }
        }
        let flushed = device.flush().map_err(|error| (taken, error));
        drop(tell);
        flushed.map(|()| Sent { taken, whole: cut.is_none() })
    });
    observer.end();
    result.map_err(|(taken, source)| RawError::Write {
        path: path.to_path_buf(),
        taken,
        length: job.len(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_gets_every_byte_in_order_however_slowly_it_takes_them() {
        use std::io::Read as _;
        use std::os::fd::AsRawFd as _;
        let (mut reader, writer) = std::io::pipe().unwrap();
        let job: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
        let got = std::thread::spawn(move || {
            let mut got = Vec::new();
            let mut buffer = [0; 777];
            while got.len() < 200_000 {
                let count = reader.read(&mut buffer).unwrap();
                got.extend_from_slice(&buffer[..count]);
            }
            got
        });
        let sent = send_while(&job, Path::new(&path), &Silent, &|| false).unwrap();
        assert_eq!(sent, Sent { taken: job.len(), whole: true });
        assert!(got.join().unwrap() == job);
        drop(writer);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_that_fails_in_the_middle_costs_the_sheet_and_says_so() {
        let error = send_while(&[0; 10], Path::new("/dev/full"), &Silent, &|| false).unwrap_err();
        assert!(matches!(error, RawError::Write { taken: 0, length: 10, .. }), "{error}");
        let error = try_open(Path::new("/no/such/device")).unwrap_err();
        assert!(matches!(error, RawError::Open { .. }));
        // What a file holds stays there.
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "precious").unwrap();
        let error = send_while(&[0; 10], file.path(), &Silent, &|| false).unwrap_err();
        assert!(matches!(error, RawError::NoDevice { .. }), "{error}");
        assert_eq!(std::fs::read(file.path()).unwrap(), b"precious");
    }
}
