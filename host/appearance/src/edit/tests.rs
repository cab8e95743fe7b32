//! What holds for edits of any document.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use files::shelf::{Disk, Shelf};
use observe::Silent;
use proptest::prelude::*;

use super::*;
use crate::brdf::{Space, Table};
use crate::document::foil;
use crate::materials::Factored;
use crate::weights::{ONE, WeightMaps, quantise};

mod every_basis;

const SIZE: (usize, usize) = (6, 5);

fn value(seed: u32, i: usize) -> f64 {
    let v = (i as u32 + 1).wrapping_mul(2_654_435_761).wrapping_add(seed).wrapping_mul(2_246_822_519);
    f64::from(v ^ (v >> 13)) / f64::from(u32::MAX)
}

/// A document of lobes on bodies with random weights, many of them 0 or 1.
fn document(bases: usize, seed: u32) -> Factored {
    let space = Space::half_angle(8);
    let mut table = Table::new(space.columns());
    for b in 0..bases {
        let v = |i: usize| value(seed, 50 * b + i);
        let lobes = inks::Lobes {
            kd: [v(0), v(1), v(2)],
            entering: v(3),
            lobes: vec![inks::Lobe { f0: [v(4), v(5), v(6)], alpha: 0.03 + 0.9 * v(7) }],
        };
        table.push(&space.row(&lobes.curve(space.angles())));
    }
    let mut data = vec![0; SIZE.0 * SIZE.1 * bases];
    for (pixel, out) in data.chunks_exact_mut(bases).enumerate() {
        let weights: Vec<f64> =
            (0..bases).map(|b| (value(seed ^ 77, pixel * 97 + b * 7) - 0.4).max(0.0).powi(3)).collect();
        quantise(&weights, out);
    }
    let maps = WeightMaps::new(SIZE.0, SIZE.1, bases, data).unwrap();
    Factored { space, bases: table, maps }
}

fn painted(seed: u32, hard: bool) -> Mask {
    let weight = |pixel| {
        let v = value(seed, pixel);
        if hard { if v > 0.5 { ONE } else { 0 } } else { (v * f64::from(ONE)) as u16 }
    };
    let values = (0..SIZE.0 * SIZE.1).map(weight).collect();
    Mask::Painted(Painted { name: "rim.png".into(), width: SIZE.0, height: SIZE.1, values })
}

fn masks() -> impl Strategy<Value = Option<Mask>> {
    prop_oneof![
        Just(None),
        (any::<u32>(), any::<bool>()).prop_map(|(seed, hard)| Some(painted(seed, hard))),
        (0usize..3).prop_map(|basis| Some(Mask::Basis(basis))),
        (0usize..3, 0.01f64..=1.0).prop_map(|(basis, weight)| Some(Mask::AtLeast(basis, weight))),
        (0..SIZE.0, 0..SIZE.1).prop_map(|(x, y)| Some(Mask::Region(x, y))),
    ]
}

/// Steps that suit a document of three bases.
fn steps() -> impl Strategy<Value = Vec<Step>> {
    let surface = (prop::option::of(0usize..3), 0.1f64..10.0, any::<[u8; 3]>(), 0.0f64..5.0).prop_map(
        |(basis, rougher, tint, albedo)| Change::Surface {
            basis,
            surface: Surface { rougher, tint: Tint(tint), albedo },
        },
    );
    let replace = (0usize..3, any::<u32>()).prop_map(|(basis, seed)| {
        let other = document(1, seed);
        Change::Replace { basis, by: Replacement { name: "other".into(), row: other.bases.row(0).to_vec() } }
    });
    let two = (0usize..3, 1usize..3).prop_map(|(a, further)| (a, (a + further) % 3));
    let swap = two.clone().prop_map(|(a, b)| Change::Swap(a, b));
    let mix = (two, 0.0f64..=1.0).prop_map(|((basis, into), share)| Change::Mix { basis, into, share });
    let step =
        (prop_oneof![surface, replace, swap, mix], masks()).prop_map(|(change, mask)| Step { change, mask });
    prop::collection::vec(step, 1..5)
}

fn folder_bytes(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap()))
        .collect();
    files.sort();
    files
}

fn written(edited: &Edited, steps: &Steps, folder: &Path) -> Vec<(String, Vec<u8>)> {
    foil::write(&edited.document, "a thing", None, None, folder).unwrap();
    steps.write(folder, &edited.document.space).unwrap();
    folder_bytes(folder)
}

proptest! {
    #![proptest_config(testing::cases(48))]

    /// Sums stay 1 (maps with other sums cannot be made), other pixels stay as they are, and every result is a reflectance.
    #[test]
    fn steps_keep_documents_whole(seed in any::<u32>(), steps in steps()) {
        let before = document(3, seed);
        let edited = apply(&before, &steps).unwrap();
        let after = &edited.document;
        prop_assert_eq!(after.bases.len(), after.maps.channels());
        prop_assert_eq!(edited.origin.len(), after.bases.len());
        prop_assert!(after.bases.rows().flatten().all(|v| v.is_finite() && *v >= 0.0));
        for weights in after.maps.data().chunks_exact(after.maps.channels()) {
            prop_assert_eq!(weights.iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
        }
        for effect in &edited.effects {
            prop_assert!(effect.share > 0.0 && effect.share <= 1.0 + 1e-9, "{:?}", effect);
            prop_assert!(effect.basis < after.bases.len() && effect.into < after.bases.len());
        }
    }

    /// The steps written beside an edited document give the same files again.
    #[test]
    fn replayed_steps_give_identical_bytes(seed in any::<u32>(), steps in steps()) {
        let before = document(3, seed);
        let home = tempfile::tempdir().unwrap();
        let edited = apply(&before, &steps).unwrap();
        let kept = Steps {
            document: "a thing".into(),
            fingerprint: Some(fingerprint(&before)),
            result: Some(fingerprint(&edited.document)),
            steps,
        };
        let first = written(&edited, &kept, &home.path().join("first.foil"));
        let path = home.path().join("first.foil").join(FILE_NAME);
        let read = Steps::read(&disk(), &path, &before.space, &Silent).unwrap();
        read.check(&path, &fingerprint(&before)).unwrap();
        let again = apply(&before, &read.steps).unwrap();
        prop_assert_eq!(&again.document, &edited.document);
        let second = written(&again, &read, &home.path().join("second.foil"));
        prop_assert_eq!(first, second);
        // What was written is what was edited.
        let document = foil::read(&Disk, &home.path().join("first.foil"), &Silent).unwrap();
        prop_assert_eq!(fingerprint(document.as_factored().unwrap()), kept.result.unwrap());
    }

    /// Factors of 1, a white tint, no share, the same material and black masks change nothing.
    #[test]
    fn identity_edits_change_nothing(seed in any::<u32>(), mask in masks(), steps in steps()) {
        let before = document(3, seed);
        let by = Replacement { name: "itself".into(), row: before.bases.row(1).to_vec() };
        let nothing = [
            Change::Surface { basis: None, surface: Surface::default() },
            Change::Mix { basis: 2, into: 0, share: 0.0 },
            Change::Replace { basis: 1, by },
        ];
        for change in nothing {
            let edited = apply(&before, &[Step { change, mask: mask.clone() }]).unwrap();
            prop_assert_eq!(&edited.document, &before);
            prop_assert!(edited.effects.is_empty());
        }
        let black = Painted { name: "black".into(), width: SIZE.0, height: SIZE.1, values: vec![0; SIZE.0 * SIZE.1] };
        for step in steps {
            let edited = apply(&before, &[Step { mask: Some(Mask::Painted(black.clone())), ..step }]).unwrap();
            prop_assert_eq!(&edited.document, &before);
        }
    }

    /// Swapping twice is no edit, wherever it is done wholly; and a swap looks as if the curves had changed places.
    #[test]
    fn swapping_twice_is_identity(seed in any::<u32>(), mask in any::<u32>(), everywhere in any::<bool>()) {
        let before = document(3, seed);
        let mask = (!everywhere).then(|| painted(mask, true));
        let swap = Step { change: Change::Swap(0, 2), mask };
        let once = apply(&before, std::slice::from_ref(&swap)).unwrap();
        if everywhere {
            for pixel in 0..SIZE.0 * SIZE.1 {
                let (old, new) = (before.maps.at(pixel), once.document.maps.at(pixel));
                prop_assert_eq!([old[0], old[1], old[2]], [new[2], new[1], new[0]]);
            }
        }
        let twice = apply(&before, &[swap.clone(), swap]).unwrap();
        prop_assert_eq!(&twice.document, &before);
    }

    /// A masked edit reflects what the mask says: so much of the edited material, the rest of the old one.
    #[test]
    fn masked_edits_are_mixtures_of_before_and_after(seed in any::<u32>(), soft in any::<u32>()) {
        use crate::materials::Materials;
        let before = document(3, seed);
        let change =
            Change::Surface { basis: Some(1), surface: Surface { rougher: 2.0, tint: Tint([200, 90, 30]), albedo: 0.8 } };
        let mask = painted(soft, false);
        let whole = apply(&before, &[Step { change: change.clone(), mask: None }]).unwrap().document;
        let masked = apply(&before, &[Step { change, mask: Some(mask.clone()) }]).unwrap().document;
        let Mask::Painted(mask) = mask else { unreachable!() };
        let columns = before.space.columns();
        let (mut a, mut b, mut found) = (vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]);
        for (pixel, &m) in mask.values.iter().enumerate() {
            before.reflectance(pixel, &mut a);
            whole.reflectance(pixel, &mut b);
            masked.reflectance(pixel, &mut found);
            let m = f32::from(m) / f32::from(ONE);
            for (j, found) in found.iter().enumerate() {
                let expected = (1.0 - m) * a[j] + m * b[j];
                // Half a unit of weight goes one way or the other, and f32 rounds.
                let most = (before.bases.row(1)[j] - whole.bases.row(1)[j]).abs() as f32;
                let rounded = 0.51 / f32::from(ONE) * most + 2e-6 * (a[j] + b[j]);
                prop_assert!((expected - found).abs() <= rounded, "{expected} {found}");
            }
        }
    }
}

#[test]
fn a_basis_is_split_only_where_some_of_it_stays() {
    let before = document(3, 9);
    let darker = Change::Surface { basis: Some(1), surface: Surface { albedo: 0.5, ..Surface::default() } };
    let all = Mask::Painted(Painted {
        name: "white".into(),
        width: SIZE.0,
        height: SIZE.1,
        values: vec![ONE; SIZE.0 * SIZE.1],
    });
    let whole = apply(&before, &[Step { change: darker.clone(), mask: Some(all) }]).unwrap();
    assert_eq!(whole.document.bases.len(), 3);
    assert_eq!(
        whole.document,
        apply(&before, &[Step { change: darker.clone(), mask: None }]).unwrap().document
    );
    let half = apply(&before, &[Step { change: darker, mask: Some(painted(4, false)) }]).unwrap();
    assert_eq!((half.document.bases.len(), &half.origin[..]), (4, &[0, 1, 2, 1][..]));
    assert_eq!((half.effects[0].basis, half.effects[0].into), (1, 3));
    assert_eq!(half.document.bases.row(1), before.bases.row(1));
}

#[test]
fn regions_are_connected_and_end_where_another_basis_weighs_more() {
    // Two columns of basis 0 with one of basis 1 between them.
    let map: Vec<u16> = (0..15).map(|pixel| if pixel % 5 == 2 { 0 } else { ONE }).collect();
    let other: Vec<u16> = map.iter().map(|w| ONE - w).collect();
    let maps = [map, other];
    let found = Mask::Region(0, 1).values((5, 3), &maps).unwrap();
    assert!(found.iter().enumerate().all(|(pixel, &w)| (w == ONE) == (pixel % 5 < 2)), "{found:?}");
    let found = Mask::AtLeast(1, 0.5).values((5, 3), &maps).unwrap();
    assert!(found.iter().enumerate().all(|(pixel, &w)| (w == ONE) == (pixel % 5 == 2)), "{found:?}");
    assert!(matches!(Mask::Region(5, 0).values((5, 3), &maps), Err(EditError::Pixel { .. })));
}

/// Each new basis needs memory; the limit is said.
#[test]
fn too_many_bases_are_refused() {
    let before = document(3, 5);
    // Each step moves the least weight there is from a few pixels.
    let faint =
        Painted { name: "faint".into(), width: SIZE.0, height: SIZE.1, values: vec![1; SIZE.0 * SIZE.1] };
    assert!((0..SIZE.0 * SIZE.1).any(|pixel| before.maps.at(pixel)[0] > ONE / 2 + 300));
    let step = |i: u32| Step {
        change: Change::Surface {
            basis: Some(0),
            surface: Surface { albedo: 0.5 + f64::from(i) * 1e-3, ..Surface::default() },
        },
        mask: Some(Mask::Painted(faint.clone())),
    };
    let steps: Vec<Step> = (0..300).map(step).collect();
    let error = observe::with_causes(&apply(&before, &steps).unwrap_err());
    assert!(error.contains("step 254") && error.contains("256 is the limit"), "{error}");
}

#[test]
fn wrong_steps_are_refused_with_the_step_and_the_reason() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(FILE_NAME);
    let before = document(3, 5);
    fs::write(home.path().join("notes.txt"), "hello").unwrap();
    image::GrayImage::new(3, 3).save(home.path().join("small.png")).unwrap();
    let colours = image::RgbImage::from_pixel(6, 5, image::Rgb([250, 10, 20]));
    colours.save(home.path().join("red.png")).unwrap();
    let mut bright = image::Rgb32FImage::new(6, 5);
    bright.put_pixel(2, 1, image::Rgb([1.5; 3]));
    image::DynamicImage::ImageRgb32F(bright).save(home.path().join("bright.exr")).unwrap();
    fs::write(home.path().join("nan.csv"), "theta_h_deg,r,g,b\n0,NaN,1,1\n").unwrap();
    let refused = |step: &str, says: &str| {
        fs::write(&path, format!("format = 1\n[[step]]\nbasis = 0\nrougher = 1.1\n[[step]]\n{step}\n"))
            .unwrap();
        let error = Steps::read(&disk(), &path, &before.space, &Silent)
            .and_then(|steps| apply(&before, &steps.steps));
        let error = observe::with_causes(&error.expect_err(step));
        assert!(error.contains(says), "{step}: {error}");
        assert!(!error.chars().any(|c| c.is_control() && c != '\n'), "{error:?}");
    };
    refused("basis = 0\nrougher = nan", "step 2: rougher = NaN: expected 0.05 to 20");
    refused("basis = 0\nglossier = inf", "step 2: glossier = inf");
    refused("basis = 0\nrougher = -1.0", "rougher = -1");
    refused("basis = 0\nalbedo = nan", "albedo = NaN");
    refused("basis = 0\nmix = 1\nshare = 1.5", "share = 1.5: expected 0 to 1");
    refused("basis = 0\nmix = 1\nshare = nan", "share = NaN");
    refused("basis = 0\nmix = 1", "mix needs share");
    refused("mix = 1\nshare = 0.5", "mix needs basis");
    refused("basis = 3\nrougher = 2", "there is no basis 3: the document has bases 0 to 2");
    refused("swap = [0, 99]", "there is no basis 99");
    refused("swap = [1, 1]", "both bases are 1");
    refused("swap = [0, -1]", "steps.toml");
    refused("basis = 1\ntint = \"brown\"", "`brown`: expected a colour");
    refused("basis = 1\ntint = \"#+1+2+3\"", "expected a colour");
    refused("basis = 1\ntint = \"#é080\"", "expected a colour");
    refused("basis = 1\nrougher = 2\nswap = [0, 1]", "a step is one of");
    refused("basis = 1\nrougher = 2\nglossier = 2", "not both");
    refused("basis = 1", "a step is one of");
    refused("basis = 1\nruogher = 2", "ruogher");
    refused(
        "basis = 1\nrougher = 2\nmask = \"small.png\"",
        "small.png has 3 x 3 pixels, and the document 6 x 5",
    );
    refused("basis = 1\nrougher = 2\nmask = \"red.png\"", "pixel (0, 0) is coloured");
    refused("basis = 1\nrougher = 2\nmask = \"bright.exr\"", "pixel (2, 1) of the mask is 1.5");
    refused("basis = 1\nrougher = 2\nmask = \"notes.txt\"", "notes.txt");
    refused("basis = 1\nrougher = 2\nmask = \"missing.png\"", "missing.png");
    refused("basis = 1\nrougher = 2\nmask = \"../rim.png\"", "must be a file in the folder of the step file");
    refused(
        "basis = 1\nrougher = 2\nmask = \"/etc/passwd\"",
        "must be a file in the folder of the step file",
    );
    refused(
        "basis = 1\nrougher = 2\nmask = \"\\u001b[2Jx.png\"",
        "must be a file in the folder of the step file",
    );
    refused("basis = 1\nrougher = 2\nmask = \"basis:7\"", "there is no basis 7");
    refused("basis = 1\nrougher = 2\nmask = \"basis:x\"", "`basis:x`: expected a grey picture");
    refused("basis = 1\nrougher = 2\nmask = \"basis:1,NaN\"", "`basis:1,NaN`: expected a grey picture");
    refused("basis = 1\nrougher = 2\nmask = \"region:6,0\"", "there is no pixel (6, 0)");
    refused("basis = 1\nreplace = \"../chrome.binary\"", "must be a file in the folder of the step file");
    refused("basis = 1\nreplace = \"nan.csv\"", "nan.csv");
    refused("basis = 1\nreplace = \"notes.txt\"", "notes.txt");
    refused("replace = \"nan.csv\"", "nan.csv");
    fs::write(&path, "format = 2\n").unwrap();
    assert!(
        Steps::read(&disk(), &path, &before.space, &Silent).unwrap_err().to_string().contains("format = 2")
    );
    fs::write(&path, "format = 1\n").unwrap();
    assert!(Steps::read(&disk(), &path, &before.space, &Silent).unwrap_err().to_string().contains("0 steps"));
}

#[test]
fn steps_of_another_document_are_refused_by_its_name() {
    let (one, other) = (document(3, 1), document(3, 2));
    let steps = Steps {
        document: "leaf\u{1b}[2J".into(),
        fingerprint: Some(fingerprint(&one)),
        result: None,
        steps: vec![Step { change: Change::Swap(0, 1), mask: None }],
    };
    let home = tempfile::tempdir().unwrap();
    steps.write(home.path(), &one.space).unwrap();
    let path = home.path().join(FILE_NAME);
    let read = Steps::read(&disk(), &path, &one.space, &Silent).unwrap();
    assert!(read.check(&path, &fingerprint(&one)).is_ok());
    let error = read.check(&path, &fingerprint(&other)).unwrap_err().to_string();
    assert!(error.contains("`leaf[2J`") && error.contains("delete the line `fingerprint`"), "{error}");
    assert!(!error.chars().any(char::is_control), "{error:?}");
}

#[test]
fn a_basis_can_become_a_basis_of_another_document_or_a_curve() {
    let home = tempfile::tempdir().unwrap();
    let (one, other) = (document(3, 1), document(2, 2));
    let at = |name: &str| home.path().join(name).to_string_lossy().into_owned();
    foil::write(&other, "other", None, None, Path::new(&at("other.foil"))).unwrap();
    let open = |name: &str| Replacement::open(&disk(), &at(name), &one.space, &Silent);
    assert_eq!(open("other.foil:1").unwrap().row, other.bases.row(1));
    for (name, says) in
        [("other.foil", "name one of them"), ("other.foil:2", "no basis 2"), ("nowhere:0", "nowhere")]
    {
        let error = observe::with_causes(&open(name).unwrap_err());
        assert!(error.contains(says), "{error}");
    }
    let curve = one.space.curve(other.bases.row(0));
    curve.to_csv(fs::File::create(at("0.csv")).unwrap()).unwrap();
    assert_eq!(open("0.csv").unwrap().row, other.bases.row(0));
    assert!(open("0.csv:0").is_err());
}

fn disk() -> Arc<dyn Shelf> {
    Arc::new(Disk)
}
