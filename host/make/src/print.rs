//! A document of materials to its print: dots, job, figures, pictures, pages.
//!
//! Problem: commands that print, plan, show and compare a document must not differ in the dots they make of
//! it. Method: [`Print::new`] halftones the document as the settings say, by [`press::pipeline`]; what else
//! is asked for is made of these dots. [`Print::made`] makes the job and proves it on the simulated printer
//! while another thread looks at the dots: how far they are from the document, and how even they are.
//! Pictures and pages are drawn when they are asked for. Cost: the mixture of a fine document takes the most
//! memory; it is given back as soon as it was measured. Limits: those of the stages.

use appearance::brdf::reflectances;
use appearance::document::Document;
use appearance::factor::{FactorReport, FactorSettings, Factored};
use appearance::gamut::{GamutSettings, InkMix, Printable};
use appearance::srgb::luminance;
use halftone::metrics::{self, Look, Tone};
use inks::{InkSet, Library};
use maths::Maths;
use observe::{Beside, Diagnosis, Fault, Observer};
use press::job::plan::Plan;
use press::layout::Mm;
use press::pipeline::document::{self, Halftoned};
use press::pipeline::{self, Draft, Request};
use press::preview::gloss::{self, Gloss};
use press::preview::{
    self, Contrasts, EYE, FidelityReport, Heading, Panels, Probe, STANDARD_LIGHTS, Source, Spectrum, Swatch,
    TILTS,
};
use protocol::ink::Ink;
use rayon::prelude::*;
use readers::Pixels;
use serde_json::{Value, json};
use sheet::Area;

use crate::options::HALFTONE;
use crate::shown::{Mixture, Shown};
use crate::view::View;
use crate::{Error, PageSettings, outline, report};

/// Bases of a document whose print needs none, so that the picture of it is close.
const BASES: usize = 12;
/// Pixels of the longer side of a panel in `sheet.png`.
const PANEL: usize = 480;
/// Pixels across a ball in `materials.png`.
const BALL: usize = 160;
/// Rows of the light probe of `materials.png`, if none is named: a soft studio.
const STUDIO: usize = 128;
/// The half angle in radians at which dots are light or dark for their spectrum: beside the highlight.
const ASIDE: f64 = 0.35;

/// How a document is printed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How it becomes dots.
    pub dots: document::Settings,
    /// The ink library.
    pub library: Library,
    /// How it lies on the paper.
    pub page: PageSettings,
    /// What lights the balls of `materials.png`; a soft studio without one.
    pub probe: Option<Probe>,
}

/// The seed unless another is given.
pub const SEED: u64 = 1;

impl Default for Settings {
    /// The default inks of the built-in library but primer, whose ribbon can tear there, in the middle of
    /// plain A4.
    fn default() -> Settings {
        Settings {
            dots: document::Settings {
                factor: FactorSettings { seed: SEED, ..FactorSettings::default() },
                gamut: GamutSettings { seed: SEED, ..GamutSettings::default() },
                inks: InkSet::default().without(Ink::Primer),
                held_back: InkSet::of([Ink::Primer]),
                halftone: halftone::Method::default(),
                size: None,
            },
            library: Library::builtin(),
            page: PageSettings::default(),
            probe: None,
        }
    }
}

/// A document with everything that decides its print, and its dots.
pub struct Print {
    /// The document.
    pub document: Document,
    /// How it is printed.
    pub settings: Settings,
    /// The dots, and what the document went through.
    pub halftoned: Halftoned,
    /// How well each of two pictures is seen, if the document was made of two.
    pub contrasts: Option<Contrasts>,
}

impl Print {
    /// The dots of a document.
    ///
    /// # Errors
    /// Those of the stages, and two pictures of which one would not be seen.
    pub fn new(document: Document, settings: &Settings, observer: &dyn Observer) -> Result<Print, Error> {
        let halftoned = document::halftoned(
            &document,
            &settings.library,
            &settings.dots,
            &settings.page.layout,
            observer,
        )?;
        let contrasts = contrasts(&document, &settings.library, &halftoned)?;
        if let Some((contrasts, name)) =
            contrasts.as_ref().and_then(|contrasts| Some((contrasts, contrasts.lost()?)))
        {
            let lost = format!("nothing is left of {name} in the print: {contrasts}");
            return Err(Diagnosis::new(Fault::Setting, lost)
                .hint("allow more inks, print larger, or give the other picture less contrast")
                .set("inks", "all")
                .into());
        }
        Ok(Print { document, settings: settings.clone(), halftoned, contrasts })
    }

    /// The page, its passes and its plan. What must not be printed is planned, too.
    ///
    /// # Errors
    /// A layout without room.
    pub fn draft(&self, observer: &dyn Observer) -> Result<Draft, Error> {
        let mut draft = pipeline::draft(&self.request(), observer)?;
        draft.plan.notes.clone_from(&self.document.notes);
        draft.plan.look = self.look(&self.gloss());
        Ok(draft)
    }

    /// What is seen of the print, and beside it what `job` makes of it.
    ///
    /// # Errors
    /// Those of the stages, and of the job.
    pub(crate) fn seen<J: Send>(
        mut self,
        job: impl FnOnce(&Print) -> Result<J, Error> + Send,
        observer: &dyn Observer,
    ) -> Result<(J, Seen), Error> {
        // Of a fine document the mixture takes the most memory. It is given back as soon as it was measured.
        let mix = self.halftoned.mapped.mix.take();
        let gloss = self.gloss();
        let (print, beside) = (&self, Beside(observer));
        // Some steps to a job are one thread's. What does not depend on it is looked at beside them.
        let (job, seen) = rayon::join(
            || job(print),
            || {
                rayon::join(
                    || print.fidelity(&beside),
                    || {
                        let halftone = Halftone::measured(print, &mix, &beside)?;
                        let space = print.document.materials().space();
                        Ok::<_, Error>((halftone, Mixture::of(mix, &print.settings.library, space)?))
                    },
                )
            },
        );
        let (job, fidelity, (halftone, mixture)) = (job?, seen.0?, seen.1?);
        Ok((job, Seen { print: self, gloss, fidelity, halftone, mixture, replay: String::new() }))
    }

    pub(crate) fn request(&self) -> Request<'_> {
        let Settings { dots, library, page, .. } = &self.settings;
        page.request(&self.document.name, &self.halftoned.dots, dots.inks, library)
    }

    /// Gloss of each material of the mapping, in its order.
    fn gloss(&self) -> Vec<Gloss> {
        let Settings { dots, library, .. } = &self.settings;
        let space = self.document.materials().space();
        let lowest = gloss::lowest_peak(&Printable::combined(library, &dots.inks, space));
        let materials = self.halftoned.mapped.report.materials.par_iter();
        materials.map(|material| Gloss::of(space, material, lowest)).collect()
    }

    /// How the print will look, in sentences: two pictures, and gloss.
    fn look(&self, gloss: &[Gloss]) -> Vec<String> {
        let materials = &self.halftoned.mapped.report.materials;
        let shares: Vec<(f64, Gloss)> =
            materials.iter().map(|m| m.share).zip(gloss.iter().copied()).collect();
        let contrasts = self.contrasts.iter().map(Contrasts::to_string);
        contrasts.chain(gloss::sentences(&shares)).collect()
    }

    /// How the document's bases for pictures of it are found, unless it came with bases.
    #[must_use]
    pub fn factoring(&self) -> FactorSettings {
        let (asked, uses_bases) = (&self.settings.dots.factor, self.uses_bases());
        let bases = asked.bases.or((!uses_bases).then_some(BASES));
        FactorSettings { bases, ..asked.clone() }
    }

    /// The document's bases for pictures of it.
    ///
    /// # Errors
    /// Those of factoring.
    pub fn bases(&self, observer: &dyn Observer) -> Result<Factored, Error> {
        Ok(document::factored(&self.document, &self.factoring(), observer)?.0.into_owned())
    }

    /// Whether bases were mapped, and not pixels.
    #[must_use]
    pub fn uses_bases(&self) -> bool {
        self.halftoned.mapped.report.intent.uses_bases()
    }

    /// The document for pictures of it.
    #[must_use]
    pub fn target(&self) -> Source<'_> {
        match self.document.as_factored() {
            Some(factored) => Source::Factored(factored),
            None => Source::Document(self.document.materials()),
        }
    }

    /// What the materials of a report are.
    fn kind(&self) -> &'static str {
        if self.uses_bases() { "basis" } else { "material" }
    }

    /// How far print and document are apart for an eye.
    ///
    /// The document by itself: the simulated page was compared dot for dot with the one laid out from it, and
    /// what mirror and printer profile do to the page is undone on paper.
    fn fidelity(&self, observer: &dyn Observer) -> Result<FidelityReport, Error> {
        let (dots, space) = (&self.halftoned.dots, self.document.materials().space());
        let stacks = reflectances(dots.stacks(), &self.settings.library, space);
        let area = Area::whole(dots);
        let printed = Source::Print { dots, space, stacks: &stacks, area };
        Ok(preview::fidelity(&self.target(), &printed, (area.width, area.length), EYE, observer)?)
    }
}

/// How well each of two pictures is seen on the dots.
fn contrasts(
    document: &Document,
    library: &Library,
    halftoned: &Halftoned,
) -> Result<Option<Contrasts>, Error> {
    let (Some(views), Some(target)) = (&document.views, document.as_factored()) else { return Ok(None) };
    let dots = &halftoned.dots;
    let stacks = reflectances(dots.stacks(), library, &target.space);
    let print = Source::Print { dots, space: &target.space, stacks: &stacks, area: Area::whole(dots) };
    Ok(preview::contrasts(target, views, &print, EYE)?)
}

/// What there is to say of the dots.
struct Halftone {
    look: Option<Look>,
    tones: Vec<Tone>,
    spectrum: Option<Spectrum>,
}

impl Halftone {
    fn measured(print: &Print, mix: &InkMix, observer: &dyn Observer) -> Result<Halftone, Error> {
        let (dots, library) = (&print.halftoned.dots, &print.settings.library);
        let chosen = halftone::Settings::from_library(&mix.stacks, library);
        let space = print.document.materials().space();
        let looks = reflectances(dots.stacks(), library, space);
        let lightness = |row: &[f64]| luminance(space.curve(row).at(ASIDE)).cube_root();
        let values: Vec<f64> = looks.rows().map(lightness).collect();
        let (tones, (look, spectrum)) = rayon::join(
            || metrics::tones(mix, dots, observer),
            || rayon::join(|| metrics::look(mix, dots, &chosen), || preview::spectrum(dots, &values)),
        );
        Ok(Halftone { look: look?, tones: tones?, spectrum })
    }
}

/// A print of a document, and what was seen of it.
pub struct Seen {
    /// The document and its dots. The mixture has been given back.
    pub print: Print,
    /// How far print and document are apart for an eye at [`EYE`] metres.
    pub fidelity: FidelityReport,
    /// The commands that replay edits of the document, one a line, for the page of the sheet.
    pub replay: String,
    gloss: Vec<Gloss>,
    halftone: Halftone,
    mixture: Mixture,
}

impl Seen {
    /// Completes a plan by what there is to say of the document and its print.
    pub(crate) fn complete(&self, plan: &mut Plan) {
        plan.notes.clone_from(&self.print.document.notes);
        plan.look = self.print.look(&self.gloss);
    }

    /// Document and print side by side, with the number of passes below.
    pub(crate) fn sheet(&self, plan: &Plan, observer: &dyn Observer) -> Result<Pixels<[u8; 3]>, Error> {
        let Print { document, settings, halftoned, contrasts } = &self.print;
        let (dots, space) = (&halftoned.dots, document.materials().space());
        let stacks = reflectances(dots.stacks(), &settings.library, space);
        let printed = Source::Print { dots, space, stacks: &stacks, area: Area::whole(dots) };
        let target = self.print.target();
        let lights = if contrasts.is_some() { &TILTS } else { &STANDARD_LIGHTS };
        let panels = Panels::lit(&target, &printed, lights, PANEL, observer)?;
        let (width, height) = (Mm::of_dots(dots.width() as i64).0, Mm::of_dots(dots.length() as i64).0);
        let notes = [
            format!("{width:.0} x {height:.0} mm, {} passes", plan.passes.len()),
            format!("seen from {EYE} m: mean d {:.3},", self.fidelity.mean),
            format!("95 % below {:.3}", self.fidelity.p95),
        ];
        let heading = Heading { title: &document.name, modelled: !plan.modelled().is_empty() };
        Ok(panels.picture(heading, &notes)?)
    }

    /// Materials before and after mapping, as balls.
    pub(crate) fn materials(&self, observer: &dyn Observer) -> Result<Pixels<[u8; 3]>, Error> {
        let Print { document, settings, halftoned, .. } = &self.print;
        let kind = self.print.kind();
        let materials = halftoned.mapped.report.materials.iter().enumerate();
        let swatches: Vec<Swatch> = materials
            .map(|(number, material)| Swatch {
                name: format!("{kind} {number}, {:.0} %", 100.0 * material.share),
                target: &material.target,
                printed: &material.printed,
                mix: material.weights.clone(),
            })
            .collect();
        let studio;
        let probe = match &settings.probe {
            Some(probe) => probe,
            None => {
                studio = Probe::studio(STUDIO);
                &studio
            }
        };
        let space = document.materials().space();
        let mixed = swatches.iter().flat_map(|swatch| swatch.mix.iter().map(|(stack, _)| stack));
        let modelled = !settings.library.modelled(mixed).is_empty();
        Ok(preview::materials_picture(space, &swatches, probe, BALL, modelled, observer)?)
    }

    /// The page on which light follows the hand.
    pub(crate) fn light(&self, observer: &dyn Observer) -> Result<String, Error> {
        let Print { document, settings, halftoned, .. } = &self.print;
        let (drawn, also);
        let (target, replay) = match document.as_factored() {
            Some(factored) => {
                also = String::new();
                (factored, self.replay.as_str())
            }
            None => {
                drawn = outline::of(document.materials(), settings.dots.factor.seed, observer)?;
                let FactorReport { bases, rmse, .. } = drawn.report;
                also = format!("; the document as mixtures of {bases} materials (d = {rmse:.3})");
                (&drawn.factored, "")
            }
        };
        let shown = Shown {
            name: &document.name,
            space: document.materials().space(),
            library: &settings.library,
            dots: std::borrow::Cow::Borrowed(&halftoned.dots),
            target: Some((target, &self.mixture)),
            replay,
            also,
        };
        Ok(shown.page(&View::default(), observer)?.html)
    }

    /// The page that joins all.
    pub(crate) fn report_page(&self, plan: &Plan) -> Result<String, Error> {
        let Print { document, halftoned, contrasts, .. } = &self.print;
        report::page(&report::Subject {
            plan,
            space: document.materials().space(),
            materials: &halftoned.mapped.report.materials,
            gloss: &self.gloss,
            kind: self.print.kind(),
            fidelity: (&self.fidelity, EYE),
            doubt: halftoned.doubt,
            look: self.halftone.look.as_ref(),
            tones: &self.halftone.tones,
            spectrum: self.halftone.spectrum.as_ref(),
            contrasts: contrasts.as_ref(),
        })
    }

    /// What the report of a document says beside what every report says.
    pub(crate) fn figures(&self) -> Value {
        let Print { document, settings, halftoned, contrasts } = &self.print;
        let (mapped, fidelity, dots) = (&halftoned.mapped.report, &self.fidelity, &self.halftone);
        let materials: Vec<_> = mapped
            .materials
            .iter()
            .zip(&self.gloss)
            .map(|(material, gloss)| {
                let mix: Vec<_> = material
                    .weights
                    .iter()
                    .map(|(stack, weight)| json!({ "stack": stack, "weight": weight }))
                    .collect();
                json!({
                    "share": material.share, "distance": material.distance,
                    "unscaled_distance": material.unscaled_distance, "light_distance": material.light, "mix": mix,
                    "gap": material.gap, "gap_is_a_bound": material.convex, "starts": material.starts,
                    "starts_agreeing": material.agreeing, "pruning_cost": material.pruning_cost, "gloss_units": gloss,
                })
            })
            .collect();
        let given_up: Vec<_> = mapped
            .given_up
            .iter()
            .map(|g| json!({
                "ink": g.ink.name(), "material": g.material, "share": g.share, "with": g.with, "without": g.without,
                "hue_share": g.hue,
            }))
            .collect();
        let pixels = mapped.pixels.map(|p| {
            json!({
                "rmse": p.rms, "light_rmse": p.light, "p95": p.p95, "max": p.max, "largest_gap": p.gap,
                "merged_pairs": p.merged, "clamped_share": p.clamped,
            })
        });
        json!({
            "document": { "name": document.name, "sha256": document.digest, "notes": document.notes },
            "seed": settings.dots.factor.seed,
            "factoring": halftoned.factoring,
            "gamut": {
                "intent": mapped.intent, "light_weight": settings.dots.gamut.light,
                "uses_bases": self.print.uses_bases(), "gloss_scale": mapped.gloss_scale, "materials": materials,
                "given_up": given_up, "pixels": pixels, "merged_pairs_if_blended": mapped.not_blended,
                "measurement": halftoned.doubt,
                "held_back": halftoned.held_back.iter().map(|gain| json!({
                    "inks": gain.inks.iter().map(|ink| ink.name()).collect::<Vec<_>>(),
                    "distance_with": gain.after, "distance_without": gain.before,
                })).collect::<Vec<_>>(),
            },
            "fidelity": {
                "eye_m": EYE, "mean": fidelity.mean, "rmse": fidelity.rmse, "p95": fidelity.p95, "max": fidelity.max,
                "light_rmse": fidelity.light_rmse,
            },
            "views": contrasts.as_ref().map(|c| json!({
                "pictures": c.names, "straight": c.straight, "reflection": c.reflection,
            })),
            "halftone": {
                "method": HALFTONE.name_of(|choices| choices.halftone == settings.dots.halftone), "look": dots.look, "tones": dots.tones,
                "spectrum": dots.spectrum.as_ref().map(|spectrum| &spectrum.rings),
            },
        })
    }
}
