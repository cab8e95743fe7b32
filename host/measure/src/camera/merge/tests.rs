use super::*;
use observe::Silent;
use readers::Exif;
use std::path::Path;

/// A scene of discs on shaded ground, as a camera with shot noise would record it.
fn photograph(folder: &Path, name: &str, time: f64, scene: f64, shift: (i64, i64), gamma: bool) -> Exposure {
    let (width, height) = (320i64, 240i64);
    let mut state = 0x1234_5678u64 ^ time.to_bits() ^ shift.0 as u64;
    let mut noise = move || {
        (0..12)
            .map(|_| {
                // Splitmix: neighbours are independent.
                state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((z ^ (z >> 31)) >> 40) as f64 / (1u64 << 24) as f64
            })
            .sum::<f64>()
            - 6.0
    };
    let picture = image::ImageBuffer::from_fn(width as u32, height as u32, |x, y| {
        let light = light(i64::from(x) - shift.0, i64::from(y) - shift.1, scene);
        image::Rgb([1.7, 1.0, 1.4].map(|gain| {
            let value = 20_000.0 * gain * light * time;
            let value = (value + noise() * (4.0 * value + 1000.0).sqrt()).clamp(0.0, 65_520.0);
            if gamma {
                (65_535.0 * (value / 65_535.0).powf(0.45)) as u16
            } else {
                (value / 16.0).round() as u16 * 16
            }
        }))
    });
    let path = folder.join(name);
    picture.save(&path).unwrap();
    Exposure { path, seconds: time, exif: Exif::default() }
}

/// Five decades of light; `scene` is the size of one disc.
fn light(x: i64, y: i64, scene: f64) -> f64 {
    let disc =
        |cx: f64, cy: f64, r: f64| 1.0 / (1.0 + (((x as f64 - cx).hypot(y as f64 - cy) - r) / 1.5).exp());
    0.02 + 0.0005 * x as f64
        + 0.3 * disc(90.0, 100.0, 40.0)
        + 5.0 * disc(220.0, 140.0, scene)
        + 40.0 * disc(220.0, 60.0, 12.0)
}

const TIMES: [f64; 5] = [16.0, 4.0, 1.0, 0.25, 0.03];

fn series(folder: &Path) -> Vec<Exposure> {
    TIMES.iter().map(|&t| photograph(folder, &format!("t{t}.png"), t, 30.0, (0, 0), false)).collect()
}

fn merged(exposures: Vec<Exposure>) -> Result<(Radiance, Vec<Shot>), MeasureError> {
    merge(exposures, &Frames::none(), None, None, &Silent)
}

#[test]
fn five_decades_come_back_with_their_variance() {
    let folder = tempfile::tempdir().unwrap();
    let (radiance, shots) = merged(series(folder.path())).unwrap();
    // The units are those of the longest exposure.
    let unit = 20_000.0 * TIMES[0];
    let (mut off, mut sum, mut count) = (0.0, 0.0, 0.0);
    for y in 0..240 {
        for x in 0..320 {
            let expected = unit * light(x, y, 30.0);
            let i = 3 * (y * 320 + x) as usize + 1;
            let error = f64::from(radiance.value[i]) - expected;
            off += error / expected;
            sum += error * error / f64::from(radiance.variance[i]);
            count += 1.0;
        }
    }
    assert!((off / count).abs() < 2e-3, "bias {}", off / count);
    assert!((0.6..1.7).contains(&(sum / count)), "chi squared {}", sum / count);
    assert!(shots.iter().all(|shot| (shot.ratio - 1.0).abs() < 0.01), "{shots:?}");
    assert!(radiance.bound.iter().all(|b| *b == 0));
}

/// Short exposures of dark ground are noise that the sensor cuts off at zero: a mean with them is too bright.
#[test]
fn dark_ground_is_not_made_brighter_by_short_exposures() {
    let folder = tempfile::tempdir().unwrap();
    let times = [1.0, 0.25, 0.06, 0.015, 0.004];
    let exposures = times.map(|t| photograph(folder.path(), &format!("t{t}.png"), t, 30.0, (0, 0), false));
    let (radiance, _) = merged(exposures.to_vec()).unwrap();
    let (mut sum, mut expected) = (0.0, 0.0);
    for (x, y) in (0..30).flat_map(|x| (0..240).map(move |y| (x, y))) {
        sum += f64::from(radiance.value[3 * (y * 320 + x) as usize + 1]);
        expected += 20_000.0 * light(x, y, 30.0);
    }
    assert!((sum / expected - 1.0).abs() < 0.005, "{}", sum / expected);
}

/// The mean of least variance of dark ground of which there is no long exposure: a pixel that noise makes dark is no surer than one that it
/// makes bright.
#[test]
fn noise_does_not_choose_its_own_weight() {
    let folder = tempfile::tempdir().unwrap();
    let times = [0.25, 0.06, 0.015];
    let exposures = times.map(|t| photograph(folder.path(), &format!("t{t}.png"), t, 30.0, (0, 0), false));
    let (radiance, _) = merged(exposures.to_vec()).unwrap();
    let (mut sum, mut weight) = (0.0, 0.0);
    for (x, y) in (0..40).flat_map(|x| (0..240).map(move |y| (x, y))) {
        let (i, expected) = (3 * (y * 320 + x) as usize + 1, 20_000.0 * times[0] * light(x, y, 30.0));
        let w = expected * expected / f64::from(radiance.variance[i]);
        sum += w * f64::from(radiance.value[i]) / expected;
        weight += w;
    }
    assert!((sum / weight - 1.0).abs() < 0.01, "{}", sum / weight);
}

#[test]
fn without_a_short_exposure_the_brightest_are_lower_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let (radiance, _) = merged(series(folder.path()).into_iter().take(3).collect()).unwrap();
    let at = |x: usize, y: usize| y * 320 + x;
    assert_eq!([radiance.bound[at(220, 60)], radiance.bound[at(90, 100)]], [7, 0]);
    let bound = f64::from(radiance.value[3 * at(220, 60)]) / (20_000.0 * TIMES[0]) / 1.7;
    assert!(bound > 1.5 && bound < light(220, 60, 30.0), "{bound}");
}

#[test]
fn shutters_that_are_off_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mut exposures = series(folder.path());
    exposures[2] = photograph(folder.path(), "slow.png", 1.1, 30.0, (0, 0), false);
    exposures[2].seconds = 1.0;
    let (_, shots) = merged(exposures).unwrap();
    assert!((shots[2].ratio / shots[1].ratio - 1.1).abs() < 0.01, "{shots:?}");
    let mut exposures = series(folder.path());
    exposures[2].seconds = 2.5;
    let error = merged(exposures).err().unwrap().to_string();
    assert!(error.contains("t1.png") && error.contains("exposure time of 2.5 s"), "{error}");
}

#[test]
fn small_shifts_are_undone_and_large_ones_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut exposures = series(folder.path());
    exposures[3] = photograph(folder.path(), "moved.png", 0.25, 30.0, (3, -2), false);
    let (radiance, shots) = merged(exposures).unwrap();
    assert!((shots[3].shift[0] - 3.0).abs() < 0.1 && (shots[3].shift[1] + 2.0).abs() < 0.1, "{shots:?}");
    let mut worst = 0.0f64;
    for (x, y) in [(220, 60), (205, 140), (240, 150), (90, 100), (40, 30)] {
        let found = f64::from(radiance.value[3 * (y * 320 + x) + 1]) / (20_000.0 * TIMES[0]);
        worst = worst.max((found / light(x as i64, y as i64, 30.0) - 1.0).abs());
    }
    assert!(worst < 0.04, "{worst}");
    let mut exposures = series(folder.path());
    exposures[3] = photograph(folder.path(), "away.png", 0.25, 30.0, (14, 0), false);
    let error = merged(exposures).err().unwrap().to_string();
    assert!(error.contains("away.png") && error.contains("tripod"), "{error}");
}

#[test]
fn a_photograph_of_another_scene_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for stranger in 1..4 {
        let mut exposures = series(folder.path());
        exposures[stranger] = photograph(folder.path(), "other.png", TIMES[stranger], 80.0, (0, 0), false);
        let error = merged(exposures).err().unwrap().to_string();
        assert!(error.contains("other.png: shows something else"), "{stranger}: {error}");
    }
}

#[test]
fn a_tone_curve_is_noticed_and_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let curved: Vec<Exposure> = TIMES
        .iter()
        .map(|&t| photograph(folder.path(), &format!("g{t}.png"), t, 30.0, (0, 0), true))
        .collect();
    let error = merged(curved.clone()).err().unwrap().to_string();
    assert!(error.contains("not proportional to light") && error.contains("power 0.4"), "{error}");
    let (radiance, _) = merge(curved, &Frames::none(), None, Some(false), &Silent).unwrap();
    let at = |x: usize, y: usize| f64::from(radiance.value[3 * (y * 320 + x) + 1]);
    for ((x, y), (u, v)) in [((220, 60), (220, 140)), ((220, 140), (90, 100)), ((90, 100), (30, 200))] {
        let ratio = at(x, y) / at(u, v) / (light(x as i64, y as i64, 30.0) / light(u as i64, v as i64, 30.0));
        assert!((ratio - 1.0).abs() < 0.06, "{x}, {y}: {ratio}");
    }
}
