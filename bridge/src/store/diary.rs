//! Which sheet the printer was in when the supply went, in two sectors.
//!
//! Problem: a board loses its memory with its supply, perhaps in the middle of a sheet, and whoever comes
//! next must not print into it.
//! Method: a record a job. It is programmed before the job's first byte leaves, with its last word left
//! blank, and the end of the job, or the reset that follows a lost one, programs that word: flash clears bits
//! without an erase. The last record counts. One whose end is missing says that the printer may have a part
//! of its job; one that is torn, aged or worn says that nobody knows. The other sector is erased ahead,
//! between jobs, so before a first byte stands one page program. What cannot be written is erased, since no
//! record says nothing either.
//! Cost: 32 bytes and two programs a job, one erase in 128 jobs. Limits: a question to the printer is noted
//! only when it stays half put.

use super::NUMBERS;
use super::flash::{Flash, PAGE, SECTOR};
use protocol::link::frame::checksum;
use protocol::link::message::PAST;

/// Sectors of the diary, the first of the area.
pub(super) const SECTORS: u32 = 2;

const RECORD: u32 = 32;
const RECORDS: u32 = SECTOR / RECORD;
const _: () = assert!(PAGE.is_multiple_of(RECORD));
/// Where in a record its end is.
const END: u32 = RECORD - 4;
/// The words for an end.
const ENDS: [(End, [u8; 4]); 2] = [(End::Legal, *b"end."), (End::Reset, *b"lost")];
const BLANK: u8 = 0xff;
/// Records before the last one that are told: half of the jobs that a host is told of, so that those in the
/// flash are among them, too.
const RECENT: usize = PAST / 2;
/// Places that are tried when one does not keep what is written.
const TRIES: u32 = 4;

/// How the printer has come to stand between two jobs behind one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// By the legal end of the job.
    Legal,
    /// By a reset: the job was lost.
    Reset,
}

/// What was noted of a job.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// The job.
    pub job: u32,
    /// What it was stored as, or 0.
    pub stored: u32,
    /// Its end, if it has one.
    pub end: Option<End>,
}

/// The diary. The flash is lent to each call.
pub(super) struct Diary {
    /// The last record; none if it says nothing.
    last: Option<Record>,
    /// Where it is, from the beginning of the area, if it is there.
    place: Option<u32>,
    number: u32,
    sector: u32,
    /// The next place of the sector; [`RECORDS`] if it is full.
    next: u32,
    /// The other sector is blank.
    spare: bool,
}

/// What is in a place.
enum Place {
    Blank,
    Whole(u32, Record),
    Torn,
}

impl Diary {
    /// Reads what is there.
    pub(super) fn open(flash: &impl Flash) -> Diary {
        let mut diary = Diary { last: None, place: None, number: 0, sector: 1, next: RECORDS, spare: false };
        for sector in 0..SECTORS {
            for at in 0..RECORDS {
                if let Place::Whole(number, record) = look(flash, sector, at)
                    && number > diary.number
                {
                    (diary.number, diary.sector, diary.last) = (number, sector, Some(record));
                    diary.place = Some(address(sector, at));
                }
            }
        }
        let other = diary.sector ^ 1;
        diary.spare = is_blank(flash, other);
        let Some(place) = diary.place else { return diary };
        let is_written = |&at: &u32| !matches!(look(flash, diary.sector, at), Place::Blank);
        diary.next = (0..RECORDS).rev().find(is_written).map_or(0, |at| at + 1);
        // What stands behind the last whole record was one once, or was to be one.
        let behind = match diary.next {
            RECORDS => matches!(look(flash, other, 0), Place::Torn),
            next => address(diary.sector, next) != place + RECORD,
        };
        if behind {
            diary.last = None;
        }
        diary
    }

    /// The last record; none if nothing is known.
    pub(super) fn last(&self) -> Option<Record> {
        self.last
    }

    /// The records before the last one, the newest first, as far as they are there.
    pub(super) fn before(&self, flash: &impl Flash) -> [Option<Record>; RECENT] {
        let mut records = [None; RECENT];
        for (sector, at) in (0..SECTORS).flat_map(|sector| (0..RECORDS).map(move |at| (sector, at))) {
            if let Place::Whole(number, record) = look(flash, sector, at)
                && let Some(back) = self.number.checked_sub(number + 1)
                && let Some(place) = records.get_mut(back as usize)
            {
                *place = Some(record);
            }
        }
        records
    }

    /// Notes that a job begins, or that nobody knows where the printer stands.
    pub(super) fn begin(&mut self, flash: &mut impl Flash, job: u32, stored: u32) {
        let record = Record { job, stored, end: None };
        (self.last, self.number) = (Some(record), self.number + 1);
        for _ in 0..TRIES {
            if self.next == RECORDS {
                self.erase_ahead(flash);
                (self.sector, self.next, self.spare) = (self.sector ^ 1, 0, false);
            }
            let at = self.next;
            self.next += 1;
            flash.program(address(self.sector, at), &bytes(self.number, record));
            if matches!(look(flash, self.sector, at), Place::Whole(number, found) if (number, found) == (self.number, record))
            {
                self.place = Some(address(self.sector, at));
                return;
            }
        }
        (0..SECTORS).for_each(|sector| flash.erase(sector));
        (self.place, self.sector, self.next, self.spare) = (None, 0, 0, is_blank(flash, 1));
    }

    /// Notes that the printer stands between two jobs.
    pub(super) fn end(&mut self, flash: &mut impl Flash, end: End) {
        let Some(record) = self.last.as_mut().filter(|record| record.end.is_none()) else { return };
        record.end = Some(end);
        let word = ENDS.iter().find(|(which, _)| *which == end);
        if let (Some(place), Some((_, word))) = (self.place, word) {
            flash.program(place + END, word);
        }
    }

    /// Erases the other sector, if it is not blank; says whether that was done.
    pub(super) fn erase_ahead(&mut self, flash: &mut impl Flash) -> bool {
        let due = !self.spare;
        if due {
            flash.erase(self.sector ^ 1);
            self.spare = true;
        }
        due
    }
}

fn address(sector: u32, at: u32) -> u32 {
    sector * SECTOR + at * RECORD
}

fn bytes(number: u32, record: Record) -> [u8; RECORD as usize] {
    let mut bytes = [BLANK; RECORD as usize];
    for (word, value) in bytes[4..16].chunks_exact_mut(4).zip([number, record.job, record.stored]) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    let sum = checksum(&bytes[4..END as usize]);
    bytes[..4].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn look(flash: &impl Flash, sector: u32, at: u32) -> Place {
    let mut bytes = [0; RECORD as usize];
    flash.read(address(sector, at), &mut bytes);
    if bytes.iter().all(|&byte| byte == BLANK) {
        return Place::Blank;
    }
    let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    if word(0) != checksum(&bytes[4..END as usize]) || word(4) >= NUMBERS {
        return Place::Torn;
    }
    let end = ENDS.iter().find(|(_, word)| bytes[END as usize..] == *word).map(|(end, _)| *end);
    Place::Whole(word(4), Record { job: word(8), stored: word(12), end })
}

fn is_blank(flash: &impl Flash, sector: u32) -> bool {
    (0..RECORDS).all(|at| matches!(look(flash, sector, at), Place::Blank))
}
