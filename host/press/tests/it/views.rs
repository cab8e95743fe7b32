//! Two pictures in one print, looked at as a camera would: the dots under one lamp, at the geometries that
//! the views name.

use std::path::Path;

use appearance::brdf::{Space, reflectances};
use appearance::document::Document;
use appearance::factor::FactorSettings;
use appearance::gamut::{GamutSettings, Printable};
use appearance::views::{self, Pictures, ViewsError};
use files::shelf::Disk;
use inks::{InkSet, Library};
use observe::Silent;
use press::layout::Layout;
use press::pipeline::document::{Halftoned, Settings, halftoned};
use press::preview::{EYE, Light, Source, contrasts, flat};
use protocol::paper::Paper;
use sheet::Area;

/// Pixels of the test's pictures across and down.
const SIDES: (usize, usize) = (24, 16);

/// What a picture shows at a pixel, 0 to 1.
type Drawing = fn(usize, usize) -> f64;

/// Bars that grow lighter to the right.
fn bars(x: usize, y: usize) -> f64 {
    if (y / 4).is_multiple_of(2) { x as f64 / (SIDES.0 - 1) as f64 } else { 0.25 }
}

/// A disc on black.
fn disc(x: usize, y: usize) -> f64 {
    f64::from(u8::from((x as f64 - 14.0).hypot(y as f64 - 7.5) < 5.5))
}

fn write(path: &Path, (width, height): (usize, usize), drawing: Drawing) {
    let pixels = (0..width * height).map(|i| drawing(i % width, i / width));
    let bytes: Vec<u8> = pixels.map(|v| (255.0 * appearance::srgb::encode(v as f32)).round() as u8).collect();
    let size = (width as u32, height as u32);
    std::fs::write(path, readers::png(&bytes, size, readers::Pixel::Grey).unwrap()).unwrap();
}

/// The document of two drawings for these inks.
fn document(a: Drawing, b: Drawing, b_sides: (usize, usize), inks: &str) -> Result<Document, ViewsError> {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.png", "b.png"].map(|name| folder.path().join(name));
    write(&paths[0], SIDES, a);
    write(&paths[1], b_sides, b);
    let [straight, highlight] = paths;
    let space = Space::half_angle(32);
    let printable = Printable::combined(&Library::builtin(), &inks.parse().unwrap(), &space);
    views::open(&Disk, &Pictures::Pair { straight, highlight }, None, &printable, &space, &Silent)
}

fn printed(document: &Document, inks: &str) -> Halftoned {
    let settings = Settings {
        factor: FactorSettings::default(),
        gamut: GamutSettings::default(),
        inks: inks.parse::<InkSet>().unwrap(),
        held_back: InkSet::EMPTY,
        halftone: halftone::Method::default(),
        size: Some("36x24mm".parse().unwrap()),
    };
    let layout = Layout::centred(Paper::Postcard);
    halftoned(document, &Library::builtin(), &settings, &layout, &Silent).unwrap()
}

/// Pearson's correlation.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let product = |a: &[f64], ma: f64, b: &[f64], mb: f64| {
        a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>()
    };
    product(a, ma, b, mb) / (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt()
}

#[test]
fn each_picture_is_seen_in_its_view_and_the_other_one_is_not() {
    for (inks, least) in [("process,finish", 0.3), ("all", 0.6)] {
        let document = document(bars, disc, SIDES, inks).unwrap();
        let halftoned = printed(&document, inks);
        let (dots, space) = (&halftoned.dots, document.materials().space());
        let stacks = reflectances(dots.stacks(), &Library::builtin(), space);
        let print = Source::Print { dots, space, stacks: &stacks, area: Area::whole(dots) };
        // A camera above, the lamp at 45 degrees and then beside the camera: half angles of 22.5 and 0
        // degrees.
        let lamps = [Light::Far([1.0, 0.0, 1.0]), Light::Far([0.0, 0.0, 1.0])];
        let photographs = flat(&print, &lamps, SIDES.0, SIDES.1, &Silent).unwrap();
        let seen: Vec<Vec<f64>> = photographs
            .iter()
            .map(|photograph| photograph.pixels.iter().map(|p| f64::from(p[1]).cbrt()).collect())
            .collect();
        let drawn = [bars as Drawing, disc].map(|drawing| {
            let values = (0..SIDES.0 * SIDES.1).map(|i| drawing(i % SIDES.0, i / SIDES.0).cbrt());
            values.collect::<Vec<f64>>()
        });
        let between = correlation(&drawn[0], &drawn[1]).abs();
        assert!(between < 0.2, "the drawings themselves resemble each other: {between}");
        for (view, seen) in seen.iter().enumerate() {
            let [own, other] = [view, 1 - view].map(|k| correlation(seen, &drawn[k]));
            assert!(own > 0.9 && other.abs() < between + 0.1, "{inks}, view {view}: {own}, {other}");
        }
        // The stated contrasts, by hand: white and black bars beside the disc, and the disc on a bar of one
        // grey.
        let (views, target) = (document.views.as_ref().unwrap(), document.as_factored().unwrap());
        let found = contrasts(target, views, &print, EYE).unwrap().unwrap();
        assert!(found.straight[0] > least && found.reflection[1] > least, "{inks}: {found}");
        assert!(found.straight[1].abs() < 0.06 && found.reflection[0].abs() < 0.06, "{inks}: {found}");
        assert_eq!(found.lost(), None);
        let mean = |view: usize, inside: &dyn Fn(usize, usize) -> bool| {
            let all = (0..SIDES.0 * SIDES.1).filter(|i| inside(i % SIDES.0, i / SIDES.0));
            let values: Vec<f64> = all.map(|i| seen[view][i].powi(3)).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        let grey =
            |x: usize, y: usize| y / 4 % 2 == 1 && !y.is_multiple_of(4) && y % 4 != 3 && (2..22).contains(&x);
        let far = |x: usize| (x as f64 - 14.0).abs() > 7.0;
        let bright = mean(1, &|x, y| grey(x, y) && (x as f64 - 14.0).hypot(y as f64 - 7.5) < 4.5);
        let dark = mean(1, &|x, y| grey(x, y) && far(x));
        let by_hand = 1.0 - (dark / bright).cbrt();
        assert!((by_hand - found.reflection[1]).abs() < 0.08, "{inks}: {by_hand}, {found}");
    }
}

#[test]
fn no_stack_and_no_pair_of_stacks_is_nearer_to_two_by_two_pixels() {
    let document = document(
        |x, _| f64::from(u8::from(x >= 12)),
        |_, y| f64::from(u8::from(y >= 8)),
        SIDES,
        "K,MS,F,SF,W",
    )
    .unwrap();
    let space = document.materials().space();
    let inks: InkSet = "K,MS,F,SF,W".parse().unwrap();
    let printable = Printable::combined(&Library::builtin(), &inks, space);
    let mapped = printed(&document, "K,MS,F,SF,W").mapped;
    // Each quarter is one material.
    let (columns, stacks) = (space.columns(), printable.stacks.len());
    for pixel in [0, 23, 24 * 15, 24 * 15 + 23] {
        let mut target = vec![0.0f32; columns];
        document.materials().reflectance(pixel, &mut target);
        let target: Vec<f64> = target.into_iter().map(f64::from).collect();
        assert_eq!((mapped.mix.maps.width(), mapped.mix.maps.height()), SIDES);
        let curves = reflectances(&mapped.mix.stacks, &Library::builtin(), space);
        let (mut shares, mut row) = (vec![0.0; curves.len()], vec![0.0; columns]);
        mapped.mix.shares(pixel, &mut shares);
        for (share, curve) in shares.iter().zip(curves.rows()) {
            row.iter_mut().zip(curve).for_each(|(sum, f)| *sum += share * f);
        }
        let chosen = space.distance(&target, &row);
        let mut best = f64::MAX;
        let mut mix = vec![0.0; columns];
        for a in 0..stacks {
            for b in a..stacks {
                for step in 0..=8 {
                    let t = f64::from(step) / 8.0;
                    let (p, q) = (printable.curves.row(a), printable.curves.row(b));
                    mix.iter_mut().zip(p.iter().zip(q)).for_each(|(m, (p, q))| *m = p + t * (q - p));
                    best = best.min(space.distance(&target, &mix));
                }
            }
        }
        assert!(chosen <= best + 1e-3, "pixel {pixel}: {chosen}, by force {best}");
    }
}

#[test]
fn what_cannot_be_printed_is_refused_with_what_to_do() {
    let said = |result: Result<Document, ViewsError>| result.unwrap_err().to_string();
    let shapes = said(document(bars, disc, (24, 24), "all"));
    assert!(
        shapes.contains("24 x 16") && shapes.contains("24 x 24") && shapes.contains("crop one"),
        "{shapes}"
    );
    let flat = said(document(bars, |_, _| 0.0, SIDES, "all"));
    assert!(flat.contains("equally light everywhere") && flat.contains("white on black"), "{flat}");
    let faint = said(document(bars, disc, SIDES, "process"));
    assert!(faint.contains("nothing would be left of b.png") && faint.contains("--inks all"), "{faint}");
}
