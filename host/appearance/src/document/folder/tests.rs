//! Folders as users have them: every encoding of the same numbers, and every mistake with its message.

use std::path::Path;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};

use crate::document::{ColourSpace, Content, Document, DocumentError, Options, open};
use crate::materials::{Materials, Surface, Surfaces};
use observe::Silent;

mod exports;
mod scenes;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Saves in the format of the content, whatever the name says.
    fn save(self, name: &str, picture: impl Into<DynamicImage>, format: ImageFormat) -> Folder {
        picture.into().save_with_format(self.path().join(name), format).unwrap();
        self
    }

    fn png(self, name: &str, picture: impl Into<DynamicImage>) -> Folder {
        self.save(name, picture, ImageFormat::Png)
    }

    fn text(self, name: &str, text: &str) -> Folder {
        std::fs::write(self.path().join(name), text).unwrap();
        self
    }

    fn open(&self) -> Result<Document, DocumentError> {
        open(self.path().to_str().unwrap(), &Options::default(), &Silent)
    }

    fn surfaces(&self) -> (Surfaces, Vec<String>) {
        let document = self.open().unwrap();
        match document.content {
            Content::Surfaces(surfaces) => (surfaces, document.notes),
            other => panic!("{other:?}"),
        }
    }

    fn error(&self) -> String {
        self.open().unwrap_err().to_string()
    }
}

fn grey(width: u32, height: u32, value: u8) -> ImageBuffer<Luma<u8>, Vec<u8>> {
    ImageBuffer::from_pixel(width, height, Luma([value]))
}

fn rgb(width: u32, height: u32, value: [u8; 3]) -> ImageBuffer<Rgb<u8>, Vec<u8>> {
    ImageBuffer::from_pixel(width, height, Rgb(value))
}

/// The transfer curve of sRGB, written out.
fn srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn close(found: Surface, expected: Surface, tolerance: f32) {
    let values = |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
    for (a, b) in values(found).into_iter().zip(values(expected)) {
        assert!((a - b).abs() <= tolerance, "found {found:?}, expected {expected:?}");
    }
}

fn noted(notes: &[String], text: &str) {
    assert!(notes.iter().any(|note| note.contains(text)), "`{text}` is not among {notes:?}");
}

#[test]
fn maps_follow_the_metallic_workflow() {
    let folder = Folder::new()
        .png("albedo.png", rgb(2, 3, [200, 100, 50]))
        .png("roughness.png", grey(2, 3, 128))
        .png("metallic.png", grey(2, 3, 51));
    let (surfaces, notes) = folder.surfaces();
    assert_eq!((surfaces.width(), surfaces.height()), (2, 3));
    let base = [200.0, 100.0, 50.0].map(|v: f32| srgb(v / 255.0));
    let expected = Surface {
        diffuse: base.map(|v| v * 0.8 * 0.96),
        f0: base.map(|v| 0.04 * 0.8 + 0.2 * v),
        alpha: (128.0f32 / 255.0).powi(2),
    };
    close(surfaces.surface(5), expected, 1e-4);
    noted(&notes, "sRGB");
}

#[test]
fn sixteen_bits_alpha_and_packed_channels_hold_the_same_numbers() {
    let plain = Folder::new()
        .png("albedo.png", rgb(2, 2, [200, 100, 50]))
        .png("roughness.png", grey(2, 2, 128))
        .png("metallic.png", grey(2, 2, 51))
        .surfaces()
        .0;
    let deep = |v: u8| u16::from(v) * 257;
    let fine = Folder::new()
        .png(
            "M_Base_Color.png",
            ImageBuffer::from_pixel(2, 2, Rgba([deep(200), deep(100), deep(50), 1000u16])),
        )
        .save(
            "M_OcclusionRoughnessMetallic.tif",
            ImageBuffer::from_pixel(2, 2, Rgb([7u16, deep(128), deep(51)])),
            ImageFormat::Tiff,
        );
    let (fine, notes) = fine.surfaces();
    close(fine.surface(3), plain.surface(3), 1e-5);
    noted(&notes, "alpha is ignored");
    let grey_alpha = Folder::new()
        .png("albedo.png", ImageBuffer::from_pixel(2, 2, LumaA([128u8, 255])))
        .png("orm.png", rgb(2, 2, [0, 128, 255]));
    let (surfaces, notes) = grey_alpha.surfaces();
    assert!((surfaces.surface(0).f0[1] - srgb(128.0 / 255.0)).abs() < 1e-5);
    assert!(!notes.iter().any(|note| note.contains("alpha is ignored")), "{notes:?}");
}

#[test]
fn floating_point_colours_are_linear_by_default() {
    let picture = ImageBuffer::from_pixel(2, 2, Rgb([0.5f32, 0.25, 0.125]));
    let folder = || Folder::new().png("roughness.png", grey(2, 2, 255)).png("metallic.png", grey(2, 2, 255));
    let f0 = |folder: &Folder| folder.surfaces().0.surface(0).f0;
    for (name, format) in [("albedo.exr", ImageFormat::OpenExr), ("albedo.hdr", ImageFormat::Hdr)] {
        let linear = folder().save(name, picture.clone(), format);
        let found = f0(&linear);
        assert!((found[0] - 0.5).abs() < 2e-3 && (found[2] - 0.125).abs() < 2e-3, "{name} {found:?}");
        noted(&linear.surfaces().1, "linear");
        let told = linear.text("material.toml", "colour_space = \"srgb\"\n");
        assert!((f0(&told)[0] - srgb(0.5)).abs() < 2e-3);
    }
    // What the user says on the command line stands above the folder's own word.
    let eight =
        folder().png("albedo.png", grey(2, 2, 128)).text("material.toml", "colour_space = \"srgb\"\n");
    let options = Options { colour_space: Some(ColourSpace::Linear), ..Options::default() };
    let document = open(eight.path().to_str().unwrap(), &options, &Silent).unwrap();
    let Content::Surfaces(surfaces) = &document.content else { panic!() };
    assert!((surfaces.surface(0).f0[0] - 128.0 / 255.0).abs() < 1e-5);
}

#[test]
fn a_single_exr_channel_is_a_map() {
    use exr::prelude::*;
    let folder = Folder::new().png("albedo.png", grey(4, 2, 128)).png("metallic.png", grey(4, 2, 0));
    let samples = FlatSamples::F32((0..8).map(|i| i as f32 / 8.0).collect());
    let channels = AnyChannels::sort(smallvec(AnyChannel::new("Y", samples)));
    Image::from_channels((4, 2), channels).write().to_file(folder.path().join("roughness.exr")).unwrap();
    let alpha = folder.surfaces().0.surface(6).alpha;
    assert!((alpha - 0.5625).abs() < 1e-4, "{alpha}");
}

fn smallvec<T>(value: T) -> exr::prelude::SmallVec<[T; 4]>
where
    [T; 4]: Sized,
{
    let mut list = exr::prelude::SmallVec::new();
    list.push(value);
    list
}

#[test]
fn specular_maps_and_gloss_are_the_other_workflow() {
    let folder = Folder::new()
        .png("wood_diffuse.png", rgb(2, 2, [128, 128, 128]))
        .png("wood_specular.png", rgb(2, 2, [90, 60, 60]))
        .png("wood_glossiness.png", grey(2, 2, 204));
    let f0 = [90.0, 60.0, 60.0].map(|v: f32| srgb(v / 255.0));
    let diffuse = [srgb(128.0 / 255.0) * (1.0 - f0[0]); 3];
    let gloss: f32 = 1.0 - 204.0 / 255.0;
    close(folder.surfaces().0.surface(0), Surface { diffuse, f0, alpha: gloss * gloss }, 1e-4);
}

#[test]
fn contents_decide_the_format_of_a_file() {
    let folder = Folder::new()
        .save("albedo.jpg", rgb(2, 2, [10, 20, 30]), ImageFormat::Png)
        .png("roughness.png", grey(2, 2, 9))
        .png("metalness.png", grey(2, 2, 0));
    noted(&folder.surfaces().1, "read as PNG, which it is despite its name");
}

#[test]
fn maps_of_other_sizes_are_resized_and_other_shapes_refused() {
    let split = ImageBuffer::from_fn(4, 4, |x, _| Luma([if x < 2 { 0u8 } else { 255 }]));
    let folder = Folder::new()
        .png("albedo.png", grey(2, 2, 128))
        .png("metal.png", grey(2, 2, 0))
        .png("rough.png", split);
    let (surfaces, notes) = folder.surfaces();
    assert!(surfaces.surface(0).alpha < 0.021 && surfaces.surface(1).alpha > 0.999);
    noted(&notes, "rough.png: resized from 4 x 4 to 2 x 2");
    let folder = folder.png("rough.png", grey(4, 2, 9));
    let error = folder.error();
    assert!(error.contains("rough.png is 4 x 2") && error.contains("2 x 2"), "{error}");
}

#[test]
fn relief_widens_the_lobe_and_gives_a_note() {
    // Slopes of 0.3 to the left and right in turn.
    let component = |s: f32| (127.5 + 127.5 * s / (1.0f32 + s * s).sqrt()).round() as u8;
    let ridges =
        ImageBuffer::from_fn(32, 32, |x, _| Rgb([component(if x % 2 == 0 { 0.3 } else { -0.3 }), 128, 250]));
    let folder = Folder::new()
        .png("albedo.png", grey(32, 32, 128))
        .png("metal.png", grey(32, 32, 0))
        .png("rough.png", grey(32, 32, 102))
        .png("normal.png", ridges);
    let (surfaces, notes) = folder.surfaces();
    let alpha = 0.16f32;
    let variance = 0.5 * 0.09 * (1.0 - 1.0 / 49.0);
    let expected = (alpha * alpha + 2.0 * variance).sqrt();
    assert!((surfaces.surface(16 * 32 + 16).alpha / expected - 1.0).abs() < 0.02);
    noted(&notes, "normal.png: paper is flat");
}

#[test]
fn pictures_that_are_no_maps_by_their_names_are_named_in_a_note() {
    let folder = Folder::new()
        .png("Metal06_col.png", rgb(2, 2, [10, 200, 60]))
        .png("Metal06_rgh.png", grey(2, 2, 128))
        .png("Metal06_met.png", grey(2, 2, 255))
        .png("Metal06_disp.png", grey(2, 2, 128))
        .png("Metal06_opacity.png", grey(2, 2, 128))
        .png("render.png", grey(2, 2, 0));
    let (surfaces, notes) = folder.surfaces();
    assert!(
        surfaces.surface(0).diffuse.iter().all(|&part| part < 1e-4),
        "a metal: {:?}",
        surfaces.surface(0)
    );
    noted(&notes, "not used: Metal06_disp.png, render.png;");
    noted(&notes, "not printed: Metal06_opacity.png;");
}

#[test]
fn a_rough_metals_roughness_is_no_packed_map() {
    let roughness = |picture: DynamicImage| {
        // One file alone does not tell where the name of the material ends.
        let folder =
            Folder::new().png("albedo.png", rgb(2, 2, [90, 90, 90])).png("old_metal_rough.png", picture);
        folder.surfaces()
    };
    let alone = (128.0f32 / 255.0).powi(2);
    for one in [grey(2, 2, 128).into(), rgb(2, 2, [128; 3]).into()] {
        let (surfaces, notes) = roughness(one);
        let found = surfaces.surface(0);
        assert!((found.alpha - alone).abs() < 1e-3 && found.diffuse[0] > 0.05, "{found:?}");
        noted(&notes, "old_metal_rough.png: read as roughness alone");
        noted(&notes, "no metallic map");
    }
    let (surfaces, notes) = roughness(rgb(2, 2, [0, 128, 255]).into());
    assert!(surfaces.surface(0).diffuse[0] < 1e-4, "{:?}", surfaces.surface(0));
    noted(&notes, "roughness is read from green, metallic from blue");
}

#[test]
fn each_mistake_has_its_message() {
    let base = || Folder::new().png("albedo.png", grey(2, 2, 128));
    let full = || base().png("roughness.png", grey(2, 2, 9)).png("metallic.png", grey(2, 2, 9));
    let orm_grey = base().png("orm.png", grey(2, 2, 9));
    let coloured = full().png("roughness.png", rgb(2, 2, [200, 10, 10]));
    let cases: [(Folder, &[&str]); 13] = [
        (
            Folder::new().png("rust.png", grey(2, 2, 9)),
            &["no base colour map", "base_color, albedo", "rust.png"],
        ),
        (base(), &["no roughness map", "albedo.png"]),
        (full().png("x_albedo.png", grey(2, 2, 9)), &["albedo.png and x_albedo.png", "material.toml"]),
        (
            full().png("gloss.png", grey(2, 2, 9)).text("material.toml", "workflo = 1"),
            &["material.toml", "workflo"],
        ),
        (full().text("material.toml", "size_mm = [10]"), &["material.toml", "size_mm"]),
        (full().text("material.toml", "size_mm = [10, nan]"), &["material.toml", "size_mm", "NaN"]),
        (full().text("material.toml", "roughness = 3"), &["material.toml", "roughness = 3"]),
        (full().text("material.toml", "[maps]\nnormal = \"../n.png\""), &["material.toml", "../n.png"]),
        (full().text("material.toml", "[maps]\nnormal = \"n.png\""), &["n.png"]),
        (full().text("roughness.png", "no picture"), &["roughness.png", "expected a PNG"]),
        (full().text("roughness.png", ""), &["roughness.png", "empty"]),
        (orm_grey, &["orm.png", "three channels", "grey"]),
        (coloured, &["roughness.png", "one roughness value", "colours"]),
    ];
    for (folder, says) in cases {
        let error = folder.error();
        for text in says {
            assert!(error.contains(text), "`{text}` is not in: {error}");
        }
    }
}

#[test]
fn values_that_are_not_finite_and_huge_sizes_are_errors() {
    let picture = ImageBuffer::from_pixel(2, 2, Rgb([0.5f32, f32::NAN, 0.1]));
    let folder = Folder::new().save("albedo.exr", picture, ImageFormat::OpenExr);
    let error = folder.error();
    assert!(error.contains("albedo.exr") && error.contains("pixel (0, 0) channel 1 is NaN"), "{error}");
    // A PNG header that asks for 100000 x 100000 pixels.
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    let header = [&100_000u32.to_be_bytes()[..], &100_000u32.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    bytes.extend(&header);
    bytes.extend(crc(&[b"IHDR", &header[..]].concat()).to_be_bytes());
    let folder = Folder::new();
    std::fs::write(folder.path().join("albedo.png"), &bytes).unwrap();
    let error = folder.error();
    assert!(error.contains("albedo.png"), "{error}");
}

/// The checksum of a PNG chunk, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[test]
fn the_real_documents_open() {
    let Some(data) = testing::needs::data() else { return };
    for (name, side) in [("rustymetal", 1024), ("helmet_metal", 512), ("helmet_leather", 512)] {
        let path = data.join("svbrdf").join(name);
        let document = open(path.to_str().unwrap(), &Options::default(), &Silent).unwrap();
        let Content::Surfaces(surfaces) = &document.content else { panic!("{name} is made of surfaces") };
        assert_eq!((surfaces.width(), surfaces.height(), &document.name[..]), (side, side, name));
        noted(&document.notes, "paper is flat");
        let metal = (0..side * side).filter(|&i| surfaces.surface(i).f0[1] > 0.2).count();
        let rough = (0..side * side).filter(|&i| surfaces.surface(i).alpha > 0.3).count();
        // All three hold bright metal as well as dull surfaces.
        assert!(metal > 0 && rough > 0, "{name}: {metal} {rough}");
    }
}
