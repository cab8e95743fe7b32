//! The program in a folder of its own, and a small document for it.

use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

/// The program: cargo's own for an integration test of its package, or the one `FOILPRESS_PROGRAM` names, as the gate does;
/// else built now, beside the running test.
///
/// # Panics
/// When it cannot be built.
pub fn path() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let built = ["CARGO_BIN_EXE_foilpress", "FOILPRESS_PROGRAM"].into_iter().find_map(std::env::var_os);
        if let Some(program) = built {
            return program.into();
        }
        let test = std::env::current_exe().expect("a test has a file");
        let folder = test.parent().and_then(Path::parent).expect("cargo keeps tests two folders down");
        let mut build = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
        build.args([
            "build",
            "--quiet",
            "--locked",
            "--package",
            "foilpress",
            "--bin",
            "foilpress",
            "--all-features",
        ]);
        if folder.ends_with("release") {
            build.arg("--release");
        }
        build.arg("--target-dir").arg(folder.parent().expect("target"));
        assert!(build.status().is_ok_and(|status| status.success()), "the program can be built");
        folder.join("foilpress")
    })
}

/// A fresh folder to run the program in.
pub struct Bench {
    folder: TempDir,
    /// Where the program keeps settings and jobs: not those of whoever runs the tests.
    home: TempDir,
}

impl Bench {
    /// An empty one.
    #[expect(clippy::new_without_default, reason = "a test's helper")]
    pub fn new() -> Bench {
        let folder = || tempfile::tempdir().expect("a temporary folder");
        Bench { folder: folder(), home: folder() }
    }

    /// A name in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with these arguments, split at spaces.
    pub fn command(&self, args: &str) -> Command {
        self.command_of(args.split_whitespace())
    }

    /// The program with these arguments.
    pub fn command_of(&self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
        let mut command = Command::new(path());
        command.args(args).current_dir(self.folder.path()).stdin(Stdio::null());
        command.env("FOILPRESS_CONFIG", self.home.path().join("config"));
        command
            .env("FOILPRESS_JOBS", self.home.path().join("jobs"))
            .env("FOILPRESS_PRINTERS", self.home.path().join("printers"));
        command
    }

    /// Runs to the end with this typed.
    pub fn answered(&self, args: &str, typed: &str) -> Output {
        let mut command = self.command(args);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        child.stdin.take().expect("piped").write_all(typed.as_bytes()).expect("it listens");
        child.wait_with_output().expect("it ends")
    }

    /// Runs to the end.
    pub fn run(&self, args: &str) -> Output {
        self.command(args).output().expect("the program starts")
    }

    /// Runs and returns standard output; fails the test unless the exit code is 0.
    pub fn done(&self, args: &str) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(0), "{args}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Runs what must fail with this exit code; returns what was said.
    pub fn refused(&self, code: i32, args: &str) -> String {
        let output = self.run(args);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        assert!(!said.contains("panicked"), "{args}: {said}");
        said
    }

    /// Everything in the folder, hidden entries too.
    pub fn entries(&self) -> Vec<String> {
        entries(self.folder.path())
    }
}

/// Names in a folder, sorted.
pub fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Bytes as text.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A small PBR folder: a glossy red half beside a bare metal half.
pub fn small_document(folder: &Path) {
    fs::create_dir_all(folder).expect("a folder");
    let half = |left: [u8; 3], right: [u8; 3]| {
        image::RgbImage::from_fn(24, 16, |x, _| image::Rgb(if x < 12 { left } else { right }))
    };
    for (name, picture) in [
        ("base_color.png", half([180, 30, 25], [200, 200, 205])),
        ("roughness.png", half([90; 3], [130; 3])),
        ("metallic.png", half([0; 3], [255; 3])),
    ] {
        picture.save(folder.join(name)).expect("a picture");
    }
}
