//! Pictures for the report: the scene, what was used of it, and how far pixels deviate from their curve.

use readers::Pixels;

use crate::camera::merge::Radiance;

/// Pixels across a picture, at most: as many as a page shows, so that a report stays small.
const ACROSS: usize = 900;

/// A small copy of a series for people.
pub(crate) struct Copy {
    picture: Pixels<[u8; 3]>,
    factor: usize,
}

impl Copy {
    /// The radiance with each channel balanced by the card; a white surface at the card is bright, and dark tones are lifted.
    pub(crate) fn new(radiance: &Radiance, white: [f64; 3]) -> Copy {
        let factor = radiance.width.div_ceil(ACROSS).max(1);
        let (width, height) = ((radiance.width / factor).max(1), (radiance.height / factor).max(1));
        let picture = Pixels::from_fn(width as u32, height as u32, |x, y| {
            let (x, y) = (x as usize * factor, y as usize * factor);
            std::array::from_fn(|c| {
                let mut sum = 0.0;
                for j in 0..factor {
                    for i in 0..factor {
                        let at = (y + j).min(radiance.height - 1) * radiance.width
                            + (x + i).min(radiance.width - 1);
                        sum += f64::from(radiance.value[3 * at + c]);
                    }
                }
                let share = (sum / (factor * factor) as f64 / white[c].max(1e-30)).clamp(0.0, 1.0);
                (255.0 * share.powf(1.0 / 2.4)) as u8
            })
        });
        Copy { picture, factor }
    }

    /// The scene with a mark on every pixel that took part (green) or was left out (red), and the card's steps framed.
    pub(crate) fn mask(&self, pixels: &[(f64, f64, Option<f64>)], steps: &[[f64; 4]; 3]) -> Pixels<[u8; 3]> {
        let mut picture = self.picture.clone();
        for &(x, y, deviation) in pixels {
            let colour = if deviation.is_some() { [0u8, 200, 80] } else { [255, 30, 30] };
            if let Some(pixel) = self.pixel(&mut picture, x, y) {
                for (old, new) in pixel.iter_mut().zip(colour) {
                    *old = ((u16::from(*old) + u16::from(new)) / 2) as u8;
                }
            }
        }
        for step in steps {
            let [left, top, right, bottom] = *step;
            let along =
                |from: f64, to: f64| (0..=400).map(move |i| from + (to - from) * f64::from(i) / 400.0);
            let places: Vec<(f64, f64)> = along(left, right)
                .flat_map(|x| [(x, top), (x, bottom)])
                .chain(along(top, bottom).flat_map(|y| [(left, y), (right, y)]))
                .collect();
            for (x, y) in places {
                if let Some(pixel) = self.pixel(&mut picture, x, y) {
                    *pixel = [255, 220, 0];
                }
            }
        }
        picture
    }

    /// Deviations of ln f from the curve: blue below, red above, full colour at 10 %.
    pub(crate) fn residuals(&self, pixels: &[(f64, f64, Option<f64>)]) -> Pixels<[u8; 3]> {
        let (width, height) = self.picture.size();
        let mut picture = Pixels::filled(width, height, [40, 40, 40]);
        for &(x, y, deviation) in pixels {
            let Some(deviation) = deviation else { continue };
            let part = (deviation / 0.1).clamp(-1.0, 1.0);
            let fade = |away: f64| (255.0 * (1.0 - away.max(0.0))) as u8;
            if let Some(pixel) = self.pixel(&mut picture, x, y) {
                *pixel = [fade(-part), fade(part.abs()), fade(part)];
            }
        }
        picture
    }

    fn pixel<'a>(&self, picture: &'a mut Pixels<[u8; 3]>, x: f64, y: f64) -> Option<&'a mut [u8; 3]> {
        let (x, y) = ((x / self.factor as f64) as u32, (y / self.factor as f64) as u32);
        picture.at_mut(x, y)
    }
}
