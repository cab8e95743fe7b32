//! `cargo xtask firmware`: the bridge's image, and whether it is as small as it is to be.

use crate::{cargo, elf, succeed};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Where the microcontroller's code is built for: Cortex-M0+, no atomics with compare-and-swap.
pub const BARE_METAL: &str = "thumbv6m-none-eabi";

/// Flash and static memory the image may take.
struct Budget {
    flash: usize,
    memory: usize,
}

const MEMORY: u32 = 0x2000_0000;

/// Builds the image and writes it as UF2; gives the path of that.
pub fn build(root: &Path) -> Result<PathBuf> {
    let folder = root.join("bridge/firmware");
    let target = target(root);
    let mut build = cargo(&["build", "--release", "--locked"]);
    // The folder's own settings name the processor, the linker's scripts and what is logged.
    build.current_dir(&folder).env("CARGO_TARGET_DIR", &target);
    let status = build.status().context("cargo cannot be started")?;
    if !status.success() {
        bail!("the firmware does not build ({status})");
    }
    let program = target.join(BARE_METAL).join("release/foilpress-firmware");
    let bytes = fs::read(&program).with_context(|| format!("{} cannot be read", program.display()))?;
    let segments = elf::segments(&bytes)?;
    let pieces: Vec<(u64, &[u8])> = segments
        .iter()
        .filter(|segment| !segment.bytes.is_empty())
        .map(|segment| (segment.address, segment.bytes))
        .collect();
    let flash: usize = pieces.iter().map(|(_, bytes)| bytes.len()).sum();
    let memory: usize = segments
        .iter()
        .filter(|segment| segment.running >= MEMORY)
        .map(|segment| segment.size as usize)
        .sum();

    let image = uf2::encode(&pieces)?;
    // What the ROM would read has to be the image, and one it starts.
    let read = uf2::decode(&image)?;
    read.check_boot().context("is `link-rp.x` among the linker's scripts?")?;
    let path = target.join("foilpress-bridge.uf2");
    fs::write(&path, &image).with_context(|| format!("{} cannot be written", path.display()))?;
    // The log is read with it.
    let elf = path.with_extension("elf");
    fs::write(&elf, &bytes).with_context(|| format!("{} cannot be written", elf.display()))?;

    let budget = budget(&folder.join("budget.toml"))?;
    println!("flash   {flash:>7} of {:>7} bytes", budget.flash);
    println!("memory  {memory:>7} of {:>7} bytes, static; the rest of 270336 is stack", budget.memory);
    println!("{} ({} pages)", path.display(), read.pages().len());
    if flash > budget.flash || memory > budget.memory {
        bail!("the image is larger than bridge/firmware/budget.toml allows");
    }
    Ok(path)
}

/// Checks the image's source as `cargo clippy` checks all other.
pub fn lint(root: &Path) -> Result<()> {
    let mut lint = cargo(&["clippy", "--release", "--locked", "--", "-D", "warnings"]);
    lint.current_dir(root.join("bridge/firmware")).env("CARGO_TARGET_DIR", target(root));
    succeed(&mut lint)
}

/// Where the image is built: beside the workspace's own artifacts.
pub fn target(root: &Path) -> PathBuf {
    workspace_target(root).join("firmware")
}

/// Where the workspace is built.
pub fn workspace_target(root: &Path) -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}

fn budget(path: &Path) -> Result<Budget> {
    let text = fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))?;
    let number = |key: &str| {
        text.lines()
            .filter_map(|line| line.split('#').next()?.split_once('='))
            .find(|(name, _)| name.trim() == key)
            .and_then(|(_, value)| value.trim().parse().ok())
            .with_context(|| format!("{}: `{key}` is missing or no number of bytes", path.display()))
    };
    Ok(Budget { flash: number("flash")?, memory: number("memory")? })
}
