//! How a sheet is looked at: what is shown, lights, eye and pose, as options and as a page's address.

use std::path::PathBuf;
use std::str::FromStr;

use ::view::{Camera, Light, Pose, Scene, direction};
use clap::{Args, ValueEnum};
use press::preview::{Probe, Radiance, ToneCurve};

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Show {
    /// The document itself
    Document,
    /// The mixtures of inks that stand for it
    Mapped,
    /// The printed dots
    Printed,
}

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

/// So many finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    values.and_then(|values| values.try_into().ok()).ok_or_else(|| format!("expected {expected}"))
}

/// Options of the picture. The default is what they are when none is given.
#[derive(Args, Debug)]
pub struct ViewArgs {
    /// What to show first or in a picture [default: printed]
    #[arg(long, value_name = "WHAT", value_enum)]
    pub show: Option<Show>,
    /// Direction of a light, with its distance in metres if it is near; up to four times [default: -25,30,0.6]
    #[arg(long, value_name = "AZ,EL[,M]", allow_hyphen_values = true)]
    pub light: Vec<Lamp>,
    /// Light from everywhere: a latitude-longitude panorama (.hdr) [default: none; a page has a soft studio to switch on]
    #[arg(long, value_name = "FILE")]
    pub light_probe: Option<PathBuf>,
    /// Direction from the sheet to the eye
    #[arg(long, value_name = "AZ,EL", default_value = "0,0", allow_hyphen_values = true)]
    view: Degrees,
    /// Distance of the eye in metres, or far
    #[arg(long, value_name = "M", default_value = "0.5")]
    distance: Distance,
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

impl Default for ViewArgs {
    fn default() -> ViewArgs {
        let level = Degrees(0.0, 0.0);
        ViewArgs {
            show: None,
            light: Vec::new(),
            light_probe: None,
            view: level,
            distance: Distance(Some(0.5)),
            tilt: level,
            curl: None,
            exposure: None,
            tone_curve: ToneCurve::PAPER.knee,
        }
    }
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
    /// The scene of a sheet of this size in metres, in a picture so much wider than high.
    pub fn scene(&self, size: [f64; 2], aspect: f64, probe: Option<Probe>) -> Scene {
        let lamp = |Lamp(Degrees(azimuth, elevation), distance): Lamp| {
            let towards = direction(azimuth, elevation);
            distance.map_or(Light::Far(towards), |d| Light::Near(towards.map(|c| c * d)))
        };
        Scene {
            camera: Camera::whole(direction(self.view.0, self.view.1), self.distance.0, size, aspect),
            pose: Pose { turn: self.tilt.0.to_radians(), tip: self.tilt.1.to_radians(), curl: self.curl },
            lights: self.lamps().into_iter().map(lamp).collect(),
            probe,
        }
    }

    /// What a picture shows.
    pub fn what(&self) -> Show {
        self.show.unwrap_or(Show::Printed)
    }

    /// The tone curve with the exposure asked for, or with one for this picture.
    pub fn tone(&self, radiance: &Radiance) -> ToneCurve {
        let tone = match self.exposure {
            Some(stops) => ToneCurve::stops(f64::from(stops)),
            None => ToneCurve::of(std::slice::from_ref(radiance)),
        };
        ToneCurve { knee: self.tone_curve, ..tone }
    }

    /// The lights named; without any and without a probe, one.
    fn lamps(&self) -> Vec<Lamp> {
        if self.light.is_empty() && self.light_probe.is_none() {
            return vec![Lamp(Degrees(-25.0, 30.0), Some(0.6))];
        }
        self.light.clone()
    }

    /// Whether there are options that only light needs.
    pub fn has_lights(&self) -> bool {
        !self.light.is_empty() || self.light_probe.is_some() || self.has_tone()
    }

    /// Whether there are options of the tone curve.
    pub fn has_tone(&self) -> bool {
        self.exposure.is_some() || self.tone_curve != ToneCurve::PAPER.knee
    }

    /// The same scene as the page's address holds it.
    pub fn fragment(&self, tone: ToneCurve, both: bool, probe: bool) -> String {
        let lamp = |Lamp(Degrees(a, e), distance): &Lamp| format!("{a},{e},{}", distance.unwrap_or(0.0));
        let lights: Vec<String> = self.lamps().iter().map(lamp).collect();
        let name = |show| match show {
            Show::Document => "document",
            Show::Mapped => "mapped",
            Show::Printed => "printed",
        };
        // Unless one thing was asked for, the document stands beside its print.
        let shows = match (self.show, both) {
            (None, true) => "show=document&with=printed&split=0.5".to_owned(),
            _ => format!("show={}", name(self.what())),
        };
        format!(
            "{shows}&light={}&probe={}&view={},{}&distance={}&tilt={},{}&curl={}&exposure={:.2}&knee={}",
            lights.join(";"),
            u8::from(probe),
            self.view.0,
            self.view.1,
            self.distance.0.unwrap_or(0.0),
            self.tilt.0,
            self.tilt.1,
            self.curl.unwrap_or(0.0),
            tone.in_stops(),
            tone.knee,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(share("1.01").is_err() && share("NaN").is_err() && share("-0.1").is_err());
        assert_eq!(share("1"), Ok(1.0));
        assert!("1,2,3".parse::<Degrees>().unwrap_err().contains("30,15"));
    }
}
