//! How large art is on paper.
//!
//! Problem: the size comes from the user, from the file's resolution, or from neither; and the page has limited room.
//! Method: settings override the file. Without either, a layer takes one dot for each pixel, while a plain picture fills
//! the room; a note says which. Art that is larger than the room is an error unless the page crops it. Units:
//! millimetres, then dots of 600 dpi. A drawing that states no size on paper is measured in its program's units. Limits: twice the largest page on each side if it is cropped; at least one dot.

use std::path::Path;

use crate::error::{beyond, no_size, too_large, too_small};
use crate::options::{Options, Room};
use observe::Diagnosis;
use readers::resolution::Dpi;
use sheet::Size;

/// Millimetres in a dot: the printer has 600 an inch, and an inch has 25.4 mm.
pub(crate) const MM: f64 = 25.4 / DPI;
/// Dots in an inch, across and down, as the printer has them; there are `Options::across` times as many
/// across.
pub(crate) const DPI: f64 = 600.0;

/// How large to print a picture whose file states no resolution.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Unstated {
    /// As large as the room allows: plain colour has no size of its own.
    FillRoom,
    /// One dot for each pixel: layers of ink are drawn for the printer.
    PixelPerDot,
    /// So many units in an inch: a drawing that states no size on paper.
    Units(Units),
    /// Does not happen: a drawing has a size, and what is taken for its pixels is only a measure. It is known to this many
    /// millimetres.
    Drawing { rounded_mm: f64 },
}

/// Units of a drawing in an inch, and why so many, in words that follow the number.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Units {
    pub per_inch: f64,
    pub why: &'static str,
}

/// A rectangle in millimetres: width, height.
type Rectangle = (f64, f64);

/// Fits art of one shape to a page.
struct Fit {
    room: Rectangle,
    /// Height of the art divided by its width.
    aspect: f64,
    /// Whether the page crops larger art.
    crops: bool,
    /// What the art may be larger than the room: half a dot as in the layout, or what its size is rounded by.
    grace: f64,
}

impl Fit {
    fn new(room: Room, aspect: f64, unstated: Unstated) -> Fit {
        let grace = if let Unstated::Drawing { rounded_mm } = unstated { rounded_mm } else { 0.0 };
        let sides = (room.width as f64 * MM, room.length as f64 * MM);
        Fit { room: sides, aspect, crops: room.cut, grace: grace.max(MM / 2.0) }
    }

    /// The largest art of this shape in a rectangle.
    fn within(&self, (width, height): Rectangle) -> Rectangle {
        let width = width.min(height / self.aspect);
        (width, width * self.aspect)
    }

    fn largest(&self) -> Rectangle {
        self.within(self.room)
    }

    /// Whether art is small enough for the room.
    fn accepts(&self, (width, height): Rectangle) -> bool {
        self.crops || width < self.room.0 + self.grace && height < self.room.1 + self.grace
    }
}

/// The size in dots of a picture of so many pixels: as set, else as the file states, else by `unstated`, with a note; the latter
/// two times the scale.
///
/// # Errors
/// Art larger than the room or than the largest page, or smaller than a dot.
pub(crate) fn dots(
    path: &Path,
    pixels: (f64, f64),
    stated: Option<Dpi>,
    unstated: Unstated,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<(usize, usize), Diagnosis> {
    let pixels = (options.scale * pixels.0, options.scale * pixels.1);
    let inches = |(x, y): Dpi| (25.4 * pixels.0 / x, 25.4 * pixels.1 / y);
    let drawing = matches!(unstated, Unstated::Drawing { .. });
    let asked = options.dpi.filter(|_| !drawing);
    if drawing && options.dpi.is_some() {
        notes.push(format!(
            "{}: a drawing has a size of its own, so the resolution has no effect; set its size to change it",
            path.display()
        ));
    }
    let own = asked.map(|dpi| (dpi, dpi)).or(stated).map(inches);
    let aspect = own.map_or(pixels.1 / pixels.0, |(width, height)| height / width);
    let fit = Fit::new(options.room, aspect, unstated);
    let size = match (options.size, own) {
        (Some(Size { width, height: None }), _) => (width, width * fit.aspect),
        (Some(Size { width, height: Some(height) }), _) => fit.within((width, height)),
        (None, Some(own)) => {
            if let (None, Some(stated), false) = (asked, stated, fit.accepts(own)) {
                let says = (!drawing).then_some(stated);
                return Err(beyond(path, says, own, fit.room, fit.largest().0));
            }
            own
        }
        (None, None) => without_resolution(path, pixels, unstated, &fit, notes)?,
    };
    let (width, length) = to_dots(size, &fit)?;
    Ok((width * options.across.max(1), length))
}

/// The size of a picture whose resolution neither the file nor the user states.
fn without_resolution(
    path: &Path,
    pixels: (f64, f64),
    unstated: Unstated,
    fit: &Fit,
    notes: &mut Vec<String>,
) -> Result<Rectangle, Diagnosis> {
    let (size, assumed) = match unstated {
        Unstated::FillRoom => {
            let size = fit.largest();
            let dpi = 25.4 * pixels.0 / size.0;
            (size, format!("as large as the page allows, {:.1} x {:.1} mm ({dpi:.0} dpi)", size.0, size.1))
        }
        Unstated::Units(Units { per_inch, why }) => {
            let size = (25.4 * pixels.0 / per_inch, 25.4 * pixels.1 / per_inch);
            let measure = format!("units at {per_inch} an inch{why}");
            if !fit.accepts(size) {
                return Err(no_size(
                    (path, "size on paper", "300"),
                    (pixels, &measure),
                    size,
                    fit.room,
                    fit.largest().0,
                ));
            }
            (size, format!("{:.1} x {:.1} mm large: its {measure}", size.0, size.1))
        }
        Unstated::PixelPerDot | Unstated::Drawing { .. } => {
            let size = (25.4 * pixels.0 / 600.0, 25.4 * pixels.1 / 600.0);
            if !fit.accepts(size) {
                let measure = "pixels at 600 dpi";
                return Err(no_size(
                    (path, "resolution", "1200"),
                    (pixels, measure),
                    size,
                    fit.room,
                    fit.largest().0,
                ));
            }
            (size, format!("at 600 dpi, {:.1} x {:.1} mm", size.0, size.1))
        }
    };
    let lacks = if matches!(unstated, Unstated::Units(_)) { "size on paper" } else { "resolution" };
    notes.push(format!(
        "{} states no {lacks}, so it is printed {assumed}; set its size or resolution to change this",
        path.display()
    ));
    Ok(size)
}

fn to_dots((width_mm, height_mm): Rectangle, fit: &Fit) -> Result<(usize, usize), Diagnosis> {
    let (across, down) = ((width_mm / MM).round(), (height_mm / MM).round());
    if !(across >= 1.0 && down >= 1.0) {
        return Err(too_small(width_mm, height_mm));
    }
    let most = halftone::LARGEST_MAP;
    let most = (f64::from(most.0), f64::from(most.1));
    if across > most.0 || down > most.1 {
        return Err(too_large((width_mm, height_mm), (most.0 * MM, most.1 * MM), fit.largest().0));
    }
    Ok((across as usize, down as usize))
}

/// The dots of a page of so many pixels at a resolution; `None` for no dots or more than 65535 on a side.
pub(crate) fn page_dots(pixels: (usize, usize), dpi: f64) -> Option<(usize, usize)> {
    let side = |pixels: usize| {
        let dots = (pixels as f64 * 600.0 / dpi).round();
        (1.0..=65535.0).contains(&dots).then_some(dots as usize)
    };
    Some((side(pixels.0)?, side(pixels.1)?))
}
