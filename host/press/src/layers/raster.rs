//! Decoded pictures on their way to layers: pixels, transparency, physical size.
//!
//! Problem: art comes in any depth and kind and says more or less about its size; a layer wants one bit a dot at
//! 600 dpi, a picture wants sRGB.
//! Method: PNG is decoded row by row, other formats by the `image` crate, both within limits. What a layer is made of is
//! its coverage, 0 to 255, by [`Coverage`]. Art at another resolution than 600 dpi is resampled as coverage (bilinear
//! between pixels, averaged over them when there are more pixels than dots) and thresholded after.
//! Cost: about 0.2 s for a page of 600 dpi PNG. Limits: [`MOST_PIXELS`].

use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use image::imageops::FilterType;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageFormat};

use super::error::resolution;
use super::{LayersError, Options};
use crate::layout::Size;

/// The most pixels of a picture: a page at 1200 dpi.
pub const MOST_PIXELS: u64 = 1 << 28;

/// The most bytes of a file.
pub(super) const MOST_BYTES: u64 = 1 << 30;

/// Millimetres in a dot.
pub(super) const MM: f64 = 25.4 / 600.0;

/// Pixels in an inch, across and down.
pub(super) type Density = (f64, f64);

pub(super) fn wrong(path: &Path, problem: impl Into<String>) -> LayersError {
    LayersError::File { path: path.to_path_buf(), problem: problem.into() }
}

pub(super) fn io<'a>(path: &'a Path, attempt: &'static str) -> impl Fn(std::io::Error) -> LayersError + 'a {
    move |source| LayersError::Io { path: path.to_path_buf(), attempt, source }
}

/// Refuses sizes nobody can mean, before anything is allocated.
pub(super) fn check_size(path: &Path, width: u32, height: u32) -> Result<(), LayersError> {
    if width == 0 || height == 0 {
        return Err(wrong(path, format!("the picture is {width} x {height} pixels; expected at least one")));
    }
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(wrong(
            path,
            format!(
                "the picture is {width} x {height} pixels, more than a page at 1200 dpi; make it smaller"
            ),
        ));
    }
    Ok(())
}

/// How much of a layer's ink is on each pixel.
///
/// Of opaque art: as much as the darkest of red, green and blue is below white, so black art is ink and so is art drawn
/// in the ink's own saturated colour. Of art with transparency drawn in one colour: its opacity, whatever the colour,
/// because what is drawn is meant. Of other art with transparency: the two multiplied, dark is ink.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Coverage {
    /// Dark is ink.
    Dark,
    /// Opaque is ink.
    Opaque,
    /// Dark and opaque is ink.
    DarkAndOpaque,
}

/// A layer's art as read, before it is one bit a dot.
pub(super) struct Scan {
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub density: Option<Density>,
    /// 0 no ink, 255 ink; a byte a pixel.
    pub coverage: Vec<u8>,
    pub by: Coverage,
}

impl Scan {
    /// In words.
    pub fn size(&self) -> String {
        let pixels = format!("{} x {} pixels", self.width, self.height);
        self.density.map_or(pixels.clone(), |density| format!("{pixels} at {}", resolution(density)))
    }
}

/// Gathers coverage pixel by pixel and decides by which rule at the end.
pub(super) struct Gather {
    dark: Vec<u8>,
    alpha: Vec<u8>,
    /// Least and largest red, green and blue among opaque pixels.
    range: [(u8, u8); 3],
    transparent: bool,
}

impl Gather {
    /// Colours further apart than this in any channel are two colours.
    const ONE_COLOUR: u8 = 24;

    pub fn new(pixels: usize, alpha: bool) -> Gather {
        Gather {
            dark: Vec::with_capacity(pixels),
            alpha: Vec::with_capacity(if alpha { pixels } else { 0 }),
            range: [(255, 0); 3],
            transparent: false,
        }
    }

    /// Adds pixels of so many channels: grey, grey and alpha, RGB, RGB and alpha.
    pub fn row(&mut self, row: &[u8], channels: usize) {
        match channels {
            1 => self.dark.extend(row.iter().map(|&v| 255 - v)),
            3 => self.dark.extend(row.as_chunks::<3>().0.iter().map(|&[r, g, b]| 255 - r.min(g).min(b))),
            2 => row.as_chunks::<2>().0.iter().for_each(|&[v, a]| self.pixel([v; 3], a)),
            _ => row.as_chunks::<4>().0.iter().for_each(|&[r, g, b, a]| self.pixel([r, g, b], a)),
        }
    }

    fn pixel(&mut self, colour: [u8; 3], alpha: u8) {
        self.dark.push(255 - colour[0].min(colour[1]).min(colour[2]));
        self.alpha.push(alpha);
        self.transparent |= alpha < 255;
        // Only what is fully there: programs store any colour they like under transparent pixels.
        if alpha >= 250 {
            for (range, v) in self.range.iter_mut().zip(colour) {
                *range = (range.0.min(v), range.1.max(v));
            }
        }
    }

    /// The coverage, and by which rule.
    pub fn finish(self) -> (Vec<u8>, Coverage) {
        if !self.transparent {
            return (self.dark, Coverage::Dark);
        }
        if self.range.iter().all(|&(least, most)| most <= least.saturating_add(Gather::ONE_COLOUR)) {
            return (self.alpha, Coverage::Opaque);
        }
        let times = |(d, a): (&u8, &u8)| ((u32::from(*d) * u32::from(*a) + 127) / 255) as u8;
        (self.dark.iter().zip(&self.alpha).map(times).collect(), Coverage::DarkAndOpaque)
    }
}

/// Reads the art of one layer.
pub(super) fn scan(path: &Path) -> Result<Scan, LayersError> {
    let file = std::fs::File::open(path).map_err(io(path, "open it"))?;
    if file.metadata().map_err(io(path, "look at it"))?.len() > MOST_BYTES {
        return Err(wrong(path, "the file is larger than a gigabyte"));
    }
    let mut file = BufReader::with_capacity(1 << 16, file);
    let start = file.fill_buf().map_err(io(path, "read it"))?;
    if start.starts_with(b"\x89PNG") {
        return scan_png(path, file);
    }
    let picture = decode(path, file)?;
    let (width, height) = (picture.image.width(), picture.image.height());
    let alpha = picture.image.color().has_alpha();
    let mut gather = Gather::new(width as usize * height as usize, alpha);
    match (picture.image.color().has_color(), alpha) {
        (false, false) => gather.row(&picture.image.into_luma8(), 1),
        (true, false) => gather.row(&picture.image.into_rgb8(), 3),
        (_, true) => gather.row(&picture.image.into_rgba8(), 4),
    }
    let (coverage, by) = gather.finish();
    Ok(Scan { path: path.to_path_buf(), width, height, density: picture.density, coverage, by })
}

fn scan_png(path: &Path, file: impl BufRead + Seek) -> Result<Scan, LayersError> {
    let bad = |error: png::DecodingError| wrong(path, format!("cannot decode the picture: {error}"));
    let limits = png::Limits { bytes: 1 << 26 };
    let mut decoder = png::Decoder::new_with_limits(file, limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(bad)?;
    let (width, height) = (reader.info().width, reader.info().height);
    check_size(path, width, height)?;
    let density = reader.info().pixel_dims.and_then(png_density);
    let channels = reader.output_color_type().0.samples();
    let mut gather = Gather::new(width as usize * height as usize, channels % 2 == 0);
    if reader.info().interlaced {
        let size = reader.output_buffer_size().ok_or_else(|| wrong(path, "the picture is too large"))?;
        let mut pixels = vec![0; size];
        reader.next_frame(&mut pixels).map_err(bad)?;
        gather.row(&pixels, channels);
    } else {
        for _ in 0..height {
            let row = reader.next_row().map_err(bad)?;
            let row = row.ok_or_else(|| wrong(path, "the picture ends before its last row"))?;
            gather.row(row.data(), channels);
        }
    }
    let (coverage, by) = gather.finish();
    Ok(Scan { path: path.to_path_buf(), width, height, density, coverage, by })
}

fn png_density(dims: png::PixelDimensions) -> Option<Density> {
    let inch = |per_metre: u32| f64::from(per_metre) * 0.0254;
    (dims.unit == png::Unit::Meter).then(|| (inch(dims.xppu), inch(dims.yppu))).filter(plausible)
}

/// Densities of 1 and the like are left there by programs that did not mean them.
fn plausible(density: &Density) -> bool {
    let fine = |d: f64| d.is_finite() && (20.0..=10_000.0).contains(&d);
    fine(density.0) && fine(density.1)
}

/// A decoded picture.
pub(super) struct Decoded {
    pub image: DynamicImage,
    pub density: Option<Density>,
    pub profile: Option<Vec<u8>>,
}

/// Decodes a whole picture within limits, whatever its format.
pub(super) fn decode(path: &Path, mut file: impl Read) -> Result<Decoded, LayersError> {
    let mut bytes = Vec::new();
    file.by_ref().take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(io(path, "read it"))?;
    let format = image::guess_format(&bytes).ok().filter(|format| {
        matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Tiff | ImageFormat::Pnm)
    });
    let Some(format) = format else {
        let found = if bytes.is_empty() { "an empty file" } else { "something else" };
        return Err(wrong(
            path,
            format!("expected a PNG, TIFF, JPEG, PNM, SVG, PDF or PostScript file, found {found}"),
        ));
    };
    if format == ImageFormat::Jpeg && jpeg_frame(&bytes).is_some_and(|(channels, ..)| channels == 4) {
        return Err(wrong(path, "the picture is CMYK, which is four layers, not one; convert it to grey"));
    }
    let bad = |error: image::ImageError| wrong(path, format!("cannot decode the picture: {error}"));
    let mut reader = image::ImageReader::with_format(Cursor::new(&bytes[..]), format);
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(8 * MOST_PIXELS);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(bad)?;
    let (width, height) = decoder.dimensions();
    check_size(path, width, height)?;
    // Damage to a profile is no damage to the picture.
    let profile = decoder.icc_profile().ok().flatten();
    let density = density(&bytes, format);
    let image = DynamicImage::from_decoder(decoder).map_err(bad)?;
    Ok(Decoded { image, density, profile })
}

/// What a file says of its resolution.
pub(super) fn density(bytes: &[u8], format: ImageFormat) -> Option<Density> {
    match format {
        ImageFormat::Png => {
            let decoder = png::Decoder::new(Cursor::new(bytes));
            decoder.read_info().ok()?.info().pixel_dims.and_then(png_density)
        }
        ImageFormat::Jpeg => jfif_density(bytes),
        ImageFormat::Tiff => super::tiff::density(bytes),
        _ => None,
    }
    .filter(plausible)
}

/// Channels, height and width of a JPEG: said in the first of its frame headers.
pub(super) fn jpeg_frame(bytes: &[u8]) -> Option<(u8, u16, u16)> {
    let mut rest = bytes.strip_prefix(b"\xff\xd8")?;
    loop {
        let (&[0xff, marker, high, low], body) = rest.split_first_chunk::<4>()? else { return None };
        // C4, C8 and CC are tables, all others of this row are frames.
        if (0xc0..=0xcf).contains(&marker) && ![0xc4, 0xc8, 0xcc].contains(&marker) {
            let &[_, h, e, w, i, channels] = body.first_chunk()?;
            return Some((channels, u16::from_be_bytes([h, e]), u16::from_be_bytes([w, i])));
        }
        rest = body.get(usize::from(u16::from_be_bytes([high, low])).checked_sub(2)?..)?;
    }
}

/// The density in the JFIF segment, which follows the start of the file when there is one.
fn jfif_density(bytes: &[u8]) -> Option<Density> {
    let segment = bytes.strip_prefix(b"\xff\xd8\xff\xe0")?.get(2..14)?.strip_prefix(b"JFIF\0")?;
    let number = |at: usize| f64::from(u16::from_be_bytes([segment[at], segment[at + 1]]));
    let inch = match segment[2] {
        1 => 1.0,
        2 => 2.54,
        _ => return None,
    };
    Some((number(3) * inch, number(5) * inch))
}

/// What to do with a picture that says no resolution.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Unstated {
    /// Plain colour has no size of its own: as large as the room allows.
    Fills,
    /// Layers of ink are drawn for the printer: a pixel is a dot.
    IsDots,
}

/// Dots of 600 dpi that so many pixels fill: as the user says, else as the file says, else as `unstated` says, which is noted.
pub(super) fn dots(
    path: &Path,
    (width, height): (f64, f64),
    density: Option<Density>,
    unstated: Unstated,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<(usize, usize), LayersError> {
    let Options { size, dpi, room, .. } = *options;
    let inch = |(x, y): Density| (25.4 * width / x, 25.4 * height / y);
    let room_mm = (room.width as f64 * MM, room.length as f64 * MM);
    let own = dpi.map(|dpi| (dpi, dpi)).or(density).map(inch);
    let aspect = own.map_or(height / width, |(width, height)| height / width);
    let within = |width: f64, height: f64| {
        let width = width.min(height / aspect);
        (width, width * aspect)
    };
    // Half a dot of grace, as in the layout.
    let fits = |(width, height): (f64, f64)| width < room_mm.0 + MM / 2.0 && height < room_mm.1 + MM / 2.0;
    let fitting = within(room_mm.0, room_mm.1);
    let (width_mm, height_mm) = match (size, own, unstated) {
        (Some(Size { width, height: None }), ..) => (width, width * aspect),
        (Some(Size { width, height: Some(height) }), ..) => within(width, height),
        (None, Some(own), _) => {
            if let (None, Some(says), false) = (dpi, density, room.cut || fits(own)) {
                return Err(LayersError::Beyond {
                    path: path.to_path_buf(),
                    says,
                    size_mm: own,
                    room_mm,
                    fits_mm: fitting.0,
                });
            }
            own
        }
        (None, None, Unstated::Fills) => {
            notes.push(format!(
                "{} says no resolution: printed as large as the page allows, {:.1} x {:.1} mm ({:.0} dpi); --size or --dpi \
                 makes it another size",
                path.display(),
                fitting.0,
                fitting.1,
                25.4 * width / fitting.0
            ));
            fitting
        }
        (None, None, Unstated::IsDots) => {
            let drawn = inch((600.0, 600.0));
            if !room.cut && !fits(drawn) {
                return Err(LayersError::NoSize {
                    path: path.to_path_buf(),
                    pixels: (width as u32, height as u32),
                    size_mm: drawn,
                    room_mm,
                    fits_mm: fitting.0,
                });
            }
            notes.push(format!(
                "{} says no resolution: taken as drawn at 600 dpi, {:.1} x {:.1} mm; --size or --dpi makes it another size",
                path.display(),
                drawn.0,
                drawn.1
            ));
            drawn
        }
    };
    let (across, down) = ((width_mm / MM).round(), (height_mm / MM).round());
    if !(across >= 1.0 && down >= 1.0) {
        return Err(LayersError::TooSmall { width_mm, height_mm });
    }
    let most = protocol::paper::LARGEST;
    let most = (f64::from(most.0.max(most.1)), f64::from(most.1));
    if across > most.0 || down > most.1 {
        let (most_width_mm, most_height_mm) = (most.0 * MM, most.1 * MM);
        return Err(LayersError::TooLarge {
            width_mm,
            height_mm,
            most_width_mm,
            most_height_mm,
            fits_mm: fitting.0,
        });
    }
    Ok((across as usize, down as usize))
}

/// Coverage at the dots.
pub(super) fn resample(coverage: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    if (from.0 as usize, from.1 as usize) == to {
        return coverage;
    }
    // The length is the product of the sides, so the picture is there.
    match GrayImage::from_raw(from.0, from.1, coverage) {
        Some(image) => {
            image::imageops::resize(&image, to.0 as u32, to.1 as u32, FilterType::Triangle).into_raw()
        }
        None => vec![0; to.0 * to.1],
    }
}

/// Each dot's value is that of the pixel under its middle.
pub(super) fn nearest(bytes: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    let from = (from.0 as usize, from.1 as usize);
    if from == to {
        return bytes;
    }
    let columns: Vec<usize> = (0..to.0).map(|x| (2 * x + 1) * from.0 / (2 * to.0)).collect();
    let row = |y: usize| &bytes[(2 * y + 1) * from.1 / (2 * to.1) * from.0..][..from.0];
    (0..to.1).flat_map(|y| columns.iter().map(move |&x| row(y)[x])).collect()
}
