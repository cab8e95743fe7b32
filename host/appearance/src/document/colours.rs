//! The colour spaces that documents name, as a transfer curve and primaries.
//!
//! Problem: MaterialX and USD state the space of each colour by a name; read as linear Rec. 709, brass in
//! ACEScg prints orange.
//! Method: a table of the names of MaterialX, with those of its newer versions and of USD beside them. A
//! name that is not in it is an error: no guess is nearer than another. Cost: none. Limits: no spaces of
//! cameras, no profiles.
//! Source: MaterialX specification 1.39, Color Spaces; SMPTE ST 2065-1 and the Academy's S-2014-004 for
//! AP1; SMPTE EG 432-1 for P3 with D65; Adobe RGB (1998) Color Image Encoding, whose exponent is 563/256;
//! ITU-R BT.1886 for displays.

use readers::Primaries;

use super::picture::Encoding;
use super::picture::primaries::to_rec_709;

const AP1: Primaries = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]];
const P3: Primaries = [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], [0.3127, 0.3290]];
const ADOBE: Primaries = [[0.64, 0.33], [0.21, 0.71], [0.15, 0.06], [0.3127, 0.3290]];

/// How numbers stand for colours.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Colours {
    /// The transfer curve.
    pub encoding: Encoding,
    /// The primaries, if they are not those of Rec. 709.
    pub primaries: Option<&'static Primaries>,
    /// What people call it.
    pub name: &'static str,
}

const fn colours(encoding: Encoding, primaries: Option<&'static Primaries>, name: &'static str) -> Colours {
    Colours { encoding, primaries, name }
}

/// Numbers that are no colours, or linear Rec. 709.
pub(super) const LINEAR: Colours = colours(Encoding::Linear, None, "linear");

/// Names, and what they say.
const NAMES: [(&[&str], Colours); 11] = [
    (&["lin_rec709", "lin_srgb", "linear", "raw", "none"], LINEAR),
    (&["srgb_texture", "srgb_rec709", "srgb", "auto"], colours(Encoding::Srgb, None, "sRGB")),
    (&["g22_rec709", "g22", "gamma22"], colours(Encoding::Power(1.0 / 2.2), None, "a gamma of 2.2")),
    (&["g18_rec709", "g18", "gamma18"], colours(Encoding::Power(1.0 / 1.8), None, "a gamma of 1.8")),
    (&["rec709_display"], colours(Encoding::Power(1.0 / 2.4), None, "a Rec. 709 display's")),
    (&["acescg", "lin_ap1"], colours(Encoding::Linear, Some(&AP1), "ACEScg")),
    (&["g22_ap1"], colours(Encoding::Power(1.0 / 2.2), Some(&AP1), "ACES primaries with a gamma of 2.2")),
    (&["lin_displayp3", "lin_p3d65"], colours(Encoding::Linear, Some(&P3), "linear Display P3")),
    (&["srgb_displayp3", "srgb_p3d65"], colours(Encoding::Srgb, Some(&P3), "Display P3")),
    (&["adobergb", "g22_adobergb"], colours(Encoding::Power(256.0 / 563.0), Some(&ADOBE), "Adobe RGB")),
    (&["lin_adobergb"], colours(Encoding::Linear, Some(&ADOBE), "linear Adobe RGB")),
];

impl Colours {
    /// The space of this name.
    ///
    /// # Errors
    /// The names that are known.
    pub fn named(name: &str) -> Result<Colours, String> {
        let plain = name.strip_suffix("_scene").unwrap_or(name);
        let is = |known: &&str| known.eq_ignore_ascii_case(plain);
        let found = NAMES.iter().find(|(names, _)| names.iter().any(&is));
        found.map(|(_, colours)| *colours).ok_or_else(|| {
            let known: Vec<&str> = NAMES.iter().map(|(names, _)| names[0]).collect();
            format!("`{name}` is no colour space that is read; expected one of {}", known.join(", "))
        })
    }

    /// A colour as linear Rec. 709, below 0 where that has no such colour; a single number counts for all
    /// three.
    pub fn linear(self, numbers: &[f32]) -> Vec<f32> {
        let light: Vec<f32> = numbers.iter().map(|&v| self.encoding.linear(v)).collect();
        let matrix = self.primaries.and_then(|primaries| to_rec_709(primaries).ok().flatten());
        match (matrix, &light[..]) {
            (Some(matrix), &[r, g, b]) => {
                let from = [r, g, b].map(f64::from);
                matrix.map(|row| (0..3).map(|c| row[c] * from[c]).sum::<f64>() as f32).to_vec()
            }
            _ => light,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(name: &str, numbers: [f32; 3]) -> [f32; 3] {
        Colours::named(name).unwrap().linear(&numbers).try_into().unwrap()
    }

    /// Against matrices that others publish, and curves by their own formulas.
    #[test]
    fn colours_are_those_of_other_programs() {
        // OpenColorIO's ACEScg; Apple's Display P3 (D65 on both sides); Bruce Lindbloom's Adobe RGB.
        for (name, numbers, expected) in [
            ("acescg", [0.6, 0.3, 0.1], [0.8282, 0.2630, 0.0622]),
            ("lin_ap1_scene", [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]),
            ("lin_displayp3", [1.0, 0.0, 0.0], [1.2249, -0.0421, -0.0196]),
            ("lin_adobergb", [0.0, 1.0, 0.0], [-0.3984, 1.0, -0.0429]),
            ("srgb_texture", [0.5, 0.5, 0.5], [0.2140, 0.2140, 0.2140]),
            ("g22_rec709", [0.5, 0.5, 0.5], [0.2176, 0.2176, 0.2176]),
            ("adobergb", [0.5, 0.5, 0.5], [0.2177, 0.2177, 0.2177]),
            ("raw", [0.6, 0.3, 0.1], [0.6, 0.3, 0.1]),
        ] {
            let found = linear(name, numbers);
            for (a, b) in found.into_iter().zip(expected) {
                assert!((a - b).abs() < 3e-4, "{name}: {found:?}");
            }
        }
    }

    #[test]
    fn an_unknown_space_is_named_with_those_that_are_known() {
        let error = Colours::named("srgb_tex").unwrap_err();
        assert!(
            error.contains("`srgb_tex`") && error.contains("srgb_texture, ") && error.contains("acescg"),
            "{error}"
        );
        assert_eq!(Colours::named("sRGB"), Colours::named("srgb_texture"));
    }
}
