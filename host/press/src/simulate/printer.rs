//! The printer: takes bytes in pieces of any size, fetches cartridges, prints rows, and stops when it is in trouble.

use protocol::ink::{Ink, Kind};
use protocol::paper::{LEFT, Paper};
use protocol::rgl::{Command, Fault, Mode, Order, PaperCode, Resolution, Step, parse};

use super::canvas::Canvas;
use super::carousel::{Carousel, CarouselError, Cartridge, Fetch, PLACES};
use super::printout::Printout;
use super::status::{ASK, Activity, CLEAR, Lever, STATUS_LENGTH, TAKEN, Trouble, answer};
use crate::job::fault::words;
use crate::layout::paper::Stock;
use crate::separate::Pass;

/// Rows of 1/600 inch that the printer needs below the printable area (14.4 mm): slightly less than the margin of any driver
/// whose pages are known to print (postcard 14.5 mm, A4 in its longest form 14.9 mm).
const BOTTOM: u16 = 340;

/// A number of dots at a resolution, in 1/600 inch.
pub(super) fn from_dots(dots: u16, dpi: u16) -> u16 {
    (u32::from(dots) * 600 / u32::from(dpi)).min(u16::MAX.into()) as u16
}

/// The first byte that is not part of a legal job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("byte {offset}: {}", words(*fault))]
pub struct Refused {
    /// Its offset from the first byte since the printer was switched on.
    pub offset: u64,
    /// What is wrong.
    pub fault: Fault,
}

/// A job being printed.
#[derive(Clone, Debug)]
struct Job {
    stock: Stock,
    top: u16,
    /// Dots per inch across and along.
    dpi: (u16, u16),
    printout: Printout,
    /// The line of the sheet under the head, in 1/600 inch from its upper edge.
    position: u32,
    pass: Option<(Ink, Canvas)>,
    /// An ink whose cartridge is missing.
    wanted: Option<Ink>,
}

/// The printer. It stays on between jobs, and waits until [`Printer::take_printout`] removes the finished sheet.
#[derive(Clone, Debug)]
pub struct Printer {
    carousel: Carousel,
    lever: Lever,
    tray: Option<Stock>,
    trouble: Option<Trouble>,
    /// The cartridge entries from before the trouble: the printer does not update them until it is over.
    stale: [u8; PLACES + 1],
    order: Order,
    /// The beginning of an incomplete command.
    carry: Vec<u8>,
    /// A command that waits for the operator.
    held: Vec<u8>,
    /// Offset of the command being read.
    offset: u64,
    refused: Option<Refused>,
    job: Option<Job>,
    finished: Option<Printout>,
    answers: Vec<u8>,
    /// So many answers behind a sheet say that it idles, and so many then that it prints.
    lag: [u32; 2],
    /// What is left of them.
    lagging: [u32; 2],
}

/// What the bytes at a command boundary are.
enum Next<'a> {
    Command(Command<'a>, usize),
    Ask,
    Clear,
    More(usize),
}

impl Printer {
    /// A printer with these cartridges and no paper.
    pub fn new(carousel: Carousel, lever: Lever) -> Printer {
        Printer {
            carousel,
            lever,
            tray: None,
            trouble: None,
            stale: [0xff; PLACES + 1],
            order: Order::new(),
            carry: Vec::new(),
            held: Vec::new(),
            offset: 0,
            refused: None,
            job: None,
            finished: None,
            answers: Vec::new(),
            lag: [0; 2],
            lagging: [0; 2],
        }
    }

    /// The same with a status that lags, as that of an MD-5000 does: behind each sheet so many answers say that it idles, and so
    /// many then that it prints.
    pub fn lagging(self, idle: u32, printing: u32) -> Printer {
        Printer { lag: [idle, printing], ..self }
    }

    /// Takes bytes in pieces of any size and returns how many it took: not all of them if it waits for the operator.
    ///
    /// # Errors
    /// A byte that is not part of a legal job. The printer then refuses everything until it is switched off and on.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<usize, Refused> {
        let mut taken = 0;
        loop {
            if let Some(refused) = self.refused {
                return Err(refused);
            }
            if self.trouble.is_none() && !self.held.is_empty() {
                let held = std::mem::take(&mut self.held);
                self.offset -= held.len() as u64;
                let next = self.next(&held)?;
                self.act(next, &held)?;
                continue;
            }
            let rest = &bytes[taken..];
            if self.carry.is_empty() {
                if !self.accepts(rest) {
                    return Ok(taken);
                }
                match self.next(rest)? {
                    Next::More(_) => {
                        self.carry.extend_from_slice(rest);
                        return Ok(bytes.len());
                    }
                    next => taken += self.act(next, rest)?,
                }
                continue;
            }
            // Rare: the previous piece ended inside a command.
            if !self.accepts(&self.carry) {
                return Ok(taken);
            }
            let mut carry = std::mem::take(&mut self.carry);
            match self.next(&carry)? {
                Next::More(length) => {
                    let piece = &rest[..rest.len().min(length - carry.len())];
                    carry.extend_from_slice(piece);
                    taken += piece.len();
                    self.carry = carry;
                    if piece.is_empty() {
                        return Ok(taken);
                    }
                }
                next => {
                    self.act(next, &carry)?;
                }
            }
        }
    }

    /// Whether the printer accepts these bytes at a command boundary. In trouble it accepts only questions, which begin with
    /// other bytes than any command.
    fn accepts(&self, bytes: &[u8]) -> bool {
        self.trouble.is_none() || bytes.first().is_none_or(|&first| is_question(first))
    }

    fn next<'a>(&mut self, bytes: &'a [u8]) -> Result<Next<'a>, Refused> {
        let Some(&first) = bytes.first() else { return Ok(Next::More(1)) };
        if is_question(first) {
            if self.trouble.is_none() && !self.order.is_idle() && !self.order.is_complete() {
                return self.refuse(Fault::StatusInJob, 0);
            }
            return if bytes.starts_with(&ASK) {
                Ok(Next::Ask)
            } else if bytes.starts_with(&CLEAR) {
                Ok(Next::Clear)
            } else if ASK.starts_with(bytes) {
                Ok(Next::More(ASK.len()))
            } else if CLEAR.starts_with(bytes) {
                Ok(Next::More(CLEAR.len()))
            } else {
                self.refuse(Fault::UnknownCommand, 0)
            };
        }
        match parse(bytes) {
            Ok(Step::Command(command, length)) => Ok(Next::Command(command, length)),
            Ok(Step::More(length)) => Ok(Next::More(length)),
            Err(refusal) => self.refuse(refusal.fault, refusal.at),
        }
    }

    fn refuse<T>(&mut self, fault: Fault, at: usize) -> Result<T, Refused> {
        let refused = Refused { offset: self.offset + at as u64, fault };
        self.refused = Some(refused);
        Err(refused)
    }

    /// Acts on the command or question at the start of `bytes` and returns its length. A command that must wait for the
    /// operator is held.
    fn act(&mut self, next: Next<'_>, bytes: &[u8]) -> Result<usize, Refused> {
        let length = match next {
            Next::Ask => {
                let status = self.status();
                if let Some(left) = self.lagging.iter_mut().find(|left| **left > 0) {
                    *left -= 1;
                }
                self.answers.extend_from_slice(&status);
                ASK.len()
            }
            Next::Clear => {
                self.clear();
                self.answers.push(TAKEN);
                CLEAR.len()
            }
            Next::Command(command, length) => {
                let mut order = self.order;
                let mut legal = order.accept(&command);
                if self.order.is_complete() && self.finished.is_none() && legal.is_err() {
                    // The sheet was removed, so anything but the reset after its job begins the next job.
                    order = Order::new();
                    legal = order.accept(&command);
                }
                if let Err(refusal) = legal {
                    return self.refuse(refusal.fault, refusal.at);
                }
                if self.perform(&command, &order) {
                    self.order = order;
                } else {
                    self.held.extend_from_slice(&bytes[..length]);
                }
                length
            }
            Next::More(_) => 0,
        };
        self.offset += length as u64;
        Ok(length)
    }

    /// Carries out a legal command; `order` is the state after it. Returns false if trouble prevents that.
    fn perform(&mut self, command: &Command<'_>, order: &Order) -> bool {
        match *command {
            Command::RasterStart => return self.begin(order),
            Command::InkSelect { ink, .. } => {
                self.begin_pass(ink, order);
                // Done even if the cartridge is missing: the printer stops after this command.
            }
            Command::Row { data, .. } => {
                let row = order.row();
                if !self.sheet_reaches(Some(row), order) {
                    return false;
                }
                if let Some(job) = &mut self.job {
                    job.position = job.line_below(row + u32::from(order.declared().shift_y));
                    if let Some((_, canvas)) = &mut job.pass {
                        canvas.put(row, order.compression(), data);
                    }
                }
            }
            Command::BackFeed | Command::RasterEnd => {
                if !self.sheet_reaches(None, order) {
                    return false;
                }
                if let Some(job) = &mut self.job {
                    job.position = job.top.into();
                    job.end_pass();
                }
            }
            Command::FormFeed => self.eject(true),
            _ => {}
        }
        true
    }

    /// Takes a sheet; in the mode without ink-select, also begins its pass.
    fn begin(&mut self, order: &Order) -> bool {
        let Some(stock) = self.tray.take() else {
            self.stop(Trouble::NoPaper);
            return false;
        };
        let declared = order.declared();
        let resolution = declared.resolution.unwrap_or_default();
        let dpi = resolution.dpi();
        let code = declared.paper.unwrap_or(PaperCode::from_paper(Paper::A4));
        let paper = code.paper(from_dots(declared.width, dpi.0), from_dots(declared.length, dpi.1));
        let position = code.top().into();
        let printout = Printout {
            paper,
            resolution,
            media: declared.media.unwrap_or_default(),
            curl_correction: declared.curl.unwrap_or(true),
            passes: Vec::new(),
            platen_dots: 0,
            lost_dots: 0,
            complete: false,
        };
        self.job = Some(Job { stock, top: code.top(), dpi, printout, position, pass: None, wanted: None });
        if declared.mode == Some(Mode::BlackRaster) {
            self.begin_pass(Ink::Black, order);
        }
        true
    }

    fn begin_pass(&mut self, ink: Ink, order: &Order) {
        let Some(job) = &mut self.job else { return };
        let declared = order.declared();
        let edge = usize::from(job.stock.width.saturating_sub(LEFT)) * usize::from(job.dpi.0) / 600;
        // The cartridge's barcode sets the dot pitch: these inks print at 600 dpi in any job.
        let spread = match declared.resolution {
            Some(Resolution::Dpi1200) if ink.kind() != Kind::Process => 2,
            _ => 1,
        };
        let shift = (declared.shift_x.into(), declared.shift_y.into());
        let canvas = Canvas::new(declared.width.into(), declared.length.into(), shift, edge, spread);
        job.pass = Some((ink, canvas));
        job.wanted = Some(ink);
        self.fetch();
    }

    /// Fetches the cartridge that the pass needs; trouble if it is missing or spent.
    fn fetch(&mut self) {
        let Some(ink) = self.job.as_ref().and_then(|job| job.wanted) else { return };
        let before = self.carousel.entries();
        let trouble = match self.carousel.fetch(ink.barcode()) {
            Fetch::Ready => None,
            Fetch::Missing => Some(Trouble::RibbonMismatch { wanted: ink.barcode() }),
            Fetch::Spent => Some(Trouble::RibbonEnd { barcode: ink.barcode() }),
        };
        match (trouble, &mut self.job) {
            (None, Some(job)) => job.wanted = None,
            _ if self.trouble.is_none() => self.stale = before,
            _ => {}
        }
        self.trouble = trouble;
    }

    /// Whether the sheet is long enough for a row, or for the whole page at the end of a pass. The printer detects the end of
    /// the sheet as it passes, so it stops in the middle of a page that is too long.
    fn sheet_reaches(&mut self, row: Option<u32>, order: &Order) -> bool {
        let Some(job) = &self.job else { return true };
        let declared = order.declared();
        let last = row.map_or(u32::from(declared.length) - 1, |row| row + u32::from(declared.shift_y));
        let reaches = job.line_below(last) + u32::from(BOTTOM) <= u32::from(job.stock.length);
        if !reaches {
            self.stop(Trouble::WrongSize);
        }
        reaches
    }

    fn stop(&mut self, trouble: Trouble) {
        if self.trouble.is_none() {
            self.stale = self.carousel.entries();
        }
        self.trouble = Some(trouble);
    }

    fn eject(&mut self, complete: bool) {
        if let Some(mut job) = self.job.take() {
            job.end_pass();
            job.printout.complete = complete;
            self.finished = Some(job.printout);
        }
    }

    /// Takes the answers to all questions so far.
    pub fn answers(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.answers)
    }

    /// The status answer at this moment. In trouble, the cartridge entries are those from before.
    pub fn status(&self) -> [u8; STATUS_LENGTH] {
        let prints = self.lagging[0] == 0 && self.lagging[1] > 0;
        let activity = if self.job.is_some() || prints {
            Activity::Printing
        } else if self.finished.is_some() || !(self.order.is_idle() || self.order.is_complete()) {
            Activity::Buffered
        } else {
            Activity::Idle
        };
        let entries = if self.trouble.is_some() { self.stale } else { self.carousel.entries() };
        answer(activity, self.trouble, self.lever, entries)
    }

    /// The trouble that stops the printer.
    pub fn trouble(&self) -> Option<Trouble> {
        self.trouble
    }

    /// The cartridges.
    pub fn carousel(&self) -> &Carousel {
        &self.carousel
    }

    /// The line of the sheet under the head, in 1/600 inch from its upper edge; `None` if there is no sheet.
    pub fn position(&self) -> Option<u32> {
        self.job.as_ref().map(|job| job.position)
    }

    /// Offset of the command that the printer reads next.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Puts a sheet in the tray or the slot, in place of any other.
    pub fn load(&mut self, stock: Stock) {
        self.tray = Some(stock);
        if self.trouble == Some(Trouble::NoPaper) {
            self.trouble = None;
        }
    }

    /// Opens the cover, inserts a cartridge and closes the cover. A print that waited for it continues.
    ///
    /// # Errors
    /// See [`CarouselError`].
    pub fn insert(&mut self, cartridge: Cartridge) -> Result<(), CarouselError> {
        self.carousel.insert(cartridge)?;
        if matches!(self.trouble, Some(Trouble::RibbonMismatch { .. } | Trouble::RibbonEnd { .. })) {
            self.fetch();
        }
        Ok(())
    }

    /// Opens the cover, removes a cartridge and closes the cover.
    pub fn remove(&mut self, barcode: u8) -> Option<Cartridge> {
        self.carousel.remove(barcode)
    }

    /// Causes trouble, for tests of the software in front of the printer.
    pub fn strike(&mut self, trouble: Trouble) {
        self.stop(trouble);
    }

    /// Closes the cover.
    pub fn close_cover(&mut self) {
        if self.trouble == Some(Trouble::CoverOpen) {
            self.trouble = None;
        }
    }

    /// Does what "@RCL3" does: clears an error that can be cleared, drops the job, and ejects the sheet as it is.
    pub fn clear(&mut self) {
        if self.trouble.is_some_and(Trouble::can_be_cleared) {
            self.trouble = None;
            self.abandon();
        }
    }

    /// Switches the printer off and on: the trouble is over, the job is lost, and offsets start from 0.
    pub fn power_cycle(&mut self) {
        self.trouble = None;
        self.refused = None;
        self.abandon();
        self.offset = 0;
        self.answers.clear();
        self.lagging = [0; 2];
    }

    fn abandon(&mut self) {
        self.eject(false);
        self.order = Order::new();
        self.carry.clear();
        self.held.clear();
    }

    /// Removes the ejected sheet, so that the printer is ready for the next job. `None` if there is none.
    pub fn take_printout(&mut self) -> Option<Printout> {
        if self.finished.as_ref().is_some_and(|printout| printout.complete) && !self.order.is_complete() {
            return None;
        }
        if self.finished.is_some() {
            self.lagging = self.lag;
        }
        self.finished.take()
    }
}

/// Whether a byte begins a question: a status question or "@RCL3".
fn is_question(first: u8) -> bool {
    first == ASK[0] || first == CLEAR[0]
}

impl Job {
    /// The line below a row of the page, in 1/600 inch from the sheet's upper edge.
    fn line_below(&self, row: u32) -> u32 {
        (row + 1) * 600 / u32::from(self.dpi.1) + u32::from(self.top)
    }

    fn end_pass(&mut self) {
        if let Some((ink, canvas)) = self.pass.take() {
            self.printout.platen_dots += canvas.platen;
            self.printout.lost_dots += canvas.lost;
            self.printout.passes.push(Pass { ink, plane: canvas.into_plane() });
        }
    }
}
