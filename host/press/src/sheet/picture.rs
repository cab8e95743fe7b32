//! Pictures of exact dots: writing and strictly reading one-bit and indexed PNG.
//!
//! A picture that is data must come back bit by bit, so nothing is converted on the way: a file with another size,
//! depth or kind than expected is refused, before anything is decoded.

use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Dots per metre at 600 dpi.
const DENSITY: u32 = 23_622;

/// The most bytes a text file beside the pictures may have.
const MOST_TEXT: u64 = 1 << 20;

/// Why a saved sheet or saved passes cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refused.
    #[error("{}: cannot be read or written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A text file does not say what it should.
    #[error("{}: {problem}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field.
        problem: String,
    },
    /// A picture is no PNG, or damaged.
    #[error("{}: the picture is damaged; write it again from its source", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: png::DecodingError,
    },
    /// A picture is of another kind or size than the text beside it says.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Size and kind expected.
        expected: String,
        /// Size and kind found.
        found: String,
    },
}

/// What a picture must be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind<'a> {
    /// One bit a dot, rows padded to bytes, 0 black.
    Bits,
    /// One byte a dot, with as many colours as there are stacks.
    Indexed(&'a [[u8; 3]]),
}

impl Kind<'_> {
    fn png(self) -> (png::ColorType, png::BitDepth) {
        match self {
            Kind::Bits => (png::ColorType::Grayscale, png::BitDepth::One),
            Kind::Indexed(_) => (png::ColorType::Indexed, png::BitDepth::Eight),
        }
    }
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> FileError + '_ {
    move |source| FileError::Io { path: path.to_path_buf(), source }
}

/// Writes a file beside its final place and renames it, so that no half-written file is ever seen.
pub(crate) fn write(
    path: &Path,
    with: impl FnOnce(&mut BufWriter<&mut std::fs::File>) -> std::io::Result<()>,
) -> Result<(), FileError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".foilpress-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The user's umask decides, as for any other file; temporary files are private otherwise.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(io(folder))?;
    let mut buffer = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    with(&mut buffer).and_then(|()| buffer.flush()).map_err(io(path))?;
    drop(buffer);
    file.persist(path).map_err(|error| io(path)(error.error))?;
    Ok(())
}

/// Writes a picture.
pub(crate) fn write_png(
    path: &Path,
    (width, length): (usize, usize),
    kind: Kind,
    data: &[u8],
) -> Result<(), FileError> {
    write(path, |out| {
        // Sides are u16 in every paper.
        let mut encoder = png::Encoder::new(out, width as u32, length as u32);
        let (colour, depth) = kind.png();
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: DENSITY,
            yppu: DENSITY,
            unit: png::Unit::Meter,
        }));
        if let Kind::Indexed(colours) = kind {
            encoder.set_palette(colours.concat());
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(data)?;
        writer.finish()?;
        Ok(())
    })
}

/// Reads a picture that must be of this size and kind; for an indexed one the colours may differ, not their number.
pub(crate) fn read_png(
    path: &Path,
    (width, length): (usize, usize),
    kind: Kind,
) -> Result<Vec<u8>, FileError> {
    let file = std::fs::File::open(path).map_err(io(path))?;
    let bad = |source| FileError::Png { path: path.to_path_buf(), source };
    let bytes = width.max(64) * length.max(64);
    let mut decoder =
        png::Decoder::new_with_limits(BufReader::new(file), png::Limits { bytes: 2 * bytes + (1 << 20) });
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(bad)?;
    let info = reader.info();
    let colours = info.palette.as_ref().map_or(0, |palette| palette.len() / 3);
    let describe = |width: usize, length: usize, colour, depth, colours: usize| match colour {
        png::ColorType::Indexed => {
            format!("{width} x {length} dots, {depth:?} bits indexed, {colours} colours")
        }
        _ => format!("{width} x {length} dots, {depth:?} bits {colour:?}"),
    };
    let (colour, depth) = kind.png();
    let wanted = if let Kind::Indexed(colours) = kind { colours.len() } else { 0 };
    let found = describe(info.width as usize, info.height as usize, info.color_type, info.bit_depth, colours);
    let expected = describe(width, length, colour, depth, wanted);
    if found != expected || info.animation_control.is_some() {
        return Err(FileError::Kind { path: path.to_path_buf(), expected, found });
    }
    let size = if depth == png::BitDepth::One { width.div_ceil(8) * length } else { width * length };
    let mut data = vec![0; size];
    reader.next_frame(&mut data).map_err(bad)?;
    reader.finish().map_err(bad)?;
    Ok(data)
}

/// Writes a value as TOML.
pub fn write_toml(path: &Path, value: &impl serde::Serialize) -> Result<(), FileError> {
    let text = toml::to_string(value)
        .map_err(|error| FileError::Text { path: path.to_path_buf(), problem: error.to_string() })?;
    write(path, |out| out.write_all(text.as_bytes()))
}

/// Reads TOML of at most a megabyte; unknown fields are the type's own business.
pub fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    use std::io::Read;
    let wrong = |problem: String| FileError::Text { path: path.to_path_buf(), problem };
    let file = std::fs::File::open(path).map_err(io(path))?;
    let mut text = String::new();
    file.take(MOST_TEXT + 1).read_to_string(&mut text).map_err(io(path))?;
    if text.len() as u64 > MOST_TEXT {
        return Err(wrong(format!("more than {MOST_TEXT} bytes")));
    }
    toml::from_str(&text).map_err(|error| wrong(error.to_string().trim_end().to_string()))
}
