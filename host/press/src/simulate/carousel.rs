//! Cassettes: eight places in the carousel, at most seven cassettes, one of them on the carriage while it prints.
//!
//! The machine knows a cassette by its barcode, never by its place: the carousel turns.

use protocol::ink::Ink;
use protocol::rgl::command::MAX_CARTRIDGES;

/// Places in the carousel: upper 1 to 4, lower 1 to 4.
pub const PLACES: usize = 8;

/// What the machine's sensor says about a cassette.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Condition {
    /// Usable.
    #[default]
    Ready,
    /// Put in backwards.
    Backwards,
    /// Its ribbon is at the end.
    Spent,
}

/// A cassette.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cassette {
    /// The number on it, below 64.
    pub barcode: u8,
    /// Its state.
    pub condition: Condition,
}

impl From<Ink> for Cassette {
    fn from(ink: Ink) -> Cassette {
        Cassette { barcode: ink.barcode(), condition: Condition::Ready }
    }
}

/// Why cassettes cannot be loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CarouselError {
    /// Too many.
    #[error("the printer holds seven cassettes, not {0}; take some out")]
    TooMany(usize),
    /// No such barcode.
    #[error("barcode {0} is no cassette's; barcodes are below 63")]
    Barcode(u8),
}

/// How fetching a cassette went.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Fetch {
    /// It is on the carriage.
    Ready,
    /// There is none with this barcode that can be used.
    Missing,
    /// It is there, and its ribbon is at the end.
    Spent,
}

/// The cassettes in the machine.
#[derive(Clone, Debug, Default)]
pub struct Carousel {
    places: [Option<Cassette>; PLACES],
    /// The cassette on the carriage and the place it came from.
    carriage: Option<(Cassette, usize)>,
}

impl Carousel {
    /// A carousel with these cassettes, upper places first.
    pub fn new(cassettes: &[Cassette]) -> Result<Carousel, CarouselError> {
        let mut carousel = Carousel::default();
        if cassettes.len() > MAX_CARTRIDGES {
            return Err(CarouselError::TooMany(cassettes.len()));
        }
        cassettes.iter().try_for_each(|&cassette| carousel.insert(cassette))?;
        Ok(carousel)
    }

    fn count(&self) -> usize {
        self.places.iter().flatten().count() + usize::from(self.carriage.is_some())
    }

    /// Puts a cassette in. One with the same barcode that cannot be used any more is taken out for it.
    pub fn insert(&mut self, cassette: Cassette) -> Result<(), CarouselError> {
        if cassette.barcode >= 0x3f {
            return Err(CarouselError::Barcode(cassette.barcode));
        }
        for place in &mut self.places {
            if place.is_some_and(|old| old.barcode == cassette.barcode && old.condition != Condition::Ready) {
                *place = Some(cassette);
                return Ok(());
            }
        }
        if self
            .carriage
            .is_some_and(|(old, _)| old.barcode == cassette.barcode && old.condition != Condition::Ready)
        {
            self.carriage = self.carriage.map(|(_, from)| (cassette, from));
            return Ok(());
        }
        if self.count() >= MAX_CARTRIDGES {
            return Err(CarouselError::TooMany(self.count() + 1));
        }
        let home = self.carriage.map(|(_, from)| from);
        let free = (0..PLACES).find(|&place| self.places[place].is_none() && Some(place) != home);
        // Seven cassettes at most in eight places: one is always free.
        match free {
            Some(place) => self.places[place] = Some(cassette),
            None => return Err(CarouselError::TooMany(PLACES + 1)),
        }
        Ok(())
    }

    /// Takes the cassette with this barcode out.
    pub fn remove(&mut self, barcode: u8) -> Option<Cassette> {
        if let Some(place) = self.places.iter_mut().find(|p| p.is_some_and(|c| c.barcode == barcode)) {
            return place.take();
        }
        let (cassette, _) = self.carriage.take_if(|(cassette, _)| cassette.barcode == barcode)?;
        Some(cassette)
    }

    /// Takes back what is on the carriage and fetches the cassette with this barcode.
    pub(super) fn fetch(&mut self, barcode: u8) -> Fetch {
        let ready =
            |cassette: &Cassette| cassette.barcode == barcode && cassette.condition == Condition::Ready;
        if self.carriage.is_some_and(|(cassette, _)| ready(&cassette)) {
            return Fetch::Ready;
        }
        if let Some((cassette, home)) = self.carriage.take() {
            self.places[home] = Some(cassette);
        }
        if let Some(place) = (0..PLACES).find(|&place| self.places[place].as_ref().is_some_and(ready)) {
            self.carriage = self.places[place].take().map(|cassette| (cassette, place));
            return Fetch::Ready;
        }
        let spent = |c: &Cassette| c.barcode == barcode && c.condition == Condition::Spent;
        if self.places.iter().flatten().any(spent) { Fetch::Spent } else { Fetch::Missing }
    }

    /// The barcode on the carriage.
    pub fn on_carriage(&self) -> Option<u8> {
        self.carriage.map(|(cassette, _)| cassette.barcode)
    }

    /// The first bytes of the nine status entries: upper 1-4, lower 1-4, carriage.
    pub(super) fn entries(&self) -> [u8; PLACES + 1] {
        let entry = |cassette: Option<Cassette>| {
            cassette.map_or(0xff, |cassette| {
                let state = match cassette.condition {
                    Condition::Ready => 0x00,
                    Condition::Backwards => 0x40,
                    Condition::Spent => 0x80,
                };
                state | cassette.barcode
            })
        };
        let mut entries = [0xff; PLACES + 1];
        for (place, cassette) in entries.iter_mut().zip(self.places) {
            *place = entry(cassette);
        }
        entries[PLACES] = entry(self.carriage.map(|(cassette, _)| cassette));
        entries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cassette_goes_to_the_carriage_and_back_to_its_place() {
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
    fn eight_cassettes_do_not_go_in() {
        let eight: Vec<Cassette> = Ink::ALL[..8].iter().map(|&ink| ink.into()).collect();
        assert_eq!(Carousel::new(&eight).unwrap_err(), CarouselError::TooMany(8));
        let mut seven = Carousel::new(&eight[..7]).unwrap();
        assert_eq!(seven.fetch(eight[0].barcode), Fetch::Ready);
        assert_eq!(seven.insert(eight[7]), Err(CarouselError::TooMany(8)), "the one on the carriage counts");
        assert_eq!(seven.insert(Cassette { barcode: 63, ..eight[7] }), Err(CarouselError::Barcode(63)));
    }

    #[test]
    fn a_spent_cassette_is_found_and_replaced() {
        let spent = Cassette { condition: Condition::Spent, ..Ink::Black.into() };
        let mut carousel = Carousel::new(&[spent]).unwrap();
        assert_eq!(carousel.fetch(0), Fetch::Spent);
        assert_eq!(carousel.entries()[0], 0x80);
        carousel.insert(Ink::Black.into()).unwrap();
        assert_eq!((carousel.fetch(0), carousel.count()), (Fetch::Ready, 1));
    }
}
