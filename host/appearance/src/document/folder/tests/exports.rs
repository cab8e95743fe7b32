//! Materials as programs and sites export them: one panel of brass, chalk and lacquer in every encoding.

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgba};

use super::{Folder, close, grey, noted, srgb};
use crate::document::{Content, Options, open};
use crate::materials::{Materials, Surface};
use observe::Silent;

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
    // A step without its high frequencies rises 1/pi times the integral of sin x / x from 0 to pi, less a half, above its top: 8.95 %
    // of it. A limit a fifth lower would refuse that, and one a fifth higher would take what no resizing makes.
    let steps = 10_000;
    let sine_integral: f64 = (0..steps)
        .map(|i| (f64::from(i) + 0.5) * std::f64::consts::PI / f64::from(steps))
        .map(|x| x.sin() / x * std::f64::consts::PI / f64::from(steps))
        .sum();
    let gibbs = (sine_integral / std::f64::consts::PI - 0.5) as f32;
    assert!((0.089..0.09).contains(&gibbs) && gibbs > 0.8 * 0.1, "{gibbs}");
    for value in [1.0 + gibbs, -gibbs] {
        noted(&folder(value).surfaces().1, "x_rough.exr: values outside 0 to 1 are clamped");
    }
    for value in [89.0, 1.2, -0.2, 1.119, -0.119] {
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
            (width / 2, [0.9, 0.9, 0.88], 0.9, 0.0),
            (width * 4 / 5, [0.05, 0.15, 0.45], 0.2, 0.0),
        ] {
            let expected = crate::materials::metallic(base, [0.04; 3], roughness, metal);
            close(surfaces.surface(middle + at), expected, 0.01);
        }
    }
}
