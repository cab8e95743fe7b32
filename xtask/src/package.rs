//! The Debian package: built, installed into a root of its own and looked at there; as root also installed on this machine,
//! where it prints through the machine's own print system, and taken away again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use needs::Need;

use crate::{cargo, command, firmware, queue, succeed, tools};

/// What makes the package; fetched into the build's folder if it is not there.
const CARGO_DEB: &str = "3.8.0";

/// Which build goes into the package.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// For users.
    Release,
    /// For a try: the same package of a slower program.
    Dev,
}

/// Builds the program and its package, tries it, and says where it is.
pub fn build(root: &Path, profile: Profile) -> Result<()> {
    let target = firmware::workspace_target(root);
    let (name, built) = match profile {
        Profile::Release => ("release", target.join("release/foilpress")),
        Profile::Dev => ("dev", target.join("debug/foilpress")),
    };
    // The tests' build has the libraries already, with the features of the whole workspace.
    let which: &[&str] = match profile {
        Profile::Release => &["--package", "foilpress", "--all-features"],
        Profile::Dev => &["--workspace", "--bin", "foilpress", "--features", "foilpress/log,foilpress/serve"],
    };
    succeed(cargo(&[&["build", "--locked", "--profile", name], which].concat()).current_dir(root))?;
    pack(root, &built, profile)
}

/// Another system's package: the compiler's name of it, and the time of the release in seconds since 1970.
pub struct Release<'r> {
    /// The compiler's name of the system.
    pub triple: &'r str,
    /// Whether it is another architecture than this machine's, so that its libraries are not here.
    pub is_foreign: bool,
    /// When, in seconds since 1970.
    pub time: &'r str,
}

/// The package of this program on this machine.
fn pack(root: &Path, built: &Path, profile: Profile) -> Result<()> {
    firmware::build(root)?;
    let package = firmware::workspace_target(root).join("package/foilpress.deb");
    let tree = make(root, built, built, &package, profile, None)?;
    check(&package, &tree)?;
    if is_root() {
        install_here(root, &package)?;
    } else {
        println!("not installed on this machine: only root can");
    }
    println!("{}", package.display());
    Ok(())
}

/// Makes the package of this program, with pages that a program of this machine writes, the `native` one; gives the folder of what that wrote.
pub fn make(
    root: &Path,
    built: &Path,
    native: &Path,
    package: &Path,
    profile: Profile,
    release: Option<&Release<'_>>,
) -> Result<PathBuf> {
    let target = firmware::workspace_target(root);
    // `cargo-deb` looks for what it packs below the build's folder, in `release`: one of our own, to hold nothing else.
    let target_of_package = target.join("package");
    let folder = target_of_package.join(release.map_or("", |release| release.triple)).join("release");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder)?;
    fs::copy(built, folder.join("foilpress"))?;
    let tree = folder.join("tree");
    succeed(Command::new(native).arg("generate").arg(&tree))?;
    let mut pages = command("gzip", &["-9", "--no-name", "--recursive"]);
    succeed(pages.arg(tree.join("usr/share/man")))?;
    // The bridge's images, and the programs they were made of, which logs are read with.
    let images = folder.join("firmware");
    fs::create_dir(&images)?;
    for file in firmware::INSTALLED {
        let built = firmware::target(root).join(file);
        fs::copy(&built, images.join(file))
            .with_context(|| format!("{} cannot be copied", built.display()))?;
    }
    let mut make = Command::new(tool(&target)?);
    make.args(["--no-build", "--locked", "--quiet", "--output"]).arg(package);
    match release {
        // The optimised program has no symbols any more.
        Some(release) => {
            make.args(["--no-strip", "--target", release.triple]).env("SOURCE_DATE_EPOCH", release.time);
            if release.is_foreign {
                make.args(["--variant", "foreign"]);
            }
        }
        None => {
            make.arg("--strip");
        }
    }
    if profile == Profile::Dev {
        // Nobody keeps this one.
        make.arg("--fast");
    }
    succeed(make.current_dir(root.join("host")).env("CARGO_TARGET_DIR", &target_of_package))?;
    Ok(tree)
}

/// The package of the tests' own build, for the gate; left out with a word where print queues are.
pub fn run_where_possible(root: &Path, program: &Path) -> Result<()> {
    let possible = is_root() && Path::new("/usr/bin/dpkg").exists() && Path::new("/usr/bin/man").exists();
    if !possible {
        return tools::skip(Need::Package, "the Debian package needs root, dpkg and man");
    }
    pack(root, program, Profile::Dev)
}

/// `cargo-deb` in this version.
fn tool(target: &Path) -> Result<PathBuf> {
    let tools = target.join("tools");
    let program = tools.join("bin/cargo-deb");
    let there = Command::new(&program).arg("--version").output();
    if !there.is_ok_and(|said| String::from_utf8_lossy(&said.stdout).trim().ends_with(CARGO_DEB)) {
        let mut install = cargo(&[
            "install",
            "cargo-deb",
            "--version",
            CARGO_DEB,
            "--locked",
            "--force",
            "--quiet",
            // It packs for a second; optimised it is built for minutes.
            "--debug",
            "--no-default-features",
            "--root",
        ]);
        // A target folder of its own, not that of the workspace.
        succeed(
            install.arg(&tools).arg("--target-dir").arg(tools.join("build")).env_remove("CARGO_TARGET_DIR"),
        )?;
    }
    Ok(program)
}

/// Installs the package into an empty root and does there what its users do first.
fn check(package: &Path, tree: &Path) -> Result<()> {
    let root = tree.with_file_name("root");
    let _ = fs::remove_dir_all(&root);
    for folder in ["var/lib/dpkg/updates", "var/lib/dpkg/info", "tmp"] {
        fs::create_dir_all(root.join(folder))?;
    }
    fs::write(root.join("var/lib/dpkg/status"), "")?;
    let mut install = Command::new("dpkg");
    install.arg(format!("--root={}", root.display()));
    // The root has no other packages; scripts run outside of it, where its shell is.
    install.args([
        "--force-depends",
        "--force-script-chrootless",
        "--force-not-root",
        "--log=/dev/null",
        "--install",
    ]);
    succeed(install.arg(package).stdout(Stdio::null()))?;
    let program = root.join("usr/bin/foilpress");
    let version = said(Command::new(&program).arg("--version"))?;
    ensure!(version.starts_with("foilpress "), "`foilpress --version` said {version}");
    // What the print system will start is what the program itself writes, and all of it is there.
    for (path, mode) in [
        ("usr/lib/cups/backend/foilpress", 0o755),
        ("usr/lib/cups/filter/foilpress", 0o755),
        ("usr/share/cups/mime/foilpress.types", 0o644),
        ("usr/share/ppd/foilpress/foilpress-md5500.ppd", 0o644),
        ("usr/lib/udev/rules.d/70-foilpress.rules", 0o644),
        ("usr/lib/udev/rules.d/71-foilpress-queues.rules", 0o644),
        ("usr/share/bash-completion/completions/foilpress", 0o644),
        ("usr/share/foilpress/firmware/foilpress-bridge.elf", 0o644),
        ("usr/share/foilpress/firmware/foilpress-bridge-pico2.elf", 0o644),
        ("usr/share/doc/foilpress/README.md", 0o644),
        ("usr/share/doc/foilpress/docs/wiring.md", 0o644),
        ("usr/share/doc/foilpress/docs/guide/decal/white.png", 0o644),
    ] {
        let found = root.join(path);
        let installed = fs::read(&found).with_context(|| format!("{path} is not in the package"))?;
        if tree.join(path).exists() {
            ensure!(installed == fs::read(tree.join(path))?, "{path} differs from what the program writes");
        }
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let found = fs::metadata(&found)?.permissions().mode() & 0o777;
            ensure!(found == mode, "{path} has mode {found:o}, not {mode:o}");
        }
    }
    ensure!(
        said(Command::new(&program).args(["queue", "ppd"]))?.as_bytes()
            == fs::read(root.join("usr/share/ppd/foilpress/foilpress-md5500.ppd"))?,
        "the printer description is not that of the program"
    );
    // Nobody listens there; the images are found and read before anything is asked.
    let mut flash = Command::new(&program);
    flash.args(["bridge", "flash", "--to", "tcp:127.0.0.1:1"]).env_remove("FOILPRESS_FIRMWARE");
    let flash = String::from_utf8_lossy(&flash.output()?.stderr).into_owned();
    ensure!(
        flash.contains("for a Pico\n") && flash.contains("for a Pico 2\n"),
        "`bridge flash` said {flash}"
    );
    let devices = said(Command::new(&program).arg("cups-backend"))?;
    ensure!(devices.contains("foilpress"), "the backend lists no device: {devices}");
    for page in fs::read_dir(root.join("usr/share/man/man1"))? {
        let page = page?.path();
        let mut man = command("man", &["--warnings", "--local-file"]);
        let shown = man.arg(&page).env("MANWIDTH", "100").env("LC_ALL", "C.UTF-8").output()?;
        let complaints = String::from_utf8_lossy(&shown.stderr);
        ensure!(shown.status.success() && complaints.trim().is_empty(), "{}: {complaints}", page.display());
        ensure!(
            String::from_utf8_lossy(&shown.stdout).contains("SYNOPSIS"),
            "{} has no synopsis",
            page.display()
        );
    }
    succeed(command("bash", &["-n"]).arg(root.join("usr/share/bash-completion/completions/foilpress")))?;
    fs::remove_dir_all(&root)?;
    Ok(())
}

/// What the package puts on a machine.
const INSTALLED: [&str; 3] =
    ["/usr/bin/foilpress", "/usr/lib/cups/backend/foilpress", "/usr/lib/cups/filter/foilpress"];

/// What all users of the machine share: made by the package, removed with it when it is purged.
const STATE: &str = "/var/lib/foilpress";

fn is_root() -> bool {
    #[cfg(unix)]
    return fs::metadata("/proc/self").is_ok_and(|data| std::os::unix::fs::MetadataExt::uid(&data) == 0);
    #[cfg(not(unix))]
    return false;
}

/// Installs the package, prints through it, and removes it. A machine that has one keeps it.
fn install_here(root: &Path, package: &Path) -> Result<()> {
    if let Some(path) = INSTALLED.into_iter().chain([STATE]).find(|path| Path::new(path).exists()) {
        println!("not installed on this machine: {path} is there already, and stays");
        return Ok(());
    }
    queue::install()?;
    succeed(command("dpkg", &["--install"]).arg(package).stdout(Stdio::null()))?;
    // Whatever comes of it, the machine is left as it was.
    let tried = has_shared_state().and_then(|()| try_here(root));
    let removed = succeed(command("dpkg", &["--purge", "foilpress"]).stdout(Stdio::null()));
    tried.and(removed)?;
    let left: Vec<&str> =
        INSTALLED.into_iter().chain([STATE]).filter(|path| Path::new(path).exists()).collect();
    ensure!(left.is_empty(), "left behind by the package: {}", left.join(", "));
    Ok(())
}

/// The folder of resets owed and ribbon used is there, and every user may write to it but not remove another's files.
fn has_shared_state() -> Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let data = fs::metadata(STATE).with_context(|| format!("the package did not make {STATE}"))?;
        let mode = data.permissions().mode() & 0o7777;
        ensure!(data.is_dir() && mode == 0o1777, "{STATE} has mode {mode:o}, not 1777");
    }
    Ok(())
}

fn try_here(root: &Path) -> Result<()> {
    let version = said(Command::new(INSTALLED[0]).arg("--version"))?;
    ensure!(version.starts_with("foilpress "), "`foilpress --version` said {version}");
    let page = said(command("man", &["foilpress-queue"]).env("MANWIDTH", "100").env("LC_ALL", "C.UTF-8"))?;
    ensure!(page.contains("SYNOPSIS"), "`man foilpress-queue` shows {page}");
    let mut queues = cargo(&["test", "--workspace", "--test", "it", "--locked", "--quiet"]);
    succeed(queues.args(["--", "--ignored", "queue::system::"]).current_dir(root))
}

fn said(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("cannot start {command:?}"))?;
    if !output.status.success() {
        bail!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
