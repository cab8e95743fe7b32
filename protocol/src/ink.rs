//! The inks: one cartridge each, with the two numbers by which the printer knows it.
//!
//! The *ink code* is in the ink-select command of a job. The *barcode* is printed on the cartridge and is in the cartridge
//! list and in the printer's status. They are different numbers.
//! Sources: streams of the established open driver (codes of process inks, metallics, white, finish, primer),
//! observation on hardware (black, cyan, magenta, yellow, white, finish, primer), vendor driver data
//! (barcodes, the foils' codes, which no captured stream confirms).

/// An ink this project prints with, in the order of the printer's ink codes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
pub enum Ink {
    /// Process black.
    Black,
    /// Process cyan.
    Cyan,
    /// Process magenta.
    Magenta,
    /// Process yellow.
    Yellow,
    /// Gold flake ink.
    MetallicGold,
    /// Magenta flake ink, sold as metallic red.
    MetallicMagenta,
    /// Cyan flake ink, sold as metallic blue.
    MetallicCyan,
    /// Silver flake ink.
    MetallicSilver,
    /// Spot white, an undercoat.
    White,
    /// Clear gloss overcoat, sold as glossy finish or finish II.
    Finish,
    /// Clear undercoat, sold as VPhoto primer.
    Primer,
    /// Gold foil, sold as flash gold. Its code is inferred, not captured.
    GoldFoil,
    /// Silver foil, sold as flash silver. Its code is inferred, not captured.
    SilverFoil,
}

/// The material of an ink, as far as the order and the size of its dots depend on it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Transparent colour: cyan, magenta, yellow, black. The only inks that may print at 1200 dpi.
    Process,
    /// Opaque flakes in a binder.
    Metallic,
    /// Opaque metallised film, spot use only.
    Foil,
    /// Opaque white undercoat.
    White,
    /// Clear undercoat.
    Primer,
    /// Clear overcoat.
    Finish,
}

struct InkRow {
    ink: Ink,
    name: &'static str,
    short: &'static str,
    code: u8,
    barcode: u8,
    part: &'static str,
    kind: Kind,
}

const fn row(
    ink: Ink,
    name: &'static str,
    short: &'static str,
    code: u8,
    barcode: u8,
    part: &'static str,
    kind: Kind,
) -> InkRow {
    InkRow { ink, name, short, code, barcode, part, kind }
}

const TABLE: [InkRow; 13] = [
    row(Ink::Black, "black", "K", 0x00, 0, "MDC-FLCK", Kind::Process),
    row(Ink::Cyan, "cyan", "C", 0x01, 3, "MDC-FLCC", Kind::Process),
    row(Ink::Magenta, "magenta", "M", 0x02, 2, "MDC-FLCM", Kind::Process),
    row(Ink::Yellow, "yellow", "Y", 0x03, 1, "MDC-FLCY", Kind::Process),
    row(Ink::MetallicGold, "metallic-gold", "MG", 0x04, 8, "MDC-METG", Kind::Metallic),
    row(Ink::MetallicMagenta, "metallic-magenta", "MM", 0x05, 9, "MDC-METR", Kind::Metallic),
    row(Ink::MetallicCyan, "metallic-cyan", "MC", 0x06, 10, "MDC-METB", Kind::Metallic),
    row(Ink::MetallicSilver, "metallic-silver", "MS", 0x07, 11, "MDC-METS", Kind::Metallic),
    row(Ink::White, "white", "W", 0x0b, 16, "MDC-SCWH", Kind::White),
    row(Ink::Finish, "finish", "F", 0x0e, 19, "MDC-FRVG", Kind::Finish),
    row(Ink::Primer, "primer", "P", 0x10, 18, "MDC-PREP", Kind::Primer),
    row(Ink::GoldFoil, "gold-foil", "GF", 0x11, 5, "MDC-FMEG", Kind::Foil),
    row(Ink::SilverFoil, "silver-foil", "SF", 0x14, 6, "MDC-FMES", Kind::Foil),
];

impl Ink {
    /// Every ink, in the order of the ink codes.
    pub const ALL: [Ink; 13] = {
        let mut all = [Ink::Black; 13];
        let mut i = 0;
        while i < 13 {
            all[i] = TABLE[i].ink;
            i += 1;
        }
        all
    };

    fn row(self) -> &'static InkRow {
        &TABLE[self as usize]
    }

    /// The name for people and in files, such as `metallic-silver`.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The one- or two-letter name in stacks, such as `MS`.
    pub fn short(self) -> &'static str {
        self.row().short
    }

    /// The number in the ink-select command.
    pub fn code(self) -> u8 {
        self.row().code
    }

    /// The number on the cartridge, in the cartridge list and in the printer's status.
    pub fn barcode(self) -> u8 {
        self.row().barcode
    }

    /// The vendor's part number of the cartridge.
    pub fn part(self) -> &'static str {
        self.row().part
    }

    /// The material of the ink.
    pub fn kind(self) -> Kind {
        self.row().kind
    }

    /// The ink with this code, if it is one this project prints with.
    pub fn from_code(code: u8) -> Option<Ink> {
        TABLE.iter().find(|row| row.code == code).map(|row| row.ink)
    }

    /// The ink on the cartridge with this barcode.
    pub fn from_barcode(barcode: u8) -> Option<Ink> {
        TABLE.iter().find(|row| row.barcode == barcode).map(|row| row.ink)
    }

    /// The ink with this long or short name, in upper or lower case.
    pub fn from_name(name: &str) -> Option<Ink> {
        TABLE
            .iter()
            .find(|row| row.name.eq_ignore_ascii_case(name) || row.short.eq_ignore_ascii_case(name))
            .map(|row| row.ink)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_enum_and_of_the_codes() {
        for (i, row) in TABLE.iter().enumerate() {
            assert_eq!(row.ink as usize, i);
            assert_eq!(Ink::from_code(row.code), Some(row.ink));
            assert_eq!(Ink::from_barcode(row.barcode), Some(row.ink));
            assert_eq!(Ink::from_name(row.name), Some(row.ink));
            assert_eq!(Ink::from_name(row.short), Some(row.ink));
        }
        assert!(TABLE.windows(2).all(|pair| pair[0].code < pair[1].code));
    }
}
