//! The folder of a measurement: an ink library with the measured curves, all figures as JSON, and pictures.
//!
//! Curves are CSV with the columns that every reader of libraries knows (`theta_h_deg,r,g,b`), followed by the standard deviation of each
//! channel, the number of pixels, and how the sample was obtained.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::reduce::CurveRow;
use crate::MeasureError;
use crate::measurement::{Measurement, Taken};

/// The file with all figures.
pub const FIGURES: &str = "measurement.json";
/// The largest file of figures that is read, in bytes, as memory must hold it: few enough for hostile files.
const MOST_BYTES: u64 = 64 << 20;

/// The name of a stack's curve file.
pub fn curve_name(stack: &str) -> String {
    format!("{}.csv", stack.to_lowercase().replace('+', "-"))
}

/// A string of TOML.
pub fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn curve(rows: &[CurveRow]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["theta_h_deg", "r", "g", "b", "r_sigma", "g_sigma", "b_sigma", "pixels", "kind"])?;
    for row in rows {
        let numbers = std::iter::once(row.theta_deg).chain(row.rgb).chain(row.sigma);
        let mut record: Vec<String> = numbers.map(|v| format!("{v:.6e}")).collect();
        record.push(row.pixels.to_string());
        record.push(row.kind.word().to_owned());
        writer.write_record(&record)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// Writes a measurement into a folder that exists.
///
/// # Errors
/// Files that cannot be written.
pub fn write(taken: &Taken, folder: &Path) -> Result<(), MeasureError> {
    let save = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(|source| MeasureError::Io { path, source })
    };
    let failed = |name: &str, error: &dyn std::fmt::Display| MeasureError::Io {
        path: folder.join(name),
        source: std::io::Error::other(error.to_string()),
    };
    let measurement = &taken.measurement;
    let mut library = String::from("format = 1\nbased_on = \"built-in\"\n");
    let _ = writeln!(
        library,
        "name = {}",
        quoted(&format!("measured by {}, {}", measurement.by, measurement.when))
    );
    for stack in &measurement.stacks {
        let name = curve_name(&stack.stack);
        let _ = write!(
            library,
            "\n[[measured]]\nstack = {}\ncurve = {}\nby = {}\nwhen = {}\nsetup = {}\n",
            quoted(&stack.stack),
            quoted(&name),
            quoted(&measurement.by),
            quoted(&measurement.when),
            quoted(&measurement.setup)
        );
        save(&name, &curve(&stack.rows).map_err(|e| failed(&name, &e))?)?;
    }
    save(inks::FILE_NAME, library.as_bytes())?;
    save(FIGURES, &serde_json::to_vec_pretty(measurement).map_err(|e| failed(FIGURES, &e))?)?;
    for (name, picture) in &taken.pictures {
        save(name, &picture.png().map_err(|e| failed(name, &e))?)?;
    }
    Ok(())
}

/// What a measurement's folder holds that other commands added to it, in words; `None` for nothing, or for no such folder.
pub fn added(folder: &Path) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Stack {
        stack: String,
    }
    #[derive(serde::Deserialize)]
    struct Tables {
        #[serde(default)]
        measured: Vec<Stack>,
        #[serde(default)]
        predicted: Vec<Stack>,
        #[serde(default)]
        dots: Vec<toml::Table>,
    }
    let own = read(folder).ok()?;
    let text = fs::read_to_string(folder.join(inks::FILE_NAME)).ok()?;
    let tables: Tables = toml::from_str(&text).ok()?;
    let known = |stack: &&str| own.stacks.iter().any(|own| own.stack == **stack);
    let stacks = tables.measured.iter().chain(&tables.predicted).map(|table| table.stack.as_str());
    let mut words: Vec<String> =
        stacks.filter(|stack| !known(stack)).map(|stack| format!("the curve of {stack}")).collect();
    words.extend(
        tables.dots.iter().filter_map(|table| Some(format!("the dots of {}", table.get("ink")?.as_str()?))),
    );
    (!words.is_empty()).then(|| words.join(", "))
}

/// Reads the figures of a measurement's folder.
///
/// # Errors
/// A folder that holds no measurement.
pub fn read(folder: &Path) -> Result<Measurement, MeasureError> {
    let path = folder.join(FIGURES);
    let io = |source| MeasureError::Io { path: path.clone(), source };
    if fs::metadata(&path).map_err(io)?.len() > MOST_BYTES {
        return Err(io(std::io::Error::other(format!("longer than {} MB", MOST_BYTES >> 20))));
    }
    serde_json::from_slice(&fs::read(&path).map_err(io)?).map_err(|error| MeasureError::Setup {
        path,
        problem: format!("not the figures of a measurement ({error}); measure again"),
    })
}
