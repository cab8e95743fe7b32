//! `foilpress print`: a document in, a folder with the job and everything to look at out.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args as ClapArgs;
use image::RgbImage;
use inks::{InkSet, Library};
use serde_json::json;

use super::args::{DocumentArgs, FactorArgs, GamutArgs, InkArgs};
use super::choice::choice;
use super::deliver::DeliverArgs;
use super::layout::{LayoutArgs, MediaArgs};
use super::piece::{Places, ResultArgs, write, write_job};
use super::preset::PresetArg;
use appearance::document::Document;
use observe::Observer;
use press::halftone::Method;
use press::job::placement::Size;
use press::job::plan::{Plan, Subject};
use press::layout::Mm;
use press::pipeline::{self, Print};
use press::preview::{self, Area, Probe, STANDARD_LIGHTS, Source, Swatch};
use press::separate;

/// Pixels of the longer side of a panel in `sheet.png`.
const PANEL: usize = 480;
/// Pixels across a ball in `materials.png`.
const BALL: usize = 160;
/// Where the eye is when print and document are compared, in metres.
const EYE: f64 = 0.5;

/// A document and everything that decides how it is printed.
#[derive(ClapArgs, Debug)]
pub struct Work {
    #[command(flatten)]
    pub document: DocumentArgs,
    /// Size on paper, such as 120x90mm, 12cm or 5x4in; the document keeps its shape
    /// [default: the document's own size, else as large as the page allows]
    #[arg(long)]
    pub size: Option<Size>,
    #[command(flatten)]
    pub layout: LayoutArgs,
    #[command(flatten)]
    pub media: MediaArgs,
    #[command(flatten)]
    pub factor: FactorArgs,
    #[command(flatten)]
    pub gamut: GamutArgs,
    /// How dots are chosen
    #[arg(long, value_name = "METHOD", default_value = "walk", value_parser = choice::<Method>())]
    pub halftone: Method,
    #[command(flatten)]
    pub inks: InkArgs,
    #[command(flatten)]
    pub preset: PresetArg,
}

/// A document that was printed on the simulated printer.
pub struct Done {
    /// The document.
    pub document: Document,
    /// The ink library.
    pub library: Library,
    /// What was decided.
    pub settings: pipeline::Settings,
    /// What came of it.
    pub print: Print,
    /// The plan.
    pub plan: Plan,
}

impl Work {
    /// Opens the document.
    pub fn open(&self, observer: &dyn Observer) -> Result<Document> {
        self.document.open(observer)
    }

    /// Opens the document and prints it.
    pub fn print(&self, observer: &dyn Observer) -> Result<Done> {
        let (inks, library) = self.inks.at_hand()?;
        self.print_document(self.open(observer)?, inks, library, observer)
    }

    fn print_document(
        &self,
        document: Document,
        inks: InkSet,
        library: Library,
        observer: &dyn Observer,
    ) -> Result<Done> {
        let layout = self.layout.layout(observer)?;
        let page = self.media.page(layout.paper);
        let settings = pipeline::Settings {
            factor: self.factor.settings(),
            gamut: self.gamut.settings(self.factor.seed),
            inks,
            halftone: self.halftone,
            layout,
            media: page.media,
            curl_correction: page.curl_correction,
            size: self.size,
        };
        let print = pipeline::print(&document, &library, &settings, observer)?;
        let subject = Subject::new(&document.name, &print.sheet, &print.laid, &print.separation, &page);
        let plan = Plan::new(&subject, &library);
        Ok(Done { document, library, settings, print, plan })
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
    foilpress print sample:card --inks all          (with foils)"
)]
pub struct Args {
    #[command(flatten)]
    work: Work,
    /// Light probe (.hdr) for the balls in materials.png [default: a soft studio]
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Runs `print`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let (inks, library) = args.work.inks.at_hand()?;
    let probe = match &args.probe {
        Some(path) => Probe::read_hdr(path)?,
        None => Probe::studio(128),
    };
    let document = args.work.open(observer)?;
    let places = Places::new(args.result.target(&document.name), args.deliver.file())?;
    let Done { document, library, settings, print, plan } =
        args.work.print_document(document, inks, library, observer)?;

    let folder = places.create()?;
    let ground = args.result.background.unwrap_or_default();
    write_job(folder, &print.job, &plan, &print.printed, &print.printout, &print.laid, ground)?;
    let passes = folder.join("passes");
    fs::create_dir(&passes).with_context(|| format!("cannot write {}", passes.display()))?;
    separate::files::save(&print.separation, &passes)?;
    let pictures = pictures(&document, &print, &library, &probe, observer)?;
    for (name, picture) in [("sheet.png", &pictures.sheet), ("materials.png", &pictures.materials)] {
        picture.save(folder.join(name)).with_context(|| format!("cannot write {name}"))?;
    }
    print.sheet.save_colours(print.laid.area, &folder.join("separation.png"))?;
    let report = report(&document, &settings, &print, &plan, &pictures.fidelity);
    let report = serde_json::to_string_pretty(&report)?;
    write(&folder.join("report.json"), report.as_bytes())?;
    let target = places.target.clone();
    places.commit(&print.job)?;

    if args.result.json {
        super::show(&format!("{report}\n"))?;
    } else {
        super::show(&format!(
            "{plan}\nSeen from {EYE} m the print differs from the document by d = {:.3} on average (0.01 is hard to see, \
             0.05 plain).\nThe simulated printer made exactly this sheet. Look at {}\n",
            pictures.fidelity.mean,
            target.join("sheet.png").display()
        ))?;
    }
    args.deliver.send(&document.name, &print.job, observer)
}

/// What there is to look at, and how far print and document are apart.
struct Pictures {
    sheet: RgbImage,
    materials: RgbImage,
    fidelity: preview::Report,
}

fn pictures(
    document: &Document,
    print: &Print,
    library: &inks::Library,
    probe: &Probe,
    observer: &dyn Observer,
) -> Result<Pictures> {
    let space = &print.factored.space;
    // The document by itself: the simulated page was compared dot for dot with the one laid out from it, and what mirror and
    // machine profile do to the page is undone on paper.
    let halftoned = &print.halftoned;
    let stacks = pipeline::stack_table(halftoned, library, space);
    let area = Area::whole(halftoned);
    let target = match document.as_factored() {
        Some(factored) => Source::Factored(factored),
        None => Source::Document(document.materials()),
    };
    let printed = Source::Print { sheet: halftoned, space, stacks: &stacks, area };
    let fidelity = preview::fidelity(&target, &printed, (area.width, area.length), EYE, observer)?;
    let (width, height) = (Mm::of_dots(area.width as i64).0, Mm::of_dots(area.length as i64).0);
    let notes = [
        format!("{width:.0} x {height:.0} mm, {} passes", print.separation.passes.len()),
        format!("seen from {EYE} m: mean d {:.3}, 95 % below {:.3}", fidelity.mean, fidelity.p95),
    ];
    let sheet =
        preview::sheet_picture(&target, &printed, &STANDARD_LIGHTS, PANEL, &document.name, &notes, observer)?;
    let swatches: Vec<Swatch> = (1..)
        .zip(&print.mapped.report.bases)
        .map(|(number, basis)| Swatch {
            name: format!("basis {number}"),
            target: &basis.target,
            printed: &basis.printed,
            mix: basis.weights.clone(),
        })
        .collect();
    let materials = preview::materials_picture(space, &swatches, probe, BALL, observer)?;
    Ok(Pictures { sheet, materials, fidelity })
}

/// Everything that is known of a print, for programs.
fn report(
    document: &Document,
    settings: &pipeline::Settings,
    print: &Print,
    plan: &Plan,
    fidelity: &preview::Report,
) -> serde_json::Value {
    let mapped = &print.mapped.report;
    let bases: Vec<_> = mapped
        .bases
        .iter()
        .map(|basis| {
            let mix: Vec<_> = basis
                .weights
                .iter()
                .map(|(stack, weight)| json!({ "stack": stack, "weight": weight }))
                .collect();
            json!({
                "distance": basis.distance, "unscaled_distance": basis.unscaled_distance, "mix": mix,
                "gap": basis.gap, "gap_is_a_bound": basis.convex, "starts": basis.starts,
                "starts_agreeing": basis.agreeing, "pruning_cost": basis.pruning_cost,
            })
        })
        .collect();
    let given_up: Vec<_> = mapped
        .given_up
        .iter()
        .map(|g| json!({ "ink": g.ink.name(), "distance_before": g.before, "distance_after": g.after }))
        .collect();
    let pixels = mapped.pixels.map(|p| {
        json!({
            "rmse": p.rms, "p95": p.p95, "max": p.max, "largest_gap": p.gap,
            "merged_pairs": p.merged, "clamped_share": p.clamped,
        })
    });
    json!({
        "program": concat!("foilpress ", env!("CARGO_PKG_VERSION")),
        "document": { "name": document.name, "sha256": document.digest, "notes": document.notes },
        "seed": settings.factor.seed,
        "factoring": print.factoring,
        "gamut": {
            "intent": mapped.intent, "gloss_scale": mapped.gloss_scale, "bases": bases,
            "given_up": given_up, "pixels": pixels,
        },
        "plan": plan,
        "job": { "bytes": print.job.len() },
        "fidelity": {
            "eye_m": EYE, "mean": fidelity.mean, "rmse": fidelity.rmse, "p95": fidelity.p95, "max": fidelity.max,
        },
        // `pipeline::print` compares the sheets dot for dot and fails if they differ.
        "simulated": { "equal": true },
    })
}
