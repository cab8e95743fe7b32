//! The claims of section 4.1, figure 5's ladder, the limits, and the intents against each other.

mod dark;
mod needed;
mod shine;

use inks::{Curve, InkSet, Library, Stack};
use proptest::prelude::*;
use protocol::ink::Ink;

use super::*;
use crate::brdf::{Space, Table};
use crate::materials::{Factored, Materials, Surface};
use crate::weights::{ONE, WeightMaps, quantise};
use observe::Silent;

fn space() -> Space {
    Space::half_angle(32)
}

fn everything(space: &Space) -> Printable {
    Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), space)
}

/// Maps a document by the pixels given, or by its own.
fn map(
    document: &Factored,
    materials: Option<&dyn Materials>,
    printable: &Printable,
    settings: &GamutSettings,
    observer: &Silent,
) -> Result<Mapped, GamutError> {
    let factored = || Ok(std::borrow::Cow::Borrowed(document));
    super::map(materials.unwrap_or(document), factored, printable, settings, observer)
}

fn basis_settings() -> GamutSettings {
    GamutSettings { intent: Intent::Basis, ..GamutSettings::default() }
}

fn maps(width: usize, height: usize, channels: usize, weight: impl Fn(usize, usize) -> f64) -> WeightMaps {
    let mut data = vec![0; width * height * channels];
    for (pixel, out) in data.chunks_exact_mut(channels).enumerate() {
        let weights: Vec<f64> = (0..channels).map(|c| weight(pixel, c)).collect();
        quantise(&weights, out);
    }
    WeightMaps::new(width, height, channels, data).unwrap()
}

fn document(space: &Space, surfaces: &[Surface], maps: WeightMaps) -> Factored {
    let mut bases = Table::new(space.columns());
    surfaces.iter().for_each(|s| bases.push(&space.row(&s.curve(space.angles()))));
    Factored { space: space.clone(), bases, maps }
}

fn surface(diffuse: [f32; 3], f0: [f32; 3], alpha: f32) -> Surface {
    Surface { diffuse, f0, alpha }
}

/// Four materials: two printable, one glossier than any stack, one more colourful.
fn four() -> [Surface; 4] {
    [
        surface([0.5, 0.4, 0.3], [0.04; 3], 0.2),
        surface([0.02; 3], [0.4, 0.3, 0.2], 0.3),
        surface([0.0; 3], [1.0; 3], 0.03),
        surface([0.9, 0.0, 0.0], [0.04; 3], 0.3),
    ]
}

fn pattern(width: usize, height: usize) -> WeightMaps {
    maps(width, height, 4, |p, c| {
        ((p * (7 + 3 * c) + 5 * c) % 23) as f64 * f64::from(u8::from((p + c) % 3 > 0))
    })
}

/// Materials as surfaces, one for each pixel.
struct Field {
    space: Space,
    width: usize,
    surfaces: Vec<Surface>,
}

impl Materials for Field {
    fn width(&self) -> usize {
        self.width
    }
    fn height(&self) -> usize {
        self.surfaces.len() / self.width
    }
    fn space(&self) -> &Space {
        &self.space
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let row = self.space.row(&self.surfaces[pixel].curve(self.space.angles()));
        out.iter_mut().zip(&row).for_each(|(out, &f)| *out = f as f32);
    }
}

fn printed_row(mix: &InkMix, printable: &Printable, pixel: usize) -> Vec<f64> {
    let mut shares = vec![0.0; mix.stacks.len()];
    mix.shares(pixel, &mut shares);
    let mut row = vec![0.0; printable.curves.columns()];
    for (stack, share) in mix.stacks.iter().zip(&shares) {
        if *share > 0.0 {
            let k = printable.stacks.iter().position(|s| s == stack).unwrap();
            row.iter_mut().zip(printable.curves.row(k)).for_each(|(row, f)| *row += share * f);
        }
    }
    row
}

fn is_printable(mix: &InkMix, most: usize) {
    mix.check().unwrap();
    assert!(mix.inks().len() <= most, "{:?}", mix.inks());
    let mut shares = vec![0.0; mix.stacks.len()];
    for pixel in 0..mix.maps.width() * mix.maps.height() {
        mix.shares(pixel, &mut shares);
        assert!(shares.iter().all(|&s| s >= 0.0));
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

proptest! {
    #![proptest_config(testing::cases(24))]

    /// Convex combinations of convex combinations are convex combinations, in exact arithmetic.
    #[test]
    fn weights_of_weights_are_weights(
        a in prop::collection::vec(0.0f64..1.0, 5),
        s in prop::collection::vec(prop::collection::vec(0.0f64..1.0, 9), 5),
    ) {
        let stacks: Vec<Stack> = everything(&space()).stacks[..9].to_vec();
        let mut weights = vec![0; 5];
        quantise(&a, &mut weights);
        let matrix: Vec<Vec<u16>> = s.iter().map(|row| {
            let mut out = vec![0; 9];
            quantise(row, &mut out);
            out
        }).collect();
        let mix = InkMix::new(stacks, WeightMaps::new(1, 1, 5, weights).unwrap(), matrix).unwrap();
        let mut shares = vec![0.0; 9];
        mix.shares(0, &mut shares);
        prop_assert!(shares.iter().all(|&s| s >= 0.0));
        prop_assert_eq!(shares.iter().sum::<f64>(), 1.0);
    }

    /// Section 4.1: if the bases are printable, so is every pixel, and it is printed as it is.
    #[test]
    fn documents_in_the_gamut_are_printed_as_well_as_exactly(
        parts in prop::collection::vec(prop::collection::vec(0.1f64..1.0, 3), 4),
        stacks in prop::collection::vec(0usize..9, 12),
    ) {
        let space = space();
        let printable = everything(&space);
        let mut bases = Table::new(space.columns());
        let mut shares = vec![vec![0.0; printable.stacks.len()]; parts.len()];
        for (i, part) in parts.iter().enumerate() {
            let sum: f64 = part.iter().sum();
            let mut row = vec![0.0; space.columns()];
            for (part, &k) in part.iter().zip(&stacks[3 * i..]) {
                shares[i][k] += part / sum;
                row.iter_mut().zip(printable.curves.row(k)).for_each(|(r, f)| *r += part / sum * f);
            }
            bases.push(&row);
        }
        let document = Factored { space: space.clone(), bases, maps: pattern(6, 5) };
        // All inks, so that none must be given up for another.
        let settings = GamutSettings { most_cartridges: 13, intent: Intent::Clamp, ..GamutSettings::default() };
        let mapped = map(&document, None, &printable, &settings, &Silent).unwrap();
        is_printable(&mapped.mix, 13);
        // By distance alone, too, where bases are mapped.
        let paper = GamutSettings { most_cartridges: 13, light: 0.0, ..basis_settings() };
        let by_bases = map(&document, None, &printable, &paper, &Silent).unwrap().mix;
        let ways = [(&mapped.mix, settings.light), (&by_bases, paper.light)];
        let mut target = vec![0f32; space.columns()];
        for (mix, light) in ways {
            // What is rare and each cartridge that is left out may cost half of what is barely visible.
            let used = stacks.iter().flat_map(|&k| printable.stacks[k].layers());
            let left_out = InkSet::of(used.copied().filter(|ink| !mix.inks().contains(ink))).len();
            let seen = 0.005 * (1 + left_out) as f64;
            let hull = candidates::Candidates::new(&space, &printable, light).unwrap().free;
            let mut weights = vec![0.0; mix.stacks.len()];
            let mut more = 0.0;
            for pixel in 0..30 {
                document.reflectance(pixel, &mut target);
                let target: Vec<f64> = target.iter().map(|&f| f64::from(f)).collect();
                let target = hull.target(&target).unwrap();
                let (mut exact, mut printed) = (vec![0.0; shares[0].len()], vec![0.0; shares[0].len()]);
                for (&weight, shares) in document.maps.at(pixel).iter().zip(&shares) {
                    let weight = f64::from(weight) / f64::from(ONE);
                    exact.iter_mut().zip(shares).for_each(|(exact, s)| *exact += s * weight);
                }
                mix.shares(pixel, &mut weights);
                for (stack, share) in mix.stacks.iter().zip(&weights) {
                    printed[printable.stacks.iter().position(|s| s == stack).unwrap()] = *share;
                }
                let [exact, printed] =
                    [exact, printed].map(|a| crate::solve::Mixer::new().objective(&hull, &target, &a));
                // Grain has a price, so a mixture may be off for less of it, by no more than it saves.
                let most = exact + seen.max(0.02);
                prop_assert!(printed < most, "pixel {pixel}: {printed}, not {exact}, {left_out} left out");
                more += (printed - exact) / 30.0;
            }
            prop_assert!(more < seen, "{more} more on the mean");
        }
    }
}

/// Figure 5: four materials of one colour with 100, 80, 50 and 10 % gloss, and a printer that reaches 50 %.
fn ladder(space: &Space) -> (Printable, Vec<Curve>) {
    let gloss = |s: f64| Curve::sampled(space.angles(), |t| [0.1 + s * 0.5 * inks::ggx::lobe(t, 0.2); 3]);
    let mut curves = Table::new(space.columns());
    let stacks = ["substrate", "F"].map(|s| s.parse().unwrap()).to_vec();
    [0.0, 0.5].iter().for_each(|&s| curves.push(&space.row(&gloss(s))));
    (Printable::new(stacks, curves), [1.0, 0.8, 0.5, 0.1].map(gloss).to_vec())
}

/// The weight of the gloss coat in each pixel of a four-pixel image of the ladder.
fn rungs(
    bases: &[usize],
    weight: impl Fn(usize, usize) -> f64,
    settings: &GamutSettings,
) -> (Vec<f64>, GamutReport) {
    let space = space();
    let (printable, curves) = ladder(&space);
    let mut table = Table::new(space.columns());
    bases.iter().for_each(|&i| table.push(&space.row(&curves[i])));
    let document = Factored { space, bases: table, maps: maps(4, 1, bases.len(), weight) };
    let mapped = map(&document, None, &printable, settings, &Silent).unwrap();
    let mut shares = vec![0.0; mapped.mix.stacks.len()];
    let share = |pixel| {
        mapped.mix.shares(pixel, &mut shares);
        shares[1]
    };
    ((0..4).map(share).collect(), mapped.report)
}

fn is_the_ladder(rungs: &[f64]) {
    // The gloss coat alone is 50 %, so the ladder at half height is its share: 1, 0.8, 0.5, 0.1.
    for (rung, expected) in rungs.iter().zip([1.0, 0.8, 0.5, 0.1]) {
        assert!((rung - expected).abs() < 0.03, "{rungs:?}");
    }
}

#[test]
fn the_ladder_stays_a_ladder_when_every_rung_is_a_basis() {
    let (rungs, report) = rungs(&[0, 1, 2, 3], |p, c| f64::from(u8::from(p == c)), &basis_settings());
    is_the_ladder(&rungs);
    // Not quite a half: what never falls below the lobe's own tail counts as diffuse.
    assert!((report.gloss_scale.unwrap() - 0.5).abs() < 0.03, "{:?}", report.gloss_scale);
}

#[test]
fn without_scaling_the_upper_rungs_are_clamped_together() {
    let settings = GamutSettings { gloss: Gloss::Keep, ..basis_settings() };
    let (rungs, report) = rungs(&[0, 1, 2, 3], |p, c| f64::from(u8::from(p == c)), &settings);
    assert!(rungs[..3].iter().all(|r| *r > 0.99) && rungs[3] < 0.25, "{rungs:?}");
    assert_eq!(report.gloss_scale, None);
}

/// The case of the paper: the extremes are the bases, and the steps between them keep their relative
/// positions.
#[test]
fn the_ladder_stays_a_ladder_when_its_ends_are_the_bases() {
    let gloss = [1.0, 0.8, 0.5, 0.1];
    let upper = |p: usize| (gloss[p] - 0.1) / 0.9;
    let weight = |p: usize, c: usize| if c == 0 { upper(p) } else { 1.0 - upper(p) };
    let (rungs, report) = rungs(&[0, 3], weight, &basis_settings());
    assert_eq!(report.gloss_scale, None, "two bases that stay apart need no scaling");
    for p in 0..4 {
        let place = (rungs[p] - rungs[3]) / (rungs[0] - rungs[3]);
        assert!((place - upper(p)).abs() < 1e-3, "{rungs:?}");
    }
    assert!(rungs[0] > 0.99 && rungs[3] < 0.25);
}

#[test]
fn clamping_the_ladder_merges_it() {
    let weight = |p: usize, c: usize| f64::from(u8::from(p == c));
    let clamp = GamutSettings { intent: Intent::Clamp, ..GamutSettings::default() };
    let (clamped, report) = rungs(&[0, 1, 2, 3], weight, &clamp);
    assert!(clamped[..3].iter().all(|r| *r > 0.99), "{clamped:?}");
    assert!(report.pixels.unwrap().merged > 0.01);
}

/// Stripes of gloss far beyond what can be printed, each a basis: clamping prints them alike, a blend
/// scales them apart.
#[test]
fn the_automatic_choice_blends_where_that_keeps_materials_apart() {
    let space = space();
    let (printable, _) = ladder(&space);
    let stripes = [4.0, 2.0, 1.0].map(|s| surface([0.3; 3], [s; 3], 0.2));
    let stripe = |pixel: usize| pixel % 72 / 24;
    let document =
        document(&space, &stripes, maps(72, 8, 3, |pixel, c| f64::from(u8::from(stripe(pixel) == c))));
    let run = |intent| {
        let settings = GamutSettings { intent, ..GamutSettings::default() };
        map(&document, None, &printable, &settings, &Silent).unwrap()
    };
    let (auto, clamped) = (run(Intent::Auto), run(Intent::Clamp));
    let merged = |mapped: &Mapped| mapped.report.pixels.unwrap().merged;
    assert_eq!(auto.report.intent, Intent::Blend);
    assert!(merged(&auto) < 0.8 * merged(&clamped), "{} {}", merged(&auto), merged(&clamped));
}

/// All materials that clamping merges are far outside the gamut, and one basis stands for them: a blend
/// prints all of them as that basis and keeps no more apart.
#[test]
fn the_automatic_choice_clamps_where_a_blend_merges_as_many() {
    let space = space();
    let (printable, _) = ladder(&space);
    let surfaces: Vec<Surface> =
        (0..64).map(|i| surface([0.3; 3], [0.1 + 0.1 * (i % 8) as f32; 3], 0.2)).collect();
    let one = document(&space, &surfaces[7..8], WeightMaps::uniform(8, 8));
    let pixels = Field { space: space.clone(), width: 8, surfaces };
    let run = |intent| {
        let settings = GamutSettings { intent, ..GamutSettings::default() };
        map(&one, Some(&pixels), &printable, &settings, &Silent).unwrap()
    };
    let (auto, clamped, blended) = (run(Intent::Auto), run(Intent::Clamp), run(Intent::Blend));
    let merged = |mapped: &Mapped| mapped.report.pixels.unwrap().merged;
    assert!(merged(&clamped) > 0.01 && merged(&blended) >= merged(&clamped), "{}", merged(&blended));
    assert_eq!((auto.report.intent, auto.report.not_blended), (Intent::Clamp, Some(merged(&blended))));
    assert_eq!((auto.mix, auto.report.pixels), (clamped.mix, clamped.report.pixels));
}

/// The figures of a blend are those of what is printed, not of what was clamped on the way.
#[test]
fn reported_distances_are_those_of_the_mix() {
    let space = space();
    let printable = everything(&space);
    let pixels = field(&space, 20, 19);
    let document = document(&space, &four(), pattern(20, 19));
    for intent in [Intent::Clamp, Intent::Blend, Intent::Contrast] {
        let settings = GamutSettings { intent, ..GamutSettings::default() };
        let mapped = map(&document, Some(&pixels), &printable, &settings, &Silent).unwrap();
        let (mut distances, mut light) = (Vec::new(), 0.0);
        let mut row = vec![0f32; space.columns()];
        for pixel in 0..380 {
            pixels.reflectance(pixel, &mut row);
            let target: Vec<f64> = row.iter().map(|&f| f64::from(f)).collect();
            let printed = printed_row(&mapped.mix, &printable, pixel);
            distances.push(space.distance(&target, &printed));
            light += space.light_distance(&target, &printed).powi(2) / 380.0;
        }
        distances.sort_by(f64::total_cmp);
        let rms = (distances.iter().map(|d| d * d).sum::<f64>() / 380.0).sqrt();
        let report = mapped.report.pixels.unwrap();
        let expected = [rms, light.sqrt(), distances[379 * 95 / 100], distances[379]];
        for (found, expected) in [report.rms, report.light, report.p95, report.max].iter().zip(expected) {
            // Shares are rounded to 1/32768.
            assert!((found - expected).abs() < 3e-4, "{intent:?}: {report:?}, not {expected}");
        }
    }
}

/// What other inks would bring is what a mapping with them, of the same intent, finds by the same materials.
#[test]
fn the_gain_of_inks_is_judged_by_what_the_intent_maps() {
    let space = space();
    let library = Library::builtin();
    let few = Printable::from_library(&library, &"process,finish".parse().unwrap(), &space);
    let more = Printable::from_library(&library, &"process,finish,SF,P".parse().unwrap(), &space);
    let pixels = field(&space, 12, 10);
    let document = document(&space, &four(), pattern(12, 10));
    for intent in [Intent::Basis, Intent::Clamp, Intent::Blend] {
        let settings = GamutSettings { intent, gloss: Gloss::Keep, light: 0.0, ..GamutSettings::default() };
        let run = |printable| map(&document, Some(&pixels), printable, &settings, &Silent).unwrap();
        let (without, with) = (run(&few), run(&more));
        let gain = gain(&without.judged, &few, &more, &space, &settings).unwrap().unwrap();
        assert_eq!(
            (gain.before, gain.after),
            (without.judged.objective, with.judged.objective),
            "{intent:?}"
        );
        assert!(gain.inks.contains(&Ink::SilverFoil), "{gain:?}");
        if intent == Intent::Basis {
            let materials = &with.report.materials;
            let square: f64 = materials.iter().map(|basis| basis.share * basis.distance.powi(2)).sum();
            assert!((gain.after / square.sqrt() - 1.0).abs() < 0.02, "{} {}", gain.after, square.sqrt());
        }
    }
}

#[test]
fn reports_say_what_the_mix_prints() {
    let space = space();
    let printable = everything(&space);
    let document = document(&space, &four(), pattern(8, 8));
    let mapped = map(&document, None, &printable, &basis_settings(), &Silent).unwrap();
    is_printable(&mapped.mix, 7);
    assert_eq!(mapped.report.materials.len(), 4);
    let curve =
        |stack: &Stack| printable.curves.row(printable.stacks.iter().position(|s| s == stack).unwrap());
    for (i, basis) in mapped.report.materials.iter().enumerate() {
        let mut row = vec![0.0; space.columns()];
        for (stack, &share) in mapped.mix.stacks.iter().zip(&mapped.mix.matrix[i]) {
            let w = f64::from(share) / f64::from(ONE);
            row.iter_mut().zip(curve(stack)).for_each(|(row, f)| *row += w * f);
        }
        assert!(space.distance(&row, &basis.printed) < 1e-12);
        assert!((space.distance(&row, document.bases.row(i)) - basis.unscaled_distance).abs() < 1e-12);
        assert!((space.distance(&row, &basis.target) - basis.distance).abs() < 1e-12);
        assert_eq!(basis.agreeing, basis.starts);
        assert!(basis.weights.iter().all(|(_, w)| *w >= 0.004) && basis.pruning_cost >= -1e-12);
    }
}

/// Seven, five, one and no cartridges (only paper) all work; each limit costs distance.
#[test]
fn fewer_cartridges_are_kept_to_and_cost_distance() {
    let space = space();
    let printable = everything(&space);
    let mut rng = 0.0;
    let surfaces: Vec<Surface> = (0..12)
        .map(|i| {
            rng = (rng + 0.618) % 1.0;
            let hue = |c: usize| ((i * (3 + c)) % 7) as f32 / 8.0;
            surface(
                [hue(0), hue(1), hue(2)],
                [0.04 + 0.6 * hue(2), 0.04 + 0.5 * hue(0), 0.1],
                0.05 + 0.03 * i as f32,
            )
        })
        .collect();
    let weights = maps(6, 4, 12, |p, c| f64::from(u8::from(p % 12 == c)));
    let document = document(&space, &surfaces, weights);
    let mut last = 0.0;
    for most in [13, 7, 5, 1, 0] {
        let settings = GamutSettings { most_cartridges: most, gloss: Gloss::Keep, ..basis_settings() };
        let Mapped { mix, report, judged } = map(&document, None, &printable, &settings, &Silent).unwrap();
        is_printable(&mix, most);
        assert_eq!(report.cartridges, mix.inks());
        // Up to what is left out because nobody sees it.
        assert!(judged.objective >= last - 1e-3, "{most}: {} {last}", judged.objective);
        last = judged.objective;
        assert!(report.given_up.iter().all(|g| g.with <= g.without + 1e-12));
        assert!(report.given_up.windows(2).all(|w| w[0].without - w[0].with >= w[1].without - w[1].with));
    }
}

#[test]
fn no_cartridge_and_no_substrate_is_an_error() {
    let space = space();
    let mut printable = everything(&space);
    let bare = printable.stacks.remove(0);
    assert_eq!(bare, Stack::SUBSTRATE);
    let mut curves = Table::new(space.columns());
    printable.curves.rows().skip(1).for_each(|row| curves.push(row));
    printable.curves = curves;
    let document = document(&space, &four(), pattern(4, 4));
    let settings = GamutSettings { most_cartridges: 0, ..basis_settings() };
    let error = map(&document, None, &printable, &settings, &Silent).unwrap_err();
    assert_eq!(error, GamutError::Cartridges { most: 0 });
    // With cartridges it works, and the substrate is listed first all the same.
    let mapped = map(&document, None, &printable, &basis_settings(), &Silent).unwrap();
    assert_eq!(mapped.mix.stacks[0], Stack::SUBSTRATE);
    assert!(mapped.mix.matrix.iter().all(|row| row[0] == 0));
}

fn field(space: &Space, width: usize, height: usize) -> Field {
    let surfaces = (0..width * height)
        .map(|p| {
            let (u, v) = ((p % width) as f32 / width as f32, (p / width) as f32 / height as f32);
            let rough = 0.08 + 0.3 * ((p * 7919) % 101) as f32 / 101.0;
            surface([0.6 * u, 0.3 * v, 0.2], [0.04 + 0.5 * u * v, 0.04, 0.1 * v], rough)
        })
        .collect();
    Field { space: space.clone(), width, surfaces }
}

/// Each clamped pixel is as near as eq. 1 gets from all starts, whatever its neighbours.
#[test]
fn every_clamped_pixel_is_its_own_best() {
    let space = space();
    // Without advice against any stack, which would trade a little distance for stacks that print well.
    let Printable { stacks, curves, .. } = everything(&space);
    let printable = Printable::new(stacks, curves);
    let pixels = field(&space, 20, 19);
    let document = document(&space, &four(), pattern(20, 19));
    let settings = GamutSettings { intent: Intent::Clamp, most_cartridges: 13, ..GamutSettings::default() };
    let mapped = map(&document, Some(&pixels), &printable, &settings, &Silent).unwrap();
    is_printable(&mapped.mix, 13);
    let hull =
        |curves: &Table| crate::solve::Hull::new(&space, curves, &vec![0.0; curves.len()], LIGHT).unwrap();
    let mut used = Table::new(space.columns());
    for stack in &mapped.mix.stacks {
        let k = printable.stacks.iter().position(|other| other == stack).unwrap();
        used.push(printable.curves.row(k));
    }
    let (all, used) = (hull(&printable.curves), hull(&used));
    let mut mixer = crate::solve::Mixer::new();
    let mut row = vec![0f32; space.columns()];
    let mut shares = vec![0.0; mapped.mix.stacks.len()];
    let (mut with_all, mut with_used) = (0.0, 0.0);
    for pixel in (0..380).step_by(3) {
        pixels.reflectance(pixel, &mut row);
        let target: Vec<f64> = row.iter().map(|&f| f64::from(f)).collect();
        with_all += mixer.best(&all, &all.target(&target).unwrap()).unwrap().fit.objective.powi(2);
        let own = mixer.best(&used, &used.target(&target).unwrap()).unwrap();
        let best = own.fit.objective;
        mapped.mix.shares(pixel, &mut shares);
        // With the grain that is seen of each share, as what is rare is judged; price of layers and
        // rounding of shares.
        let aim = used.target(&target).unwrap();
        let (found, least) = (mixer.exactly(&used, &aim, &shares), mixer.exactly(&used, &aim, &own.weights));
        assert!(found < least + 1e-3, "pixel {pixel}: {found} {least}");
        with_used += best.powi(2);
    }
    // Cartridges that bring less to each material than half of what is barely visible were left out.
    let (with_all, with_used) = (with_all.sqrt(), with_used.sqrt());
    assert!(with_used >= with_all - 1e-9 && with_used < 1.1 * with_all, "{with_used} {with_all}");
    let report = mapped.report.pixels.unwrap();
    assert!(report.gap <= 1e-7 && report.rms <= report.max && report.p95 <= report.max, "{report:?}");
}

/// What is certified is the worst pixel, wherever it stands: more pixels after it take nothing back.
#[test]
fn the_gap_is_that_of_the_worst_pixel_so_far() {
    let space = space();
    // Few enough that none has to be chosen.
    let process = InkSet::of([Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black]);
    let printable = Printable::from_library(&Library::builtin(), &process, &space);
    let part = |seed: usize| (seed * 7919 % 97) as f32 / 97.0;
    let surfaces: Vec<Surface> = (0..24)
        .map(|n| {
            let diffuse = [part(n + 1), part(3 * n + 2), part(5 * n + 3)].map(|v| 0.8 * v);
            surface(diffuse, [0.04 + 0.3 * part(7 * n + 4); 3], 0.05 + 0.4 * part(11 * n + 5))
        })
        .collect();
    let gap = |count: usize| {
        let field = Field { space: space.clone(), width: 1, surfaces: surfaces[..count].to_vec() };
        let inks = GamutSettings { intent: Intent::Clamp, ..GamutSettings::default() };
        let mapped = super::map::clamped(&field, &printable, &inks, &Silent).unwrap();
        mapped.report.pixels.unwrap().gap
    };
    let gaps: Vec<f64> = (1..=surfaces.len()).map(gap).collect();
    assert!(gaps.last() > gaps.first(), "{gaps:?}");
    assert!(gaps.windows(2).all(|pair| pair[0] <= pair[1]), "{gaps:?}");
}

/// The result is equal bit for bit for any number of threads.
#[test]
fn mapping_is_the_same_with_any_number_of_threads() {
    let space = space();
    let printable = everything(&space);
    let pixels = field(&space, 40, 50);
    let document = document(&space, &four(), pattern(40, 50));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = GamutSettings { intent: Intent::Blend, ..GamutSettings::default() };
        pool.install(|| map(&document, Some(&pixels), &printable, &settings, &Silent).unwrap())
    };
    let one = run(1);
    assert_eq!(one, run(3));
    is_printable(&one.mix, 7);
}

/// The blend equals the clamped mix where that is near, and its reported weight lies between 0 and 1.
#[test]
fn blending_follows_the_clamped_mix_inside_the_gamut() {
    let space = space();
    let printable = everything(&space);
    let inside = surface([0.5, 0.4, 0.3], [0.04; 3], 0.2);
    let pixels = Field { space: space.clone(), width: 24, surfaces: vec![inside; 24 * 24] };
    let document = document(&space, &four(), pattern(24, 24));
    let run = |intent| {
        let settings =
            GamutSettings { intent, gloss: Gloss::Keep, most_cartridges: 13, ..GamutSettings::default() };
        map(&document, Some(&pixels), &printable, &settings, &Silent).unwrap()
    };
    let (clamped, blended) = (run(Intent::Clamp), run(Intent::Blend));
    assert!(clamped.report.pixels.unwrap().max < 0.01, "{:?}", clamped.report.pixels);
    assert!(blended.report.pixels.unwrap().clamped > 0.999);
    let d = space
        .distance(&printed_row(&clamped.mix, &printable, 99), &printed_row(&blended.mix, &printable, 99));
    // Each has cartridges and stacks of its own, without those that bring less than is seen.
    assert!(d < 0.01, "{d}");
}

#[test]
fn inconsistent_inputs_are_errors() {
    let space = space();
    let printable = everything(&space);
    let document = document(&space, &four(), pattern(4, 4));
    let fails = |document: &Factored, materials: Option<&dyn Materials>, printable: &Printable| {
        let settings = GamutSettings { intent: Intent::Blend, ..GamutSettings::default() };
        map(document, materials, printable, &settings, &Silent).unwrap_err()
    };
    let none = Printable::new(vec![], Table::new(space.columns()));
    assert_eq!(fails(&document, None, &none), GamutError::NothingPrintable);
    let mut twice = printable.clone();
    twice.stacks[5] = twice.stacks[9].clone();
    assert!(matches!(fails(&document, None, &twice), GamutError::Twice { .. }));
    let mut short = printable.clone();
    short.stacks.pop();
    assert_eq!(fails(&document, None, &short), GamutError::Curves { stacks: 56, curves: 57 });
    let mut other = printable.clone();
    other.curves = everything(&Space::half_angle(8)).curves;
    assert!(observe::with_causes(&fails(&document, None, &other)).contains("24 columns"));
    let pixels = field(&space, 3, 4);
    assert!(matches!(fails(&document, Some(&pixels), &printable), GamutError::Size { found_width: 3, .. }));
    let mut fewer = document.clone();
    fewer.bases = Table::new(space.columns());
    fewer.bases.push(document.bases.row(0));
    assert_eq!(fails(&fewer, None, &printable), GamutError::Channels { bases: 1, channels: 4 });
    let mut bad = document.clone();
    bad.bases.row_mut(2)[5] = f64::NAN;
    let error = observe::with_causes(&fails(&bad, None, &printable));
    assert!(error.contains("basis 2") && error.contains("column 5"), "{error}");
}
