//! `foilpress preview`: a document or a sheet as it looks, under any light and from any direction.

pub mod figure;
pub mod subject;
pub mod view;
mod wear;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use ::view::{Glb, Lit, Renderer, finer, glb, places_for_dot_gain, proportions};
use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use make::shown::png;
use make::view::Show;
use observe::Observer;
use press::preview::{Probe, Radiance};
use serde_json::json;

use self::figure::Figure;
use self::subject::PreviewSubject;
use self::view::ViewArgs;
use self::wear::{Told, WearArgs};
use crate::cli::arguments::choice::whole;
use crate::cli::arguments::document_dots::DotsArgs;
use crate::cli::commands::preset::PresetArg;
use crate::cli::console::{stdout, usage};
use crate::cli::output::Staged;

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Page,
    Png,
    Exr,
    /// A material, which needs no light.
    Glb,
}

/// Arguments of `preview`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress preview sample:leaf -o leaf.html\n  \
    foilpress preview sample:card -o card.png --light -40,30 --view 20,10 --curl 0.1\n  \
    foilpress preview sample:dove -o dove.exr --show document --light 0,60,0.5 --distance far\n  \
    foilpress preview sample:leaf -o near.png --zoom 40 --middle 20x30mm --seen-from 0.5m\n  \
    foilpress preview sample:leaf -o leaf.glb                              (for other renderers)\n  \
    foilpress preview sample:dove -o dove.png --figure weights             (figures of the paper)\n\n\
    DOC may also be a job (.rgl), or a folder written by `print`, `halftone`, `layout` or `simulate`;\n\
    these show printed dots alone.\n\
    Angles are in degrees: the first to the right, the second upwards; 0,0 is straight above the sheet. All lights have the\n\
    same strength at the middle of the sheet. A page has controls for everything and shows the document, its mixture of\n\
    inks, the print, their difference, the stacks and the passes; it opens from a disk and needs no network."
)]
pub struct Args {
    #[command(flatten)]
    dots: DotsArgs,
    #[command(flatten)]
    preset: PresetArg,
    /// File to write: a page (.html), a picture (.png), linear radiance (.exr), or a glTF material (.glb)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    /// Draw a figure of the 2009 paper of this document instead (.png)
    #[arg(long, value_name = "FIGURE", value_enum)]
    figure: Option<Figure>,
    /// Pixels of the longer side of a picture or texture
    #[arg(long, value_name = "PIXELS", default_value_t = 1024, value_parser = whole(16..=8192u16))]
    pixels: u16,
    #[command(flatten)]
    wear: WearArgs,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs `preview`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let format = format(&args.output)?;
    if args.view.light.len() > 4 {
        bail!("--light: at most four lights, not {}", args.view.light.len());
    }
    if format == Format::Glb && args.view.has_lights() {
        bail!(
            "{}: a .glb has no lights; leave --light, --light-probe, --exposure and --tone-curve out",
            args.output.display()
        );
    }
    if format == Format::Glb && args.view.has_part() {
        bail!("{}: a .glb is the whole sheet; leave --zoom and --middle out", args.output.display());
    }
    if args.view.seen_from.is_some() && format == Format::Page {
        bail!("--seen-from: a page shows dots as they are, at whatever zoom; write a picture (.png or .exr)");
    }
    if args.view.seen_from.is_some() && format == Format::Glb {
        bail!("--seen-from: a .glb is the material, whoever looks at it; write a picture (.png or .exr)");
    }
    if format == Format::Exr && args.view.has_tone() {
        bail!("{}: an .exr holds radiance; leave --exposure and --tone-curve out", args.output.display());
    }
    let probe = args.view.light_probe.as_deref().map(Probe::read).transpose()?;
    let staged = Staged::file(&args.output)?;
    if let Some(figure) = args.figure {
        return draw_figure(args, figure, format, probe, staged, observer);
    }
    let (what, is_page) = (args.view.show.unwrap_or(Show::Printed), format == Format::Page);
    let with_bases = what != Show::Printed || is_page;
    args.wear.check(what == Show::Printed || is_page, is_page)?;
    let mut shown = PreviewSubject::open(&args.dots, with_bases, observer)?;
    shown.worn = args.wear.apply(&mut shown.dots, &shown.library)?;
    let subject = shown;
    let shown = subject.shown();
    if shown.target.is_none() && what != Show::Printed {
        bail!(
            "--show {}: {} has printed dots and no document; leave --show out, or name a document",
            if what == Show::Document { "document" } else { "mapped" },
            args.dots.document.path().display()
        );
    }
    let (tone, (width, height)) = if is_page {
        let page = shown.page(&args.view.view(shown.size(), probe)?, observer)?;
        fs::write(staged.path(), page.html)
            .with_context(|| format!("cannot write {}", args.output.display()))?;
        (page.tone, page.pixels)
    } else {
        let (size, stacks) = (shown.size(), shown.stacks());
        let (width, height) = proportions(size, args.pixels.into());
        let lit = |pixels: f64| -> Result<Lit> {
            // A .glb has no dots to look at.
            let mut places = match format {
                Format::Glb => usize::from(args.pixels).clamp(64, 2048),
                _ => shown.places(what, pixels),
            };
            if args.wear.dot_gain.is_some() {
                places = places.max(places_for_dot_gain(size)).min(2048);
            }
            let lit = Lit::new(&shown.source(what, &stacks), size, places)?;
            Ok(match args.wear.dot_gain {
                Some(n) => lit.with_dot_gain(shown.space, n),
                None => lit,
            })
        };
        let pixels = f64::from(args.pixels);
        if format == Format::Glb {
            let glb = glb(&lit(pixels)?, shown.space, shown.name, observer)?;
            return write_glb(args, &glb, &subject, staged);
        }
        let view = args.view.view(size, probe)?;
        let scene = view.scene(size, width as f64 / height as f64)?;
        let pixels = pixels * args.view.zoom;
        let radiance = match args.view.seen_from {
            Some(metres) => {
                let (finer, enough) = finer(&scene.camera, width, height, metres);
                if !enough {
                    observer.note(
                        "the picture is coarser than what an eye sees from there; take more --pixels or a larger --zoom",
                    );
                }
                let lit = lit(pixels * finer as f64)?;
                Renderer::new(&lit).seen_from(&scene, (width, height), metres, finer, observer)?
            }
            None => Renderer::new(&lit(pixels)?).render(&scene, width, height, observer)?,
        };
        if radiance.pixels.iter().all(|[light @ .., _]| *light == [0.0; 3]) {
            observer.note("no light falls on what is seen of the sheet, so all of it is black; --light 0,0 is straight above it");
        }
        let tone = view.tone(&radiance);
        match format {
            Format::Exr => write_exr(&radiance, staged.path())?,
            _ => fs::write(staged.path(), png(&radiance, tone)?)?,
        }
        (tone, (width, height))
    };
    let bytes = fs::metadata(staged.path()).map_or(0, |found| found.len());
    staged.commit()?;
    let mut out = stdout();
    if args.json {
        let size_mm = shown.size().map(|side| side * 1000.0);
        let report = json!({
            "written": args.output.display().to_string(), "bytes": bytes, "name": shown.name, "size_mm": size_mm,
            "pixels": [width, height], "exposure_stops": tone.in_stops(), "tone_curve": tone.knee, "zoom": args.view.zoom,
            "seen_from_mm": args.view.seen_from.map(|metres| 1000.0 * metres), "worn": subject.worn.as_ref().map(Told::json),
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{} ({:.1} MB)", args.output.display(), bytes as f64 / 1e6)?;
        subject.say(&mut out)?;
    }
    Ok(())
}

/// Writes a figure.
fn draw_figure(
    args: &Args,
    figure: Figure,
    format: Format,
    probe: Option<Probe>,
    staged: Staged,
    observer: &dyn Observer,
) -> Result<()> {
    if format != Format::Png {
        bail!("{}: a figure is a picture; name a .png", args.output.display());
    }
    let probe = probe.unwrap_or_else(|| Probe::studio(128));
    let picture = figure::figure(figure, &args.dots, &probe, observer)?;
    fs::write(staged.path(), picture.png()?)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    staged.commit()?;
    let (width, height) = picture.size();
    let mut out = stdout();
    if args.json {
        let report = json!({ "written": args.output.display().to_string(), "pixels": [width, height] });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{} ({width} x {height} pixels)", args.output.display())?;
    }
    Ok(())
}

fn format(output: &Path) -> Result<Format> {
    let ending = output.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("html" | "htm") => Ok(Format::Page),
        Some("png") => Ok(Format::Png),
        Some("exr") => Ok(Format::Exr),
        Some("glb") => Ok(Format::Glb),
        _ => Err(usage(format!(
            "{}: the name of the file must end in .html, .png, .exr or .glb",
            output.display()
        ))),
    }
}

fn write_glb(args: &Args, glb: &Glb, shown: &PreviewSubject, staged: Staged) -> Result<()> {
    fs::write(staged.path(), &glb.bytes)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    staged.commit()?;
    let mut out = stdout();
    let Glb { bytes, texels, distance, worst } = glb;
    if args.json {
        let size_mm = shown.size().map(|side| side * 1000.0);
        let report = json!({
            "written": args.output.display().to_string(), "bytes": bytes.len(), "name": shown.name, "size_mm": size_mm,
            "pixels": texels, "distance": distance, "worst": worst, "worn": shown.worn.as_ref().map(Told::json),
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{} ({:.1} MB)", args.output.display(), bytes.len() as f64 / 1e6)?;
        writeln!(
            out,
            "one lobe a texel, and a clear coat: difference d {distance:.3} (root mean square), {worst:.3} at worst; 0.01 is barely visible"
        )?;
        shown.say(&mut out)?;
    }
    Ok(())
}

/// Linear radiance with coverage as premultiplied alpha.
fn write_exr(radiance: &Radiance, path: &Path) -> Result<()> {
    Ok(fs::write(path, readers::open_exr(&radiance.pixels, (radiance.width, radiance.height))?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_decides_what_is_written() {
        assert_eq!(format(Path::new("a/leaf.HTML")).unwrap(), Format::Page);
        assert!(format(Path::new("leaf.jpg")).unwrap_err().to_string().contains(".html, .png, .exr or .glb"));
        assert!(format(Path::new("leaf")).is_err());
    }
}
