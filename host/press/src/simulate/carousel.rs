//! Cartridges: eight places in the carousel, at most seven cartridges, one of them on the carriage while it prints.
//!
//! The carousel turns, so the printer identifies a cartridge by its barcode instead of its place.

use protocol::ink::Ink;
use protocol::rgl::command::MAX_CARTRIDGES;

/// Places in the carousel: upper 1 to 4, lower 1 to 4.
pub const PLACES: usize = 8;

/// The state of a cartridge as the printer's sensor reads it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Condition {
    /// Usable.
    #[default]
    Ready,
    /// Inserted backwards.
    Backwards,
    /// Its ribbon is used up.
    Spent,
}

/// A cartridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cartridge {
    /// Its barcode, below 64.
    pub barcode: u8,
    /// Its state.
    pub condition: Condition,
}

impl From<Ink> for Cartridge {
    fn from(ink: Ink) -> Cartridge {
        Cartridge { barcode: ink.barcode(), condition: Condition::Ready }
    }
}

/// Why cartridges cannot be loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CarouselError {
    /// Too many.
    #[error("the printer holds seven cartridges, not {0}; remove some")]
    TooMany(usize),
    /// A barcode out of range.
    #[error("no cartridge has barcode {0}; barcodes are below 63")]
    Barcode(u8),
}

/// The result of fetching a cartridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Fetch {
    /// It is on the carriage.
    Ready,
    /// No usable cartridge has this barcode.
    Missing,
    /// It is present, but its ribbon is used up.
    Spent,
}

/// The cartridges in the printer.
#[derive(Clone, Debug, Default)]
pub struct Carousel {
    places: [Option<Cartridge>; PLACES],
    /// The cartridge on the carriage and the place it came from.
    carriage: Option<(Cartridge, usize)>,
}

impl Carousel {
    /// A carousel with these cartridges, upper places first.
    ///
    /// # Errors
    /// Too many cartridges, or a barcode out of range.
    pub fn new(cartridges: &[Cartridge]) -> Result<Carousel, CarouselError> {
        let mut carousel = Carousel::default();
        if cartridges.len() > MAX_CARTRIDGES {
            return Err(CarouselError::TooMany(cartridges.len()));
        }
        cartridges.iter().try_for_each(|&cartridge| carousel.insert(cartridge))?;
        Ok(carousel)
    }

    fn count(&self) -> usize {
        self.places.iter().flatten().count() + usize::from(self.carriage.is_some())
    }

    /// Inserts a cartridge. It replaces an unusable one with the same barcode.
    ///
    /// # Errors
    /// Too many cartridges, or a barcode out of range.
    pub fn insert(&mut self, cartridge: Cartridge) -> Result<(), CarouselError> {
        if cartridge.barcode >= 0x3f {
            return Err(CarouselError::Barcode(cartridge.barcode));
        }
        for place in &mut self.places {
            if place.is_some_and(|old| old.barcode == cartridge.barcode && old.condition != Condition::Ready)
            {
                *place = Some(cartridge);
                return Ok(());
            }
        }
        if self
            .carriage
            .is_some_and(|(old, _)| old.barcode == cartridge.barcode && old.condition != Condition::Ready)
        {
            self.carriage = self.carriage.map(|(_, from)| (cartridge, from));
            return Ok(());
        }
        if self.count() >= MAX_CARTRIDGES {
            return Err(CarouselError::TooMany(self.count() + 1));
        }
        let home = self.carriage.map(|(_, from)| from);
        let free = (0..PLACES).find(|&place| self.places[place].is_none() && Some(place) != home);
        // At most seven cartridges are in eight places, so one is always free.
        match free {
            Some(place) => self.places[place] = Some(cartridge),
            None => return Err(CarouselError::TooMany(PLACES + 1)),
        }
        Ok(())
    }

    /// Removes the cartridge with this barcode.
    pub fn remove(&mut self, barcode: u8) -> Option<Cartridge> {
        if let Some(place) = self.places.iter_mut().find(|p| p.is_some_and(|c| c.barcode == barcode)) {
            return place.take();
        }
        let (cartridge, _) = self.carriage.take_if(|(cartridge, _)| cartridge.barcode == barcode)?;
        Some(cartridge)
    }

    /// Returns the cartridge on the carriage to its place and fetches the one with this barcode.
    pub(super) fn fetch(&mut self, barcode: u8) -> Fetch {
        let ready =
            |cartridge: &Cartridge| cartridge.barcode == barcode && cartridge.condition == Condition::Ready;
        if self.carriage.is_some_and(|(cartridge, _)| ready(&cartridge)) {
            return Fetch::Ready;
        }
        if let Some((cartridge, home)) = self.carriage.take() {
            self.places[home] = Some(cartridge);
        }
        if let Some(place) = (0..PLACES).find(|&place| self.places[place].as_ref().is_some_and(ready)) {
            self.carriage = self.places[place].take().map(|cartridge| (cartridge, place));
            return Fetch::Ready;
        }
        let spent = |c: &Cartridge| c.barcode == barcode && c.condition == Condition::Spent;
        if self.places.iter().flatten().any(spent) { Fetch::Spent } else { Fetch::Missing }
    }

    /// Barcode of the cartridge on the carriage.
    pub fn on_carriage(&self) -> Option<u8> {
        self.carriage.map(|(cartridge, _)| cartridge.barcode)
    }

    /// The first bytes of the nine status entries: upper 1-4, lower 1-4, carriage.
    pub(super) fn entries(&self) -> [u8; PLACES + 1] {
        let entry = |cartridge: Option<Cartridge>| {
            cartridge.map_or(0xff, |cartridge| {
                let state = match cartridge.condition {
                    Condition::Ready => 0x00,
                    Condition::Backwards => 0x40,
                    Condition::Spent => 0x80,
                };
                state | cartridge.barcode
            })
        };
        let mut entries = [0xff; PLACES + 1];
        for (place, cartridge) in entries.iter_mut().zip(self.places) {
            *place = entry(cartridge);
        }
        entries[PLACES] = entry(self.carriage.map(|(cartridge, _)| cartridge));
        entries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cartridge_goes_to_the_carriage_and_back_to_its_place() {
        let mut carousel = Carousel::new(&[Ink::Cyan.into(), Ink::White.into()]).unwrap();
        assert_eq!(carousel.fetch(16), Fetch::Ready);
        assert_eq!(carousel.entries(), [3, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 16]);
        assert_eq!(carousel.fetch(3), Fetch::Ready);
        assert_eq!(carousel.entries(), [0xff, 16, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 3]);
        assert_eq!(carousel.fetch(5), Fetch::Missing);
        assert_eq!(carousel.on_carriage(), None);
        assert_eq!(carousel.remove(3).map(|c| c.barcode), Some(3));
    }

    #[test]
    fn eight_cartridges_do_not_go_in() {
        let eight: Vec<Cartridge> = Ink::ALL[..8].iter().map(|&ink| ink.into()).collect();
        assert_eq!(Carousel::new(&eight).unwrap_err(), CarouselError::TooMany(8));
        let mut seven = Carousel::new(&eight[..7]).unwrap();
        assert_eq!(seven.fetch(eight[0].barcode), Fetch::Ready);
        assert_eq!(seven.insert(eight[7]), Err(CarouselError::TooMany(8)), "the one on the carriage counts");
        assert_eq!(seven.insert(Cartridge { barcode: 63, ..eight[7] }), Err(CarouselError::Barcode(63)));
    }

    #[test]
    fn a_spent_cartridge_is_found_and_replaced() {
        let spent = Cartridge { condition: Condition::Spent, ..Ink::Black.into() };
        let mut carousel = Carousel::new(&[spent]).unwrap();
        assert_eq!(carousel.fetch(0), Fetch::Spent);
        assert_eq!(carousel.entries()[0], 0x80);
        carousel.insert(Ink::Black.into()).unwrap();
        assert_eq!((carousel.fetch(0), carousel.count()), (Fetch::Ready, 1));
    }
}
