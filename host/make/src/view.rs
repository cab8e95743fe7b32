//! How a sheet is looked at: what is shown, lights, eye and pose, as a scene and as a page's address.
//!
//! Limits: at most four lights, which a page has room for; angles are in degrees, lengths in metres.

use press::preview::{Probe, Radiance, ToneCurve};
use view::{Camera, Light, Pose, Scene, ViewError, direction};

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// The document itself.
    Document,
    /// The mixtures of inks that stand for it.
    Mapped,
    /// The printed dots.
    Printed,
}

/// The light of a sheet for which none is named: from above and the left, an arm's length away.
const LAMP: ([f64; 2], Option<f64>) = ([-25.0, 30.0], Some(0.6));

/// How a sheet is looked at. The default is straight from above, half a metre away.
#[derive(Clone, Debug)]
pub struct View {
    /// What to show first or in a picture; the document beside its print on a page, and the print in a
    /// picture, if nothing is asked for.
    pub show: Option<Show>,
    /// Lights: azimuth to the right and elevation upwards in degrees, and the distance in metres of one that
    /// is near. Without any and without a probe there is one.
    pub lights: Vec<([f64; 2], Option<f64>)>,
    /// Light from everywhere.
    pub probe: Option<Probe>,
    /// Direction from the sheet to the eye, as for lights.
    pub eye: [f64; 2],
    /// Distance of the eye in metres; far away without one.
    pub distance: Option<f64>,
    /// How many times the sheet is enlarged.
    pub zoom: f64,
    /// The place in the middle of the picture, in metres right and up of the middle of the sheet.
    pub middle: [f64; 2],
    /// How the sheet is turned to the right and tipped back, in degrees.
    pub tilt: [f64; 2],
    /// Radius in metres of the upright cylinder around which the sheet is bent.
    pub curl: Option<f64>,
    /// Brightness in stops; one that suits the picture without it.
    pub exposure: Option<f32>,
    /// Brightness up to this share of white is kept, what is brighter is compressed.
    pub knee: f32,
}

impl Default for View {
    fn default() -> View {
        View {
            show: None,
            lights: Vec::new(),
            probe: None,
            eye: [0.0; 2],
            distance: Some(0.5),
            zoom: 1.0,
            middle: [0.0; 2],
            tilt: [0.0; 2],
            curl: None,
            exposure: None,
            knee: ToneCurve::PAPER.knee,
        }
    }
}

impl View {
    /// The scene of a sheet of this size in metres, in a picture so much wider than high.
    ///
    /// # Errors
    /// A scene that cannot be seen, or a place to look at that is turned away.
    pub fn scene(&self, size: [f64; 2], aspect: f64) -> Result<Scene, ViewError> {
        let lamp = |([azimuth, elevation], distance): ([f64; 2], Option<f64>)| {
            let towards = direction(azimuth, elevation);
            distance.map_or(Light::Far(towards), |d| Light::Near(towards.map(|c| c * d)))
        };
        let [turn, tip] = self.tilt.map(f64::to_radians);
        let pose = Pose { turn, tip, curl: self.curl };
        let whole = Camera::whole(direction(self.eye[0], self.eye[1]), self.distance, size, aspect);
        let lights = self.lamps().into_iter().map(lamp).collect();
        let mut scene = Scene { camera: whole, pose, lights, probe: self.probe.clone() };
        scene.check(size)?;
        scene.camera = whole.zoomed(self.zoom, self.middle, &pose)?;
        Ok(scene)
    }

    /// What a picture shows.
    #[must_use]
    pub fn what(&self) -> Show {
        self.show.unwrap_or(Show::Printed)
    }

    /// The tone curve with the exposure asked for, or with one for this picture.
    #[must_use]
    pub fn tone(&self, radiance: &Radiance) -> ToneCurve {
        let tone = match self.exposure {
            Some(stops) => ToneCurve::stops(f64::from(stops)),
            None if self.probe.is_some() => ToneCurve::under_a_probe(std::slice::from_ref(radiance)),
            None => ToneCurve::of(std::slice::from_ref(radiance)),
        };
        ToneCurve { knee: self.knee, ..tone }
    }

    /// The lights named; without any and without a probe, one.
    fn lamps(&self) -> Vec<([f64; 2], Option<f64>)> {
        if self.lights.is_empty() && self.probe.is_none() { vec![LAMP] } else { self.lights.clone() }
    }

    /// The same scene as a page's address holds it; `both` tells that the document is there beside its print.
    #[must_use]
    pub fn fragment(&self, camera: &Camera, tone: ToneCurve, both: bool) -> String {
        // A tenth of a micrometre.
        let [right, up] = camera.middle.map(|m| (m * 1e7).round() / 1e7);
        let lamp =
            |([a, e], distance): &([f64; 2], Option<f64>)| format!("{a},{e},{}", distance.unwrap_or(0.0));
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
            "{shows}&light={}&probe={}&view={},{}&distance={}&tilt={},{}&curl={}&zoom={}&pan={right},{up}\
             &exposure={:.2}&knee={}",
            lights.join(";"),
            u8::from(self.probe.is_some()),
            self.eye[0],
            self.eye[1],
            self.distance.unwrap_or(0.0),
            self.tilt[0],
            self.tilt[1],
            self.curl.unwrap_or(0.0),
            self.zoom,
            tone.in_stops(),
            tone.knee,
        )
    }
}
