//! What has to be known of the printer after the supply was gone, in two sectors.
//!
//! Problem: a bridge that prints alone loses its memory with its supply, perhaps in the middle of a sheet. The printer then waits for
//! the rest of a row, and prints the next job as text unless it is reset. Method: a record is appended before the first byte of a
//! stored job goes out, when it has ended, and whenever a reset is owed or was done. The last whole record counts. When a sector
//! is full, the other one is erased, which holds older records only. Cost: 32 bytes a record, one erase in 128.

use super::NUMBERS;
use super::flash::{Flash, PAGE, SECTOR};
use protocol::link::frame::checksum;

/// Sectors of the printer log, the first of the area.
pub(super) const SECTORS: u32 = 2;

const RECORD: u32 = 32;
const RECORDS: u32 = SECTOR / RECORD;
/// Records of a page.
const _: () = assert!(PAGE.is_multiple_of(RECORD));
/// Places that are tried when one does not keep what is written.
const TRIES: u32 = 4;

/// Where the printer stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Standing {
    /// It holds no part of a stored job, and no reset is owed.
    Clear,
    /// It has to be reset before anything else goes to it.
    ResetOwed,
    /// A stored job is being printed, or was when the supply went.
    Printing,
}

/// A record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Note {
    /// Where the printer stands.
    pub standing: Standing,
    /// The job that was last printed from the store, or 0.
    pub job: u32,
    /// What it was stored as.
    pub stored: u32,
}

/// The printer log. The flash is lent to each call.
pub(super) struct PrinterLog {
    last: Note,
    number: u32,
    sector: u32,
    /// The next record of the sector; [`RECORDS`] if it is full.
    next: u32,
}

impl PrinterLog {
    /// Reads what is there.
    pub(super) fn open(flash: &impl Flash) -> PrinterLog {
        let last = Note { standing: Standing::Clear, job: 0, stored: 0 };
        let mut log = PrinterLog { last, number: 0, sector: 1, next: RECORDS };
        for sector in 0..SECTORS {
            for at in 0..RECORDS {
                if let Some((number, note)) = read(flash, sector, at)
                    && number > log.number
                {
                    (log.number, log.last, log.sector) = (number, note, sector);
                }
            }
        }
        if log.number > 0 {
            // Behind everything, whole or not.
            log.next = (0..RECORDS).rev().find(|&at| !is_blank(flash, log.sector, at)).map_or(0, |at| at + 1);
        }
        log
    }

    /// The last record.
    pub(super) fn last(&self) -> Note {
        self.last
    }

    /// Appends a record. Afterwards it is the last one, or the flash is worn out.
    pub(super) fn write(&mut self, flash: &mut impl Flash, note: Note) {
        if self.last == note {
            return;
        }
        let number = self.number + 1;
        for _ in 0..TRIES {
            if self.next == RECORDS {
                (self.sector, self.next) = (self.sector ^ 1, 0);
                flash.erase(self.sector);
            }
            let at = self.next;
            self.next += 1;
            flash.program(self.sector * SECTOR + at * RECORD, &bytes(number, note));
            if read(flash, self.sector, at) == Some((number, note)) {
                break;
            }
        }
        (self.number, self.last) = (number, note);
    }
}

fn bytes(number: u32, note: Note) -> [u8; RECORD as usize] {
    let standing: u32 = match note.standing {
        Standing::Clear => 0,
        Standing::ResetOwed => 1,
        Standing::Printing => 2,
    };
    let mut record = [0; RECORD as usize];
    for (word, value) in record[4..].chunks_exact_mut(4).zip([number, standing, note.job, note.stored]) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    let sum = checksum(&record[4..]);
    record[..4].copy_from_slice(&sum.to_le_bytes());
    record
}

fn read(flash: &impl Flash, sector: u32, at: u32) -> Option<(u32, Note)> {
    let mut record = [0; RECORD as usize];
    flash.read(sector * SECTOR + at * RECORD, &mut record);
    let word = |at: usize| u32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    let standing = match word(8) {
        0 => Standing::Clear,
        1 => Standing::ResetOwed,
        2 => Standing::Printing,
        _ => return None,
    };
    let whole = word(0) == checksum(&record[4..]) && word(4) < NUMBERS;
    whole.then_some((word(4), Note { standing, job: word(12), stored: word(16) }))
}

fn is_blank(flash: &impl Flash, sector: u32, at: u32) -> bool {
    let mut record = [0; RECORD as usize];
    flash.read(sector * SECTOR + at * RECORD, &mut record);
    record.iter().all(|&byte| byte == 0xff)
}
