//! A flat document or sheet under lights, seen from straight above.
//!
//! Method: the eye is orthographic, so the view direction is the normal everywhere and the half angle is half the polar angle
//! of the light. The mean reflectance of each pixel is read once and evaluated for every light:
//! `L = f(theta_h) E cos_i`. E is 1 at the middle of the picture facing the light, and falls with the square of the
//! distance from a point light. Stacks and bases are tabulated finely once and their values mixed; the rows of other
//! documents are interpolated one by one ([`Knots`]).
//! Cost: reading the source, then for each light and pixel six multiply-adds a stack, or some tens of logarithms.
//! Limits: lights have no size, so a highlight is as sharp as the material.

use inks::Knots;
use rayon::prelude::*;

use appearance::brdf::Space;
use observe::Observer;

use super::error::PreviewError;
use super::fine::Fine;
use super::radiance::Radiance;
use super::source::{Lines, Mean, Scratch, Source};

/// A light over the picture. x points right, y to the top of the picture, z to the eye. The unit of length is the
/// picture's longer side; the origin is its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Infinitely far away in this direction (any length, z > 0).
    Far([f64; 3]),
    /// At this point (z > 0). Highlights lie beneath it.
    Point([f64; 3]),
}

impl Light {
    fn check(self, light: usize) -> Result<(), PreviewError> {
        let (Light::Far(v) | Light::Point(v)) = self;
        let wrong = |problem| Err(PreviewError::Light { light, problem });
        if !v.iter().all(|c| c.is_finite() && c.abs() < 1e6) {
            return wrong("its coordinates must be finite and below a million");
        }
        if v[2] < 1e-6 {
            return wrong("it must be above the sheet (z > 0)");
        }
        Ok(())
    }

    /// The direction from a point of the sheet to the light, of any length.
    pub(super) fn direction(self, x: f64, y: f64) -> [f64; 3] {
        match self {
            Light::Far(v) => v,
            Light::Point(p) => [p[0] - x, p[1] - y, p[2]],
        }
    }

    /// The half angle (radians) and `E cos_i` at a point of the sheet.
    pub(super) fn at(self, x: f64, y: f64) -> (f64, f64) {
        let to = self.direction(x, y);
        let falloff = match self {
            Light::Far(_) => 1.0,
            Light::Point(p) => dot(p, p) / dot(to, to),
        };
        let across = (to[0] * to[0] + to[1] * to[1]).sqrt();
        (0.5 * across.atan2(to[2]), falloff * to[2] / dot(to, to).sqrt())
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Places averaged along each axis of a pixel if a document is finer than the picture.
pub(super) const DOCUMENT_SAMPLES: usize = 4;

/// Renders `source` as `width` x `height` pixels, one picture for each of `lights`.
///
/// # Errors
/// A tabulation without half angles, tables that do not match each other, or a light below the sheet.
pub fn flat(
    source: &Source,
    lights: &[Light],
    width: usize,
    height: usize,
    observer: &dyn Observer,
) -> Result<Vec<Radiance>, PreviewError> {
    let space = source.space();
    let angles = space.angles();
    if angles.is_empty() {
        return Err(PreviewError::NoAngles { columns: space.columns() });
    }
    for (i, light) in lights.iter().enumerate() {
        light.check(i)?;
    }
    let lines = source.lines(width, height, DOCUMENT_SAMPLES)?;
    if lights.is_empty() {
        return Ok(Vec::new());
    }
    observer.begin("lighting the sheet", height as u64);
    let unit = 1.0 / width.max(height) as f64;
    let mut all = vec![[0.0f32; 4]; width * height * lights.len()];
    let curves = Curves::new(space, &lines);
    all.par_chunks_exact_mut(width * lights.len()).enumerate().for_each_init(
        Scratch::default,
        |scratch, (y, out)| {
            let py = (height as f64 / 2.0 - y as f64 - 0.5) * unit;
            let mut x = 0;
            lines.each(y, scratch, |mean| {
                let px = (x as f64 + 0.5 - width as f64 / 2.0) * unit;
                for (light, out) in lights.iter().zip(out.chunks_exact_mut(width)) {
                    let (theta, irradiance) = light.at(px, py);
                    let [r, g, b] = curves.at(theta, &mean).map(|f| irradiance as f32 * f);
                    out[x] = [r, g, b, 1.0];
                }
                x += 1;
            });
            observer.advance(1);
        },
    );
    observer.end();
    let picture = |light: usize| Radiance {
        width,
        height,
        pixels: all.chunks_exact(width).skip(light).step_by(lights.len()).flatten().copied().collect(),
    };
    Ok((0..lights.len()).map(picture).collect())
}

/// What pixels are mixed of, between the samples.
pub(super) struct Curves {
    fine: Fine,
    /// The table of each stack or basis.
    tables: Vec<Vec<[f32; 3]>>,
    /// The angles of rows.
    knots: Knots,
}

impl Curves {
    pub fn new(space: &Space, lines: &Lines) -> Curves {
        let fine = Fine::new();
        let rows = lines.table().map_or_else(Vec::new, |table| table.rows().collect());
        let tables = rows.into_iter().map(|row| fine.table(&space.curve(row))).collect();
        Curves { fine, tables, knots: Knots::new(space.angles().to_vec()) }
    }

    /// The reflectance (1/sr) of a pixel at a half angle.
    pub fn at(&self, theta: f64, mean: &Mean) -> [f32; 3] {
        match mean {
            Mean::Shares(shares) => {
                let (k, s) = self.fine.at((2.0 * (0.5 * theta).sin()) as f32);
                let mut sum = [0.0; 3];
                for (&share, table) in shares.iter().zip(&self.tables).filter(|(share, _)| **share > 0.0) {
                    let (near, far) = (table[k], table[k + 1]);
                    (0..3).for_each(|c| sum[c] += share * (near[c] + s * (far[c] - near[c])));
                }
                sum
            }
            Mean::Row(row) => {
                let place = self.knots.place(theta);
                std::array::from_fn(|c| self.knots.value(place, |n| f64::from(row[3 * n + c])) as f32)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::Table;
    use inks::{Curve, Stack};
    use observe::Silent;
    use protocol::paper::Paper;
    use sheet::{Area, Sheet};
    use std::f64::consts::PI;

    /// A sheet of two stacks, the second on every dot where `inked` says so.
    fn sheet(width: u16, length: u16, inked: impl Fn(usize, usize) -> bool) -> Sheet {
        let index = (0..usize::from(width) * usize::from(length))
            .map(|i| u8::from(inked(i % usize::from(width), i / usize::from(width))))
            .collect();
        let stacks = vec![Stack::SUBSTRATE, "SF".parse().unwrap()];
        Sheet::new(Paper::Custom { width, length }, stacks, index).unwrap()
    }

    fn rows(space: &Space, curves: [&dyn Fn(f64) -> f64; 2]) -> Table {
        let mut rows = Table::new(space.columns());
        for f in curves {
            rows.push(&space.row(&Curve::sampled(space.angles(), |t| [f(t); 3])));
        }
        rows
    }

    fn lit(sheet: &Sheet, space: &Space, stacks: &Table, lights: &[Light]) -> Vec<Radiance> {
        let print = Source::Print { dots: sheet.dots(), space, stacks, area: Area::whole(sheet.dots()) };
        flat(&print, lights, sheet.width(), sheet.length(), &Silent).unwrap()
    }

    #[test]
    fn lambertian_paper_under_a_lamp_falls_off_with_cosine_and_distance() {
        let space = Space::half_angle(8);
        let rows = rows(&space, [&|_| 0.6 / PI, &|_| 0.0]);
        let (sheet, lamp) = (sheet(40, 20, |_, _| false), [0.3, -0.1, 0.8]);
        let picture = &lit(&sheet, &space, &rows, &[Light::Point(lamp)])[0];
        for (x, y) in [(0usize, 0usize), (39, 0), (20, 10), (7, 19), (31, 4)] {
            // E = I cos_i / r^2 with I such that a surface at the middle turned to the lamp receives 1.
            let to = [lamp[0] - (x as f64 - 19.5) / 40.0, lamp[1] + (y as f64 - 9.5) / 40.0, lamp[2]];
            let intensity = lamp.iter().map(|v| v * v).sum::<f64>();
            let r = to.iter().map(|v| v * v).sum::<f64>().sqrt();
            let expected = 0.6 / PI * intensity * to[2] / r.powi(3);
            let found = f64::from(picture.pixels[y * 40 + x][1]);
            assert!((found / expected - 1.0).abs() < 1e-5, "({x}, {y}): {found}, not {expected}");
        }
    }

    #[test]
    fn a_far_light_shows_the_curve_at_half_its_angle() {
        let space = Space::half_angle(64);
        let rows = rows(&space, [&|t| 1.0 + t, &|_| 0.0]);
        let sheet = sheet(3, 2, |_, _| false);
        for degrees in [0.0, 10.0, 47.0, 80.0f64] {
            let angle = degrees.to_radians();
            let light = Light::Far([0.0, 5.0 * angle.sin(), 5.0 * angle.cos()]);
            let expected = (1.0 + angle / 2.0) * angle.cos();
            for p in &lit(&sheet, &space, &rows, &[light])[0].pixels {
                assert!((f64::from(p[0]) - expected).abs() < 1e-4, "{degrees} degrees: {p:?}");
            }
        }
    }

    /// One material everywhere, as a document of rows.
    struct Rows<'a>(&'a Space, &'a [f64]);

    impl appearance::document::Materials for Rows<'_> {
        fn width(&self) -> usize {
            1
        }
        fn height(&self) -> usize {
            1
        }
        fn space(&self) -> &Space {
            self.0
        }
        fn reflectance(&self, _pixel: usize, out: &mut [f32]) {
            out.iter_mut().zip(self.1).for_each(|(o, &v)| *o = v as f32);
        }
    }

    /// Every stack of the library as a print and as a document, under a lamp close to the sheet, from its 32 samples: as far
    /// as 75 degrees, by the lobes themselves.
    #[test]
    fn sheets_are_lit_by_the_curves_themselves() {
        let space = Space::half_angle(32);
        let lamp = Light::Point([-0.45, 0.3, 0.25]);
        let (side, mut most) = (64, 0.0f64);
        for entry in inks::Library::builtin().entries() {
            let lobes = entry.lobes.as_ref().unwrap();
            let mut rows = Table::new(space.columns());
            rows.push(&space.row(&lobes.curve(space.angles())));
            let sheet = Sheet::new(
                Paper::Custom { width: side, length: side },
                vec![Stack::SUBSTRATE],
                vec![0; usize::from(side).pow(2)],
            )
            .unwrap();
            let area = Area::whole(sheet.dots());
            let print = Source::Print { dots: sheet.dots(), space: &space, stacks: &rows, area };
            let document = Rows(&space, rows.row(0));
            for source in [print, Source::Document(&document)] {
                let side = usize::from(side);
                let picture = &flat(&source, &[lamp], side, side, &Silent).unwrap()[0];
                for (i, pixel) in picture.pixels.iter().enumerate() {
                    let place = |i: usize| (i as f64 + 0.5) / side as f64 - 0.5;
                    let (theta, irradiance) = lamp.at(place(i % side), -place(i / side));
                    for (&found, f) in pixel.iter().zip(lobes.at(theta)) {
                        most = most.max((f64::from(found) / (f * irradiance) - 1.0).abs());
                    }
                }
            }
        }
        println!("greatest relative error {most:.5}");
        assert!(most < 0.005, "{most}");
    }

    #[test]
    fn the_highlight_lies_beneath_the_lamp_and_is_sharper_on_foil_than_on_paper() {
        let space = Space::half_angle(32);
        let paper = |t| 0.27 + 0.04 * inks::ggx::lobe(t, 0.28);
        let foil = |t| 0.005 + 0.85 * inks::ggx::lobe(t, 0.06);
        let rows = rows(&space, [&paper, &foil]);
        let sheet = sheet(120, 120, |x, _| x >= 60);
        let at = |x: f64, y: f64| Light::Point([(x - 59.5) / 120.0, (59.5 - y) / 120.0, 0.7]);
        let pictures = lit(&sheet, &space, &rows, &[at(30.0, 40.0), at(90.0, 70.0)]);
        let mut widths = Vec::new();
        for (picture, (x, y), half) in [(&pictures[0], (30, 40), 0..60), (&pictures[1], (90, 70), 60..120)] {
            let row = |x: usize| picture.pixels[y * 120 + x][0];
            let peak = half.clone().max_by(|&a, &b| row(a).total_cmp(&row(b))).unwrap();
            assert!(peak.abs_diff(x) <= 1, "peak at {peak}, lamp over {x}");
            widths.push(half.filter(|&x| row(x) > 0.5 * row(peak)).count());
        }
        assert!(widths[1] * 4 < widths[0], "half widths of paper and foil: {widths:?}");
    }

    #[test]
    fn a_fine_mixture_is_lit_like_the_mean_of_its_parts() {
        let space = Space::half_angle(16);
        let rows = rows(&space, [&|t| 0.3 - 0.1 * t, &|t| 2.0 / (0.1 + t)]);
        let quarter = sheet(80, 40, |x, y| (x + 2 * y) % 4 == 0);
        let lights = [Light::Point([0.2, 0.1, 1.0]), Light::Far([-1.0, 0.5, 1.0])];
        let picture = |sheet: &Sheet| {
            let print = Source::Print {
                dots: sheet.dots(),
                space: &space,
                stacks: &rows,
                area: Area::whole(sheet.dots()),
            };
            flat(&print, &lights, 20, 10, &Silent).unwrap()
        };
        let (mixed, none, all) =
            (picture(&quarter), picture(&sheet(80, 40, |_, _| false)), picture(&sheet(80, 40, |_, _| true)));
        for light in 0..2 {
            for i in 0..200 {
                let expected = 0.75 * none[light].pixels[i][0] + 0.25 * all[light].pixels[i][0];
                assert!((mixed[light].pixels[i][0] / expected - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn pictures_do_not_depend_on_the_number_of_threads() {
        let space = Space::half_angle(8);
        let rows = rows(&space, [&|t| 1.0 + t, &|t| 0.3 * t]);
        let sheet = sheet(61, 33, |x, y| (x * y) % 3 == 1);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| lit(&sheet, &space, &rows, &[Light::Point([0.1, 0.2, 0.9])]))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn lights_below_the_sheet_and_tables_without_angles_are_refused() {
        let space = Space::half_angle(2);
        let rows = rows(&space, [&|_| 1.0, &|_| 1.0]);
        let sheet = sheet(2, 2, |_, _| false);
        let print = Source::Print {
            dots: sheet.dots(),
            space: &space,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        let lights = [Light::Far([0.0, 0.0, 1.0]), Light::Point([0.0, 0.0, -1.0])];
        assert!(matches!(flat(&print, &lights, 2, 2, &Silent), Err(PreviewError::Light { light: 1, .. })));
        let bare = Space::tabulated(&[1.0, 1.0], &[1.0, 1.0]).unwrap();
        let print = Source::Print {
            dots: sheet.dots(),
            space: &bare,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        assert!(matches!(flat(&print, &[], 2, 2, &Silent), Err(PreviewError::NoAngles { columns: 6 })));
    }
}
