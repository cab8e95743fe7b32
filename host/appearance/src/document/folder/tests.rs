//! Folders as users have them: every encoding of the same numbers, and every mistake with its message.

use std::path::Path;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};

use crate::document::{ColourSpace, Content, Document, DocumentError, Options, open};
use crate::materials::{Materials, Surface, Surfaces};
use observe::Silent;

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

/// Left brass, in the middle white chalk, right blue lacquer: what the exports below must all be.
fn panel(x: u32) -> ([u8; 3], u8, u8) {
    match x {
        0 => ([238, 210, 149], 89, 255),
        1 => ([243, 243, 243], 230, 0),
        _ => ([63, 108, 180], 51, 0),
    }
}

fn expected_panel(x: u32) -> Surface {
    let (colour, roughness, metal) = panel(x);
    let base = colour.map(|v| srgb(f32::from(v) / 255.0));
    crate::materials::metallic(base, [0.04; 3], f32::from(roughness) / 255.0, f32::from(metal) / 255.0)
}

fn is_the_panel(folder: &Folder, what: &str) {
    let (surfaces, _) = folder.surfaces();
    for x in 0..3 {
        let (found, expected) = (surfaces.surface(x as usize), expected_panel(x));
        for c in 0..3 {
            assert!(
                (found.diffuse[c] - expected.diffuse[c]).abs() < 0.01,
                "{what} {x}: {found:?} {expected:?}"
            );
            assert!((found.f0[c] - expected.f0[c]).abs() < 0.01, "{what} {x}: {found:?} {expected:?}");
        }
        assert!((found.alpha - expected.alpha).abs() < 0.02, "{what} {x}: {found:?} {expected:?}");
    }
}

fn colours() -> ImageBuffer<Rgb<u8>, Vec<u8>> {
    ImageBuffer::from_fn(3, 2, |x, _| Rgb(panel(x).0))
}

fn roughness() -> ImageBuffer<Luma<u8>, Vec<u8>> {
    ImageBuffer::from_fn(3, 2, |x, _| Luma([panel(x).1]))
}

fn metal() -> ImageBuffer<Luma<u8>, Vec<u8>> {
    ImageBuffer::from_fn(3, 2, |x, _| Luma([panel(x).2]))
}

#[test]
fn exports_of_each_program_are_the_same_material() {
    let fab = Folder::new()
        .png("T_tdbkabgs_2K_B.png", colours())
        .png("T_tdbkabgs_2K_ORM.png", ImageBuffer::from_fn(3, 2, |x, _| Rgb([255, panel(x).1, panel(x).2])));
    is_the_panel(&fab, "Fab");
    let smooth = |x: u32| Rgba([panel(x).2, panel(x).2, panel(x).2, 255 - panel(x).1]);
    for name in ["Thing_MetallicSmoothness.png", "Thing_MaskMap.png"] {
        let unity = Folder::new()
            .png("Thing_AlbedoTransparency.png", colours())
            .png(name, ImageBuffer::from_fn(3, 2, |x, _| smooth(x)));
        is_the_panel(&unity, name);
        noted(&unity.surfaces().1, "alpha is read as smoothness");
    }
    let opaque = Folder::new().png("T_Albedo.png", colours()).png("T_MetallicSmoothness.png", metal());
    assert!(opaque.error().contains("expected smoothness in the alpha channel"), "{}", opaque.error());
    for format in [ImageFormat::Tga, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Tiff] {
        let ending = format.extensions_str()[0];
        let folder = Folder::new()
            .save(&format!("w_BaseColor.{ending}"), colours(), format)
            .save(&format!("w_Roughness.{ending}"), DynamicImage::from(roughness()).to_rgb8(), format)
            .save(&format!("w_Metallic.{ending}"), DynamicImage::from(metal()).to_rgb8(), format);
        is_the_panel(&folder, ending);
    }
    let specular = Folder::new()
        .png("w_diffuse.png", grey(2, 2, 128))
        .png("w_SpecularSmoothness.png", ImageBuffer::from_pixel(2, 2, Rgba([90u8, 60, 60, 204])));
    let f0 = [90.0, 60.0, 60.0].map(|v: f32| srgb(v / 255.0));
    let gloss: f32 = 1.0 - 204.0 / 255.0;
    let diffuse = [srgb(128.0 / 255.0) * (1.0 - f0[0]); 3];
    close(specular.surfaces().0.surface(0), Surface { diffuse, f0, alpha: gloss * gloss }, 1e-4);
}

/// Names of other layers of the material are no roles of this one.
#[test]
fn maps_of_other_layers_leave_the_base_alone() {
    let mut folder = Folder::new()
        .png("x_basecolor.png", colours())
        .png("x_roughness.png", roughness())
        .png("x_metallic.png", metal());
    for name in
        ["sheen", "sheen_color", "coat", "clearcoat", "clearcoat_roughness", "mask", "sss", "transmission"]
    {
        folder = folder.png(&format!("x_{name}.png"), grey(3, 2, 200));
    }
    is_the_panel(&folder, "layers");
    let (_, notes) = folder.surfaces();
    noted(&notes, "not printed: x_sheen.png, x_sheen_color.png, x_sss.png, x_transmission.png");
    noted(&notes, "x_clearcoat.png and x_coat.png could each be the clear coat map, so no coat is printed");
}

#[test]
fn a_coat_map_dims_what_lies_below() {
    let folder = || {
        Folder::new()
            .png("x_basecolor.png", colours())
            .png("x_roughness.png", roughness())
            .png("x_metallic.png", metal())
    };
    let coat = ImageBuffer::from_fn(3, 2, |x, _| Luma([if x == 0 { 0u8 } else { 255 }]));
    let coated = folder().png("x_clearcoat.png", coat);
    let (plain, (surfaces, notes)) = (folder().surfaces().0, coated.surfaces());
    close(surfaces.surface(0), plain.surface(0), 1e-5);
    let expected = plain.surface(1);
    let dimmed = |v: f32| v * 0.96 * 0.96;
    let expected = Surface { diffuse: expected.diffuse.map(dimmed), f0: expected.f0.map(dimmed), ..expected };
    close(surfaces.surface(1), expected, 1e-4);
    noted(&notes, "the coat is smooth");
    let uniform = folder().text("material.toml", "coat = 1\ncoat_roughness = 0.5");
    close(uniform.surfaces().0.surface(1), expected, 1e-4);
}

#[test]
fn a_map_that_cannot_be_read_stops_the_run_and_one_that_is_not_needed_does_not() {
    let folder = || Folder::new().png("x_basecolor.png", colours()).png("x_roughness.png", roughness());
    let error = folder().text("x_metallic.dds", "DDS ").error();
    assert!(
        error.contains("x_metallic.dds is the metallic map by its name, but its format is not read"),
        "{error}"
    );
    let spare =
        folder().png("x_metallic.png", metal()).text("x_metallic.psd", "8BPS").text("x_height.dds", "DDS ");
    noted(&spare.surfaces().1, "not read: x_height.dds, x_metallic.psd");
    let damaged = folder().text("x_metallic.tga", "no picture at all");
    assert!(damaged.error().contains("x_metallic.tga"), "{}", damaged.error());
}

/// Roughness of 0 to 255 in floating point, and the small overshoot of a resized map.
#[test]
fn numbers_of_another_unit_are_errors() {
    let folder = |value: f32| {
        let map: ImageBuffer<Rgb<f32>, _> =
            ImageBuffer::from_fn(3, 2, |x, _| Rgb([if x == 1 { value } else { 0.5 }; 3]));
        Folder::new().png("x_basecolor.png", colours()).png("x_metallic.png", metal()).save(
            "x_rough.exr",
            map,
            ImageFormat::OpenExr,
        )
    };
    for value in [89.0, 1.2, -0.2] {
        let error = folder(value).error();
        assert!(error.contains("x_rough.exr") && error.contains("pixel (1, 0)"), "{error}");
    }
    let (surfaces, notes) = folder(1.05).surfaces();
    noted(&notes, "x_rough.exr: values outside 0 to 1 are clamped; the farthest is 1.05");
    assert!((surfaces.surface(1).alpha - 1.0).abs() < 1e-4);
}

/// What a file says of its own colours: the power of a PNG, the primaries of an EXR, the way a photograph lies.
#[test]
fn what_a_file_states_of_its_colours_holds() {
    let rest =
        || Folder::new().png("x_roughness.png", grey(2, 2, 255)).png("x_metallic.png", grey(2, 2, 255));
    let folder = rest();
    for (power, expected) in [(1.0f32, 128.0 / 255.0), (0.5, (128.0f32 / 255.0).powi(2))] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_source_gamma(png::ScaledFloat::new(power));
        encoder.write_header().unwrap().write_image_data(&[128; 4]).unwrap();
        std::fs::write(folder.path().join("x_basecolor.png"), bytes).unwrap();
        let (surfaces, notes) = folder.surfaces();
        assert!((surfaces.surface(0).f0[0] - expected).abs() < 1e-4, "{power}: {:?}", surfaces.surface(0));
        noted(&notes, &format!("colours are read by the gamma that the file states ({power})"));
    }
    let folder = rest();
    let path = folder.path().join("x_basecolor.exr");
    use exr::prelude::*;
    let mut image =
        exr::prelude::Image::from_channels((2, 2), SpecificChannels::rgb(|_| (0.5f32, 0.25f32, 0.125f32)));
    let chromaticities = exr::meta::attribute::Chromaticities {
        red: Vec2(0.713, 0.293),
        green: Vec2(0.165, 0.830),
        blue: Vec2(0.128, 0.044),
        white: Vec2(0.32168, 0.33767),
    };
    image.attributes.chromaticities = Some(chromaticities);
    image.write().to_file(path).unwrap();
    let (surfaces, notes) = folder.surfaces();
    // By the published matrix from ACEScg.
    let expected = [
        1.70505 * 0.5 - 0.62179 * 0.25 - 0.08326 * 0.125,
        -0.13026 * 0.5 + 1.14080 * 0.25 - 0.01055 * 0.125,
        -0.02400 * 0.5 - 0.12897 * 0.25 + 1.15297 * 0.125,
    ];
    for c in 0..3 {
        assert!(
            (surfaces.surface(3).f0[c] - expected[c]).abs() < 1e-3,
            "{:?} {expected:?}",
            surfaces.surface(3)
        );
    }
    noted(&notes, "colours are converted from the primaries");
}

/// A segment of EXIF with one tag, before the rest of a JPEG.
#[test]
fn a_turned_photograph_is_noted() {
    let folder = Folder::new().png("x_roughness.png", grey(2, 2, 255)).png("x_metallic.png", grey(2, 2, 255));
    let mut jpeg = std::io::Cursor::new(Vec::new());
    grey(2, 2, 128).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    for (orientation, turned) in [(1u8, false), (6, true)] {
        let mut exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
        exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
        let mut bytes = jpeg[..2].to_vec();
        bytes.extend([0xff, 0xe1, 0, exif.len() as u8 + 2]);
        bytes.extend(exif);
        bytes.extend(&jpeg[2..]);
        std::fs::write(folder.path().join("x_basecolor.jpg"), bytes).unwrap();
        let notes = folder.surfaces().1.join("\n");
        assert_eq!(notes.contains("turned before it is shown"), turned, "{notes}");
    }
}

/// The exports that were read wrongly once, as they were found; they lie beside the repository.
#[test]
fn the_found_exports_are_the_panel() {
    let Some(data) = testing::needs::data() else { return };
    let cases = data.join("../cases/materials");
    if !cases.is_dir() {
        return;
    }
    for name in [
        "exr_layers",
        "fab_ue",
        "painter_unity",
        "tiff_float",
        "tiff_float_classic",
        "tiff_half",
        "clearcoat_maps",
    ] {
        let document = open(cases.join(name).to_str().unwrap(), &Options::default(), &Silent).unwrap();
        let Content::Surfaces(surfaces) = &document.content else { panic!("{name}") };
        let (width, middle) = (surfaces.width(), surfaces.width() * (surfaces.height() / 2));
        for (at, base, roughness, metal) in [
            (width / 5, [0.85, 0.65, 0.3], 0.35, 1.0),
            (width / 2, [0.9; 3], 0.9, 0.0),
            (width * 4 / 5, [0.05, 0.15, 0.45], 0.2, 0.0),
        ] {
            let expected = crate::materials::metallic(base, [0.04; 3], roughness, metal);
            close(surfaces.surface(middle + at), expected, 0.01);
        }
    }
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
