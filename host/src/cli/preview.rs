//! `foilpress preview`: a document or a sheet as it looks, under any light and from any direction.

mod wear;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, ValueEnum};
use image::{DynamicImage, ImageFormat, Rgba32FImage};
use inks::Library;
use serde_json::json;

use self::wear::{Told, WearArgs};
use super::output::Staged;
use super::preset::PresetArg;
use super::print::{DotsArgs, Laid};
use super::stdio::read_job;
use appearance::brdf::{Space, reflectances};
use appearance::document::SAMPLES;
use appearance::factor::{self, Factored};
use observe::Observer;
use press::layout::Mm;
use press::pipeline::document::factored;
use press::preview::{Exposure, Probe, Radiance, Source, mix_in_words, picture};
use press::sheet::{Area, DotMap, Sheet};
use press::simulate;
use view::page::{Subject, Target, page};
use view::{
    Camera, Glb, Light, Lit, Pose, Renderer, Scene, direction, glb, mapped, places_for_dot_gain, proportions,
};

/// Bases of a document whose print needs none, so that the picture of it is close.
pub const BASES: usize = 12;

/// Pixels of the longer side of the picture in the page.
const STILL: usize = 800;

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Show {
    /// The document itself
    Document,
    /// The mixtures of inks that stand for it
    Mapped,
    /// The printed dots
    Printed,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// A material, which needs no light.
    Glb,
    Lit(Picture),
}

/// What shows the sheet under light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Picture {
    Page,
    Png,
    Exr,
}

/// A direction in degrees: azimuth to the right, elevation upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Degrees(f64, f64);

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
struct Lamp(Degrees, Option<f64>);

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
struct Distance(Option<f64>);

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

/// Arguments of `preview`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress preview sample:leaf -o leaf.html\n  \
    foilpress preview sample:card -o card.png --light -40,30 --view 20,10 --curl 0.1\n  \
    foilpress preview sample:dove -o dove.exr --show document --light 0,60,0.5 --distance far\n  \
    foilpress preview sample:leaf -o leaf.glb                              (for other renderers)\n\n\
    DOC may also be a job (.rgl), or a folder written by `halftone`, `layout` or `simulate`; these show printed dots alone.\n\
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
    /// What to show first or in a picture [default: printed]
    #[arg(long, value_name = "WHAT", value_enum)]
    show: Option<Show>,
    /// Direction of a light, with its distance in metres if it is near; up to four times [default: -25,30,0.6]
    #[arg(long, value_name = "AZ,EL[,M]", allow_hyphen_values = true)]
    light: Vec<Lamp>,
    /// Light from everywhere: a latitude-longitude panorama (.hdr) [default: none; a page has a soft studio to switch on]
    #[arg(long, value_name = "FILE")]
    light_probe: Option<PathBuf>,
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
    /// Pixels of the longer side of a picture or texture
    #[arg(long, value_name = "PIXELS", default_value_t = 1024, value_parser = clap::value_parser!(u16).range(16..=8192))]
    pixels: u16,
    #[command(flatten)]
    wear: WearArgs,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

fn stops(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(stops) if (-10.0..=10.0).contains(&stops) => Ok(stops),
        _ => Err("expected a number of stops from -10 to 10, such as -1 or 0.5".into()),
    }
}

/// What there is to show.
struct Shown {
    name: String,
    space: Space,
    library: Library,
    dots: DotMap,
    target: Option<Both>,
    /// What a worn printer made of the dots.
    worn: Option<Told>,
}

/// A document and its mixture of inks.
struct Both {
    document: Factored,
    mapped: Factored,
    mixtures: Vec<String>,
}

/// Runs `preview`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let format = format(&args.output)?;
    if args.light.len() > 4 {
        bail!("--light: at most four lights, not {}", args.light.len());
    }
    if format == Format::Glb && args.has_lights() {
        bail!(
            "{}: a .glb has no lights; leave --light, --light-probe and --exposure out",
            args.output.display()
        );
    }
    let probe = args.light_probe.as_deref().map(Probe::read_hdr).transpose()?;
    let staged = Staged::file(&args.output)?;
    let what = args.show.unwrap_or(Show::Printed);
    args.wear.check(
        what == Show::Printed || format == Format::Lit(Picture::Page),
        format == Format::Lit(Picture::Page),
    )?;
    let mut shown = Shown::open(&args.dots, observer)?;
    shown.worn = args.wear.apply(&mut shown.dots, &shown.library)?;
    if shown.target.is_none() && what != Show::Printed {
        bail!(
            "--show {}: {} has printed dots and no document; leave --show out, or name a document",
            if what == Show::Document { "document" } else { "mapped" },
            args.dots.document.document
        );
    }
    let longest = if format == Format::Lit(Picture::Page) { STILL } else { args.pixels.into() };
    let size = shown.size();
    let stacks = reflectances(shown.dots.stacks(), &shown.library, &shown.space);
    let print = Source::Print {
        dots: &shown.dots,
        space: &shown.space,
        stacks: &stacks,
        area: Area::whole(&shown.dots),
    };
    let source = match (what, &shown.target) {
        (Show::Document, Some(both)) => Source::Factored(&both.document),
        (Show::Mapped, Some(both)) => Source::Factored(&both.mapped),
        _ => print,
    };
    // Fine enough for the picture and never much finer.
    let mut places = longest.clamp(64, 2048);
    if args.wear.dot_gain.is_some() {
        places = places.max(places_for_dot_gain(size)).min(2048);
    }
    let mut lit = Lit::new(&source, size, places)?;
    if let Some(n) = args.wear.dot_gain {
        lit = lit.with_dot_gain(&shown.space, n);
    }
    let Format::Lit(picture) = format else {
        return write_glb(args, &glb(&lit, &shown.space, &shown.name, observer)?, &shown, staged);
    };
    let (width, height) = proportions(size, longest);
    let scene = args.scene(size, width as f64 / height as f64, probe.clone());
    let radiance = Renderer::new(&lit).render(&scene, width, height, observer)?;
    let exposure = match args.exposure {
        Some(stops) => Exposure(Exposure::PAPER.0 * stops.exp2()),
        None => Exposure::of(std::slice::from_ref(&radiance)),
    };
    match picture {
        Picture::Png => write_png(&radiance, exposure, staged.path())?,
        Picture::Exr => write_exr(&radiance, staged.path())?,
        Picture::Page => {
            let still = png(&radiance, exposure)?;
            let start = args.fragment(exposure, what, shown.target.is_some(), probe.is_some());
            let studio = Probe::studio(64);
            let about = shown.about();
            let subject = Subject {
                name: &shown.name,
                about: &about,
                size,
                target: shown.target.as_ref().map(|both| Target {
                    document: &both.document,
                    mapped: &both.mapped,
                    mixtures: &both.mixtures,
                }),
                dots: &shown.dots,
                stacks: &stacks,
                space: &shown.space,
                probe: probe.as_ref().unwrap_or(&studio),
                start: &start,
                still: &still,
            };
            fs::write(staged.path(), page(&subject, observer)?)
                .with_context(|| format!("cannot write {}", args.output.display()))?;
        }
    }
    let bytes = fs::metadata(staged.path()).map_or(0, |found| found.len());
    staged.commit()?;
    let mut out = std::io::stdout().lock();
    if args.json {
        let size_mm = size.map(|side| side * 1000.0);
        let stops = f64::from(exposure.0 / Exposure::PAPER.0).log2();
        let report = json!({
            "written": args.output.display().to_string(), "bytes": bytes, "name": shown.name, "size_mm": size_mm,
            "pixels": [width, height], "exposure_stops": stops, "worn": shown.worn.as_ref().map(Told::json),
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{} ({:.1} MB)", args.output.display(), bytes as f64 / 1e6)?;
        shown.say(&mut out)?;
    }
    Ok(())
}

impl Args {
    fn scene(&self, size: [f64; 2], aspect: f64, probe: Option<Probe>) -> Scene {
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

    /// The lights named; without any and without a probe, one.
    fn lamps(&self) -> Vec<Lamp> {
        if self.light.is_empty() && self.light_probe.is_none() {
            return vec![Lamp(Degrees(-25.0, 30.0), Some(0.6))];
        }
        self.light.clone()
    }

    fn has_lights(&self) -> bool {
        !self.light.is_empty() || self.light_probe.is_some() || self.exposure.is_some()
    }

    /// The same scene as the page's address holds it.
    fn fragment(&self, exposure: Exposure, what: Show, both: bool, probe: bool) -> String {
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
            _ => format!("show={}", name(what)),
        };
        format!(
            "{shows}&light={}&probe={}&view={},{}&distance={}&tilt={},{}&curl={}&exposure={:.2}",
            lights.join(";"),
            u8::from(probe),
            self.view.0,
            self.view.1,
            self.distance.0.unwrap_or(0.0),
            self.tilt.0,
            self.tilt.1,
            self.curl.unwrap_or(0.0),
            f64::from(exposure.0 / Exposure::PAPER.0).log2(),
        )
    }
}

impl Shown {
    fn open(work: &DotsArgs, observer: &dyn Observer) -> Result<Shown> {
        let path = Path::new(&work.document.document);
        if let Some(dots) = printed(path, observer)? {
            let name =
                path.file_stem().map_or_else(|| "sheet".into(), |stem| stem.to_string_lossy().into_owned());
            let library = work.inks.library()?;
            return Ok(Shown {
                name,
                space: Space::half_angle(SAMPLES),
                library,
                dots,
                target: None,
                worn: None,
            });
        }
        let Laid { document, library, settings, halftoned, .. } = work.laid(observer)?;
        let space = document.materials().space().clone();
        let uses_bases = halftoned.mapped.report.intent.uses_bases();
        let bases = settings.factor.bases.or((!uses_bases).then_some(BASES));
        let bases =
            factored(&document, &factor::Settings { bases, ..settings.factor }, observer)?.0.into_owned();
        let mix = &halftoned.mapped.mix;
        let words = |row: &Vec<u16>| {
            let parts = mix.stacks.iter().cloned().zip(row.iter().map(|&share| f64::from(share)));
            mix_in_words(&parts.filter(|(_, share)| *share > 0.0).collect::<Vec<_>>())
        };
        let both = Both {
            document: bases,
            mapped: mapped(mix, &library, &space),
            mixtures: mix.matrix.iter().map(words).collect(),
        };
        Ok(Shown {
            name: document.name,
            space,
            library,
            dots: halftoned.dots,
            target: Some(both),
            worn: None,
        })
    }

    /// Width and height in metres.
    fn size(&self) -> [f64; 2] {
        [self.dots.width(), self.dots.length()].map(|dots| Mm::of_dots(dots as i64).0 / 1000.0)
    }

    fn about(&self) -> String {
        let [width, height] = self.size().map(|side| side * 1000.0);
        let stacks = self.dots.census().iter().filter(|&&dots| dots > 0).count();
        format!(
            "{width:.0} x {height:.0} mm, {:.1} million dots of {stacks} {}",
            self.dots.index().len() as f64 / 1e6,
            if stacks == 1 { "stack" } else { "stacks" }
        ) + &self.worn.as_ref().map_or_else(String::new, |worn| format!(", {}", worn.brief()))
    }

    /// Says what a worn printer made of the dots.
    fn say(&self, out: &mut dyn std::io::Write) -> std::io::Result<()> {
        self.worn.as_ref().map_or(Ok(()), |worn| worn.write(out))
    }
}

/// The dots of a job or of a folder with a sheet; nothing for a document.
pub fn printed(path: &Path, observer: &dyn Observer) -> Result<Option<DotMap>> {
    if path.join("dots.toml").is_file() {
        return Ok(Some(DotMap::load(path)?));
    }
    if path.join("sheet.toml").is_file() {
        return Ok(Some(Sheet::load(path)?.dots().clone()));
    }
    if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rgl")) {
        return Ok(None);
    }
    let job = read_job(path)?;
    let printout = simulate::print(&job, &simulate::Setup::default(), observer)
        .with_context(|| format!("{}", path.display()))?;
    Ok(Some(printout.sheet()?.dots().clone()))
}

fn format(output: &Path) -> Result<Format> {
    let ending = output.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("html" | "htm") => Ok(Format::Lit(Picture::Page)),
        Some("png") => Ok(Format::Lit(Picture::Png)),
        Some("exr") => Ok(Format::Lit(Picture::Exr)),
        Some("glb") => Ok(Format::Glb),
        _ => bail!("{}: the name of the file must end in .html, .png, .exr or .glb", output.display()),
    }
}

fn png(radiance: &Radiance, exposure: Exposure) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture(radiance, exposure)?.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

fn write_png(radiance: &Radiance, exposure: Exposure, path: &Path) -> Result<()> {
    Ok(fs::write(path, png(radiance, exposure)?)?)
}

fn write_glb(args: &Args, glb: &Glb, shown: &Shown, staged: Staged) -> Result<()> {
    fs::write(staged.path(), &glb.bytes)
        .with_context(|| format!("cannot write {}", args.output.display()))?;
    staged.commit()?;
    let mut out = std::io::stdout().lock();
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
            "one lobe a texel: difference d {distance:.3} (root mean square), {worst:.3} at worst; 0.01 is barely visible"
        )?;
        shown.say(&mut out)?;
    }
    Ok(())
}

/// Linear radiance with coverage as premultiplied alpha.
fn write_exr(radiance: &Radiance, path: &Path) -> Result<()> {
    let values = radiance.pixels.iter().flatten().copied().collect();
    let (width, height) = (u32::try_from(radiance.width)?, u32::try_from(radiance.height)?);
    let image = Rgba32FImage::from_raw(width, height, values).context("a picture has four values a pixel")?;
    Ok(DynamicImage::ImageRgba32F(image).save_with_format(path, ImageFormat::OpenExr)?)
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
        assert!("1,2,3".parse::<Degrees>().unwrap_err().contains("30,15"));
    }

    #[test]
    fn the_ending_decides_what_is_written() {
        assert_eq!(format(Path::new("a/leaf.HTML")).unwrap(), Format::Lit(Picture::Page));
        assert!(format(Path::new("leaf.jpg")).unwrap_err().to_string().contains(".html, .png, .exr or .glb"));
        assert!(format(Path::new("leaf")).is_err());
    }
}
