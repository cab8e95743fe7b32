//! Digests of what every machine has to find: functions of `maths`, and the dots of a sample.
//!
//! Problem: that a result is equal on any machine is seen only where two machines find it.
//! Method: the same functions are compiled for this machine and for WebAssembly, which Node runs: another
//! processor, another library of mathematics, another allocator, no threads. All find the same digests.
//! Cost: the stages are compiled once more. Limits: no documents of files; two samples.

use std::borrow::Cow;
use std::cell::RefCell;
use std::error::Error;

use appearance::document::{Options, open};
use appearance::factor::{FactorSettings, factor};
use appearance::gamut::{GamutSettings, Mapped, Printable, map};
use appearance::materials::Reduced;
use inks::{InkSet, Library};
use maths::Maths;
use observe::Silent;

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

/// Of the dots of a sample, some 20 mm wide, in the default inks.
fn sample(name: &str) -> Result<u64, Box<dyn Error>> {
    let document = open(&format!("sample:{name}"), &Options::default(), &Silent)?;
    let reduced = Reduced::new(document.materials(), (80, 60));
    let library = Library::builtin();
    let printable = Printable::combined(&library, &InkSet::default(), document.materials().space());
    let bases = || Ok(Cow::Owned(factor(&reduced, &FactorSettings::default(), &Silent)?.factored));
    let mapped: Result<Mapped, Box<dyn Error>> =
        map(&reduced, bases, &printable, &GamutSettings::default(), &Silent);
    let mix = mapped?.mix;
    let chosen = halftone::Settings::from_library(&mix.stacks, &library);
    let dots = halftone::halftone(&mix, (480, 360), None, &chosen, &Silent)?;
    Ok(digest(dots.index().iter().copied()))
}

/// All digests, a line for each.
///
/// # Panics
/// Where a sample cannot be made.
pub fn digests() -> String {
    let mut lines = format!("functions {:016x}\n", functions());
    for name in ["leaf", "dove"] {
        let found = sample(name).expect("a sample can be printed");
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
