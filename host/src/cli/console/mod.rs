//! What every command does the same way: results, notes and questions on the terminal, jobs from files, errors as text.

pub mod advice;
pub mod permission;
pub mod progress;
pub mod terminal;
mod visible;

pub use visible::{draw, say, show, stderr, stdout};

use std::fmt;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, bail};
use clap::error::ErrorKind;

use device::connection::OpenError;
use device::deliver::Failure;
use device::flash::FlashError;
use device::questions::query::QueryError;
use observe::{Observer, visible, with_causes};
use press::simulate;
use sheet::Sheet;

/// The largest stream that is read: several times a page of noise in seven passes.
const LARGEST_JOB: u64 = 256 << 20;

/// An error with its causes.
pub fn chain(error: &anyhow::Error) -> String {
    with_causes(error.as_ref())
}

/// A mistake in the arguments that clap does not see by itself. It ends like those that clap sees, with exit code 2.
pub fn usage(said: impl fmt::Display) -> Error {
    clap::Error::raw(ErrorKind::ValueValidation, format!("{}\n", visible(&said.to_string()))).into()
}

/// The job in a folder that `print` or `layers` wrote.
pub fn job_in(folder: &Path) -> Option<PathBuf> {
    Some(folder.join("job.rgl")).filter(|job| job.is_file())
}

/// Reads a whole job from a file or from the folder of a print.
pub fn read_job(path: &Path) -> Result<Vec<u8>> {
    let inside = job_in(path);
    let path = inside.as_deref().unwrap_or(path);
    if path.is_dir() {
        bail!(
            "{}: a folder without a job.rgl; expected a job (.rgl), or a folder that `print` or `layers` wrote",
            path.display()
        );
    }
    let cannot = || format!("cannot read {}", path.display());
    let file = File::open(path).with_context(cannot)?;
    let mut job = Vec::new();
    file.take(LARGEST_JOB + 1).read_to_end(&mut job).with_context(cannot)?;
    if job.len() as u64 > LARGEST_JOB {
        bail!("{} is larger than {} MB, too large for a job", path.display(), LARGEST_JOB >> 20);
    }
    Ok(job)
}

/// The sheet that the simulated printer makes of a job in a file.
pub fn print_job(path: &Path, observer: &dyn Observer) -> Result<Sheet> {
    let about = || path.display().to_string();
    let printout =
        simulate::print(&read_job(path)?, &simulate::Setup::default(), observer).with_context(about)?;
    printout.sheet().with_context(about)
}

/// Whether the reader of our output went away, as in `foilpress inspect job.rgl | head`. A printer or a bridge that went
/// away is something else.
pub fn closed_pipe(error: &anyhow::Error) -> bool {
    let device = error.chain().any(|cause| {
        cause.is::<Failure>()
            || cause.is::<QueryError>()
            || cause.is::<OpenError>()
            || cause.is::<FlashError>()
    });
    !device
        && error.chain().any(|cause| {
            cause.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
        })
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::path::PathBuf;

    use appearance::document::DocumentError;
    use appearance::factor::FactorError;
    use appearance::gamut::files::MixFileError;
    use appearance::gamut::{GamutError, MixError};
    use appearance::solve::MixtureError;
    use appearance::weights::WeightError;
    use device::encodings::Unsendable;
    use device::flash::drive::DriveError;
    use device::flash::image::ImageError;
    use device::flash::picoboot::WriteError;
    use device::printers::PrintersError;
    use device::transit::RunError;
    use device::transit::journal::JournalError;
    use device::transit::raw::RawError;
    use files::FileError;
    use press::inspect::StreamError;
    use press::pipeline::JobError;
    use press::pipeline::document::StageError;
    use press::simulate::{CarouselError, SimulateError};

    use observe::Diagnosis;

    use super::*;
    use queue::filter::FilterError;
    use queue::raster::RasterError;

    fn path() -> PathBuf {
        "somewhere".into()
    }

    fn disk() -> io::Error {
        io::Error::other("the disk is on fire")
    }

    fn weights() -> WeightError {
        WeightError::Sum { x: 3, y: 4, sum: 7 }
    }

    fn mixture() -> GamutError {
        GamutError::Mixture { what: "basis 2".into(), source: MixtureError::NoStacks }
    }

    fn art() -> Diagnosis {
        Diagnosis::of_file(&path(), "cannot open it").because(disk())
    }

    fn journal() -> JournalError {
        JournalError::Io { what: "write", path: path(), source: disk() }
    }

    fn png() -> FileError {
        FileError::Png { path: path(), source: disk() }
    }

    fn link() -> QueryError {
        QueryError::Link(disk())
    }

    /// Errors that have a cause, from every crate. `cause` is what the last cause of each says.
    fn caused() -> Vec<(Box<dyn Error + Send + Sync>, String)> {
        let gone = || WriteError::Gone { doing: "asked to erase".into(), source: disk() };
        let stream = StreamError { offset: 9, fault: 2, words: "unknown command" };
        let cut_off = uf2::decode(&[0; 40]).unwrap_err();
        let carousel = || CarouselError::TooMany(9);
        let fire = || "the disk is on fire".to_owned();
        vec![
            (
                Box::new(DocumentError::File(FileError::Io {
                    path: path(),
                    attempt: "open",
                    source: disk(),
                })),
                fire(),
            ),
            (Box::new(DocumentError::Weights { path: path(), source: weights() }), weights().to_string()),
            (Box::new(FactorError::Weights(weights())), weights().to_string()),
            (Box::new(mixture()), MixtureError::NoStacks.to_string()),
            (Box::new(MixFileError::Weights { path: path(), source: weights() }), weights().to_string()),
            (
                Box::new(MixFileError::Mix { path: path(), source: MixError::Rows { rows: 2, channels: 3 } }),
                MixError::Rows { rows: 2, channels: 3 }.to_string(),
            ),
            (Box::new(art()), fire()),
            (Box::new(StageError::Gamut(mixture())), MixtureError::NoStacks.to_string()),
            (Box::new(JobError::Simulate(SimulateError::Carousel(carousel()))), carousel().to_string()),
            (Box::new(FileError::Io { path: path(), attempt: "open", source: disk() }), fire()),
            (Box::new(png()), fire()),
            (Box::new(press::job::stream::StreamError::Output(disk())), fire()),
            (Box::new(DriveError::Refused { drive: path(), source: disk() }), fire()),
            (Box::new(ImageError::Damaged(cut_off.clone())), cut_off.to_string()),
            (Box::new(FlashError::Enter(link())), fire()),
            (Box::new(FlashError::Closed(disk())), fire()),
            (Box::new(FlashError::Write(gone())), fire()),
            (Box::new(Unsendable::Illegal(stream.clone())), stream.to_string()),
            (Box::new(link()), fire()),
            (Box::new(RawError::Open { path: path(), source: disk() }), fire()),
            (Box::new(RawError::Write { path: path(), taken: 1, length: 2, source: disk() }), fire()),
            (Box::new(journal()), fire()),
            (Box::new(PrintersError::Io { what: "write", path: path(), source: disk() }), fire()),
            (Box::new(Failure::Query(link())), fire()),
            (Box::new(Failure::Journal(journal())), fire()),
            (Box::new(RunError::Save(journal())), fire()),
            (Box::new(FilterError::Io { what: "read the document", source: disk() }), fire()),
            (Box::new(FilterError::NoGhostscript(disk())), fire()),
            (Box::new(FilterError::Plates(art())), fire()),
            (Box::new(FilterError::Layers { page: 3, source: art() }), fire()),
            (
                Box::new(FilterError::Job {
                    page: 3,
                    source: press::job::stream::StreamError::Output(disk()).into(),
                }),
                fire(),
            ),
            (Box::new(FilterError::Raster(RasterError::Io(disk()))), fire()),
        ]
    }

    #[test]
    fn each_cause_of_an_error_is_said_once_and_none_is_missing() {
        for (error, last) in caused() {
            let said = with_causes(error.as_ref());
            assert!(
                said.ends_with(&last) && said.len() > last.len(),
                "{last} is not the last cause of {said}"
            );
            let mut level: Option<&dyn Error> = Some(error.as_ref());
            while let Some(error) = level {
                let text = error.to_string();
                assert_eq!(said.matches(&text).count(), 1, "`{text}` in {said}");
                level = error.source();
            }
        }
    }

    #[test]
    fn what_was_attempted_comes_before_the_error_and_its_causes() {
        let error = Err::<(), _>(journal()).context("the sheet is not printed").unwrap_err();
        assert_eq!(chain(&error), "the sheet is not printed: cannot write somewhere: the disk is on fire");
    }
}
