//! New firmware for a bridge.
//!
//! Problem: install the firmware of a file on a board, whatever it runs now, so that an interrupted attempt can be repeated.
//! Method: read and check the files; bring the bridge into its boot loader by a message of the link, or use a board that is
//! already there; see which board it is and choose its image; write through [PICOBOOT](picoboot) and read back, or copy to the board's [drive] where the boot loader may
//! not be opened; wait until the bridge is back and reports its version.
//! Limits: one board in its boot loader at a time, since such boards cannot be told apart.

pub mod drive;
pub mod image;
pub mod installed;
pub mod picoboot;
#[cfg(test)]
mod rom;
#[cfg(test)]
mod tests;
pub mod usb;

use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::Duration;

use crate::connection::Bridge;
use crate::connection::find::{self, Candidate};
use crate::connection::{Address, OpenError};
use crate::questions::query::{Query, QueryError};
use drive::DriveError;
use image::Firmware;
use observe::Observer;
use picoboot::{Picoboot, Pipe, WriteError};
use uf2::Chip;

/// Time between two checks of what is plugged in.
const POLL: Duration = Duration::from_millis(250);
/// Time for a board to appear: a second or two, more with slow hubs and virus scanners.
const LOADER_PATIENCE: Duration = Duration::from_secs(10);
/// Time for the system to mount the board's drive.
const DRIVE_PATIENCE: Duration = Duration::from_secs(6);
/// Time for the bridge to come back with its new firmware; longest when its drive is written in the background.
const BACK_PATIENCE: Duration = Duration::from_secs(30);
/// Time for a bridge to answer.
const ANSWER_PATIENCE: Duration = Duration::from_secs(3);

/// Why a bridge does not have the new firmware.
#[derive(Debug, thiserror::Error)]
pub enum FlashError {
    /// There is nothing to flash.
    #[error(
        "found no bridge and no board in its boot loader; for a board without working firmware, hold its BOOTSEL button while \
         plugging it in"
    )]
    Nothing,
    /// Several bridges run, and none was named.
    #[error("several bridges are connected: {}", .0.join(", "))]
    SeveralBridges(Vec<String>),
    /// Boards in their boot loader all look the same.
    #[error("{0} boards are in their boot loader and cannot be told apart; unplug all but one")]
    SeveralBoards(usize),
    /// A board waits, but a bridge was asked for.
    #[error(
        "another board is already in its boot loader; flash that one first, without naming a bridge, or unplug it"
    )]
    AnotherBoard,
    /// The bridge's link cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The bridge does not answer, or refuses.
    #[error("the bridge cannot enter its boot loader (hold its BOOTSEL button while plugging it in instead)")]
    Enter(#[source] QueryError),
    /// The bridge is printing a job.
    #[error(
        "the bridge is printing job {0:08x}; wait until it is done, or end it with `foilpress cancel {0:08x}`"
    )]
    Printing(u32),
    /// The firmware is for another board.
    #[error("this board is a {board}, but the firmware is for a {}; nothing was written, and the board starts what it had", .firmware.board())]
    OtherBoard {
        /// The board.
        board: Chip,
        /// What there is an image for.
        firmware: Chip,
    },
    /// No board appeared in its boot loader.
    #[error(
        "the bridge was told to enter its boot loader, but no board appeared there; hold its BOOTSEL button while plugging it in \
         again, then repeat this command"
    )]
    NoLoader,
    /// Neither the boot loader nor the drive of the board can be opened.
    #[error(
        "cannot open the board in its boot loader, and its drive (RPI-RP2 or RP2350) is not mounted (`foilpress doctor` says what to set up; \
         or mount the drive and repeat this command)"
    )]
    Closed(#[source] io::Error),
    /// Writing failed.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Copying failed.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The firmware was written, but the bridge did not come back.
    #[error(
        "the firmware was written, but the bridge has not come back; unplug it and plug it in again, then check it with \
         `foilpress bridge list`"
    )]
    NotBack,
    /// The firmware was written, but another version runs.
    #[error("firmware {expected} was written, but the bridge reports firmware {found}; flash it again")]
    OtherVersion {
        /// What was written.
        expected: String,
        /// What runs.
        found: String,
    },
}

/// What flashing needs from the computer.
pub trait Computer {
    /// A way to a board in its boot loader.
    type Board: Pipe;

    /// The bridges that run.
    fn bridges(&mut self) -> Vec<Candidate>;
    /// The boards in their boot loader.
    fn boards(&mut self) -> Vec<Chip>;
    /// Opens the boot loader of the only board there.
    fn open(&mut self) -> io::Result<Self::Board>;
    /// The mounted drives of such boards.
    fn drives(&mut self) -> Vec<(Chip, PathBuf)>;
    /// Tells a bridge to enter its boot loader; returns its number.
    fn enter(&mut self, bridge: &Candidate) -> Result<u64, FlashError>;
    /// The bridge that answers there, if one does.
    fn greet(&mut self, candidate: &Candidate) -> Option<Bridge>;
    /// Waits.
    fn wait(&mut self, time: Duration);
}

/// Installs one of `images`, that of the board, on the bridge at `to`, or on the only board. Returns the bridge as it
/// introduces itself afterwards.
pub fn run(
    images: &[Firmware],
    to: Option<&Address>,
    computer: &mut impl Computer,
    observer: &dyn Observer,
) -> Result<Bridge, FlashError> {
    let bridges = computer.bridges();
    let waiting = waiting_boards(computer);
    let number = match (to, waiting) {
        (Some(_), 1..) => return Err(FlashError::AnotherBoard),
        (None, 2..) => return Err(FlashError::SeveralBoards(waiting)),
        (None, 1) => None,
        (Some(address), 0) => {
            let named = Candidate { serial_number: None, addresses: vec![address.clone()] };
            Some(enter(&named, computer, observer)?)
        }
        (None, 0) => match &bridges[..] {
            [] => return Err(FlashError::Nothing),
            [only] => Some(enter(only, computer, observer)?),
            several => {
                let names = several.iter().map(|bridge| bridge.addresses[0].to_string()).collect();
                return Err(FlashError::SeveralBridges(names));
            }
        },
    };
    let firmware = write(images, computer, observer)?;
    observer.note("waiting for the bridge to restart");
    let known: Vec<u64> = bridges.iter().filter_map(Candidate::number).collect();
    let expected = |found: u64| match number {
        Some(number) => found == number,
        None => !known.contains(&found),
    };
    let back = until(computer, BACK_PATIENCE, |computer| {
        let mut bridges = computer.bridges();
        // Other bridges are left alone.
        bridges.retain(|bridge| bridge.number().is_none_or(&expected));
        bridges.iter().filter_map(|bridge| computer.greet(bridge)).find(|bridge| expected(bridge.serial))
    });
    match back {
        None => Err(FlashError::NotBack),
        Some(bridge) if bridge.firmware != firmware.version() => {
            Err(FlashError::OtherVersion { expected: firmware.version().to_owned(), found: bridge.firmware })
        }
        Some(bridge) => Ok(bridge),
    }
}

/// The chip of the only board there is, or of the bridge at `to`, which stays as it is.
pub fn chip_there(to: Option<&Address>, computer: &mut impl Computer) -> Option<Chip> {
    if let (None, [chip]) = (to, &computer.boards()[..]) {
        return Some(*chip);
    }
    let bridges = match to {
        Some(address) => vec![Candidate { serial_number: None, addresses: vec![address.clone()] }],
        None => computer.bridges(),
    };
    match &bridges[..] {
        [only] => computer.greet(only).map(|bridge| image::chip_of(&bridge.firmware)),
        _ => None,
    }
}

/// Brings a bridge into its boot loader and waits until the board appears there; returns the bridge's number.
fn enter(
    bridge: &Candidate,
    computer: &mut impl Computer,
    observer: &dyn Observer,
) -> Result<u64, FlashError> {
    let number = computer.enter(bridge)?;
    observer.note(&format!("bridge {number:016x} is entering its boot loader"));
    let there = |computer: &mut _| (waiting_boards(computer) > 0).then_some(());
    until(computer, LOADER_PATIENCE, there).ok_or(FlashError::NoLoader)?;
    Ok(number)
}

fn waiting_boards(computer: &mut impl Computer) -> usize {
    computer.boards().len().max(computer.drives().len())
}

/// The image for a board.
fn for_board(images: &[Firmware], board: Chip) -> Result<&Firmware, FlashError> {
    let other = images.first().map_or(board, Firmware::chip);
    images
        .iter()
        .find(|firmware| firmware.chip() == board)
        .ok_or(FlashError::OtherBoard { board, firmware: other })
}

/// Writes the image of the board that waits; returns which.
fn write<'f>(
    images: &'f [Firmware],
    computer: &mut impl Computer,
    observer: &dyn Observer,
) -> Result<&'f Firmware, FlashError> {
    let closed = match computer.boards()[..] {
        // Even if the USB library cannot list the board, its drive may be mounted.
        [] => io::Error::from(ErrorKind::NotFound),
        [chip] => match (computer.open(), for_board(images, chip)) {
            (Ok(board), Ok(firmware)) => {
                observer.note(&format!("a {chip}: writing firmware {}", firmware.version()));
                Picoboot::write(board, firmware.image(), observer)?;
                return Ok(firmware);
            }
            (Ok(board), Err(error)) => {
                Picoboot::restart(board, chip)?;
                return Err(error);
            }
            (Err(error), _) => error,
        },
        ref several => return Err(FlashError::SeveralBoards(several.len())),
    };
    match &until(computer, DRIVE_PATIENCE, |computer| {
        Some(computer.drives()).filter(|found| !found.is_empty())
    })
    .unwrap_or_default()[..]
    {
        [] => Err(FlashError::Closed(closed)),
        [(chip, drive)] => {
            let firmware = for_board(images, *chip)?;
            observer.note(&format!(
                "the boot loader cannot be opened ({closed}); using its drive, {}",
                drive.display()
            ));
            drive::copy(drive, firmware.file(), observer)?;
            Ok(firmware)
        }
        several => Err(FlashError::SeveralBoards(several.len())),
    }
}

/// Repeats `check` until it finds something or `patience` is over.
fn until<C: Computer, T>(
    computer: &mut C,
    patience: Duration,
    mut check: impl FnMut(&mut C) -> Option<T>,
) -> Option<T> {
    let mut waited = Duration::ZERO;
    loop {
        if let Some(found) = check(computer) {
            return Some(found);
        }
        if waited >= patience {
            return None;
        }
        computer.wait(POLL);
        waited += POLL;
    }
}

/// The computer this program runs on.
pub struct ThisComputer;

impl Computer for ThisComputer {
    type Board = Box<dyn Pipe>;

    fn bridges(&mut self) -> Vec<Candidate> {
        find::survey().bridges
    }

    fn boards(&mut self) -> Vec<Chip> {
        usb::boards().map_or(Vec::new(), |boards| boards.iter().map(|(chip, _)| *chip).collect())
    }

    fn open(&mut self) -> io::Result<Box<dyn Pipe>> {
        let boards = usb::boards()?;
        let (_, board) = boards.first().ok_or(ErrorKind::NotFound)?;
        Ok(Box::new(usb::open(board)?))
    }

    fn drives(&mut self) -> Vec<(Chip, PathBuf)> {
        drive::find()
    }

    fn enter(&mut self, bridge: &Candidate) -> Result<u64, FlashError> {
        let (_, mut link) = bridge.open()?;
        let mut query = Query::with_any(&mut *link, ANSWER_PATIENCE).map_err(FlashError::Enter)?;
        let number = query.bridge().serial;
        query.bootloader(ANSWER_PATIENCE).map(|()| number).map_err(|error| match error {
            QueryError::JobOpen(job) => FlashError::Printing(job),
            error => FlashError::Enter(error),
        })
    }

    fn greet(&mut self, candidate: &Candidate) -> Option<Bridge> {
        let (_, mut link) = candidate.open().ok()?;
        let query = Query::with_any(&mut *link, ANSWER_PATIENCE).ok()?;
        Some(query.bridge().clone())
    }

    fn wait(&mut self, time: Duration) {
        std::thread::sleep(time);
    }
}
