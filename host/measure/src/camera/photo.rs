//! Photographs as files: 16-bit TIFF and PNG, OpenEXR, JPEG, and camera RAW through a developer program.
//!
//! RAW goes through `dcraw_emu` of LibRaw or `dcraw`, whichever is installed: linear 16-bit values in the camera's own primaries, no
//! white balance, no automatic brightness. Exposure times and the like come from EXIF. Limits: 100 million pixels a
//! photograph, two minutes for the developer.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use readers::{Bounds, Exif, Format, Samples};

use crate::MeasureError;

/// The most photographs of a measurement: ten times as many as a thorough one has, few enough for hostile
/// setups.
const MOST_PHOTOS: usize = 1000;
/// The largest file in bytes, as memory must hold it: 100 million pixels of 16 bits and three channels have
/// 0.6 GB.
const MOST_BYTES: u64 = 1 << 30;
/// The most pixels of a photograph, as memory must hold it: three channels of 32 bits take 1.2 GB.
const MOST_PIXELS: u64 = 100_000_000;
/// How long a developer program may take.
const PATIENCE: Duration = Duration::from_secs(120);

const PICTURES: [&str; 6] = ["tif", "tiff", "png", "exr", "jpg", "jpeg"];
const RAW: [&str; 11] = ["cr2", "cr3", "nef", "arw", "dng", "raf", "rw2", "orf", "pef", "srw", "nrw"];
/// Developer programs with their arguments; the file's name follows, and the picture comes on standard output.
const DEVELOPERS: [(&str, &[&str]); 2] = [
    // `-c 0`: white is the sensor's, and not the brightest value of each photograph.
    ("dcraw_emu", &["-c", "0", "-4", "-T", "-W", "-o", "0", "-r", "1", "1", "1", "1", "-Z", "-"]),
    ("dcraw", &["-4", "-T", "-W", "-o", "0", "-r", "1", "1", "1", "1", "-c"]),
];

/// A photograph.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Its values, RGB interleaved, rows from the top.
    pub values: Samples,
}

impl Photo {
    /// Value number `i`: 3 (y width + x) + channel.
    #[inline]
    pub fn at(&self, i: usize) -> f32 {
        match &self.values {
            Samples::Eight(v) => f32::from(v[i]),
            Samples::Sixteen(v) => f32::from(v[i]),
            Samples::Float(v) => v[i],
        }
    }
}

fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase())
}

/// The photographs in a folder in the order of their names; other files are left alone.
///
/// # Errors
/// A folder that cannot be read, or without photographs.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>, MeasureError> {
    let io = |source| MeasureError::Io { path: folder.to_path_buf(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let ending = extension(&path);
        let known = PICTURES.contains(&&*ending) || RAW.contains(&&*ending);
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if known && !hidden && path.is_file() {
            found.push(path);
        }
        if found.len() > MOST_PHOTOS {
            return Err(MeasureError::Scene(format!(
                "{}: more than {MOST_PHOTOS} photographs; measure them in several folders",
                folder.display()
            )));
        }
    }
    found.sort();
    if found.is_empty() {
        return Err(MeasureError::Scene(format!(
            "{}: no photographs; expected files that end in {} or a camera's RAW",
            folder.display(),
            PICTURES.join(", ")
        )));
    }
    Ok(found)
}

/// Reads EXIF; a file without it gives nothing.
///
/// # Errors
/// A file that cannot be read.
pub fn exif(path: &Path) -> Result<Exif, MeasureError> {
    let io = |source| MeasureError::Io { path: path.to_path_buf(), source };
    let file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() > MOST_BYTES {
        return Err(MeasureError::photo(path, format!("larger than {} MB", MOST_BYTES >> 20)));
    }
    Ok(readers::exif(BufReader::new(file)))
}

/// Reads a photograph, upright.
///
/// # Errors
/// A file that is no photograph, is too large, or is RAW where no developer program is installed.
pub fn read(path: &Path) -> Result<Photo, MeasureError> {
    let io = |source| MeasureError::Io { path: path.to_path_buf(), source };
    if RAW.contains(&&*extension(path)) {
        // The developer turns the picture upright itself.
        return decode(&develop(&DEVELOPERS, path)?, path, false);
    }
    let file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() > MOST_BYTES {
        return Err(MeasureError::photo(path, format!("larger than {} MB", MOST_BYTES >> 20)));
    }
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(io)?;
    decode(&bytes, path, true)
}

fn decode(bytes: &[u8], path: &Path, turn: bool) -> Result<Photo, MeasureError> {
    let wrong = |fault: &readers::Fault| {
        MeasureError::photo(
            path,
            format!("not a readable photograph ({fault}); expected TIFF, PNG, OpenEXR or JPEG"),
        )
    };
    let bounds = Bounds { side: None, bytes: 16 * MOST_PIXELS };
    let opened = Format::of(bytes, path).and_then(|format| format.open(bytes, bounds));
    let header = opened.map_err(|fault| wrong(&fault))?;
    let (width, height) = header.size();
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        let problem = format!("{width} x {height} pixels; the limit is {} million", MOST_PIXELS / 1_000_000);
        return Err(MeasureError::photo(path, problem));
    }
    let stored = header.decode().map_err(|fault| wrong(&fault))?;
    let stored = if turn { stored.upright() } else { stored };
    if stored.samples.not_finite().is_some() {
        return Err(MeasureError::photo(path, "holds values that are no numbers; export it again"));
    }
    let (width, height) = (stored.width, stored.height);
    Ok(Photo { width, height, values: stored.into_rgb() })
}

/// Runs the first of these programs that is installed on a RAW file.
fn develop(programs: &[(&str, &[&str])], path: &Path) -> Result<Vec<u8>, MeasureError> {
    for (program, arguments) in programs {
        let started = Command::new(program)
            .args(*arguments)
            .arg(path)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut child = match started {
            Ok(child) => child,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
            Err(source) => return Err(MeasureError::Io { path: (*program).into(), source }),
        };
        let failed = |what: &str| {
            MeasureError::photo(
                path,
                format!("`{program}` {what}; develop it to a linear 16-bit TIFF yourself"),
            )
        };
        let output = child.stdout.take();
        let reader = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            output.map(|output| output.take(MOST_BYTES).read_to_end(&mut bytes));
            bytes
        });
        let start = Instant::now();
        let done = loop {
            match child.try_wait() {
                Ok(Some(status)) => break status.success(),
                Ok(None) if start.elapsed() < PATIENCE => std::thread::sleep(Duration::from_millis(20)),
                _ => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err(failed("did not end"));
                }
            }
        };
        let bytes = reader.join().unwrap_or_default();
        return if done && !bytes.is_empty() { Ok(bytes) } else { Err(failed("cannot develop it")) };
    }
    Err(MeasureError::photo(
        path,
        "a RAW file needs a developer program, and neither dcraw_emu nor dcraw is installed; install LibRaw's tools (the \
         packages libraw-bin or dcraw on Debian) or develop it to a linear 16-bit TIFF",
    ))
}

#[cfg(test)]
mod raw;

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Rgb};

    fn sixteen() -> ImageBuffer<Rgb<u16>, Vec<u16>> {
        ImageBuffer::from_fn(5, 3, |x, y| Rgb([(x * 1000 + y) as u16, 40_000, 65_535]))
    }

    #[test]
    fn every_kind_gives_its_values() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.tif", "b.png"] {
            let path = folder.path().join(name);
            sixteen().save(&path).unwrap();
            let photo = read(&path).unwrap();
            assert_eq!((photo.width, photo.height), (5, 3));
            assert!(matches!(photo.values, Samples::Sixteen(_)), "{name}");
            assert_eq!([photo.at(3 * 7), photo.at(3 * 7 + 1)], [2001.0, 40_000.0], "{name}");
        }
        let path = folder.path().join("c.exr");
        ImageBuffer::from_fn(4, 4, |x, _| Rgb([x as f32 * 7.5, 1.0, 1e5])).save(&path).unwrap();
        let photo = read(&path).unwrap();
        assert_eq!([photo.at(3), photo.at(5)], [7.5, 1e5]);
        let path = folder.path().join("d.jpg");
        ImageBuffer::from_pixel(8, 8, Rgb([200u8, 100, 50])).save(&path).unwrap();
        let photo = read(&path).unwrap();
        assert!(matches!(photo.values, Samples::Eight(_)) && (photo.at(1) - 100.0).abs() < 3.0);
        std::fs::write(folder.path().join("notes.txt"), "no photograph").unwrap();
        assert_eq!(list(folder.path()).unwrap().len(), 4);
    }

    /// A TIFF with an EXIF directory, made byte by byte after the specification.
    fn tiff_with_exif() -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        let entry = |bytes: &mut Vec<u8>, tag: u16, kind: u16, value: u32| {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(1u32.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        };
        bytes.extend(2u16.to_le_bytes());
        entry(&mut bytes, 0x0112, 3, 6);
        entry(&mut bytes, 0x8769, 4, 8 + 2 + 24 + 4);
        bytes.extend(0u32.to_le_bytes());
        let values = 8 + 2 + 24 + 4 + 2 + 48 + 4;
        bytes.extend(4u16.to_le_bytes());
        entry(&mut bytes, 0x829a, 5, values);
        entry(&mut bytes, 0x829d, 5, values + 8);
        entry(&mut bytes, 0x8827, 3, 200);
        entry(&mut bytes, 0xa405, 3, 85);
        bytes.extend(0u32.to_le_bytes());
        for number in [1u32, 250, 8, 1] {
            bytes.extend(number.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn exif_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        std::fs::write(&path, tiff_with_exif()).unwrap();
        let expected = Exif {
            seconds: Some(0.004),
            aperture: Some(8.0),
            iso: Some(200.0),
            film_focal_mm: Some(85.0),
            orientation: Some(6),
        };
        assert_eq!(exif(&path).unwrap(), expected);
        std::fs::write(&path, "nothing").unwrap();
        assert_eq!(exif(&path).unwrap(), Exif::default());
    }

    #[test]
    fn raw_goes_through_a_program_and_says_which_one_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.nef");
        sixteen().save_with_format(&path, image::ImageFormat::Tiff).unwrap();
        // `cat` hands the file on, as a developer would a TIFF.
        let photo =
            decode(&develop(&[("/nonexistent/developer", &[]), ("cat", &[])], &path).unwrap(), &path, false);
        assert_eq!(photo.unwrap().at(3 * 7), 2001.0);
        let error = develop(&[("/nonexistent/developer", &[])], &path).unwrap_err().to_string();
        assert!(error.contains("libraw-bin") && error.contains("a.nef"), "{error}");
        let error = develop(&[("false", &[])], &path).unwrap_err().to_string();
        assert!(error.contains("`false` cannot develop it"), "{error}");
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        sixteen().save(&path).unwrap();
        let good = std::fs::read(&path).unwrap();
        for length in [0, 4, 20, good.len() - 5] {
            std::fs::write(&path, &good[..length]).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("a.png") && error.contains("expected TIFF"), "{error}");
        }
        assert!(list(&folder.path().join("none")).is_err());
    }
}
