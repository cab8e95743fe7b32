//! The printer, simulated: bytes in, sheet out.
//!
//! Problem: a job must be known to be right before a ribbon is spent on it, and there are no more ribbons.
//! Method: the strict reader of `protocol::rgl` drives a machine with cassettes, a carriage, a sheet of its own size
//! and troubles of its own; every refusal says at which byte.
//! Cost: one look at each byte, one bit for each dot and pass, and two walks over the page for the sheet.
//! Limits: stricter than the machine, which forgives some of what is refused here; no ribbon runs out by itself, heat
//! and adhesion are not modelled. What the machine does with an empty pass is not known: here it fetches the cassette.
//! Source: observations on the hardware for cassettes, status, paper size and white at 1200 dpi.

mod canvas;
mod carousel;
mod compose;
mod printer;
mod printout;
mod status;

#[cfg(test)]
mod tests;

use protocol::rgl::command::MAX_CARTRIDGES;
use protocol::rgl::{Command, Fault, Step, parse};

use observe::Observer;

pub use crate::layout::paper::Stock;
pub(crate) use canvas::Canvas;
pub use carousel::{Carousel, CarouselError, Cassette, Condition, PLACES};
pub use printer::{Printer, Refused};
pub use printout::{Difference, Printout, PrintoutError, difference};
pub use status::{Lever, STATUS_LENGTH, Trouble};

/// What is in the printer before the job comes.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// The cassettes; `None` for exactly those the job asks for.
    pub cassettes: Option<Vec<Cassette>>,
    /// The sheet; `None` for one of the paper the job declares.
    pub stock: Option<Stock>,
    /// Where sheets are taken from.
    pub lever: Lever,
}

/// Why a job has not become a sheet.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SimulateError {
    /// The bytes are no legal job.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The cassettes cannot be loaded.
    #[error(transparent)]
    Carousel(#[from] CarouselError),
    /// The printer has stopped and waits for the operator.
    #[error("byte {offset}: the printer stops: {trouble}")]
    Trouble {
        /// Bytes taken until then.
        offset: u64,
        /// What is the matter.
        trouble: Trouble,
    },
}

/// Prints a whole job and gives back the sheet's passes.
///
/// Errors: the first byte that is not a legal job's, or the trouble that stops the printer.
pub fn print(job: &[u8], setup: &Setup, observer: &dyn Observer) -> Result<Printout, SimulateError> {
    const CHUNK: usize = 1 << 18;
    // A job that wants more than go in is refused where it asks for the eighth.
    let cassettes =
        setup.cassettes.clone().unwrap_or_else(|| wanted(job).into_iter().take(MAX_CARTRIDGES).collect());
    let mut printer = Printer::new(Carousel::new(&cassettes)?, setup.lever);
    if let Some(stock) = setup.stock.or_else(|| declared_stock(job)) {
        printer.load(stock);
    }
    observer.begin("simulated printer", job.len() as u64);
    let mut offset = 0;
    for chunk in job.chunks(CHUNK) {
        let taken = printer.feed(chunk)?;
        offset += taken as u64;
        observer.advance(taken as u64);
        if let Some(trouble) = printer.trouble() {
            return Err(SimulateError::Trouble { offset, trouble });
        }
    }
    observer.end();
    // Without a printout the job has not come to its end.
    let printout = printer.take_printout();
    printout.ok_or_else(|| Refused { offset, fault: Fault::Truncated }.into())
}

/// The commands of a stream up to its first fault, with the offset of each.
fn commands(stream: &[u8]) -> impl Iterator<Item = (usize, Command<'_>)> {
    let mut at = 0;
    std::iter::from_fn(move || match parse(&stream[at..]) {
        Ok(Step::Command(command, length)) => {
            at += length;
            Some((at - length, command))
        }
        _ => None,
    })
}

/// The cassettes a job asks for, in the order of first use.
pub fn wanted(job: &[u8]) -> Vec<Cassette> {
    use protocol::ink::Ink;
    use protocol::rgl::Mode;
    let mut all: Vec<Cassette> = Vec::new();
    for (_, command) in commands(job) {
        let ink = match command {
            Command::InkSelect { ink, .. } => ink,
            Command::Mode(Mode::BlackRaster) => Ink::Black,
            _ => continue,
        };
        if !all.contains(&ink.into()) {
            all.push(ink.into());
        }
    }
    all
}

/// A sheet of the paper the job declares.
fn declared_stock(job: &[u8]) -> Option<Stock> {
    let (mut code, mut width, mut length) = (None, None, None);
    let mut resolution = protocol::rgl::Resolution::Dpi600;
    for (_, command) in commands(job) {
        match command {
            Command::Resolution(r) => resolution = r,
            Command::Paper(paper) => code = Some(paper),
            Command::Length(rows) => length = Some(rows),
            Command::Width(dots) => width = Some(dots),
            Command::RasterStart => break,
            _ => {}
        }
    }
    let (width, length) = (from_dots(width?, resolution.dpi().0), from_dots(length?, resolution.dpi().1));
    Some(Stock::of(code?.paper(width, length)))
}

/// Dots or rows of a resolution as 1/600 inch.
fn from_dots(dots: u16, dpi: u16) -> u16 {
    (u32::from(dots) * 600 / u32::from(dpi)).min(u16::MAX.into()) as u16
}
