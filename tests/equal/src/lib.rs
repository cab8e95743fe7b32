//! Digests of what every machine has to find: functions of `maths`, and the dots of documents of each kind.
//!
//! Problem: that a result is equal on any machine is seen only where two machines find it.
//! Method: the same functions are compiled for this machine and for WebAssembly, which Node runs: another
//! processor, another library of mathematics, another allocator, no threads. Files are read from memory. All
//! find the same digests. Cost: the stages are compiled once more. Limits: no pages, which Ghostscript draws,
//! and no text, which is drawn in the fonts of the machine.

use std::cell::RefCell;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use appearance::brdf::Space;
use appearance::document::{Document, Options, open};
use appearance::gamut::Printable;
use appearance::views::{self, Pictures};
use files::shelf::Memory;
use make::{Layers, Print, layers, print};
use maths::Maths;
use observe::Silent;
use readers::Pixels;
use sheet::DotMap;

/// FNV-1a.
fn digest(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Of every function over a range.
fn functions() -> u64 {
    let results = (1..20_000u32).flat_map(|i| {
        let x = f64::from(i) / 1000.0;
        let double = [
            x.sine(),
            x.cosine(),
            x.tangent(),
            (x / 20.0).arcsine(),
            (x / 20.0).arccosine(),
            x.arctangent(),
            x.arctangent2(3.0),
            (x - 10.0).exponential(),
            x.exponential2(),
            x.logarithm(),
            x.logarithm2(),
            x.logarithm10(),
            x.power(2.4),
            x.cube_root(),
            x.hypotenuse(7.0),
            x.whole_power(-5),
        ];
        let y = x as f32;
        let single =
            [y.sine(), y.exponential(), y.logarithm(), y.power(2.4), y.cube_root(), y.hypotenuse(7.0)];
        double.into_iter().chain(single.map(f64::from))
    });
    digest(results.flat_map(|x| x.to_bits().to_le_bytes()))
}

/// A dot's stack for each dot, and what these stacks are.
fn of_dots(dots: &DotMap) -> u64 {
    digest(format!("{:?}", dots.stacks()).bytes().chain(dots.index().iter().copied()))
}

/// Files in memory.
fn shelf(files: &[(&str, &[u8])]) -> Result<Memory, Box<dyn Error>> {
    let mut memory = Memory::default();
    for (name, bytes) in files {
        memory.insert(name, *bytes)?;
    }
    Ok(memory)
}

/// Of a document of materials, 20 mm wide, in the default inks.
fn document(document: Document) -> Result<u64, Box<dyn Error>> {
    let mut settings = print::Settings::default();
    settings.dots.size = Some("20mm".parse()?);
    Ok(of_dots(&Print::new(document, &settings, &Silent)?.halftoned.dots))
}

/// Of flat art, 12 mm wide.
fn art(files: &[(&str, &[u8])]) -> Result<u64, Box<dyn Error>> {
    let mut settings = layers::Settings::default();
    settings.read.size = Some("12mm".parse()?);
    settings.read.shelf = Arc::new(shelf(files)?);
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| name.into()).collect();
    let read = Layers::open(&paths, &settings, &Silent)?;
    Ok(of_dots(&Layers::compose(&read, &settings, &Silent)?.composed.dots))
}

/// A picture with every tone, and noise.
fn picture(size: (u32, u32), channels: [u32; 3]) -> Result<Vec<u8>, Box<dyn Error>> {
    let tone = |x: u32, y: u32, step: u32| (x * 5 + y * step + (x * y * 7919) % 23) as u8;
    let pixels = Pixels::from_fn(size.0, size.1, |x, y| channels.map(|step| tone(x, y, step)));
    Ok(pixels.png()?)
}

const DRAWING: &[u8] = br##"<svg xmlns="http://www.w3.org/2000/svg" width="30mm" height="20mm"
viewBox="0 0 30 20">
<linearGradient id="g"><stop stop-color="#b32"/><stop offset="1" stop-color="#2ac"/></linearGradient>
<circle cx="10.3" cy="10" r="8.1" fill="url(#g)"/>
<path d="M18 3q9 1 9 14l-9 .3z" transform="rotate(7)" stroke="#361" fill="#ed7" stroke-width=".4"/></svg>"##;

const BRASS: &[u8] =
    br#"{"asset": {"version": "2.0"}, "materials": [{"name": "brass", "pbrMetallicRoughness":
{"baseColorFactor": [0.8, 0.6, 0.2, 1], "metallicFactor": 1, "roughnessFactor": 0.4}}]}"#;

/// The digest of one document of each kind.
fn documents() -> Result<Vec<(&'static str, u64)>, Box<dyn Error>> {
    let sample = |name: &str| open(&format!("sample:{name}"), &Options::default(), &Silent);
    let brass = Options { shelf: Arc::new(shelf(&[("brass.gltf", BRASS)])?), ..Options::default() };
    let (day, night) = (picture((40, 30), [3, 3, 3])?, picture((40, 30), [1, 9, 4])?);
    let views = shelf(&[("day.png", &day), ("night.png", &night)])?;
    let pair = Pictures::Pair { straight: "day.png".into(), highlight: "night.png".into() };
    let (space, settings) = (Space::half_angle(Options::default().samples), print::Settings::default());
    let printable = Printable::combined(&settings.library, &settings.dots.inks, &space);
    let two = views::open(&views, &pair, None, &printable, &space, &Silent)?;
    let photograph = picture((50, 40), [2, 7, 11])?;
    let plate = |step: u32| picture((60, 50), [step; 3]);
    Ok(vec![
        ("leaf", document(sample("leaf")?)?),
        ("dove", document(sample("dove")?)?),
        ("glTF", document(open("brass.gltf", &brass, &Silent)?)?),
        ("two pictures", document(two)?),
        ("drawing", art(&[("drawing.svg", DRAWING)])?),
        ("photograph", art(&[("photograph.png", &photograph)])?),
        ("plates", art(&[("white.png", &plate(1)?), ("gold.png", &plate(6)?)])?),
    ])
}

/// All digests, a line for each.
///
/// # Panics
/// Where a document cannot be printed.
pub fn digests() -> String {
    let mut lines = format!("functions {:016x}\n", functions());
    for (name, found) in documents().expect("all can be printed") {
        lines.push_str(&format!("{name} {found:016x}\n"));
    }
    lines
}

thread_local! {
    static FOUND: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Calculates, and returns how many bytes [`found`] points to.
#[unsafe(no_mangle)]
pub extern "C" fn run() -> usize {
    FOUND.with_borrow_mut(|found| {
        *found = digests();
        found.len()
    })
}

/// The digests of the last [`run`].
#[unsafe(no_mangle)]
pub extern "C" fn found() -> *const u8 {
    FOUND.with_borrow(|found| found.as_ptr())
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::process::Command;

    use needs::Need;

    const TARGET: &str = "wasm32-unknown-unknown";

    /// Runs a module, and prints what it found. Libraries bring calls to a browser's script; none is made.
    const SCRIPT: &str = "
        const module = new WebAssembly.Module(require('fs').readFileSync(process.argv[1]));
        const imports = {};
        for (const { module: from, name } of WebAssembly.Module.imports(module)) {
            imports[from] ??= {};
            imports[from][name] = () => { throw new Error(from + ' ' + name); };
        }
        const { run, found, memory } = new WebAssembly.Instance(module, imports).exports;
        const length = run();
        process.stdout.write(Buffer.from(memory.buffer, found(), length));";

    #[test]
    #[ignore = "real time: cargo xtask test --full"]
    fn another_machine_finds_the_same() {
        let node = std::env::var_os("FOILPRESS_NODE").unwrap_or("node".into());
        if !Command::new(&node).arg("--version").output().is_ok_and(|output| output.status.success()) {
            return Need::Browser.skip("Node is missing");
        }
        let folder = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
        let folder = String::from_utf8(folder.expect("rustc runs").stdout).expect("a path");
        if !Path::new(folder.trim()).is_dir() {
            return Need::Browser.skip("the target wasm32-unknown-unknown is missing");
        }
        let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/wasm");
        let mut build = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
        // The gate's build of the tests has lints, which are said once.
        build.env_remove("RUSTC_WORKSPACE_WRAPPER");
        build.args([
            "build",
            "--quiet",
            "--locked",
            "--package",
            "foilpress-equal",
            "--lib",
            "--target",
            TARGET,
        ]);
        assert!(build.arg("--target-dir").arg(&target).status().is_ok_and(|status| status.success()));
        let module = target.join(TARGET).join("debug/equal.wasm");
        let output = Command::new(node).args(["-e", SCRIPT]).arg(module).output().expect("Node runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8(output.stdout).expect("text"), super::digests());
    }
}
