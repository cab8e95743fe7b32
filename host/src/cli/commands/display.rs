//! `foilpress display`: a printed grid of stacks, and what a screen over it has to show (figure 12 of the 2009 paper).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use appearance::brdf::Space;
use appearance::document::{Document, SAMPLES, name_of, same_shape};
use appearance::materials::{Materials, Reduced, resolution};
use clap::Args as ClapArgs;
use files::shelf::Disk;
use inks::{InkSet, Library, Stack};
use make::Made;
use press::layout::{Layout, Mm, Point};
use press::preview::{Radiance, ToneCurve, picture};
use rayon::prelude::*;
use readers::Pixels;
use serde_json::{Value, json};
use view::direction;
use view::display::{
    Frame, Grid, LONGEST, Matte, Placed, Screen, Sight, Target, choose, is_picture, page, picture_of,
};

use crate::cli::arguments::choice::whole;
use crate::cli::arguments::{DocumentArgs, InkArgs};
use crate::cli::output::write;
use crate::cli::printing::{JobArgs, Places};
use observe::Observer;

/// Stacks of a grid where none are named.
const USUAL: usize = 4;
/// The most images of one display.
const MOST_FRAMES: usize = 999;
/// The pictures show it under a light this far to the left of the eye, in degrees: near its highlight and away from it.
const LIGHTS: [f64; 2] = [-20.0, -60.0];
/// Pixels that the longer side of such a picture has at least, where the image is smaller.
const LEAST: usize = 480;
/// Pixels between the two.
const GAP: usize = 16;

/// Arguments of `display`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress display sample:leaf --pixels 96 --pitch 0.28mm --mask-size 1920x1080 -o wall/\n  \
    foilpress display white.png gold.png --pixels 80 --pitch 0.28mm --mask-size 1920x1080\n  \
    foilpress display sample:card --stacks MS+F,K,W+C,MG --pixels 64 --pitch 0.6mm --mask-size 800x600\n  \
    foilpress display sample:leaf --pixels 40 --cell 4 --depth 0.7mm --pitch 0.3mm --mask-size 800x600\n\n\
    Print the grid, lay the screen on it, show mask-align.png, and move the screen until the slits at\n\
    the corners are dark. Then show mask-001.png and so on. display.html shows masks and results, moves\n\
    light, eye and screen, and plays the frames. docs/guide/display.md shows it step by step."
)]
pub struct Args {
    /// Images to show, one a frame: plain pictures or documents of the same proportions
    ///
    /// The colours of plain pictures (.png, .jpg, .tif) are taken as matte. Documents are named as for `print`. Larger ones
    /// are averaged to the pixels of the smallest.
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<String>,
    /// Distance from one pixel of the screen to the next, such as 0.28mm
    #[arg(long, value_name = "LENGTH")]
    pitch: Mm,
    /// Pixels of the screen, across and down, such as 1920x1080
    ///
    /// The masks have as many.
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = pixels)]
    mask_size: (u32, u32),
    /// Pixels of the longer side [default: those of the images]
    ///
    /// Larger images are averaged.
    #[arg(long, value_name = "PIXELS", value_parser = whole(1..=LONGEST))]
    pixels: Option<u32>,
    /// Screen pixels along each side of a printed cell
    #[arg(long, value_name = "PIXELS", default_value_t = 1, value_parser = whole(1..=LONGEST))]
    cell: u32,
    /// Stacks of the grid, such as MS+F,MS,K,W [default: the best four]
    ///
    /// 2 to 9, separated by commas. [default: the four that show the images best]
    #[arg(long, value_name = "STACKS", value_delimiter = ',')]
    stacks: Vec<Stack>,
    /// Shares of the light that pass an open and a closed pixel of the screen once
    #[arg(long, value_name = "OPEN,CLOSED", default_value = "0.3,0.001", value_parser = transmission)]
    transmission: (f64, f64),
    /// Show what is seen when the screen lies this far right and down of its place, such as 0.1,0.05mm
    #[arg(long, value_name = "X,Y", default_value = "0,0mm", allow_hyphen_values = true)]
    shift: Point,
    /// Show what is seen when so much glass lies between the print and the screen's pixels
    #[arg(long, value_name = "LENGTH", default_value = "0mm")]
    depth: Mm,
    #[command(flatten)]
    inks: InkArgs,
    #[command(flatten)]
    job: JobArgs,
}

fn pixels(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.trim().parse::<u32>().ok().filter(|side| (1..=LONGEST).contains(side));
    text.split_once('x')
        .and_then(|(across, down)| Some((side(across)?, side(down)?)))
        .ok_or_else(|| format!("expected pixels across x down, such as 1920x1080, each from 1 to {LONGEST}"))
}

fn transmission(text: &str) -> Result<(f64, f64), String> {
    let share = |text: &str| text.trim().parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    text.split_once(',')
        .and_then(|(open, closed)| Some((share(open)?, share(closed)?)))
        .filter(|(open, closed)| open > closed)
        .ok_or_else(|| "expected two shares, the larger one first, such as 0.3,0.001".into())
}

/// One image to show.
enum Image {
    Matte(Matte),
    Document(Box<Document>),
}

impl Image {
    fn open(name: &str, observer: &dyn Observer) -> Result<Image> {
        let path = Path::new(name);
        if is_picture(path) {
            return Ok(Image::Matte(Matte::read(path, Space::half_angle(SAMPLES))?));
        }
        let document = DocumentArgs::named(name.into());
        let at_hand = || InkArgs::of(None, None).at_hand();
        Ok(Image::Document(Box::new(document.open(at_hand, observer)?)))
    }

    fn materials(&self) -> &dyn Materials {
        match self {
            Image::Matte(matte) => matte,
            Image::Document(document) => document.materials(),
        }
    }

    /// What its reader had to assume.
    fn notes(&self) -> &[String] {
        match self {
            Image::Matte(_) => &[],
            Image::Document(document) => &document.notes,
        }
    }
}

/// Runs `display`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    if args.images.len() > MOST_FRAMES {
        bail!("{} images; a display has at most {MOST_FRAMES}", args.images.len());
    }
    if args.depth.0 < 0.0 {
        bail!("--depth {}mm: the print lies behind the screen, so the depth is 0 or more", args.depth.0);
    }
    let (set, library) = args.inks.at_hand()?;
    let layout = args.job.layout.layout(observer)?;
    let places = Places::new(&args.name(), &args.job.result, &args.job.deliver)?;
    let images = args.images.iter().map(|name| Image::open(name, observer)).collect::<Result<Vec<_>>>()?;
    let shape = args.shape(&images)?;
    let reduced: Vec<Reduced> = images.iter().map(|image| Reduced::new(image.materials(), shape)).collect();
    let sources: Vec<&dyn Materials> = images
        .iter()
        .zip(&reduced)
        .map(|(image, reduced)| -> &dyn Materials {
            match resolution(size(image.materials()), shape) {
                Some(_) => reduced,
                None => image.materials(),
            }
        })
        .collect();
    let grid = args.grid(&sources, shape, (set, &library), &layout, observer)?;
    let placed = args.placed(&grid)?;
    observer.begin("solving masks", sources.len() as u64);
    let mut frames = Vec::with_capacity(sources.len() + 1);
    for (source, name) in sources.iter().zip(&args.images) {
        let frame = Frame::for_image(&grid, *source, &library).with_context(|| name.clone())?;
        frames.push((shown_name(name), frame));
        observer.advance(1);
    }
    observer.end();
    frames.push(("alignment".to_owned(), Frame::alignment(&grid)));
    let notes: Vec<String> = images.iter().flat_map(Image::notes).cloned().collect();
    let work =
        Work { name: &args.name(), notes: &notes, grid: &grid, frames: &frames, placed, library: &library };
    work.print(&args.job, (layout, if args.stacks.is_empty() { set } else { InkSet::ALL }), places, observer)
}

fn size(materials: &dyn Materials) -> (usize, usize) {
    (materials.width(), materials.height())
}

/// An image's name without its folders, as it stands on the page.
fn shown_name(name: &str) -> String {
    name_of(&Disk, Path::new(name))
}

impl Args {
    fn name(&self) -> String {
        let first = self.images.first().map_or("display", String::as_str);
        format!("{} display", shown_name(first.strip_prefix("sample:").unwrap_or(first)))
    }

    /// Pixels of every image on the display.
    fn shape(&self, images: &[Image]) -> Result<(usize, usize)> {
        let sizes: Vec<(usize, usize)> = images.iter().map(|image| size(image.materials())).collect();
        let Some((least, &first)) =
            sizes.iter().enumerate().min_by_key(|(_, (width, height))| width * height)
        else {
            bail!("no image to show")
        };
        // Larger images are averaged to the pixels of the smallest.
        if let Some(other) = sizes.iter().position(|&size| !same_shape(size, first)) {
            bail!(
                "{}: {} x {} pixels, but {} has {} x {}; all images of a display have the same proportions, so crop one",
                self.images[other],
                sizes[other].0,
                sizes[other].1,
                self.images[least],
                first.0,
                first.1
            );
        }
        let Some(wanted) = self.pixels else { return Ok(first) };
        let (wanted, longest) = (wanted as usize, first.0.max(first.1));
        if wanted > longest {
            bail!(
                "--pixels {wanted}: the images have {} x {} pixels, and none are made up; give at most {longest}",
                first.0,
                first.1
            );
        }
        let side = |side: usize| ((side * wanted + longest / 2) / longest.max(1)).max(1);
        Ok((side(first.0), side(first.1)))
    }

    /// How the screen lies over the print. Beside it nothing is seen.
    fn placed(&self, grid: &Grid) -> Result<Placed> {
        let shift = [self.shift.0.0, self.shift.1.0];
        let (across, down) = grid.size_dots();
        let size = [across, down].map(|dots| Mm::of_dots(dots as i64).0);
        if (0..2).any(|c| shift[c].abs() >= size[c]) {
            bail!(
                "--shift {},{}mm: the screen lies beside the print, which is {:.1} x {:.1} mm; shift it by less than that",
                shift[0],
                shift[1],
                size[0],
                size[1]
            );
        }
        Ok(Placed { shift_mm: shift, depth_mm: self.depth.0 })
    }

    fn grid(
        &self,
        sources: &[&dyn Materials],
        shape: (usize, usize),
        (set, library): (InkSet, &Library),
        layout: &Layout,
        observer: &dyn Observer,
    ) -> Result<Grid> {
        let (open, closed) = self.transmission;
        let screen = Screen { pixels: self.mask_size, pitch_mm: self.pitch.0, cell: self.cell, open, closed };
        let room = layout.largest();
        let known: Vec<Stack> = library.at_hand(&set).iter().map(|entry| entry.stack.clone()).collect();
        // What has no room is said before anything is computed.
        let sizes = known.get(..USUAL).filter(|_| self.stacks.is_empty());
        Grid::new(screen, sizes.unwrap_or(&self.stacks).to_vec(), shape, library, room)?;
        let stacks = if self.stacks.is_empty() {
            let targets: Vec<Target> = sources.iter().map(|source| Target::sample(*source)).collect();
            choose(&known, USUAL, &targets, &screen, library, observer)?
        } else {
            self.stacks.clone()
        };
        Ok(Grid::new(screen, stacks, shape, library, room)?)
    }
}

/// A display that is made.
struct Work<'a> {
    name: &'a str,
    notes: &'a [String],
    grid: &'a Grid,
    frames: &'a [(String, Frame)],
    placed: Placed,
    library: &'a Library,
}

impl Work<'_> {
    fn print(
        &self,
        job: &JobArgs,
        (layout, allowed): (Layout, InkSet),
        places: Places,
        observer: &dyn Observer,
    ) -> Result<()> {
        let (dots, page) = (self.grid.dots()?, job.page(layout));
        let mut made = Made::proved(&page.request(self.name, &dots, allowed, self.library), &page, observer)?;
        made.job.draft.plan.notes = self.notes.to_vec();
        self.write(&places.write(&made, observer)?, observer)?;
        let look = (&*self.advice(), "display.html");
        places.finish(&made, self.report(), look, &job.result, &job.deliver, observer)
    }

    /// Masks, pictures of what is seen, and the page.
    fn write(&self, folder: &Path, observer: &dyn Observer) -> Result<()> {
        let images = self.frames.len() - 1;
        observer.begin("drawing what is seen", self.frames.len() as u64);
        self.frames.par_iter().enumerate().try_for_each(|(i, (_, frame))| {
            let name = |kind: &str| -> PathBuf {
                let number = if i < images { format!("{:03}", i + 1) } else { "align".into() };
                folder.join(format!("{kind}-{number}.png"))
            };
            let path = name("mask");
            write(&path, &frame.picture(self.grid).png()?)?;
            write(&name("seen"), &self.seen(frame)?.png()?)?;
            observer.advance(1);
            anyhow::Ok(())
        })?;
        observer.end();
        let text = page::page(&page::Subject {
            name: self.name,
            about: &self.about(),
            grid: self.grid,
            frames: self.frames,
            placed: self.placed,
            library: self.library,
        })?;
        write(&folder.join("display.html"), text.as_bytes())
    }

    /// What is seen from straight ahead under both lights, side by side, by an eye that has adapted.
    fn seen(&self, frame: &Frame) -> Result<Pixels<[u8; 3]>> {
        let longest = self.grid.pixels().0.max(self.grid.pixels().1);
        let zoom = LEAST.div_ceil(longest);
        let panels = LIGHTS.map(|azimuth| {
            let sight = Sight { light: direction(azimuth, 0.0), eye: [0.0, 0.0, 1.0] };
            let gain = 1.0 / self.grid.brightness();
            picture_of(self.grid, frame, &self.placed, &sight, self.library, (zoom, gain))
        });
        let [left, right] = &panels;
        let width = left.width + GAP + right.width;
        let mut pixels = Vec::with_capacity(width * left.height);
        for (a, b) in left.pixels.chunks_exact(left.width).zip(right.pixels.chunks_exact(right.width)) {
            pixels.extend_from_slice(a);
            pixels.extend([[0.0; 4]; GAP]);
            pixels.extend_from_slice(b);
        }
        Ok(picture(&Radiance { width, height: left.height, pixels }, ToneCurve::PAPER)?)
    }

    fn about(&self) -> String {
        let (width, height) = self.grid.pixels();
        let names: Vec<String> = self.grid.stacks().iter().map(ToString::to_string).collect();
        format!(
            "{width} x {height} pixels of {} x {} cells, {:.2} mm each: {}; {:.1} % as bright as a print",
            self.grid.tile(),
            self.grid.tile(),
            self.grid.screen().cell_mm(),
            names.join(", "),
            100.0 * self.grid.brightness()
        )
    }

    fn advice(&self) -> String {
        let mut text = format!("\nDisplay: {}.\n", self.about());
        for (name, frame) in self.frames {
            if let Some((mean, p95)) = frame.distance {
                let _ = writeln!(
                    text,
                    "{name}: average difference d = {mean:.3}, 95 % of pixels below {p95:.3} (0.01: barely visible; 0.05: obvious)."
                );
            }
        }
        let (x, y) = self.grid.origin();
        let _ = write!(
            text,
            "Show mask-align.png first. The printed grid, with its margin, lies under the screen's pixels from {x}, {y} on."
        );
        text
    }

    fn report(&self) -> Value {
        let screen = self.grid.screen();
        let frames: Vec<Value> = self
            .frames
            .iter()
            .map(|(name, frame)| {
                json!({ "name": name, "mean": frame.distance.map(|d| d.0), "p95": frame.distance.map(|d| d.1) })
            })
            .collect();
        json!({ "display": {
            "pixels": self.grid.pixels(), "tile": self.grid.tile(), "cell_mm": screen.cell_mm(),
            "stacks": self.grid.stacks(), "mask": screen.pixels, "origin": self.grid.origin(),
            "transmission": [screen.open, screen.closed], "brightness": self.grid.brightness(),
            "shift_mm": self.placed.shift_mm, "depth_mm": self.placed.depth_mm, "frames": frames,
        } })
    }
}
