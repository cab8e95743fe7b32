//! The stage as a whole, on synthetic documents with known results and on real textures.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::brdf::Space;
use crate::materials::Materials;
use crate::weights::ONE;
use observe::{Observer, Silent};

/// Documents given as rows.
struct Rows {
    width: usize,
    space: Space,
    rows: Vec<Vec<f32>>,
}

impl Materials for Rows {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.rows.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.rows[pixel]);
    }
}

/// Metallic-roughness textures, every `step`-th pixel.
struct Textures {
    width: usize,
    space: Space,
    pixels: Vec<([f32; 3], f32, f32)>,
}

impl Textures {
    fn open(name: &str, step: u32) -> Option<Textures> {
        let folder = testing::needs::data()?.join("svbrdf").join(name);
        let load = |file: &str| image::open(folder.join(file)).ok().map(|image| image.to_rgb8());
        let separate = load("albedo.jpg").zip(load("roughness.jpg")).zip(load("metallic.jpg"));
        let packed = load("base_color.png").zip(load("occlusion_roughness_metallic.png"));
        let (base, roughness, metallic, channels) = match (separate, packed) {
            (Some(((base, roughness), metallic)), _) => (base, roughness, metallic, [0, 0]),
            (_, Some((base, packed))) => (base, packed.clone(), packed, [1, 2]),
            _ => panic!("no textures in {}", folder.display()),
        };
        let linear = |v: u8| {
            let v = f32::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let (width, height) = (base.width() / step, base.height() / step);
        let pixels = (0..width * height).map(|i| {
            let (x, y) = (i % width * step, i / width * step);
            let rough = f32::from(roughness.get_pixel(x, y)[channels[0]]) / 255.0;
            let metal = f32::from(metallic.get_pixel(x, y)[channels[1]]) / 255.0;
            (base.get_pixel(x, y).0.map(linear), (rough * rough).max(0.02), metal)
        });
        Some(Textures { width: width as usize, space: Space::half_angle(32), pixels: pixels.collect() })
    }
}

impl Materials for Textures {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.pixels.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let (base, alpha, metal) = self.pixels[pixel];
        for (out, &theta) in out.chunks_exact_mut(3).zip(self.space.angles()) {
            let lobe = inks::ggx::lobe(theta, f64::from(alpha)) as f32;
            for (out, base) in out.iter_mut().zip(base) {
                let f0 = 0.04 + (base - 0.04) * metal;
                *out = base * (1.0 - metal) * 0.96 / std::f32::consts::PI + f0 * lobe;
            }
        }
    }
}

const METHODS: [Method; 3] = [Method::Archetypes, Method::Kmeans, Method::Sacls];

fn lambert(theta: &[f64], diffuse: [f64; 3], f0: [f64; 3], alpha: f64) -> Vec<f64> {
    let value = |t: f64, c: usize| diffuse[c] / std::f64::consts::PI + f0[c] * inks::ggx::lobe(t, alpha);
    theta.iter().flat_map(|&t| (0..3).map(move |c| value(t, c))).collect()
}

/// Four materials far apart: white matte, red gloss, gold, dark plastic.
fn four(space: &Space) -> Vec<Vec<f64>> {
    let t = space.angles();
    vec![
        lambert(t, [0.8, 0.8, 0.75], [0.02; 3], 0.9),
        lambert(t, [0.5, 0.03, 0.02], [0.04; 3], 0.2),
        lambert(t, [0.01; 3], [0.9, 0.7, 0.25], 0.25),
        lambert(t, [0.02, 0.02, 0.04], [0.04; 3], 0.4),
    ]
}

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move || random.random::<f64>()
}

/// A document of random mixtures of known bases; many pixels nearly pure. Also the mixing weights.
fn mixtures(bases: &[Vec<f64>], space: &Space, pixels: usize, seed: u64) -> (Rows, Vec<Vec<f64>>) {
    let mut uniform = random(seed);
    let weights: Vec<Vec<f64>> = (0..pixels)
        .map(|_| {
            let raw: Vec<f64> = bases.iter().map(|_| uniform().powi(6) + 1e-4).collect();
            let sum: f64 = raw.iter().sum();
            raw.iter().map(|r| r / sum).collect()
        })
        .collect();
    let row = |a: &Vec<f64>| {
        (0..space.columns()).map(|j| bases.iter().zip(a).map(|(b, a)| b[j] * a).sum::<f64>() as f32).collect()
    };
    let rows = weights.iter().map(row).collect();
    (Rows { width: pixels, space: space.clone(), rows }, weights)
}

/// Mixtures of four materials with 5 % noise.
pub(super) fn noisy_mixtures(pixels: usize) -> impl Materials {
    let space = Space::half_angle(12);
    let (mut document, _) = mixtures(&four(&space), &space, pixels, 12);
    let mut uniform = random(13);
    document.rows.iter_mut().flatten().for_each(|v| *v *= 0.95 + 0.1 * uniform() as f32);
    document
}

fn run(document: &dyn Materials, method: Method, bases: impl Into<Option<usize>>) -> Factoring {
    let settings = FactorSettings { method, bases: bases.into(), ..FactorSettings::default() };
    factor(document, &settings, &Silent).expect("the document is sound")
}

/// The distance of each pixel from its mixture, by the definition.
fn distances(document: &Rows, factored: &Factored) -> Vec<f64> {
    let row = |pixel: usize| -> Vec<f64> {
        let a = factored.maps.at(pixel).iter().map(|&w| f64::from(w) / f64::from(ONE));
        let mut sum = vec![0.0; document.space.columns()];
        for (a, basis) in a.zip(factored.bases.rows()) {
            sum.iter_mut().zip(basis).for_each(|(s, b)| *s += a * b);
        }
        sum
    };
    let double = |row: &[f32]| row.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
    let all = document.rows.iter().enumerate();
    all.map(|(pixel, f)| document.space.distance(&double(f), &row(pixel))).collect()
}

/// For each true basis the found one it is matched with; panics when two share one.
fn matched(truth: &[Vec<f64>], factored: &Factored, within: f64) -> Vec<usize> {
    let mut taken = Vec::new();
    for (i, basis) in truth.iter().enumerate() {
        let distance = |l: usize| factored.space.distance(basis, factored.bases.row(l));
        let best = (0..factored.bases.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap();
        assert!(distance(best) < within, "basis {i} is found only to {}", distance(best));
        assert!(!taken.contains(&best), "two bases are found as one");
        taken.push(best);
    }
    taken
}

#[test]
fn known_bases_are_found_with_their_weights() {
    let space = Space::half_angle(16);
    let truth = four(&space);
    let (document, weights) = mixtures(&truth, &space, 1500, 1);
    // Sparsity has its price, and the linear fit is not the metric's.
    for (method, ceiling) in [(Method::Archetypes, 0.003), (Method::Sacls, 0.008)] {
        let found = run(&document, method, 4);
        assert!(found.report.rmse < ceiling, "{method:?}: {:?}", found.report);
        let order = matched(&truth, &found.factored, 0.03);
        let mut worst = 0.0f64;
        for (pixel, a) in weights.iter().enumerate() {
            for (i, &l) in order.iter().enumerate() {
                let got = f64::from(found.factored.maps.at(pixel)[l]) / f64::from(ONE);
                worst = worst.max((got - a[i]).abs());
            }
        }
        assert!(worst < 0.1, "{method:?}: a weight is off by {worst}");
    }
}

#[test]
fn noise_and_outliers_do_not_carry_the_bases_away() {
    let space = Space::half_angle(16);
    let truth = four(&space);
    let (mut document, _) = mixtures(&truth, &space, 2000, 2);
    let mut uniform = random(3);
    for (i, row) in document.rows.iter_mut().enumerate() {
        // One pixel in five hundred is no material of the document at all.
        let factor = if i % 500 == 7 { 0.2 + 6.0 * uniform() as f32 } else { 1.0 };
        row.iter_mut().for_each(|v| *v *= factor * (0.95 + 0.1 * uniform() as f32));
    }
    let found = run(&document, Method::Archetypes, 4);
    matched(&truth, &found.factored, 0.06);
    // Noise of 5 % peak, uniform: the metric sees about a third of its root mean square 0.029 of |g| = 0.6.
    assert!(found.report.rmse < 0.02, "{:?}", found.report);
}

#[test]
fn reported_errors_are_those_of_the_definition() {
    let space = Space::half_angle(16);
    let (document, _) = mixtures(&four(&space), &space, 700, 4);
    for method in METHODS {
        let Factoring { factored, report } = run(&document, method, 3);
        let mut direct = distances(&document, &factored);
        direct.sort_by(f64::total_cmp);
        let rmse = (direct.iter().map(|d| d * d).sum::<f64>() / direct.len() as f64).sqrt();
        let uncovered = direct.iter().filter(|&&d| d > 0.01).count() as f64 / direct.len() as f64;
        assert!((report.rmse - rmse).abs() < 1e-5, "{method:?}: {} {rmse}", report.rmse);
        assert!((report.max - direct[direct.len() - 1]).abs() < 1e-5);
        assert!((report.p95 - direct[direct.len() * 95 / 100 - 1]).abs() < 1e-5);
        assert!((report.uncovered - uncovered).abs() < 2.0 / direct.len() as f64);
    }
}

#[test]
fn results_are_equal_bit_for_bit_for_any_number_of_threads() {
    let space = Space::half_angle(6);
    let (document, _) = mixtures(&four(&space), &space, 4500, 5);
    for (method, bases) in [(Method::Archetypes, None), (Method::Kmeans, Some(3)), (Method::Sacls, Some(3))] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&document, method, bases)).factored
        };
        let one = with(1);
        assert!(one == with(2) && one == with(3), "{method:?}");
    }
}

#[test]
fn another_seed_is_another_factoring_and_the_same_seed_the_same() {
    let space = Space::half_angle(12);
    let (document, _) = mixtures(&four(&space), &space, 3000, 6);
    let with = |seed| {
        let settings = FactorSettings { seed, bases: Some(3), ..FactorSettings::default() };
        factor(&document, &settings, &Silent).unwrap().factored
    };
    assert_eq!(with(1), with(1));
    assert_ne!(with(1).bases, with(2).bases);
}

#[test]
fn documents_of_few_materials_are_their_own_bases() {
    let space = Space::half_angle(16);
    let truth = four(&space);
    for count in 1..=4 {
        let rows: Vec<Vec<f32>> =
            (0..60).map(|i| truth[i % count].iter().map(|&v| v as f32).collect()).collect();
        let document = Rows { width: 10, space: space.clone(), rows };
        for method in METHODS {
            for asked in [Some(8), Some(count), None] {
                let found = run(&document, method, asked);
                assert!(found.report.bases <= count, "{method:?} {asked:?}: {:?}", found.report);
                assert!(found.report.rmse < 0.015, "{method:?} {asked:?}: {:?}", found.report);
                if asked.is_some() {
                    assert_eq!(found.report.bases, count);
                    matched(&truth[..count], &found.factored, 1e-6);
                    assert!(found.report.max < 1e-4);
                }
            }
        }
    }
}

#[test]
fn one_pixel_is_one_basis_with_full_weight() {
    let space = Space::half_angle(16);
    let row: Vec<f32> = four(&space)[2].iter().map(|&v| v as f32).collect();
    let document = Rows { width: 1, space, rows: vec![row.clone()] };
    for bases in [None, Some(1), Some(5)] {
        let found = run(&document, Method::Archetypes, bases);
        assert_eq!(found.factored.maps.data(), [ONE]);
        for (found, f) in found.factored.bases.row(0).iter().zip(&row) {
            assert!((found / f64::from(*f) - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_document_of_no_light_is_one_black_basis() {
    let space = Space::half_angle(8);
    let rows = vec![vec![0.0; space.columns()]; 12];
    let found = run(&Rows { width: 4, space, rows }, Method::Archetypes, None);
    assert_eq!((found.report.bases, found.report.max), (1, 0.0));
    assert!(found.factored.bases.row(0).iter().all(|&v| v == 0.0));
}

/// With one basis the columns part, and each has the closed form `(mean cbrt f)^3`.
#[test]
fn a_single_free_basis_is_the_mean_in_the_metric() {
    let space = Space::half_angle(16);
    let (document, _) = mixtures(&four(&space), &space, 800, 7);
    let settings = FactorSettings { bases: Some(1), delta: 10.0, ..FactorSettings::default() };
    let found = factor(&document, &settings, &Silent).unwrap();
    let mean: Vec<f64> = (0..space.columns())
        .map(|j| {
            let sum: f64 = document.rows.iter().map(|row| f64::from(row[j]).cbrt()).sum();
            (sum / document.rows.len() as f64).powi(3)
        })
        .collect();
    let off = space.distance(found.factored.bases.row(0), &mean);
    // Materials merged as indistinguishable stand for each other, to half of what is hard to see at most.
    assert!(off < 2e-3, "{off}");
}

#[test]
fn as_many_bases_are_chosen_as_the_document_was_made_of() {
    let space = Space::half_angle(16);
    let truth = four(&space);
    for count in [2, 3, 4] {
        let (document, _) = mixtures(&truth[..count], &space, 2000, 8);
        let found = run(&document, Method::Archetypes, None);
        assert_eq!(found.report.bases, count, "{:?}", found.report);
        assert!(found.report.rmse < 0.015);
    }
}

#[test]
fn a_small_patch_gets_a_basis_of_its_own() {
    let space = Space::half_angle(16);
    let truth = four(&space);
    let (mut document, _) = mixtures(&truth[..2], &space, 4000, 9);
    document.width = 80;
    // A gold patch of 9 x 5 pixels, one in ninety.
    for i in 0..45 {
        document.rows[20 * 80 + i / 9 * 80 + i % 9] = truth[2].iter().map(|&v| v as f32).collect();
    }
    let found = run(&document, Method::Archetypes, None);
    matched(&truth[..3], &found.factored, 0.05);
}

#[test]
fn a_stronger_penalty_gives_purer_pixels() {
    let space = Space::half_angle(16);
    let (document, _) = mixtures(&four(&space), &space, 1200, 10);
    let purity = |lambda| {
        let settings =
            FactorSettings { method: Method::Sacls, bases: Some(4), lambda, ..FactorSettings::default() };
        let maps = factor(&document, &settings, &Silent).unwrap().factored.maps;
        let dominant = maps.data().chunks_exact(4).map(|a| f64::from(*a.iter().max().unwrap()));
        dominant.sum::<f64>() / (1200.0 * f64::from(ONE))
    };
    let (plain, sparse) = (purity(0.0), purity(0.1));
    assert!(sparse > plain, "{plain} {sparse}");
}

/// A tabulation other than half-angle curves: five directions with unequal weights, one of them zero.
#[test]
fn any_linear_tabulation_goes_through() {
    let space = Space::tabulated(&[1.0, 0.9, 0.5, 0.2, 0.0], &[0.3, 0.1, 0.0, 0.2, 0.4]).unwrap();
    let truth: Vec<Vec<f64>> = (0..3)
        .map(|i| (0..15).map(|j| if j % 3 == i { 0.9 } else { 0.05 + 0.01 * j as f64 }).collect())
        .collect();
    let (document, _) = mixtures(&truth, &space, 900, 11);
    for method in METHODS {
        let found = run(&document, method, 3);
        let ceiling = if method == Method::Kmeans { 0.1 } else { 0.01 };
        assert!(found.report.rmse < ceiling, "{method:?} {:?}", found.report);
        // Also the columns without weight are reflectances of the document.
        for row in found.factored.bases.rows() {
            assert!(row[6..9].iter().all(|&v| (0.0..1.5).contains(&v)), "{row:?}");
        }
    }
}

#[test]
fn invalid_documents_are_errors() {
    let space = Space::half_angle(4);
    let mut rows = vec![vec![0.1; space.columns()]; 6];
    let document = |rows: &Vec<Vec<f32>>| Rows { width: 3, space: space.clone(), rows: rows.clone() };
    let fails = |document: &Rows, settings: FactorSettings| factor(document, &settings, &Silent).unwrap_err();
    let empty = Rows { width: 3, space: space.clone(), rows: Vec::new() };
    assert_eq!(fails(&empty, FactorSettings::default()), FactorError::Size { width: 3, height: 0 });
    for (name, settings) in [
        ("bases", FactorSettings { bases: Some(0), ..FactorSettings::default() }),
        ("bases", FactorSettings { bases: Some(33), ..FactorSettings::default() }),
        ("delta", FactorSettings { delta: f64::NAN, ..FactorSettings::default() }),
        ("lambda", FactorSettings { lambda: -1.0, ..FactorSettings::default() }),
    ] {
        let error = fails(&document(&rows), settings);
        assert!(matches!(error, FactorError::Setting { name: n, .. } if n == name), "{error}");
    }
    for value in [f32::NAN, f32::INFINITY, 2e6] {
        rows[4][5] = value;
        let error = fails(&document(&rows), FactorSettings::default());
        assert!(matches!(error, FactorError::Reflectance { x: 1, y: 1, column: 5, .. }), "{error}");
    }
}

proptest! {
    #![proptest_config(testing::cases(24))]
    #[test]
    fn any_reflectances_factor_into_a_partition_of_unity(
        values in prop::collection::vec(prop_oneof![3 => 0.0f32..2.0, 1 => Just(0.0), 1 => 0.0f32..1e5], 12 * 9),
        k in 1usize..6, method in prop::sample::select(METHODS.to_vec())
    ) {
        let space = Space::half_angle(3);
        let rows: Vec<Vec<f32>> = values.chunks_exact(9).map(<[f32]>::to_vec).collect();
        let document = Rows { width: 4, space, rows };
        let Factoring { factored, report } = run(&document, method, k);
        // That weights sum to one is what `WeightMaps` checks; all else is checked here.
        prop_assert_eq!(factored.maps.channels(), factored.bases.len());
        prop_assert!(factored.bases.rows().flatten().all(|&v| v.is_finite() && v >= 0.0));
        let worst = distances(&document, &factored).into_iter().fold(0.0, f64::max);
        prop_assert!((report.max - worst).abs() < 1e-3 * (1.0 + worst), "{} {worst}", report.max);
    }
}

/// The dove's bases of SACLS have holes where their highlights are; the leaf's are near its materials.
#[test]
fn bases_far_from_the_document_give_way_to_means_of_its_materials() {
    /// How far outside the farthest basis is said to be.
    #[derive(Default)]
    struct Farthest(std::sync::Mutex<Option<f64>>);
    impl Observer for Farthest {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn note(&self, text: &str) {
            let number = text
                .split_once("outside the document's materials by ")
                .and_then(|(_, rest)| rest.split(' ').next().and_then(|number| number.parse().ok()));
            if number.is_some() {
                *self.0.lock().unwrap() = number;
            }
        }
    }
    let said = Farthest::default();
    let sampled = |name: &str, bases| {
        let document =
            crate::document::open(&format!("sample:{name}"), &Default::default(), &Silent).unwrap();
        let settings =
            FactorSettings { method: Method::Sacls, bases: Some(bases), ..FactorSettings::default() };
        factor(document.materials(), &settings, &said).unwrap().report
    };
    let dove = sampled("dove", 3);
    assert_eq!(dove.method, Method::Kmeans);
    assert!(dove.excursion.iter().all(|&e| e < 1e-3), "{:?}", dove.excursion);
    let leaf = sampled("leaf", 3);
    assert_eq!(leaf.method, Method::Sacls, "{:?}", leaf.excursion);
    // A limit a fifth lower or higher parts the same documents.
    assert!(leaf.excursion.iter().all(|&e| e < 0.8 * factoring::NEAR), "{:?}", leaf.excursion);
    let farthest = said.0.lock().unwrap().unwrap();
    assert!(farthest > 1.2 * factoring::NEAR, "{farthest}");
}

/// The comparison behind the default method, on a real document with many materials.
#[test]
fn on_real_materials_the_methods_rank_as_documented() {
    let Some(document) = Textures::open("helmet_metal", 6) else { return };
    let [archetypes, kmeans, sacls] = METHODS.map(|method| run(&document, method, 6).report);
    let out = |report: &FactorReport| report.excursion.iter().sum::<f64>() / report.bases as f64;
    assert!(archetypes.rmse < 0.8 * kmeans.rmse, "{} {}", archetypes.rmse, kmeans.rmse);
    assert!(out(&kmeans) < 1e-3, "means of real materials are inside: {:?}", kmeans.excursion);
    assert!(archetypes.excursion.iter().all(|&e| e < 0.0501), "{:?}", archetypes.excursion);
    // Here the bases of SACLS leave the hull by far, and those of convex k-means take their place.
    assert_eq!((sacls.method, sacls.rmse), (Method::Kmeans, kmeans.rmse));
}

#[test]
fn a_tighter_hull_costs_reconstruction() {
    let Some(document) = Textures::open("rustymetal", 16) else { return };
    let rmse = |delta| {
        let settings = FactorSettings { bases: Some(4), delta, ..FactorSettings::default() };
        factor(&document, &settings, &Silent).unwrap().report.rmse
    };
    let (none, some, much) = (rmse(0.0), rmse(0.05), rmse(0.2));
    assert!(much < some && some < none, "{none} {some} {much}");
}
