//! How Ghostscript converts the CMYK of text and drawings: as inks, so that K is black and C is cyan.
//!
//! Problem: its usual profile makes a brown black of K and a fifth of half a cyan. It can be told to
//! convert without a profile, but in 10.05 and 10.08 its device with tags then writes cyan, magenta and
//! yellow for red, green and blue. A profile that leads straight from CMYK to red, green and blue does so
//! even where a transparency group is to be mixed in CMYK, and K becomes white there.
//! Method: an ordinary profile of a printer is the one of all CMYK; pictures keep the usual one. Its inks
//! take as much light as they cover, so a tint of one ink prints on as many dots as the page asks for. Red
//! is what C and K leave of it, each by itself, and so on. What is red, green and blue in a group of CMYK
//! becomes the colour's least ink over its K, `1 - max(R, G, B)`.
//! Cost: 0.7 MB in a temporary file; 0.04 s of a document in CMYK. Limits: where an ink and K are just
//! about full together, colours differ by up to 12 of 255, tints by 2. Source: ICC.1:2010, 8.3 and 10.10,
//! with the header of version 2, for which black is black in every intent; Ghostscript's documentation of
//! `DefaultCMYKProfile` and `SourceObjectICC`.

use std::fs;
use std::io;
use std::path::Path;

use palette::chromatic_adaptation::AdaptFromUnclamped;
use palette::convert::FromColorUnclamped;
use palette::white_point::{D50, D65};
use palette::{Lab, LinSrgb, Srgb, Xyz};
use readers::profile::{self, Table};

/// Nodes on each axis of the table from CMYK, at whole steps of 8 bits, and of that to CMYK.
const NODES: usize = 16;
const NODES_OF_LAB: usize = 33;
/// Entries of a curve: one for each value of 8 bits, so that none lies between two.
const ENTRIES: usize = 256;

/// Ghostscript's options. Its process must run in the folder that has the files: it ends their names at a
/// space.
pub const OPTIONS: [&str; 2] = ["-sDefaultCMYKProfile=inks.icc", "-sSourceObjectICC=conversions"];

/// Those of a document that overprints: what lies on each other is mixed as inks, in that profile, not in
/// the usual one.
pub const OVERPRINT: [&str; 2] = ["-dOverprint=/simulate", "-sBlendColorProfile=inks.icc"];

/// The profile of pictures is Ghostscript's own; then relative intent, black point, no override of embedded
/// profiles, no kept K: as it converts pictures by itself.
const PICTURES: &str = "Image_CMYK default_cmyk.icc 1 1 0 0\n";

/// Writes the files of [`OPTIONS`] into a folder.
///
/// # Errors
/// Those of writing.
pub fn write(folder: &Path) -> io::Result<()> {
    fs::write(folder.join("inks.icc"), inks()?)?;
    fs::write(folder.join("conversions"), PICTURES)
}

/// The profile of a printer that prints inks.
fn inks() -> io::Result<Vec<u8>> {
    let part = |node: usize, nodes: usize| node as f64 / (nodes - 1) as f64;
    // Red, green and blue of all nodes are nodes, too.
    let colours: Vec<[u16; 3]> =
        nodes::<3>(NODES).map(|rgb| encoded(lab(rgb.map(|at| part(at, NODES))))).collect();
    let to_lab = nodes::<4>(NODES).flat_map(|[c, m, y, k]| {
        let [r, g, b] = [c, m, y].map(|ink| NODES - 1 - (ink + k).min(NODES - 1));
        colours[(r * NODES + g) * NODES + b]
    });
    let from_lab = nodes::<3>(NODES_OF_LAB).flat_map(|node| {
        let rgb = rgb(decoded(node.map(|at| part(at, NODES_OF_LAB))));
        let light = rgb.into_iter().fold(0.0, f64::max);
        let [r, g, b] = rgb;
        [light - r, light - g, light - b, 1.0 - light].map(|ink| (ink * WHOLE).round() as u16)
    });
    let (taking, whole) = (curve(taken), curve(|part| part));
    let inking = curve(|taken| 1.0 - light(1.0 - taken));
    profile::printer(
        table([4, 3], NODES, to_lab.collect(), [taking, whole.clone()]),
        table([3, 4], NODES_OF_LAB, from_lab.collect(), [whole, inking]),
    )
}

/// All nodes of a table, the last axis first.
fn nodes<const AXES: usize>(each: usize) -> impl Iterator<Item = [usize; AXES]> {
    (0..each.pow(AXES as u32))
        .map(move |at| std::array::from_fn(|axis| at / each.pow((AXES - 1 - axis) as u32) % each))
}

/// What an ink on so much of the dots takes from the value of red, green or blue: it takes as much of their
/// light.
pub(super) fn taken(ink: f64) -> f64 {
    1.0 - Srgb::<f64>::from_linear(LinSrgb::new(1.0 - ink, 0.0, 0.0)).red
}

/// The light of a value.
fn light(value: f64) -> f64 {
    Srgb::new(value, 0.0, 0.0).into_linear().red
}

/// A curve of a table.
fn curve(at: impl Fn(f64) -> f64) -> Vec<u16> {
    (0..ENTRIES).map(|n| (at(n as f64 / (ENTRIES - 1) as f64) * WHOLE).round() as u16).collect()
}

/// A table of so many nodes on each axis.
fn table(channels: [u8; 2], nodes: usize, values: Vec<u16>, curves: [Vec<u16>; 2]) -> Table {
    Table { channels, nodes: nodes as u8, values, curves }
}

const WHOLE: f64 = u16::MAX as f64;
/// What 16 bits mean in such tables: full lightness, and a step of the other two, which begin at -128.
const FULL: f64 = 65280.0;
const STEP: f64 = 256.0;

fn encoded(lab: Lab<D50, f64>) -> [u16; 3] {
    [lab.l / 100.0 * FULL, (lab.a + 128.0) * STEP, (lab.b + 128.0) * STEP].map(|v| v.round() as u16)
}

fn decoded([l, a, b]: [f64; 3]) -> Lab<D50, f64> {
    Lab::new(l * WHOLE / FULL * 100.0, a * WHOLE / STEP - 128.0, b * WHOLE / STEP - 128.0)
}

/// The colour of sRGB, seen in the light of profiles.
fn lab([r, g, b]: [f64; 3]) -> Lab<D50, f64> {
    let light = Xyz::<D65, f64>::from_color_unclamped(LinSrgb::from_color_unclamped(Srgb::new(r, g, b)));
    Lab::from_color_unclamped(Xyz::<D50, f64>::adapt_from_unclamped(light))
}

/// The nearest colour of sRGB, channel by channel.
fn rgb(lab: Lab<D50, f64>) -> [f64; 3] {
    let light = Xyz::<D65, f64>::adapt_from_unclamped(Xyz::<D50, f64>::from_color_unclamped(lab));
    let rgb = Srgb::from_color_unclamped(LinSrgb::<f64>::from_color_unclamped(light));
    [rgb.red, rgb.green, rgb.blue].map(|v| v.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use proptest::prelude::*;
    use testing::needs::ghostscript;

    use super::super::{Interpreter, command, order};
    use super::*;
    use crate::read::object_type::{self, ObjectType};
    use crate::read::process::{Process, limit};
    use files::scratch::Scratch;

    /// The pixels of a PostScript page of 240 x 10 points, at a pixel a point.
    fn drawn(marks: &str) -> Vec<[u8; object_type::BYTES]> {
        let folder = Scratch::new().unwrap();
        write(folder.path()).unwrap();
        let (page, picture) = (folder.path().join("page.ps"), folder.path().join("page.pam"));
        fs::write(&page, format!("%!PS\n<</PageSize [240 10]>> setpagedevice\n{marks}\nshowpage\n")).unwrap();
        let device = format!("-sDEVICE={}", object_type::DEVICE);
        let output = format!("-sOutputFile={}", picture.display());
        let options = OPTIONS.into_iter().chain(["-r72", &device, &output]);
        let mut command = command(&page, Interpreter::Usual, folder.path(), options);
        let said = Process::start(&mut command, limit()).unwrap().end(|| false).unwrap();
        let picture = fs::read(picture).unwrap();
        let mut input = &picture[..];
        assert_eq!(object_type::header(&mut input).unwrap(), Some((240, 10)), "{said}");
        let mut pixels = vec![[0; object_type::BYTES]; 2400];
        pixels.as_flattened_mut().copy_from_slice(input);
        order(input).unwrap().turn(pixels.as_flattened_mut());
        pixels
    }

    proptest! {
        #![proptest_config(testing::cases(8))]

        /// As Ghostscript reads the profile, against the formula: of colours near the kink, too.
        #[test]
        fn drawings_in_cmyk_are_inks(
            asked in prop::collection::vec((prop::array::uniform4(0f64..=1.0), 0usize..4, -0.1f64..0.1), 24)
        ) {
            if !ghostscript() {
                return Ok(());
            }
            let colour = |&(mut cmyk, near, beyond): &([f64; 4], usize, f64)| {
                if near < 3 {
                    // Where both are just about full together.
                    cmyk[near] = (1.0 - light(taken(cmyk[3])) + beyond).clamp(0.0, 1.0);
                }
                cmyk
            };
            let asked: Vec<[f64; 4]> = asked.iter().map(colour).collect();
            let mut marks = String::new();
            for (at, [c, m, y, k]) in asked.iter().enumerate() {
                writeln!(marks, "{c:.5} {m:.5} {y:.5} {k:.5} setcmykcolor {} 0 10 10 rectfill", at * 10).unwrap();
            }
            for (pixels, [c, m, y, k]) in drawn(&marks)[4 * 240..].chunks(10).zip(asked) {
                let [tag, rgb @ ..] = pixels[5];
                prop_assert_eq!(ObjectType::of(tag), ObjectType::Drawing);
                for (found, ink) in rgb.into_iter().zip([c, m, y]) {
                    let wanted = 255.0 * (1.0 - taken(ink) - taken(k)).max(0.0);
                    // Of what is nearly full, a step of the value is hardly any light.
                    let dots = (light(f64::from(found) / 255.0) - light(wanted / 255.0)).abs();
                    let is_right = dots < 0.01 || (f64::from(found) - wanted).abs() < 12.0;
                    prop_assert!(is_right, "{found} for {ink} with {k} of K");
                }
            }
        }
    }

    #[test]
    fn full_inks_and_letters_are_exact_and_pictures_keep_their_profile() {
        if !ghostscript() {
            return;
        }
        let pixels = drawn(
            "1 0 0 0 setcmykcolor 0 0 10 10 rectfill 0 0 1 0 setcmykcolor 10 0 10 10 rectfill
             0 1 1 0 setcmykcolor 20 0 10 10 rectfill 0 0 0 1 setcmykcolor 30 0 10 10 rectfill
             0 0 0 0.2 setcmykcolor /Helvetica findfont 30 scalefont setfont 40 -5 moveto (I) show
             gsave 100 0 translate 10 10 scale 1 1 8 [1 0 0 1 0 0] { <000000ff> } false 4 colorimage grestore",
        );
        let row = &pixels[5 * 240..6 * 240];
        let [drawing, text] = [ObjectType::DRAWING, ObjectType::TEXT];
        assert_eq!([row[5], row[15]], [[drawing, 0, 255, 255], [drawing, 255, 255, 0]]);
        assert_eq!([row[25], row[35]], [[drawing, 255, 0, 0], [drawing, 0, 0, 0]]);
        assert!(row[40..60].contains(&[text, 231, 231, 231]), "{:?}", &row[40..60]);
        assert_eq!(row[105][0], ObjectType::PICTURE);
        assert!(row[105][1..].iter().all(|&level| level > 20), "{:?}", row[105]);
        // Of these alone nothing tells the order.
        let dark = drawn("0 setgray 0 0 240 10 rectfill");
        assert_eq!(dark, vec![[drawing, 0, 0, 0]; 2400]);
    }
}
