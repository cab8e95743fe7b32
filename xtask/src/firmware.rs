//! `cargo xtask firmware`: the bridge's images, one for each board, and the rig's; and whether they are as
//! small as they are to be.
//!
//! Where the toolchain has clippy, the images are compiled by it, for it makes the same code as the compiler
//! and checks the sources on the way: checking them by themselves would compile everything below them a
//! second time.
//!
//! A release's images are the same bytes wherever they are built. The bridge's library lies outside of the
//! firmware's workspace, and what the compiler calls it depends on the whole path: so the sources are reached
//! by a link that has one place everywhere.

use crate::{cargo, cargo_home, command, elf, succeed, tools};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// A firmware and the board it is built for.
struct Board {
    /// Where its source is.
    folder: &'static str,
    /// What its package calls the program.
    program: &'static str,
    /// What is to run it.
    chip: uf2::Chip,
    /// The feature of the firmware that chooses the board, if there are several.
    feature: Option<&'static str>,
    /// What the compiler makes code for.
    target: &'static str,
    /// What the image is called.
    name: &'static str,
    /// Bytes of memory.
    memory: usize,
}

/// The Pico: Cortex-M0+, no atomics with compare-and-swap. The Pico 2: Cortex-M33.
const BOARDS: [Board; 2] = [
    Board {
        folder: "bridge/firmware",
        program: "foilpress-firmware",
        chip: uf2::Chip::Rp2040,
        feature: Some("pico"),
        target: "thumbv6m-none-eabi",
        name: "foilpress-bridge",
        memory: 264 << 10,
    },
    Board {
        folder: "bridge/firmware",
        program: "foilpress-firmware",
        chip: uf2::Chip::Rp2350,
        feature: Some("pico2"),
        target: "thumbv8m.main-none-eabihf",
        name: "foilpress-bridge-pico2",
        memory: 520 << 10,
    },
];

/// What is installed with the program: the images, and the programs they were made of.
pub const INSTALLED: [&str; 4] = [
    "foilpress-bridge.uf2",
    "foilpress-bridge.elf",
    "foilpress-bridge-pico2.uf2",
    "foilpress-bridge-pico2.elf",
];

/// The board that plays the printer.
const RIG: Board = Board {
    folder: "tests/rig/firmware",
    program: "foilpress-rig-firmware",
    chip: uf2::Chip::Rp2040,
    feature: None,
    target: BOARDS[0].target,
    name: "foilpress-rig",
    memory: BOARDS[0].memory,
};

/// What the compiler makes code for; `rustup target add` brings them.
pub const BARE_METAL: [&str; 2] = [BOARDS[0].target, BOARDS[1].target];

/// What an image may take, by `xtask/budgets.toml`.
struct Budget {
    flash: usize,
    memory: usize,
    stack: usize,
}

/// What the boot ROM keeps of the memory.
const ROM: usize = 8 << 10;

/// For what the folders' own settings have flags.
const BARE: &str = r#"cfg(all(target_arch = "arm", target_os = "none"))"#;

const MEMORY: u32 = 0x2000_0000;

/// Builds the bridge's images and writes them as UF2; gives the path of the Pico's.
pub fn build(root: &Path) -> Result<PathBuf> {
    let [pico, pico2] = &BOARDS;
    build_for(pico2, root, None)?;
    build_for(pico, root, None)
}

/// Builds the images of the bridge and of the rig that the installed targets allow, and names what is
/// missing. None at all is a failure.
pub fn build_possible(root: &Path) -> Result<()> {
    let sysroot = command("rustc", &["--print", "sysroot"]).output().context("there is no rustc")?.stdout;
    let targets = Path::new(String::from_utf8(sysroot)?.trim()).join("lib/rustlib");
    let (there, missing): (Vec<&Board>, Vec<&Board>) =
        BOARDS.iter().chain([&RIG]).partition(|board| targets.join(board.target).join("lib").is_dir());
    for board in &there {
        build_for(board, root, None)?;
    }
    for Board { name, target, .. } in missing {
        println!("{name} is not built, for its target is not installed: rustup target add {target}");
    }
    if there.is_empty() {
        bail!("no target for a board is installed");
    }
    Ok(())
}

/// The link to the sources of a release.
const LINK: &str = "/tmp/foilpress-release";

/// Builds the bridge's images of a release.
pub fn build_for_release(root: &Path) -> Result<()> {
    succeed(command("ln", &["-sfn"]).arg(root).arg(LINK))?;
    let built = BOARDS.iter().try_for_each(|board| build_for(board, root, Some(Path::new(LINK))).map(drop));
    fs::remove_file(LINK)?;
    built
}

/// Builds the rig's image and writes it as UF2; gives its path.
pub fn build_rig(root: &Path) -> Result<PathBuf> {
    build_for(&RIG, root, None)
}

fn build_for(board: &Board, root: &Path, link: Option<&Path>) -> Result<PathBuf> {
    let folder = root.join(board.folder);
    let target = target(root);
    let mut build = cargo(&["build", "--release", "--locked"]);
    if let Some(link) = link {
        build.arg("--manifest-path").arg(link.join(board.folder).join("Cargo.toml"));
        // Beside those of the folder's own settings.
        let flags: Vec<String> = [(root, "foilpress"), (&target, "target"), (&cargo_home(), "cargo")]
            .map(|(from, to)| format!("'--remap-path-prefix={}={to}'", from.display()))
            .into();
        build.arg("--config").arg(format!("target.'{BARE}'.rustflags = [{}]", flags.join(", ")));
    }
    // The folder's own settings name the linker's script and what is logged.
    build.args(board.arguments()).current_dir(&folder).env("CARGO_TARGET_DIR", &target);
    if tools::has_clippy() {
        tools::with_lints(&mut build);
    }
    let status = build.status().context("cargo cannot be started")?;
    if !status.success() {
        bail!(
            "{} for the {} does not build ({status}); `rustup target add {}`?",
            board.folder,
            board.chip,
            board.target
        );
    }
    let program = target.join(board.target).join("release").join(board.program);
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

    let image = uf2::encode(board.chip, &pieces)?;
    // What the ROM would read has to be the image, and one it starts.
    let read = uf2::decode(&image)?;
    read.check_boot().context("is `link-rp.x` among the linker's scripts?")?;
    let path = target.join(board.name).with_extension("uf2");
    fs::write(&path, &image).with_context(|| format!("{} cannot be written", path.display()))?;
    // The log is read with it.
    let elf = path.with_extension("elf");
    fs::write(&elf, &bytes).with_context(|| format!("{} cannot be written", elf.display()))?;

    let budget = budget(&root.join("xtask/budgets.toml"), board.name)?;
    println!("flash   {flash:>7} of {:>7} bytes", budget.flash);
    println!(
        "memory  {memory:>7} of {:>7} bytes, static; the {} has {}",
        budget.memory, board.chip, board.memory
    );
    println!("{} ({} pages)", path.display(), read.pages().len());
    if flash > budget.flash || memory > budget.memory || memory + budget.stack + ROM > board.memory {
        bail!("the image of {} is larger than xtask/budgets.toml allows", board.folder);
    }
    Ok(path)
}

impl Board {
    /// What chooses it in a build.
    fn arguments(&self) -> impl Iterator<Item = &'static str> {
        let feature = self.feature.map(|feature| ["--no-default-features", "--features", feature]);
        feature.into_iter().flatten().chain(["--target", self.target])
    }
}

/// Where the image is built: beside the workspace's own artifacts.
pub fn target(root: &Path) -> PathBuf {
    workspace_target(root).join("firmware")
}

/// Where the workspace is built.
pub fn workspace_target(root: &Path) -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}

fn budget(path: &Path, image: &str) -> Result<Budget> {
    let text = fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))?;
    let section = text.split("\n[").find_map(|section| section.strip_prefix(image)?.strip_prefix("]\n"));
    let section = section.with_context(|| format!("{}: `[{image}]` is missing", path.display()))?;
    let number = |key: &str| {
        section
            .lines()
            .filter_map(|line| line.split('#').next()?.split_once('='))
            .find(|(name, _)| name.trim() == key)
            .and_then(|(_, value)| value.trim().parse().ok())
            .with_context(|| format!("{}: `{key}` is missing or no number of bytes", path.display()))
    };
    Ok(Budget { flash: number("flash")?, memory: number("memory")?, stack: number("stack")? })
}
