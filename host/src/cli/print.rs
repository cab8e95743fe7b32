//! `foilpress print`: a document in, a folder with the job and everything to look at out.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use image::RgbImage;
use serde_json::json;

use super::args::{DocumentArgs, FactorArgs, GamutArgs, InkArgs, MediaArgs, PageArgs};
use super::output::{self, Kind, Staged};
use super::send::deliver;
use crate::document::Document;
use crate::job::plan::Plan;
use crate::observe::Observer;
use crate::pipeline::{self, Print};
use crate::preview::{self, Area, Probe, STANDARD_LIGHTS, Source, Swatch};
use crate::send::Destination;
use crate::separate;

/// Pixels of the longer side of a panel in `sheet.png`.
const PANEL: usize = 480;
/// Pixels across a ball in `materials.png`.
const BALL: usize = 160;
/// Where the eye is when print and document are compared, in metres.
const EYE: f64 = 0.5;

/// Arguments of `print`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress print sample:leaf\n  \
    foilpress print my-material/ --size 120x90mm --bases 8 --to file:job.rgl\n  \
    foilpress print helmet.gltf --material 0 --factor sacls --intent clamp\n  \
    foilpress print sample:card --inks all          (with foils)")]
pub struct Args {
    #[command(flatten)]
    document: DocumentArgs,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    factor: FactorArgs,
    #[command(flatten)]
    gamut: GamutArgs,
    #[command(flatten)]
    inks: InkArgs,
    /// Light probe (.hdr) for the balls in materials.png [default: a soft studio]
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    /// Also send the job there: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    #[arg(long, value_name = "WHERE")]
    to: Option<Destination>,
    /// Send also to a printer that says it is no ALPS
    #[arg(long, requires = "to")]
    force: bool,
    /// Folder to write [default: NAME.print in the current folder]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print the report instead of the plan in words
    #[arg(long)]
    json: bool,
}

/// Runs `print`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let (inks, library) = args.inks.at_hand()?;
    let probe = match &args.probe {
        Some(path) => Probe::read_hdr(path)?,
        None => Probe::studio(128),
    };
    let document = args.document.open(observer)?;
    let target =
        args.output.clone().unwrap_or_else(|| format!("{}.print", output::file_name(&document.name)).into());
    let to_file = match &args.to {
        Some(Destination::File(path)) => Some(path),
        _ => None,
    };
    if let Some(to) = to_file
        && absolute(to)?.starts_with(absolute(&target)?)
    {
        bail!(
            "--to {} lies in {}, which is written whole; choose another place",
            to.display(),
            target.display()
        );
    }
    let staged = Staged::folder(&target, Kind::Print)?;
    let also = to_file.map(|path| Staged::file(path)).transpose()?;

    let settings = pipeline::Settings {
        factor: args.factor.settings(),
        gamut: args.gamut.settings(args.factor.seed),
        inks,
        paper: args.page.paper,
        media: args.media.media,
        size: args.page.size,
    };
    let print = pipeline::print(&document, &library, &settings, observer)?;
    let plan = Plan::new(&document.name, &print.sheet, &print.placement, &print.separation, &library);

    let folder = staged.create()?;
    write(&folder.join("job.rgl"), &print.job)?;
    let passes = folder.join("passes");
    fs::create_dir(&passes).with_context(|| format!("cannot write {}", passes.display()))?;
    separate::files::save(&print.separation, &passes)?;
    let pictures = pictures(&document, &print, &library, &probe, observer)?;
    for (name, picture) in [("sheet.png", &pictures.sheet), ("materials.png", &pictures.materials)] {
        picture.save(folder.join(name)).with_context(|| format!("cannot write {name}"))?;
    }
    print.sheet.save_colours(Area::of(&print.placement), &folder.join("separation.png"))?;
    let report = report(&document, &settings, &print, &plan, &pictures.fidelity);
    let report = serde_json::to_string_pretty(&report)?;
    write(&folder.join("report.json"), report.as_bytes())?;
    if let Some(also) = &also {
        write(also.path(), &print.job)?;
    }
    staged.commit()?;
    if let Some(also) = also {
        also.commit()?;
    }

    if args.json {
        super::show(&format!("{report}\n"))?;
    } else {
        super::show(&format!(
            "{plan}\nSeen from {EYE} m the print differs from the document by d = {:.3} on average (0.01 is hard to see, \
             0.05 plain).\nThe simulated printer made exactly this sheet. Look at {}\n",
            pictures.fidelity.mean,
            target.join("sheet.png").display()
        ))?;
    }
    match &args.to {
        Some(to @ (Destination::Raw(_) | Destination::Bridge(_))) => {
            deliver(&document.name, &print.job, to, args.force, observer)
        }
        _ => Ok(()),
    }
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).with_context(|| format!("`{}` is no path", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
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
    let stacks = pipeline::stack_table(&print.printed, library, space);
    let area = Area::of(&print.placement);
    let target = match document.as_factored() {
        Some(factored) => Source::Factored(factored),
        None => Source::Document(document.materials()),
    };
    let printed = Source::Print { sheet: &print.printed, space, stacks: &stacks, area };
    let fidelity = preview::fidelity(&target, &printed, (area.width, area.length), EYE, observer)?;
    let (width, height) = crate::job::placement::size_mm(&print.placement);
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
