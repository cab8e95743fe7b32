//! `cargo xtask release`: what people download, for every system that one Linux machine can build for, in `dist/`.
//!
//! Problem: whoever owns such a printer has a Raspberry Pi or a Windows computer, and no compiler.
//! Method: one optimised build a system with a cross linker; a Debian package for each kind of Debian, an archive with everything
//! in one folder for the others; then each archive is unpacked and its program runs here, by itself or under an emulator ([`trial`]), and
//! its jobs are compared byte for byte with this machine's. `tried.md` says what came of it. Sums and a part of the changelog go beside them.
//! Paths of this machine are taken out of the programs, and times are that of the commit, so the same commit gives the same bytes with
//! the same tools.
//! Cost: an optimised build for each system. Limits: the C library of Windows rounds exponentials and the like otherwise, so there
//! a few dots of a material may differ, and only the jobs' sizes have to agree. macOS is not built here
//! (`packaging/macos`); nothing is signed; a board, WinUSB and a real printer are for people to try.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use anyhow::{Context as _, Result, ensure};

use crate::package::{self, Profile};
use crate::{all_files, cargo, cargo_home, command, firmware, succeed};

mod trial;

/// What an archive is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    /// A Debian package of this architecture.
    Deb(&'static str),
    /// A folder as `.tar.gz`.
    Tar,
    /// A folder as `.zip`.
    Zip,
}

impl Form {
    /// The most bytes of a program. For Windows the compiler keeps all functions of a part of a crate in one
    /// section, so that no linker takes out those that nothing calls: an eighth more.
    fn largest(self) -> u64 {
        match self {
            Form::Zip => 36 << 20,
            Form::Deb(_) | Form::Tar => 32 << 20,
        }
    }
}

/// A system.
struct System {
    /// What people call it, as in the archive's name.
    name: &'static str,
    /// What the compiler calls it.
    triple: &'static str,
    form: Form,
    /// The linker and C compiler, and the Debian package that brings it; none if it is this machine's own.
    linker: Option<(&'static str, &'static str)>,
    /// What runs its programs here, and the Debian package that brings that; none if they run by themselves.
    runner: Option<(&'static [&'static str], &'static str)>,
}

const SYSTEMS: [System; 5] = [
    System {
        name: "debian-amd64",
        triple: "x86_64-unknown-linux-gnu",
        form: Form::Deb("amd64"),
        linker: None,
        runner: None,
    },
    System {
        name: "linux-x86_64",
        triple: "x86_64-unknown-linux-musl",
        form: Form::Tar,
        linker: Some(("musl-gcc", "musl-tools")),
        runner: None,
    },
    System {
        name: "windows-x86_64",
        triple: "x86_64-pc-windows-gnu",
        form: Form::Zip,
        linker: Some(("x86_64-w64-mingw32-gcc", "gcc-mingw-w64-x86-64")),
        runner: Some((&["wine"], "wine64")),
    },
    System {
        name: "debian-arm64",
        triple: "aarch64-unknown-linux-gnu",
        form: Form::Deb("arm64"),
        linker: Some(("aarch64-linux-gnu-gcc", "gcc-aarch64-linux-gnu libc6-dev-arm64-cross")),
        runner: Some((&["qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"], "qemu-user-static")),
    },
    System {
        name: "debian-armhf",
        triple: "armv7-unknown-linux-gnueabihf",
        form: Form::Deb("armhf"),
        linker: Some(("arm-linux-gnueabihf-gcc", "gcc-arm-linux-gnueabihf libc6-dev-armhf-cross")),
        runner: Some((&["qemu-arm-static", "-L", "/usr/arm-linux-gnueabihf"], "qemu-user-static")),
    },
];

/// The most bytes of an archive for Windows.
const LARGEST_ZIP: u64 = 25 << 20;

/// The names of all systems.
pub fn names() -> [&'static str; SYSTEMS.len()] {
    SYSTEMS.map(|system| system.name)
}

/// Builds, packs and tries what is asked for; all systems if none is. `dry`: only says what is missing.
pub fn run(root: &Path, only: &[String], dry: bool) -> Result<()> {
    let chosen: Vec<&System> = SYSTEMS
        .iter()
        .filter(|system| only.is_empty() || only.iter().any(|name| name == system.name))
        .collect();
    let missing: Vec<String> = chosen.iter().flat_map(|system| system.missing()).collect();
    for line in &missing {
        println!("missing: {line}");
    }
    if dry {
        println!(
            "{} of {} systems can be built",
            chosen.iter().filter(|s| s.missing().is_empty()).count(),
            chosen.len()
        );
        return Ok(());
    }
    ensure!(missing.is_empty(), "nothing was built, because something is missing");
    let release = Release::of(root)?;
    let _ = fs::remove_dir_all(&release.dist);
    fs::create_dir_all(&release.dist)?;
    firmware::build_for_release(root)?;
    let mut tried = String::from(trial::HEAD);
    let bridge = release.build(&SYSTEMS[0], &["--package", "foilpress-tests", "--bin", "served-bridge"])?;
    let bridge = bridge.join("served-bridge");
    let mut expected = None;
    for system in chosen {
        println!("== {}", system.name);
        let program = release.program(system)?;
        let size = fs::metadata(&program)?.len();
        ensure!(
            size <= system.form.largest(),
            "the program for {} has {size} bytes, more than {}",
            system.name,
            system.form.largest()
        );
        let archive = release.pack(system, &program)?;
        let length = fs::metadata(&archive)?.len();
        ensure!(
            system.form != Form::Zip || length <= LARGEST_ZIP,
            "{} has {length} bytes",
            archive.display()
        );
        let folder = firmware::workspace_target(root).join("release-tried").join(system.name);
        let made = trial::run(system, &archive, &folder, &bridge)?;
        let expected: &Vec<Vec<u8>> = expected.get_or_insert_with(|| made.clone());
        let same = made == *expected;
        tried += &trial::line(system, [size, length], same);
        let near = made.iter().zip(expected).all(|(a, b)| a.len().abs_diff(b.len()) <= b.len() / 100);
        let right = same || near && system.form == Form::Zip;
        ensure!(right, "the program for {} makes other jobs of the same art", system.name);
    }
    for image in firmware::INSTALLED.iter().filter(|name| name.ends_with(".uf2")) {
        fs::copy(firmware::target(root).join(image), release.dist.join(image))?;
    }
    tried += NOT_TRIED;
    fs::write(release.dist.join("tried.md"), tried)?;
    fs::write(release.dist.join("changes.md"), changes(root)?)?;
    release.sums()?;
    println!("{}", release.dist.display());
    Ok(())
}

/// What this machine cannot try.
const NOT_TRIED: &str = "\nNot tried: WinUSB and the COM port of a real bridge on Windows, macOS, a real board, a real printer. The packages for \
    arm64 and armhf were unpacked, not installed.\n\nThe bridge has the USB number 1209:0001, which is for tests: boards must not be passed on with \
    it (packaging/usb-id.md).\n";

/// The part of the changelog that is not released yet.
fn changes(root: &Path) -> Result<String> {
    let text = fs::read_to_string(root.join("CHANGELOG.md")).context("the changelog cannot be read")?;
    let mut parts = text.split("\n## ").skip(1);
    parts.next().map(|part| format!("## {part}")).context("the changelog has no part")
}

impl System {
    /// What is not on this machine, and how to get it.
    fn missing(&self) -> Vec<String> {
        let mut missing = Vec::new();
        let installed = command("rustup", &["target", "list", "--installed"]).output();
        let installed =
            installed.map(|said| String::from_utf8_lossy(&said.stdout).into_owned()).unwrap_or_default();
        if !installed.lines().any(|line| line == self.triple) {
            missing.push(format!("{}: rustup target add {}", self.name, self.triple));
        }
        let runner = self.runner.map(|(runner, package)| (runner[0], package));
        let packers: &[(&str, &str)] = match self.form {
            Form::Zip => &[("zip", "zip"), ("unzip", "unzip"), ("socat", "socat")],
            Form::Deb(_) | Form::Tar => &[],
        };
        for (program, package) in self.linker.into_iter().chain(runner).chain(packers.iter().copied()) {
            if !on_path(program) {
                missing.push(format!("{}: {program}: apt install {package}", self.name));
            }
        }
        missing
    }

    /// The program's file.
    fn program(&self) -> &'static str {
        if self.form == Form::Zip { "foilpress.exe" } else { "foilpress" }
    }
}

fn on_path(program: &str) -> bool {
    env::var_os("PATH")
        .is_some_and(|path| env::split_paths(&path).any(|folder| folder.join(program).is_file()))
}

/// What all systems share.
struct Release<'r> {
    root: &'r Path,
    dist: PathBuf,
    version: String,
    /// Seconds since 1970 of the commit.
    time: String,
}

impl Release<'_> {
    fn of(root: &Path) -> Result<Release<'_>> {
        let said = command("git", &["log", "-1", "--format=%ct"]).current_dir(root).output()?;
        let time = String::from_utf8_lossy(&said.stdout).trim().to_owned();
        ensure!(time.parse::<u64>().is_ok(), "git does not say when the commit was made");
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Release { root, dist: root.join("dist"), version, time })
    }

    /// The optimised program.
    fn program(&self, system: &System) -> Result<PathBuf> {
        let folder = self.build(system, &["--package", "foilpress", "--all-features"])?;
        Ok(folder.join(system.program()))
    }

    /// Builds this with optimisation; the folder where it is then.
    fn build(&self, system: &System, what: &[&str]) -> Result<PathBuf> {
        let mut build = cargo(&["build", "--release", "--locked", "--target", system.triple]);
        build.args(what);
        let mut flags = OsString::new();
        for (from, to) in [(self.root, "foilpress"), (&cargo_home(), "cargo")] {
            flags.push(format!("--remap-path-prefix={}={to} ", from.display()));
        }
        if system.form != Form::Zip {
            // Rust's own linker folds functions that are the same, and addresses take less room: a tenth of the program.
            let linkers = rust_linkers()?;
            for option in ["-fuse-ld=lld", "-Wl,--icf=safe", "-Wl,-z,pack-relative-relocs"] {
                flags.push(format!("-Clink-arg={option} "));
            }
            flags.push(format!("-Clink-arg=-B{} ", linkers.display()));
        }
        build.env("RUSTFLAGS", flags).env("SOURCE_DATE_EPOCH", &self.time).current_dir(self.root);
        if system.form == Form::Zip {
            // Its linker leaves more unused code in the program than the others do.
            build.env("CARGO_PROFILE_RELEASE_LTO", "thin");
        }
        if let Some((linker, _)) = system.linker {
            let triple = system.triple.replace('-', "_");
            build.env(format!("CC_{triple}"), linker);
            if system.form == Form::Tar {
                // Rust brings its own start of a static program, with which `musl-gcc` does not link. What that lacks for C are the headers
                // of the kernel, by which USB is spoken to: those of this machine, after its own.
                let headers = "-idirafter /usr/include -idirafter /usr/include/x86_64-linux-gnu";
                build.env(format!("CFLAGS_{triple}"), headers);
            } else {
                build.env(format!("CARGO_TARGET_{}_LINKER", triple.to_uppercase()), linker);
            }
        }
        succeed(&mut build)?;
        Ok(firmware::workspace_target(self.root).join(system.triple).join("release"))
    }

    /// The archive in `dist/`.
    fn pack(&self, system: &System, program: &Path) -> Result<PathBuf> {
        let name = format!("foilpress-{}-{}", self.version, system.name);
        match system.form {
            Form::Deb(architecture) => {
                let archive = self.dist.join(format!("foilpress_{}_{architecture}.deb", self.version));
                let is_foreign = system.runner.is_some();
                let release = package::Release { triple: system.triple, is_foreign, time: &self.time };
                package::make(
                    self.root,
                    program,
                    &self.native()?,
                    &archive,
                    Profile::Release,
                    Some(&release),
                )?;
                Ok(archive)
            }
            Form::Tar => {
                let folder = self.folder(&name, system, program)?;
                let archive = self.dist.join(format!("{name}.tar.gz"));
                let mut tar = command(
                    "tar",
                    &["--sort=name", "--owner=0", "--group=0", "--numeric-owner", "--mode=go=u-w"],
                );
                tar.arg(format!("--mtime=@{}", self.time))
                    .arg("--use-compress-program=gzip -9n")
                    .arg("-cf")
                    .arg(&archive);
                succeed(tar.arg("-C").arg(folder.parent().unwrap_or(self.root)).arg(&name))?;
                Ok(archive)
            }
            Form::Zip => {
                let folder = self.folder(&name, system, program)?;
                let archive = self.dist.join(format!("{name}.zip"));
                let mut files = Vec::new();
                all_files(&folder, &mut files)?;
                files.sort();
                for file in &files {
                    succeed(command("touch", &["-d", &format!("@{}", self.time)]).arg(file))?;
                }
                let above = folder.parent().unwrap_or(self.root);
                let mut zip = command("zip", &["-9", "-X", "-q"]);
                zip.arg(&archive).current_dir(above).env("TZ", "UTC");
                succeed(zip.args(files.iter().map(|file| file.strip_prefix(above).unwrap_or(file))))?;
                Ok(archive)
            }
        }
    }

    /// This machine's program, which writes man pages and the like for all.
    fn native(&self) -> Result<PathBuf> {
        let native = &SYSTEMS[0];
        let program =
            firmware::workspace_target(self.root).join(native.triple).join("release").join(native.program());
        if program.is_file() { Ok(program) } else { self.program(native) }
    }

    /// Everything in one folder.
    fn folder(&self, name: &str, system: &System, program: &Path) -> Result<PathBuf> {
        let folder = firmware::workspace_target(self.root).join("release-folders").join(name);
        let _ = fs::remove_dir_all(&folder);
        let images = folder.join("firmware");
        fs::create_dir_all(&images)?;
        fs::copy(program, folder.join(system.program()))?;
        for image in firmware::INSTALLED {
            fs::copy(firmware::target(self.root).join(image), images.join(image))?;
        }
        let mut files =
            ["LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md", "README.md"].map(PathBuf::from).to_vec();
        let mut pages = Vec::new();
        all_files(&self.root.join("docs"), &mut pages)?;
        files.extend(pages.iter().filter_map(|page| page.strip_prefix(self.root).ok()).map(PathBuf::from));
        for file in files {
            let place = folder.join(&file);
            fs::create_dir_all(place.parent().unwrap_or(&folder))?;
            fs::copy(self.root.join(&file), place)
                .with_context(|| format!("{} cannot be copied", file.display()))?;
        }
        match system.form {
            Form::Zip => {
                fs::copy(self.root.join("packaging/windows/start.html"), folder.join("start.html"))?;
            }
            Form::Tar | Form::Deb(_) => {
                succeed(Command::new(self.native()?).arg("generate").arg(folder.join("tree")))?;
                for rules in ["70-foilpress.rules", "71-foilpress-queues.rules"] {
                    fs::copy(self.root.join("packaging").join(rules), folder.join(rules))?;
                }
            }
        }
        Ok(folder)
    }

    /// The sums of all files, for `sha256sum --check`.
    fn sums(&self) -> Result<()> {
        let mut names: Vec<OsString> =
            fs::read_dir(&self.dist)?.filter_map(|item| Some(item.ok()?.file_name())).collect();
        names.sort();
        let said = command("sha256sum", &["--"]).args(&names).current_dir(&self.dist).output()?;
        ensure!(said.status.success(), "sha256sum: {}", String::from_utf8_lossy(&said.stderr));
        Ok(fs::write(self.dist.join("SHA256SUMS"), said.stdout)?)
    }
}

/// The folder where C compilers find the linker that comes with Rust.
fn rust_linkers() -> Result<PathBuf> {
    let said = |what: &str| -> Result<String> {
        let output = command("rustc", &["--print", what]).output().context("cannot start rustc")?;
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let folder =
        PathBuf::from(said("sysroot")?).join("lib/rustlib").join(said("host-tuple")?).join("bin/gcc-ld");
    ensure!(folder.join("ld.lld").is_file(), "{} holds no linker", folder.display());
    Ok(folder)
}
