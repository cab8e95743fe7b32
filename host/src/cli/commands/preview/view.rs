//! How a sheet is looked at, as options.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Result, bail};
use clap::Args;
use make::view::{Show, View};
use press::layout::{Mm, Point};
use press::preview::{Probe, ToneCurve};

use crate::cli::arguments::choice::choice;

/// A direction in degrees: azimuth to the right, elevation upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Degrees(f64, f64);

impl FromStr for Degrees {
    type Err = String;

    fn from_str(text: &str) -> Result<Degrees, String> {
        let [azimuth, elevation] = numbers(text, "two angles in degrees, such as 30,15")?;
        if azimuth.abs() > 180.0 || elevation.abs() > 90.0 {
            return Err("the azimuth is from -180 to 180 degrees, the elevation from -90 to 90".into());
        }
        Ok(Degrees(azimuth, elevation))
    }
}

/// A light: a direction, and a distance in metres if it is near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp(Degrees, Option<f64>);

impl FromStr for Lamp {
    type Err = String;

    fn from_str(text: &str) -> Result<Lamp, String> {
        let (angles, distance) = match text.rsplit_once(',') {
            Some((angles, distance)) if angles.contains(',') => (angles, Some(distance)),
            _ => (text, None),
        };
        let [distance] = match distance {
            Some(text) => numbers(text, "a distance in metres").map(|d: [f64; 1]| d.map(Some))?,
            None => [None],
        };
        if distance.is_some_and(|d| !(0.01..=100.0).contains(&d)) {
            return Err("the distance of a light is from 0.01 to 100 metres".into());
        }
        Ok(Lamp(angles.parse()?, distance))
    }
}

/// The distance of the eye in metres; far away without one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance(Option<f64>);

impl FromStr for Distance {
    type Err = String;

    fn from_str(text: &str) -> Result<Distance, String> {
        if text == "far" {
            return Ok(Distance(None));
        }
        let [distance] = numbers(text, "a distance in metres, or far")?;
        if !(0.01..=100.0).contains(&distance) {
            return Err("the distance of the eye is from 0.01 to 100 metres, or far".into());
        }
        Ok(Distance(Some(distance)))
    }
}

/// How many times the sheet is enlarged: as far as the page goes.
fn zoom(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(zoom) if (0.5..=400.0).contains(&zoom) => Ok(zoom),
        _ => Err("expected a number from 0.5 to 400, such as 40".into()),
    }
}

/// A length in metres, which may also be written as `0.5m`.
fn seen_from(text: &str) -> Result<f64, String> {
    let metres = match text.trim().strip_suffix('m').map(str::parse) {
        Some(Ok(metres)) => Some(metres),
        _ => text.parse().ok().map(|Mm(mm)| mm / 1000.0),
    };
    metres
        .filter(|metres| (0.01..=100.0).contains(metres))
        .ok_or_else(|| "expected a length from 1cm to 100m, such as 0.5m or 40cm".into())
}

/// So many finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    values.and_then(|values| values.try_into().ok()).ok_or_else(|| format!("expected {expected}"))
}

/// Options of the picture.
#[derive(Args, Debug)]
pub struct ViewArgs {
    /// What to show first or in a picture [default: printed]
    #[arg(long, value_name = "WHAT", value_parser = choice::<Show>())]
    pub show: Option<Show>,
    /// Direction of a light, with its distance in metres if it is near; up to four times [default: -25,30,0.6]
    #[arg(long, value_name = "AZ,EL[,M]", allow_hyphen_values = true)]
    pub light: Vec<Lamp>,
    /// Light from everywhere: a latitude-longitude panorama (.hdr or .exr) [default: none; a page has a soft studio to switch on]
    #[arg(long, value_name = "FILE")]
    pub light_probe: Option<PathBuf>,
    /// Direction from the sheet to the eye
    #[arg(long, value_name = "AZ,EL", default_value = "0,0", allow_hyphen_values = true)]
    view: Degrees,
    /// Distance of the eye in metres, or far
    #[arg(long, value_name = "M", default_value = "0.5")]
    distance: Distance,
    /// Enlarge the sheet so many times: 1 shows all of it, and the page goes on from there
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = zoom)]
    pub zoom: f64,
    /// Place on the sheet in the middle of the picture, such as 20x30mm: across and down from its top left corner
    /// [default: the sheet's middle]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    middle: Option<Point>,
    /// Blur the picture as an eye so far away sees the sheet, such as 0.5m, to see whether dots show; not for a page or a .glb
    #[arg(long, value_name = "LENGTH", value_parser = seen_from)]
    pub seen_from: Option<f64>,
    /// Turn the sheet to the right and tip it back, in degrees
    #[arg(long, value_name = "TURN,TIP", default_value = "0,0", allow_hyphen_values = true)]
    tilt: Degrees,
    /// Bend the sheet around an upright cylinder of this radius in metres [default: flat]
    #[arg(long, value_name = "M")]
    curl: Option<f64>,
    /// Brightness in stops: 0 shows paper that faces a light nearly white, 1 is twice as bright
    /// [default: so that most of the picture is neither dark nor burnt out]
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, value_parser = stops)]
    exposure: Option<f32>,
    /// Tone curve: brightness up to this share of white is kept, and what is brighter is compressed; 1 cuts it off at white
    #[arg(long, value_name = "SHARE", default_value_t = ToneCurve::PAPER.knee, value_parser = share)]
    tone_curve: f32,
}

fn stops(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(stops) if (-10.0..=10.0).contains(&stops) => Ok(stops),
        _ => Err("expected a number of stops from -10 to 10, such as -1 or 0.5".into()),
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a share of white from 0 to 1, such as 0.4".into()),
    }
}

impl ViewArgs {
    /// The view of a sheet of this size in metres, under this light from everywhere.
    ///
    /// # Errors
    /// A place to look at that is not on the sheet.
    pub fn view(&self, size: [f64; 2], probe: Option<Probe>) -> Result<View> {
        let degrees = |Degrees(azimuth, elevation): Degrees| [azimuth, elevation];
        Ok(View {
            show: self.show,
            lights: self.light.iter().map(|&Lamp(angles, distance)| (degrees(angles), distance)).collect(),
            probe,
            eye: degrees(self.view),
            distance: self.distance.0,
            zoom: self.zoom,
            middle: self.place(size)?,
            tilt: degrees(self.tilt),
            curl: self.curl,
            exposure: self.exposure,
            knee: self.tone_curve,
        })
    }

    /// The place in the middle of the picture, in metres right and up of the middle of a sheet of this size.
    fn place(&self, [width, height]: [f64; 2]) -> Result<[f64; 2]> {
        let Some(Point(x, y)) = self.middle else { return Ok([0.0; 2]) };
        let [x, y] = [x.0, y.0].map(|mm| mm / 1000.0);
        if !((0.0..=width).contains(&x) && (0.0..=height).contains(&y)) {
            let mm = [x, y, width, height].map(|length| 1000.0 * length);
            bail!(
                "--middle: {:.1} x {:.1} mm is not on the sheet, which is {:.1} x {:.1} mm",
                mm[0],
                mm[1],
                mm[2],
                mm[3]
            );
        }
        Ok([x - 0.5 * width, 0.5 * height - y])
    }

    /// Whether only a part of the sheet is asked for.
    pub fn has_part(&self) -> bool {
        self.zoom != 1.0 || self.middle.is_some()
    }

    /// Whether there are options that only light needs.
    pub fn has_lights(&self) -> bool {
        !self.light.is_empty() || self.light_probe.is_some() || self.has_tone()
    }

    /// Whether there are options of the tone curve.
    pub fn has_tone(&self) -> bool {
        self.exposure.is_some() || self.tone_curve != ToneCurve::PAPER.knee
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        view: ViewArgs,
    }

    /// The page reads `zoom` and `pan` as its own state: the window's height is that of the whole sheet by `zoom`, and its middle
    /// is `pan` (`seen` in geometry.js).
    #[test]
    fn a_page_opens_with_the_same_part_of_the_sheet() {
        let view = |words: &str| Command::parse_from(format!("preview {words}").split(' ')).view;
        let at = |words: &str| {
            let view = view(words).view([0.1, 0.08], None).unwrap();
            let camera = view.scene([0.1, 0.08], 1.25).unwrap().camera;
            let fragment = view.fragment(&camera, ToneCurve::PAPER, false);
            let value = |key: &str| {
                let (_, rest) = fragment.split_once(&format!("&{key}=")).unwrap();
                rest.split('&').next().unwrap().to_owned()
            };
            (value("zoom"), value("pan"), camera)
        };
        let (zoom, pan, camera) = at("--zoom 40 --middle 20x30mm");
        assert_eq!((zoom.as_str(), pan.as_str()), ("40", "-0.03,0.01"));
        assert!((camera.height - 1.08 * 0.08 / 40.0).abs() < 1e-12);
        // Farther from a tilted sheet's axis than its place in the window: cos 30 of it, and nearer to a near eye.
        let (_, pan, _) = at("--zoom 2.5 --middle 2cm,3cm --tilt 30,0 --distance far");
        assert_eq!(pan, format!("{},0.01", (-0.03 * 30f64.to_radians().cos() * 1e7).round() / 1e7));
        let (zoom, pan, _) = at("--tilt 30,0");
        assert_eq!((zoom.as_str(), pan.as_str()), ("1", "0,0"));
        let refused = view("--middle 101x30mm").view([0.1, 0.08], None).unwrap_err().to_string();
        assert!(refused.contains("not on the sheet, which is 100.0 x 80.0 mm"), "{refused}");
        for text in ["0", "401", "NaN", "x"] {
            assert!(super::zoom(text).unwrap_err().contains("from 0.5 to 400"), "{text}");
        }
    }

    #[test]
    fn lights_and_angles_are_read_or_refused_with_what_is_expected() {
        assert_eq!("-40,30".parse::<Lamp>().unwrap(), Lamp(Degrees(-40.0, 30.0), None));
        assert_eq!("5,-7.5,0.5".parse::<Lamp>().unwrap(), Lamp(Degrees(5.0, -7.5), Some(0.5)));
        assert_eq!("far".parse::<Distance>().unwrap(), Distance(None));
        for text in ["", "30", "a,b", "NaN,3", "1,2,3,4", "200,0", "0,91", "0,0,0", "0,0,inf", "0,0,-1"] {
            assert!(text.parse::<Lamp>().is_err(), "{text}");
        }
        for text in ["0", "-1", "inf", "near", "1,2"] {
            assert!(text.parse::<Distance>().is_err(), "{text}");
        }
        for text in ["0.5m", "50cm", "500mm"] {
            assert_eq!(seen_from(text), Ok(0.5), "{text}");
        }
        for text in ["", "m", "0.5", "0m", "-1m", "NaNm", "infm", "200m", "1mm"] {
            assert!(seen_from(text).unwrap_err().contains("such as 0.5m"), "{text}");
        }
        assert!(share("1.01").is_err() && share("NaN").is_err() && share("-0.1").is_err());
        assert_eq!(share("1"), Ok(1.0));
        assert!("1,2,3".parse::<Degrees>().unwrap_err().contains("30,15"));
    }
}
