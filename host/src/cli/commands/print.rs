//! `foilpress print`: from a document to a folder with the job and everything to look at.

mod report;

use maths::Maths;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args as ClapArgs;
use readers::Pixels;
use serde_json::{Value, json};

use crate::cli::arguments::choice::name;
use crate::cli::arguments::document_dots::{DocumentDots, DotsArgs};
use crate::cli::arguments::layout::MediaArgs;
use crate::cli::commands::inks::luminance;
use crate::cli::commands::preset::PresetArg;
use crate::cli::commands::preview::subject::PreviewSubject;
use crate::cli::commands::preview::view::ViewArgs;
use crate::cli::console::progress::Beside;
use crate::cli::output;
use crate::cli::printing::deliver::DeliverArgs;
use crate::cli::printing::{self, Places, ResultArgs};
use appearance::brdf::reflectances;
use appearance::gamut::InkMix;
use halftone::metrics::{self, Look, Tone};
use observe::Observer;
use press::layout::Mm;
use press::pipeline::{self, Draft, Request};
use press::preview::gloss::Gloss;
use press::preview::{self, EYE, Panels, Probe, STANDARD_LIGHTS, Source, Spectrum, Swatch, TILTS};
use sheet::Area;

/// Pixels of the longer side of a panel in `sheet.png`.
const PANEL: usize = 480;
/// Pixels across a ball in `materials.png`.
const BALL: usize = 160;
/// The half angle in radians at which dots are light or dark for their spectrum: beside the highlight.
const ASIDE: f64 = 0.35;

/// A document and everything that decides how it is printed.
#[derive(ClapArgs, Debug)]
pub struct Work {
    #[command(flatten)]
    pub dots: DotsArgs,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    preset: PresetArg,
}

impl Work {
    /// The plan of the document. Nothing is written.
    pub fn draft(&self, observer: &dyn Observer) -> Result<Draft> {
        let prepared = self.dots.document_dots(observer)?;
        let mut draft = pipeline::draft(&self.request(&prepared), observer)?;
        draft.plan.notes = prepared.notes(&prepared.gloss());
        Ok(draft)
    }

    fn request<'a>(&self, prepared: &'a DocumentDots) -> Request<'a> {
        Request {
            name: &prepared.document.name,
            dots: &prepared.halftoned.dots,
            layout: &prepared.layout,
            handling: self.media.handling(),
            allowed: prepared.settings.inks,
            library: &prepared.library,
        }
    }
}

/// Arguments of `print`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress print sample:leaf\n  \
    foilpress print my-material/ --size 120x90mm --bases 8 --to file:job.rgl\n  \
    foilpress print sample:leaf --size 60mm --repeat fill --gap 3mm --crop-marks\n  \
    foilpress print helmet.gltf --material 0 --factor sacls --intent clamp\n  \
    foilpress print sample:card --inks all          (with foils)\n  \
    foilpress print --straight day.png --highlight night.png --inks all\n  \
    foilpress print --hdr window.hdr"
)]
pub struct Args {
    #[command(flatten)]
    work: Work,
    /// Light probe (.hdr or .exr) that lights the spheres in materials.png [default: a soft studio]
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Runs `print`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let (inks, library) = args.work.dots.inks.at_hand()?;
    let probe = match &args.probe {
        Some(path) => Probe::read(path)?,
        None => Probe::studio(128),
    };
    let document = args.work.dots.document.open(|| Ok((inks, library.clone())), observer)?;
    let places = Places::new(&document.name, &args.result, &args.deliver)?;
    let mut prepared = args.work.dots.halftone(document, inks, library, observer)?;
    // Of a fine document the mixture takes the most memory. It is given back as soon as it was measured.
    let mix = prepared.halftoned.mapped.mix.take();
    let gloss = prepared.gloss();
    let notes = prepared.notes(&gloss);
    let ground = args.result.background.unwrap_or_default();
    // Some steps to a job are one thread's. What does not depend on it is looked at beside them.
    let beside = Beside(observer);
    let (made, seen) = rayon::join(
        || printing::make(&args.work.request(&prepared), &notes, &[], places, ground, observer),
        || {
            let rest = || {
                let halftone = Halftone::measured(&prepared, &mix, &beside)?;
                let shown = PreviewSubject::of(
                    &prepared,
                    &mix,
                    prepared.document.as_factored().cloned(),
                    &args.work.dots,
                );
                drop(mix);
                Ok::<_, anyhow::Error>((halftone, shown.page(&ViewArgs::default(), None, &beside)?))
            };
            rayon::join(|| Pictures::new(&prepared, &probe, &beside), rest)
        },
    );
    let (made, pictures, (halftone, looked_at)) = (made?, seen.0?, seen.1?);
    let sheet = pictures.sheet(&prepared, made.job.draft.separation.passes.len())?;
    let save = |name: &str, picture: &Pixels<[u8; 3]>| {
        std::fs::write(made.folder.join(name), picture.png()?).with_context(|| format!("cannot write {name}"))
    };
    let saved = rayon::join(|| save("sheet.png", &sheet), || save("materials.png", &pictures.materials));
    saved.0?;
    saved.1?;
    let doubt = prepared.halftoned.doubt;
    let advice = format!(
        "\nSeen from {EYE} m, print and document differ: average difference d = {:.3} (0.01: barely visible; 0.05: \
         obvious).{}",
        pictures.fidelity.mean,
        doubt.map_or_else(String::new, |doubt| format!(" {doubt}."))
    );
    let page = report::page(&report::Subject {
        plan: &made.job.draft.plan,
        space: prepared.document.materials().space(),
        materials: &prepared.halftoned.mapped.report.materials,
        gloss: &gloss,
        kind: kind(&prepared),
        fidelity: (&pictures.fidelity, EYE),
        doubt,
        look: halftone.look.as_ref(),
        tones: &halftone.tones,
        spectrum: halftone.spectrum.as_ref(),
        contrasts: prepared.contrasts.as_ref(),
    })?;
    output::write(&made.folder.join("report.html"), page.as_bytes())?;
    let report = report(&prepared, &gloss, &pictures.fidelity, &halftone);
    output::write(&made.folder.join("sheet.html"), looked_at.html.as_bytes())?;
    made.finish(report, (&advice, "report.html"), &args.result, &args.deliver, observer)
}

/// What there is to look at, and how far print and document are apart.
struct Pictures {
    /// Document and print side by side.
    sheet: Panels<'static>,
    materials: Pixels<[u8; 3]>,
    fidelity: preview::FidelityReport,
}

impl Pictures {
    fn new(prepared: &DocumentDots, probe: &Probe, observer: &dyn Observer) -> Result<Pictures> {
        let DocumentDots { document, library, halftoned, .. } = prepared;
        let space = document.materials().space();
        let stacks = reflectances(halftoned.dots.stacks(), library, space);
        let target = match document.as_factored() {
            Some(factored) => Source::Factored(factored),
            None => Source::Document(document.materials()),
        };
        // The document by itself: the simulated page was compared dot for dot with the one laid out from it, and what
        // mirror and printer profile do to the page is undone on paper.
        let dots = &halftoned.dots;
        let area = Area::whole(dots);
        let printed = Source::Print { dots, space, stacks: &stacks, area };
        let fidelity = preview::fidelity(&target, &printed, (area.width, area.length), EYE, observer)?;
        let mapped = &halftoned.mapped.report;
        let kind = kind(prepared);
        let swatches: Vec<Swatch> = mapped
            .materials
            .iter()
            .enumerate()
            .map(|(number, material)| Swatch {
                name: format!("{kind} {number}, {:.0} %", 100.0 * material.share),
                target: &material.target,
                printed: &material.printed,
                mix: material.weights.clone(),
            })
            .collect();
        let materials = preview::materials_picture(space, &swatches, probe, BALL, observer)?;
        let sheet = match prepared.contrasts {
            None => Panels::lit(&target, &printed, &STANDARD_LIGHTS, PANEL, observer)?,
            // Two pictures are looked at one after the other, and the eye adapts to each.
            Some(_) => Panels::lit(&target, &printed, &TILTS, PANEL, observer)?.each_exposed(),
        };
        Ok(Pictures { sheet, materials, fidelity })
    }

    /// Document and print side by side, with the number of passes below.
    fn sheet(&self, prepared: &DocumentDots, passes: usize) -> Result<Pixels<[u8; 3]>> {
        let dots = &prepared.halftoned.dots;
        let (width, height) = (Mm::of_dots(dots.width() as i64).0, Mm::of_dots(dots.length() as i64).0);
        let notes = [
            format!("{width:.0} x {height:.0} mm, {passes} passes"),
            format!(
                "seen from {EYE} m: average d {:.3}, 95 % below {:.3}",
                self.fidelity.mean, self.fidelity.p95
            ),
        ];
        Ok(self.sheet.picture(&prepared.document.name, &notes)?)
    }
}

/// What the materials of a report are.
fn kind(prepared: &DocumentDots) -> &'static str {
    if prepared.halftoned.mapped.report.intent.uses_bases() { "basis" } else { "material" }
}

/// What there is to say of the dots.
struct Halftone {
    look: Option<Look>,
    tones: Vec<Tone>,
    spectrum: Option<Spectrum>,
}

impl Halftone {
    fn measured(prepared: &DocumentDots, mix: &InkMix, observer: &dyn Observer) -> Result<Halftone> {
        let DocumentDots { document, library, halftoned, .. } = prepared;
        let dots = &halftoned.dots;
        let chosen = halftone::Settings::from_library(&mix.stacks, library);
        let space = document.materials().space();
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

/// What the report of a document says beside what every report says.
fn report(
    prepared: &DocumentDots,
    gloss: &[Gloss],
    fidelity: &preview::FidelityReport,
    dots: &Halftone,
) -> Value {
    let DocumentDots { document, settings, halftoned, .. } = prepared;
    let mapped = &halftoned.mapped.report;
    let materials: Vec<_> = mapped
        .materials
        .iter()
        .zip(gloss)
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
        .map(|g| json!({ "ink": g.ink.name(), "distance_with": g.with, "distance_without": g.without }))
        .collect();
    let pixels = mapped.pixels.map(|p| {
        json!({
            "rmse": p.rms, "light_rmse": p.light, "p95": p.p95, "max": p.max, "largest_gap": p.gap,
            "merged_pairs": p.merged, "clamped_share": p.clamped,
        })
    });
    json!({
        "document": { "name": document.name, "sha256": document.digest, "notes": document.notes },
        "seed": settings.factor.seed,
        "factoring": halftoned.factoring,
        "gamut": {
            "intent": mapped.intent, "light_weight": settings.gamut.light,
            "uses_bases": mapped.intent.uses_bases(), "gloss_scale": mapped.gloss_scale, "materials": materials,
            "given_up": given_up, "pixels": pixels, "merged_pairs_if_blended": mapped.not_blended, "measurement": halftoned.doubt,
            "foils": halftoned.foils.as_ref().map(|gain| json!({
                "inks": gain.inks.iter().map(|ink| ink.name()).collect::<Vec<_>>(),
                "distance_with": gain.after, "distance_without": gain.before,
            })),
        },
        "fidelity": {
            "eye_m": EYE, "mean": fidelity.mean, "rmse": fidelity.rmse, "p95": fidelity.p95, "max": fidelity.max,
            "light_rmse": fidelity.light_rmse,
        },
        "views": prepared.contrasts.as_ref().map(|c| json!({
            "pictures": c.names, "straight": c.straight, "reflection": c.reflection,
        })),
        "halftone": {
            "method": name(settings.halftone), "look": dots.look, "tones": dots.tones,
            "spectrum": dots.spectrum.as_ref().map(|spectrum| &spectrum.rings),
        },
    })
}
