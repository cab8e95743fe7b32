//! How Ghostscript converts the CMYK of text and drawings: as inks, so that K is black and C is cyan.
//!
//! Problem: its usual profile makes a brown black of K and a fifth of half a cyan. It can be told to convert without a
//! profile, but since 10.04 its device with tags then writes cyan, magenta and yellow for red, green and blue.
//! Method: an ICC profile that leads straight from CMYK to the colours of the device (a device link): red is
//! `1 - min(1, C + K)`, and so on. With K counted from the other end that is `max(0, K' - C)`, whose kink lies on the
//! diagonals of the table's cells, along which programs interpolate. Pictures keep the usual conversion.
//! Cost: half a megabyte in a temporary file; 0.04 s of a document in CMYK. Limits: where an ink and K are just about full
//! together, colours differ by up to 6 of 255. Source: ICC.1:2010, 8.5 and 10.10; Ghostscript's documentation of `SourceObjectICC`.

use std::fs;
use std::io;
use std::path::Path;

use moxcms::{
    ColorProfile, DataColorSpace, LutDataType, LutStore, LutType, LutWarehouse, Matrix3d, ProfileClass,
};

/// Nodes of the table on each axis, at whole steps of 16 bits.
const NODES: u16 = 16;
/// Their distance.
const STEP: u16 = u16::MAX / (NODES - 1);

/// Ghostscript's option. Its process must run in the folder that has the files.
pub const OPTION: &str = "-sSourceObjectICC=conversions";

/// Which objects have which profile; then intent, black point, override of embedded profiles, and kept K. The names have no
/// folder, because Ghostscript ends a name at a space.
const OBJECTS: &str = "Graphic_CMYK inks.icc 0 1 0 0\nText_CMYK inks.icc 0 1 0 0\n";

/// Writes the files of [`OPTION`] into a folder.
///
/// # Errors
/// Those of writing.
pub fn write(folder: &Path) -> io::Result<()> {
    let profile = link().encode().map_err(io::Error::other)?;
    fs::write(folder.join("inks.icc"), profile)?;
    fs::write(folder.join("conversions"), OBJECTS)
}

/// The device link from CMYK to the colours of the device.
fn link() -> ColorProfile {
    let (rising, falling) = ([0, u16::MAX], [u16::MAX, 0]);
    let mut table = Vec::with_capacity(3 * usize::from(NODES).pow(4));
    for c in 0..NODES {
        for m in 0..NODES {
            for y in 0..NODES {
                for rest in 0..NODES {
                    table.extend([c, m, y].map(|ink| rest.saturating_sub(ink) * STEP));
                }
            }
        }
    }
    let lut = LutDataType {
        num_input_channels: 4,
        num_output_channels: 3,
        num_clut_grid_points: NODES as u8,
        matrix: Matrix3d::IDENTITY,
        num_input_table_entries: 2,
        num_output_table_entries: 2,
        input_table: LutStore::Store16([rising, rising, rising, falling].concat()),
        clut_table: LutStore::Store16(table),
        output_table: LutStore::Store16([rising; 3].concat()),
        lut_type: LutType::Lut16,
    };
    let mut profile = ColorProfile::default();
    profile.profile_class = ProfileClass::DeviceLink;
    profile.color_space = DataColorSpace::Cmyk;
    profile.pcs = DataColorSpace::Rgb;
    profile.lut_a_to_b_perceptual = Some(LutWarehouse::Lut(lut));
    profile
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use proptest::prelude::*;
    use testing::needs::ghostscript;

    use super::super::super::kinds::{self, Kind};
    use super::super::{Interpreter, command, order};
    use super::*;
    use crate::process::{Process, limit};
    use crate::scratch::Scratch;

    /// The pixels of a PostScript page of 240 x 10 points, at a pixel a point.
    fn drawn(marks: &str) -> Vec<[u8; kinds::BYTES]> {
        let folder = Scratch::new().unwrap();
        write(folder.path()).unwrap();
        let (page, picture) = (folder.path().join("page.ps"), folder.path().join("page.pam"));
        fs::write(&page, format!("%!PS\n<</PageSize [240 10]>> setpagedevice\n{marks}\nshowpage\n")).unwrap();
        let device = format!("-sDEVICE={}", kinds::DEVICE);
        let output = format!("-sOutputFile={}", picture.display());
        let options = [OPTION, "-r72", &device, &output];
        let mut command = command(&page, Interpreter::Usual, folder.path(), options);
        let said = Process::start(&mut command, limit()).unwrap().end(|| false).unwrap();
        let picture = fs::read(picture).unwrap();
        let mut input = &picture[..];
        assert_eq!(kinds::header(&mut input).unwrap(), Some((240, 10)), "{said}");
        let mut pixels = vec![[0; kinds::BYTES]; 2400];
        pixels.as_flattened_mut().copy_from_slice(input);
        order(input).unwrap().turn(pixels.as_flattened_mut());
        pixels
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

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
                    cmyk[near] = (1.0 - cmyk[3] + beyond).clamp(0.0, 1.0);
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
                prop_assert_eq!(Kind::of(tag), Kind::Drawing);
                for (found, ink) in rgb.into_iter().zip([c, m, y]) {
                    let wanted = 255.0 * (1.0 - ink - k).max(0.0);
                    prop_assert!((f64::from(found) - wanted).abs() < 6.4, "{found} for {ink} with {k} of K");
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
        let [drawing, text] = [Kind::DRAWING, Kind::TEXT];
        assert_eq!([row[5], row[15]], [[drawing, 0, 255, 255], [drawing, 255, 255, 0]]);
        assert_eq!([row[25], row[35]], [[drawing, 255, 0, 0], [drawing, 0, 0, 0]]);
        assert!(row[40..60].contains(&[text, 204, 204, 204]), "{:?}", &row[40..60]);
        assert_eq!(row[105][0], Kind::PICTURE);
        assert!(row[105][1..].iter().all(|&level| level > 20), "{:?}", row[105]);
        // Of these alone nothing tells the order.
        let dark = drawn("0 setgray 0 0 240 10 rectfill");
        assert_eq!(dark, vec![[drawing, 0, 0, 0]; 2400]);
    }
}
