//! NOR flash whose supply may go at any instant.
//!
//! A supply that goes while a page is programmed leaves any of the bits that were to be cleared as they were; one that goes while a
//! sector is erased leaves any of its bits, set or cleared: such chips clear all bits of a sector before they set them. What is
//! asked of a chip without supply changes nothing.

use bridge::store::{Flash, PAGE, SECTOR};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

struct Chip {
    bytes: Vec<u8>,
    /// How often each sector was erased.
    erased: Vec<u32>,
    /// Operations until the supply goes in the middle of one.
    left: Option<u32>,
    off: bool,
    operations: u32,
    /// Bytes that do not keep what is written, from this one on.
    worn: Option<usize>,
    random: ChaCha8Rng,
}

/// The flash. Clones are the same chip.
#[derive(Clone)]
pub struct ModelFlash(Arc<Mutex<Chip>>);

impl ModelFlash {
    /// A chip of so many sectors, with anything in it.
    pub fn new(sectors: usize, random: &mut ChaCha8Rng) -> ModelFlash {
        let mut random = ChaCha8Rng::seed_from_u64(random.random());
        let mut bytes = vec![0xff; sectors * SECTOR as usize];
        if random.random_bool(0.5) {
            bytes.fill_with(|| random.random());
        }
        let erased = vec![0; sectors];
        ModelFlash(Arc::new(Mutex::new(Chip {
            bytes,
            erased,
            left: None,
            off: false,
            operations: 0,
            worn: None,
            random,
        })))
    }

    fn chip(&self) -> MutexGuard<'_, Chip> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The supply goes in the middle of the operation after so many others.
    pub fn cut_after(&self, operations: u32) {
        self.chip().left = Some(operations);
    }

    /// Whether the supply is gone.
    pub fn is_off(&self) -> bool {
        self.chip().off
    }

    /// The supply is back.
    pub fn power_up(&self) {
        let mut chip = self.chip();
        (chip.off, chip.left) = (false, None);
    }

    /// Operations until now.
    pub fn operations(&self) -> u32 {
        self.chip().operations
    }

    /// How often each sector was erased.
    pub fn erased(&self) -> Vec<u32> {
        self.chip().erased.clone()
    }

    /// From this byte on the chip does not keep zeros any more.
    pub fn wear_out(&self, from: usize) {
        self.chip().worn = Some(from);
    }

    /// Changes a bit, as age does.
    pub fn flip(&self, byte: usize, bit: u8) {
        self.chip().bytes[byte] ^= 1 << bit;
    }

    /// What is in it.
    pub fn bytes(&self) -> Vec<u8> {
        self.chip().bytes.clone()
    }
}

impl Chip {
    /// Counts an operation. `None` if nothing happens, or the part of the bits that it reaches: all of them, or fewer.
    fn operate(&mut self) -> Option<f64> {
        if self.off {
            return None;
        }
        self.operations += 1;
        match &mut self.left {
            Some(0) => {
                self.off = true;
                Some([0.0, 0.02, 0.5, 0.98, 1.0][self.random.random_range(0..5)])
            }
            Some(left) => {
                *left -= 1;
                Some(1.0)
            }
            None => Some(1.0),
        }
    }

    /// Bits of which each is set with this probability.
    fn bits(&mut self, part: f64) -> u8 {
        if part >= 1.0 {
            return 0xff;
        }
        (0..8).map(|bit| u8::from(self.random.random_bool(part)) << bit).sum()
    }
}

impl Flash for ModelFlash {
    fn size(&self) -> u32 {
        self.chip().bytes.len() as u32
    }

    fn read(&self, at: u32, out: &mut [u8]) {
        let chip = self.chip();
        for (i, byte) in out.iter_mut().enumerate() {
            *byte = chip.bytes.get(at as usize + i).copied().unwrap_or(0xff);
        }
    }

    fn program(&mut self, at: u32, bytes: &[u8]) {
        assert!(
            at / PAGE == (at + bytes.len() as u32 - 1) / PAGE,
            "bytes {at} and {} on lie in two pages",
            bytes.len()
        );
        let mut chip = self.chip();
        let Some(part) = chip.operate() else { return };
        for (i, &byte) in bytes.iter().enumerate() {
            let at = at as usize + i;
            if chip.worn.is_some_and(|from| at >= from) {
                continue;
            }
            let cleared = !byte & chip.bits(part);
            chip.bytes[at] &= !cleared;
        }
    }

    fn erase(&mut self, sector: u32) {
        let mut chip = self.chip();
        let Some(part) = chip.operate() else { return };
        chip.erased[sector as usize] += 1;
        let clears = part < 1.0 && chip.random.random_bool(0.5);
        for at in (sector * SECTOR) as usize..((sector + 1) * SECTOR) as usize {
            let bits = chip.bits(part);
            if clears { chip.bytes[at] &= !bits } else { chip.bytes[at] |= bits }
        }
    }
}
