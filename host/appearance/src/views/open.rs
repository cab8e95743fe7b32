//! From two pictures, or one with more light than white, to a factored document.

use std::path::{Path, PathBuf};

use files::shelf::Shelf;
use observe::Observer;
use rayon::prelude::*;

use super::exposures::Exposures;
use super::reach::{Reach, reach};
use super::{FAINTEST, Views};
use crate::brdf::{Space, Table};
use crate::document::MOST_BYTES;
use crate::document::picture::{Encoding, Picture};
use crate::document::source::Source;
use crate::document::texture::{Plane, same_shape};
use crate::document::{ColourSpace, Content, Document, DocumentError, name_of};
use crate::gamut::Printable;
use crate::materials::Factored;
use crate::srgb::luminance;
use crate::weights::{WeightError, WeightMaps, quantise};

/// The most pixels of the document: what the largest page shows at a cluster of two dots. Finer pictures
/// are averaged.
const MOST_PIXELS: usize = 1 << 23;

/// Channels that differ by no more than one step of 8 bits are grey, for rounding makes as much.
const STEP: f32 = 1.0 / 255.0;

/// What is shown in the two views.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pictures {
    /// A picture for each.
    Pair {
        /// Seen straight on.
        straight: PathBuf,
        /// Seen in the reflection of the light.
        highlight: PathBuf,
    },
    /// Two exposures of one picture.
    Exposures(PathBuf),
}

/// Why two pictures become no document.
#[derive(Debug, thiserror::Error)]
pub enum ViewsError {
    /// A picture cannot be read.
    #[error(transparent)]
    Read(#[from] DocumentError),
    /// The pictures have different proportions.
    #[error(
        "{} has {} x {} pixels and {} {} x {}: both pictures cover the same paper, so they need the same proportions; crop one or add \
         a margin to it",
        straight.display(), sizes[0].0, sizes[0].1, highlight.display(), sizes[1].0, sizes[1].1
    )]
    Shapes {
        /// The picture seen straight on.
        straight: PathBuf,
        /// The other one.
        highlight: PathBuf,
        /// Their sizes in pixels.
        sizes: [(usize, usize); 2],
    },
    /// A picture has one lightness everywhere.
    #[error("{}: the picture is equally light everywhere, so nothing of it would be seen{}", path.display(), hint)]
    Flat {
        /// The picture.
        path: PathBuf,
        /// What to do.
        hint: &'static str,
    },
    /// The picture has not more light than white.
    #[error(
        "{}: white is only {stops:.1} stops above middle grey's exposure, so a second exposure would show nothing new; print it as an \
         ordinary picture, or give a second one with --highlight", path.display()
    )]
    NoRange {
        /// The picture.
        path: PathBuf,
        /// The difference of the two exposures.
        stops: f64,
    },
    /// The picture has whole numbers, or no light.
    #[error("{}: {problem}", path.display())]
    NotHdr {
        /// The picture.
        path: PathBuf,
        /// What is wrong, and what to do.
        problem: &'static str,
    },
    /// The inks cannot show both.
    #[error(
        "nothing would be left of {name}: with these inks it can have a contrast of {contrast:.2} {view} if the other picture is not \
         to be seen there, and {FAINTEST} is just seen; allow more inks, such as --inks process,finish or --inks all"
    )]
    Faint {
        /// The picture.
        name: String,
        /// The view it is meant for.
        view: &'static str,
        /// Its contrast.
        contrast: f64,
    },
    /// Never seen; if it is, it is a bug worth a report.
    #[error(transparent)]
    Weights(#[from] WeightError),
}

/// The words for the two views.
pub(super) const VIEWS: [&str; 2] = ["straight on", "in the reflection"];

/// Makes a document of two pictures for these stacks.
///
/// # Errors
/// Pictures that cannot be read, have different shapes or one lightness, and stacks that cannot show both.
pub fn open(
    shelf: &dyn Shelf,
    pictures: &Pictures,
    colours: Option<ColourSpace>,
    printable: &Printable,
    space: &Space,
    observer: &dyn Observer,
) -> Result<Document, ViewsError> {
    let mut source = Source::new(shelf, observer);
    let (name, names, [straight, highlight]) = match pictures {
        Pictures::Pair { straight, highlight } => {
            // Behind what is transparent lies paper, and no reflection.
            let a = read(straight, colours, 1.0, &mut source)?;
            let b = read(highlight, colours, 0.0, &mut source)?;
            if !same_shape(a.size, b.size) {
                let (straight, highlight) = (straight.clone(), highlight.clone());
                return Err(ViewsError::Shapes { straight, highlight, sizes: [a.size, b.size] });
            }
            let names = [straight, highlight].map(|path| file_name(path));
            (format!("{} and {}", name_of(shelf, straight), name_of(shelf, highlight)), names, [a, b])
        }
        Pictures::Exposures(path) => {
            let pair = exposures(path, colours, &mut source)?;
            (name_of(shelf, path), ["the long exposure", "the short exposure"].map(String::from), pair)
        }
    };
    for (picture, hint) in [(&straight, ""), (&highlight, "; for a hidden mark draw it white on black")] {
        if picture.is_flat() {
            return Err(ViewsError::Flat { path: picture.path.clone(), hint });
        }
    }
    let faint = |which: usize, contrast: f64| {
        let name = names[which].clone();
        ViewsError::Faint { name, view: VIEWS[which], contrast }
    };
    let Some(limits) = reach(printable, space) else { return Err(faint(1, 0.0)) };
    if let Some(which) = (0..2).find(|&which| limits.contrast[which] < FAINTEST) {
        return Err(faint(which, limits.contrast[which]));
    }
    source.note(format!(
        "with the inks at hand {} can have a contrast of {:.2} straight on and {} one of {:.2} in the reflection, and neither is seen in \
         the view of the other",
        names[0], limits.contrast[0], names[1], limits.contrast[1]
    ));
    if highlight.colours.is_some() {
        source.note(format!(
            "{} is printed in its lightness: a reflection has the colour of the metal or the finish",
            names[1]
        ));
    }
    let size = grid(&straight, &highlight);
    let (factored, shown) = factored(&straight, &highlight, size, &limits, printable, space)?;
    let views = Views { names, shown, white: limits.white };
    let (notes, digest) = source.finish();
    let views = Some(views);
    Ok(Document { name, content: Content::Factored(factored), size_mm: None, notes, digest, views })
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    name.chars().filter(|c| !c.is_control()).collect()
}

/// A picture as it is to be seen, 0 to 1.
struct Seen {
    path: PathBuf,
    size: (usize, usize),
    luminance: Plane,
    /// Its channels if it has colours.
    colours: Option<[Plane; 3]>,
}

impl Seen {
    fn new(path: &Path, [r, g, b]: [Plane; 3]) -> Seen {
        let size = (r.width(), r.height());
        let n = size.0 * size.1;
        let at = |i: usize| [r.at(i), g.at(i), b.at(i)];
        let grey = (0..n).into_par_iter().all(|i| {
            let [r, g, b] = at(i);
            (r - g).abs() <= STEP && (g - b).abs() <= STEP
        });
        let values = (0..n).into_par_iter().map(|i| luminance(at(i).map(f64::from)) as f32).collect();
        let luminance = Plane::new(size.0, size.1, values);
        let colours = (!grey).then_some([r, g, b]);
        Seen { path: path.into(), size, luminance, colours }
    }

    fn is_flat(&self) -> bool {
        let ends = self.luminance.values().fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(v), b.max(v)));
        ends.1 - ends.0 < STEP
    }
}

/// The linear channels of a file, over `ground` where it is transparent, and whether they are floating point.
fn linear(
    path: &Path,
    colours: Option<ColourSpace>,
    ground: f32,
    source: &mut Source<'_>,
) -> Result<([Plane; 3], bool), DocumentError> {
    let bytes = source.read(path, MOST_BYTES)?;
    let picture = Picture::decode_with_alpha(&bytes, path, source)?;
    if picture.has_foreign_profile() && colours.is_none() {
        source.note(format!("{}: its colour profile is not applied; it is read as sRGB", path.display()));
    }
    let encoding = colours.map_or_else(|| picture.natural_encoding(), Encoding::from);
    let planes = picture.linear(encoding);
    if !picture.has_alpha() {
        return Ok((planes, picture.is_float()));
    }
    let alpha = picture.channel(3);
    let over = |plane: Plane| {
        let mix = |i: usize| ground + (plane.at(i) - ground) * alpha.at(i).clamp(0.0, 1.0);
        let values = (0..picture.width * picture.height).into_par_iter().map(mix).collect();
        Plane::new(picture.width, picture.height, values)
    };
    Ok((planes.map(over), picture.is_float()))
}

fn read(
    path: &Path,
    colours: Option<ColourSpace>,
    ground: f32,
    source: &mut Source<'_>,
) -> Result<Seen, ViewsError> {
    let (planes, _) = linear(path, colours, ground, source)?;
    if planes.iter().any(|plane| plane.outside().is_some()) {
        source.note(format!(
            "{}: values beyond 0 to 1 are clipped; --hdr prints two exposures of such a picture",
            path.display()
        ));
    }
    Ok(Seen::new(path, planes.map(|plane| plane.map(|v| v.clamp(0.0, 1.0)))))
}

/// The long and the short exposure of a picture.
fn exposures(
    path: &Path,
    colours: Option<ColourSpace>,
    source: &mut Source<'_>,
) -> Result<[Seen; 2], ViewsError> {
    let wrong = |problem| ViewsError::NotHdr { path: path.into(), problem };
    let (planes, float) = linear(path, colours, 0.0, source)?;
    if !float {
        return Err(wrong(
            "its values are whole numbers, 0 to 1 of white; --hdr needs a Radiance .hdr, OpenEXR or float TIFF picture",
        ));
    }
    let n = planes[0].width() * planes[0].height();
    let values: Vec<f64> =
        (0..n).map(|i| luminance([0, 1, 2].map(|c| f64::from(planes[c].at(i).max(0.0))))).collect();
    let Some(found) = Exposures::of(&values) else { return Err(wrong("the picture is black everywhere")) };
    if found.stops() < 1.0 {
        return Err(ViewsError::NoRange { path: path.into(), stops: found.stops().max(0.0) });
    }
    source.note(format!(
        "straight on the print shows the exposure for its middle tones, in the reflection one {:.1} stops shorter",
        found.stops()
    ));
    let exposed = |factor: f64| {
        let planes = planes.clone().map(|plane| plane.map(|v| (v * factor as f32).clamp(0.0, 1.0)));
        Seen::new(path, planes)
    };
    Ok([exposed(found.long), exposed(found.short)])
}

/// The size of the document: that of the finer picture, up to a limit.
fn grid(a: &Seen, b: &Seen) -> (usize, usize) {
    let pixels = |(width, height): (usize, usize)| width * height;
    let (width, height) = if pixels(b.size) > pixels(a.size) { b.size } else { a.size };
    let shrink = (MOST_PIXELS as f64 / pixels((width, height)) as f64).sqrt().min(1.0);
    let side = |side: usize| ((side as f64 * shrink) as usize).max(1);
    (side(width), side(height))
}

/// Bases and maps: the corners of the limits, each as much as both pictures are near to it; and what each
/// basis shows.
fn factored(
    straight: &Seen,
    highlight: &Seen,
    (width, height): (usize, usize),
    limits: &Reach,
    printable: &Printable,
    space: &Space,
) -> Result<(Factored, Vec<[f64; 2]>), WeightError> {
    // First dark and bright in the reflection, then straight on.
    let rows: [[Vec<f64>; 2]; 2] = [0, 1].map(|j| [0, 1].map(|i| limits.row(printable, i, j)));
    let bits: &[[usize; 3]] = match straight.colours {
        None => &[[0; 3], [1; 3]],
        Some(_) => &[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]],
    };
    let (mut bases, mut shown) = (Table::new(space.columns()), Vec::new());
    for (reflection, rows) in [0.0, 1.0].into_iter().zip(&rows) {
        for bits in bits {
            let row: Vec<f64> = (0..space.columns()).map(|k| rows[bits[k % 3]][k]).collect();
            bases.push(&row);
            shown.push([luminance(bits.map(|bit| bit as f64)), reflection]);
        }
    }
    let planes: Vec<Plane> = match &straight.colours {
        None => vec![straight.luminance.resized(width, height)],
        Some(planes) => planes.iter().map(|plane| plane.resized(width, height)).collect(),
    };
    let mark = highlight.luminance.resized(width, height);
    let channels = bases.len();
    let mut data = vec![0; width * height * channels];
    data.par_chunks_exact_mut(width * channels).enumerate().for_each_init(
        || vec![0.0; channels],
        |weights, (y, out)| {
            for (x, out) in out.chunks_exact_mut(channels).enumerate() {
                let pixel = y * width + x;
                let b = f64::from(mark.at(pixel)).clamp(0.0, 1.0);
                for (k, weight) in weights.iter_mut().enumerate() {
                    let bits = bits[k % bits.len()];
                    let reflection = if k >= channels / 2 { b } else { 1.0 - b };
                    *weight = planes.iter().zip(bits).fold(reflection, |product, (plane, bit)| {
                        let a = f64::from(plane.at(pixel)).clamp(0.0, 1.0);
                        product * if bit == 1 { a } else { 1.0 - a }
                    });
                }
                quantise(weights, out);
            }
        },
    );
    let maps = WeightMaps::new(width, height, channels, data)?;
    Ok((Factored { space: space.clone(), bases, maps }, shown))
}
