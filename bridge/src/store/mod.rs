//! Jobs in the board's flash, in the form in which they cross the link.
//!
//! Problem: a whole job of up to some megabytes is kept on a board with some hundred kilobytes of memory, and the supply may go
//! at any instant. Afterwards there has to be what was there before, or the new job, whole. Method: a log of sectors.
//!
//! * **A sector** begins with a head: the number of the stored job, the sector's place in it, and a number that grows with every
//!   sector written. Pages of 252 bytes and a checksum follow. The sectors of a job follow each other around the area, and skip
//!   those of other jobs.
//! * **The first sector** of a job says what the job is. Behind its head is the page that makes the job count. It is written last: a
//!   job without it is none, and its sectors are free.
//! * **Deleting** a job overwrites its first head with zeros. So does every use of a sector, before it is erased: an erase that is
//!   cut short may leave any mixture of old and new bits, and none of them is a head that was there before.
//! * **Wear.** Sectors are taken in turn, each is erased once for each use, and none is ever copied. 100,000 uses of each are what
//!   makers of such chips promise.
//! * **Which sheet the printer is in** is written in two sectors of their own ([`Record`]).
//!
//! Nothing but the list of jobs is in memory. What it says is found again at the start by reading every head.
//!
//! Cost: 15 of 16 pages of a sector hold data, 252 of 256 bytes each, and the first sector one page less. An erase takes some 45 ms
//! (400 at most), a page under 1 ms. Limits: [`MOST`] jobs; a name of [`NAME_MAX`] bytes.
//! Why no library does this: `docs/decisions/print-alone.md`.

mod diary;
mod flash;

pub use diary::{End, Record};
pub use flash::{Flash, NoFlash, PAGE, SECTOR};

use crate::standing::QUESTION;
use diary::Diary;
use heapless::{String, Vec};
use protocol::link::frame::checksum;
use protocol::link::message::{JobKind, NAME_MAX};

/// The most jobs that are kept.
pub const MOST: usize = 16;

/// Bytes of a job in a page; its checksum follows.
pub const PAGE_DATA: usize = PAGE as usize - 4;

/// Pages with data in the first sector of a job, behind its head and the page that makes it count.
const FIRST_PAGES: u32 = SECTOR / PAGE - 2;
/// The same in its others.
const PAGES: u32 = SECTOR / PAGE - 1;

/// More sectors and records than any flash lasts to write: a greater number is none of ours.
const NUMBERS: u32 = 1 << 31;

const HEAD: usize = 28 + NAME_MAX;
const _: () = assert!(HEAD == 64);
const MAGIC: [u8; 2] = *b"F1";

/// What makes a job count, behind its checksum: its number and length.
const SEAL: usize = 12;

/// Sectors that are looked at in one call while the next one of a job is searched.
const LOOKS: u32 = 32;

/// A job in the store.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stored {
    /// Its number in the store, which no other job in it has had.
    id: u32,
    /// Its first sector.
    sector: u32,
    /// The job's number.
    pub job: u32,
    /// The kind of its data.
    pub kind: JobKind,
    /// Their length.
    pub length: u32,
}

impl Stored {
    /// Its number in the store, which no other job in it has had.
    pub fn id(&self) -> u32 {
        self.id
    }
}

/// The head of a sector.
struct Head {
    place: u32,
    sequence: u32,
    stored: Stored,
    name: String<NAME_MAX>,
}

/// The job that is being stored.
struct Draft {
    stored: Stored,
    name: String<NAME_MAX>,
    /// The sector under way and its place in the job; none before the first.
    open: Option<(u32, u32)>,
    /// Its next page.
    page: u32,
    /// Bytes stored.
    at: u32,
}

/// A job that is being read.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    stored: Stored,
    sector: u32,
    place: u32,
    page: u32,
    at: u32,
    /// Sectors that were looked at in vain since the last one of the job.
    looked: u32,
}

/// What comes next of a job that is being read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// So many bytes.
    Bytes(usize),
    /// Nothing yet: ask again.
    Later,
    /// The flash does not hold any more what was written.
    Damaged,
    /// Nothing: the job is at its end.
    End,
}

/// The flash does not keep what is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Worn;

/// The store.
pub struct Store<F> {
    flash: F,
    diary: Diary,
    /// Sectors for jobs, behind those of the diary.
    sectors: u32,
    /// The oldest first.
    jobs: Vec<Stored, MOST>,
    /// The number of the next sector that is written.
    sequence: u32,
    /// Where the next free sector is searched, from 0.
    next: u32,
    draft: Option<Draft>,
}

impl<F: Flash> Store<F> {
    /// Finds what is in the flash. Writes nothing.
    pub fn open(flash: F) -> Self {
        let sectors = (flash.size() / SECTOR).saturating_sub(diary::SECTORS);
        let diary = Diary::open(&flash);
        let mut store = Store { flash, diary, sectors, jobs: Vec::new(), sequence: 1, next: 0, draft: None };
        for sector in 0..sectors {
            let Some(head) = store.head(sector) else { continue };
            if head.sequence >= store.sequence {
                (store.sequence, store.next) = (head.sequence + 1, sector + 1);
            }
            if head.place == 0 && store.is_sealed(&head.stored) {
                let older = store.jobs.iter().take_while(|job| job.id < head.stored.id).count();
                // One too many cannot be: only so many are ever sealed.
                let _ = store.jobs.insert(older, head.stored);
            }
        }
        store
    }

    /// The jobs, the oldest first.
    pub fn jobs(&self) -> &[Stored] {
        &self.jobs
    }

    /// What a job was called.
    pub fn name(&self, stored: &Stored) -> String<NAME_MAX> {
        self.head(stored.sector).map(|head| head.name).unwrap_or_default()
    }

    /// Bytes of data that the store can hold in one job.
    pub fn total(&self) -> u32 {
        capacity(self.sectors)
    }

    /// Bytes of data that one more job may have.
    pub fn room(&self) -> u32 {
        if self.jobs.is_full() {
            return 0;
        }
        let used: u32 = self.jobs.iter().map(|job| sectors_of(job.length)).sum();
        capacity(self.sectors.saturating_sub(used))
    }

    /// Begins to store a job, over one that was begun before and is not whole. False if there is no room for it.
    pub fn begin(&mut self, job: u32, kind: JobKind, length: u32, name: &str) -> bool {
        self.draft = None;
        if length == 0 || length > self.room() {
            return false;
        }
        let mut short = String::new();
        for letter in name.chars() {
            if short.push(letter).is_err() {
                break;
            }
        }
        let stored = Stored { id: self.sequence, sector: 0, job, kind, length };
        self.draft = Some(Draft { stored, name: short, open: None, page: 0, at: 0 });
        true
    }

    /// How many bytes of the job that is being stored the next call of [`Store::put`] takes; 0 if none are missing.
    pub fn wants(&self) -> usize {
        let Some(Draft { stored, at, .. }) = &self.draft else { return 0 };
        PAGE_DATA.min((stored.length - at) as usize)
    }

    /// Stores the next bytes: as many as are [wanted](Store::wants). At most one sector is erased and four pages are programmed.
    /// After the last ones the job counts, and `Ok(true)` says so. Nothing counts behind an error.
    pub fn put(&mut self, bytes: &[u8]) -> Result<bool, Worn> {
        let Some(mut draft) = self.draft.take() else { return Ok(false) };
        let bytes = &bytes[..bytes.len().min(self.wants_of(&draft))];
        let pages = match draft.open {
            Some((_, 0)) => FIRST_PAGES,
            Some(_) => PAGES,
            None => 0,
        };
        if draft.page == pages {
            self.open_sector(&mut draft)?;
        }
        let Some((sector, place)) = draft.open else { return Err(Worn) };
        let mut page = [0xff; PAGE as usize];
        page[..bytes.len()].copy_from_slice(bytes);
        let sum = page_sum(&page, &draft.stored, draft.at);
        page[PAGE_DATA..].copy_from_slice(&sum.to_le_bytes());
        let at = page_address(sector, place, draft.page);
        self.flash.program(at, &page);
        let mut kept = [0; PAGE as usize];
        self.flash.read(at, &mut kept);
        if kept != page {
            return Err(Worn);
        }
        draft.page += 1;
        draft.at += u32::try_from(bytes.len()).unwrap_or(0);
        if draft.at < draft.stored.length {
            self.draft = Some(draft);
            return Ok(false);
        }
        self.flash.program(seal_address(draft.stored.sector), &seal(&draft.stored));
        if !self.is_sealed(&draft.stored) {
            return Err(Worn);
        }
        // There is room: `begin` has seen it.
        let _ = self.jobs.push(draft.stored);
        Ok(true)
    }

    fn wants_of(&self, draft: &Draft) -> usize {
        PAGE_DATA.min((draft.stored.length - draft.at) as usize)
    }

    /// Gives up the job that is being stored.
    pub fn forget(&mut self) {
        self.draft = None;
    }

    /// Deletes a job; false if there is none with this number.
    pub fn delete(&mut self, job: u32) -> bool {
        let Some(which) = self.jobs.iter().position(|stored| stored.job == job) else { return false };
        let stored = self.jobs.remove(which);
        self.blot(stored.sector);
        true
    }

    /// Begins to read a job.
    pub fn read(&self, stored: &Stored) -> Reading {
        Reading { stored: *stored, sector: stored.sector, place: 0, page: 0, at: 0, looked: 0 }
    }

    /// The next bytes of a job.
    pub fn next(&self, reading: &mut Reading, out: &mut [u8; PAGE_DATA]) -> Next {
        let Reading { stored, .. } = *reading;
        if reading.at == stored.length {
            return Next::End;
        }
        if reading.page == if reading.place == 0 { FIRST_PAGES } else { PAGES } {
            for _ in 0..LOOKS {
                reading.looked += 1;
                if reading.looked > self.sectors {
                    return Next::Damaged;
                }
                let sector = (reading.sector + reading.looked) % self.sectors;
                let head = self.head(sector);
                if head.is_some_and(|head| head.stored.id == stored.id && head.place == reading.place + 1) {
                    (reading.sector, reading.place) = (sector, reading.place + 1);
                    (reading.page, reading.looked) = (0, 0);
                    break;
                }
            }
            if reading.looked > 0 {
                return Next::Later;
            }
        }
        let mut page = [0; PAGE as usize];
        self.flash.read(page_address(reading.sector, reading.place, reading.page), &mut page);
        if page_sum(&page, &stored, reading.at).to_le_bytes() != page[PAGE_DATA..] {
            return Next::Damaged;
        }
        let count = PAGE_DATA.min((stored.length - reading.at) as usize);
        out.copy_from_slice(&page[..PAGE_DATA]);
        reading.page += 1;
        reading.at += u32::try_from(count).unwrap_or(0);
        Next::Bytes(count)
    }

    /// Whether there is room for a diary.
    pub fn keeps_diary(&self) -> bool {
        self.sectors > 0
    }

    /// What the diary says last; nothing where it says nothing that is known.
    pub fn noted(&self) -> Option<Record> {
        self.diary.last().filter(|_| self.keeps_diary())
    }

    /// Jobs before that one which have no legal end, the oldest first.
    pub fn lost_before(&self) -> impl Iterator<Item = u32> {
        let records = if self.keeps_diary() { self.diary.before(&self.flash) } else { Default::default() };
        let lost = |record: &Record| record.end != Some(End::Legal) && record.job != QUESTION;
        records.into_iter().rev().flatten().filter(lost).map(|record| record.job)
    }

    /// Notes that this job begins, unless that was noted last. `stored`: what it was stored as, or 0.
    pub fn note_begin(&mut self, job: u32, stored: u32) {
        let is_noted = self.noted() == Some(Record { job, stored, end: None });
        if self.keeps_diary() && !is_noted {
            self.diary.begin(&mut self.flash, job, stored);
        }
    }

    /// Notes that the printer stands between two jobs, if that is news.
    pub fn note_end(&mut self, end: End) {
        self.diary.end(&mut self.flash, end);
    }

    /// Makes room for what the diary notes next; whether there was something to do.
    pub fn make_room(&mut self) -> bool {
        self.keeps_diary() && self.diary.erase_ahead(&mut self.flash)
    }

    /// Takes the next free sector for the draft.
    fn open_sector(&mut self, draft: &mut Draft) -> Result<(), Worn> {
        let place = draft.open.map_or(0, |(_, place)| place + 1);
        let free = (0..self.sectors).map(|step| (self.next + step) % self.sectors);
        let sector = free.into_iter().find(|&sector| !self.is_used(sector, draft)).ok_or(Worn)?;
        self.blot(sector);
        self.flash.erase(diary::SECTORS + sector);
        if place == 0 {
            draft.stored.sector = sector;
        }
        let (sequence, head) = (self.sequence, head_bytes(draft, place, self.sequence));
        self.flash.program(address(sector), &head);
        (self.sequence, self.next) = (sequence + 1, sector + 1);
        (draft.open, draft.page) = (Some((sector, place)), 0);
        match self.head(sector) {
            Some(head) if head.sequence == sequence && head.stored.id == draft.stored.id => Ok(()),
            _ => Err(Worn),
        }
    }

    /// Whether a sector belongs to a job, or to the draft.
    fn is_used(&self, sector: u32, draft: &Draft) -> bool {
        let Some(head) = self.head(sector) else { return false };
        self.jobs.iter().chain([&draft.stored]).any(|job| job.id == head.stored.id)
    }

    /// Makes a sector's head one that says nothing.
    fn blot(&mut self, sector: u32) {
        self.flash.program(address(sector), &[0; HEAD]);
    }

    /// The head of a sector, if it has one.
    fn head(&self, sector: u32) -> Option<Head> {
        let mut head = [0; HEAD];
        self.flash.read(address(sector), &mut head);
        let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        if head[4..6] != MAGIC || word(0) != checksum(&head[4..]) {
            return None;
        }
        let kind = match head[6] {
            0 => JobKind::Raw,
            1 => JobKind::Streams,
            _ => return None,
        };
        let name = core::str::from_utf8(head.get(28..28 + usize::from(head[7]))?).ok()?;
        let stored = Stored { id: word(8), sector, job: word(20), kind, length: word(24) };
        if stored.id >= NUMBERS || word(16) >= NUMBERS {
            return None;
        }
        Some(Head { place: word(12), sequence: word(16), stored, name: name.try_into().ok()? })
    }

    fn is_sealed(&self, stored: &Stored) -> bool {
        let mut found = [0; SEAL];
        self.flash.read(seal_address(stored.sector), &mut found);
        found == seal(stored)
    }
}

fn head_bytes(draft: &Draft, place: u32, sequence: u32) -> [u8; HEAD] {
    let Draft { stored, name, .. } = draft;
    let mut head = [0; HEAD];
    head[4..6].copy_from_slice(&MAGIC);
    head[6] = match stored.kind {
        JobKind::Raw => 0,
        JobKind::Streams => 1,
    };
    // Of NAME_MAX bytes at most.
    head[7] = u8::try_from(name.len()).unwrap_or(0);
    let words = [stored.id, place, sequence, stored.job, stored.length];
    for (word, value) in head[8..28].chunks_exact_mut(4).zip(words) {
        word.copy_from_slice(&value.to_le_bytes());
    }
    head[28..28 + name.len()].copy_from_slice(name.as_bytes());
    let sum = checksum(&head[4..]);
    head[..4].copy_from_slice(&sum.to_le_bytes());
    head
}

fn seal(stored: &Stored) -> [u8; SEAL] {
    let mut seal = [0; SEAL];
    seal[4..8].copy_from_slice(&stored.id.to_le_bytes());
    seal[8..].copy_from_slice(&stored.length.to_le_bytes());
    let sum = checksum(&seal[4..]);
    seal[..4].copy_from_slice(&sum.to_le_bytes());
    seal
}

/// The checksum of a page of this job with the data from byte `at` on. Another job's page, or another page, has another one.
fn page_sum(page: &[u8; PAGE as usize], stored: &Stored, at: u32) -> u32 {
    checksum(&page[..PAGE_DATA]) ^ stored.id ^ at.rotate_left(16)
}

fn address(sector: u32) -> u32 {
    (diary::SECTORS + sector) * SECTOR
}

fn seal_address(sector: u32) -> u32 {
    address(sector) + PAGE
}

fn page_address(sector: u32, place: u32, page: u32) -> u32 {
    address(sector) + PAGE * (page + if place == 0 { 2 } else { 1 })
}

/// Bytes of data in one job of so many sectors.
fn capacity(sectors: u32) -> u32 {
    let data = |pages: u32| pages * (PAGE - 4);
    if sectors == 0 { 0 } else { data(FIRST_PAGES) + (sectors - 1) * data(PAGES) }
}

/// Sectors of a job with so many bytes of data.
fn sectors_of(length: u32) -> u32 {
    1 + length.saturating_sub(capacity(1)).div_ceil(capacity(2) - capacity(1))
}
