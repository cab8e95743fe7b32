//! Prints a whole job on a fresh printer.

use protocol::ink::Ink;
use protocol::rgl::command::MAX_CARTRIDGES;
use protocol::rgl::{Command, Fault, Mode, Resolution, Step, parse};

use observe::Observer;

use super::carousel::{Carousel, CarouselError, Cartridge};
use super::printer::{Printer, Refused, from_dots};
use super::printout::Printout;
use super::status::{Lever, Trouble};
use crate::layout::paper::Stock;

/// What is loaded in the printer before the job.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// The cartridges; `None` for exactly those the job needs.
    pub cartridges: Option<Vec<Cartridge>>,
    /// The sheet; `None` for one of the paper the job declares.
    pub stock: Option<Stock>,
    /// Where sheets are taken from.
    pub lever: Lever,
}

/// Why a job did not become a sheet.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SimulateError {
    /// The bytes are not a legal job.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The cartridges cannot be loaded.
    #[error(transparent)]
    Carousel(#[from] CarouselError),
    /// The printer has stopped and waits for the operator.
    #[error("byte {offset}: the printer stops: {trouble}")]
    Trouble {
        /// Bytes taken before it stopped.
        offset: u64,
        /// The reason.
        trouble: Trouble,
    },
}

/// Prints a whole job and returns the passes on the sheet.
///
/// # Errors
/// The first byte that is not that of a legal job, or the trouble that stops the printer.
pub fn print(job: &[u8], setup: &Setup, observer: &dyn Observer) -> Result<Printout, SimulateError> {
    const CHUNK: usize = 1 << 18;
    // A job that needs more cartridges than fit is refused where it asks for the eighth.
    let cartridges =
        setup.cartridges.clone().unwrap_or_else(|| wanted(job).into_iter().take(MAX_CARTRIDGES).collect());
    let mut printer = Printer::new(Carousel::new(&cartridges)?, setup.lever);
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
    // Without a printout the job is incomplete.
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

/// The cartridges a job needs, in the order of first use.
pub fn wanted(job: &[u8]) -> Vec<Cartridge> {
    let mut all: Vec<Cartridge> = Vec::new();
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
    let mut resolution = Resolution::Dpi600;
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
