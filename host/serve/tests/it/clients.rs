//! Real clients: the test files of CUPS' `ipptool`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use serve::body::Limits;
use testing::needs::Need;

use super::Running;

/// Where the test files are.
const FILES: &str = "/usr/share/cups/ipptool";
/// Longer than all samples take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(1500);

fn pdf() -> Vec<u8> {
    let drawing = "0 g 120 240 240 240 re f";
    let objects = [
        "<</Type/Catalog/Pages 2 0 R>>".to_owned(),
        "<</Type/Pages/Kids[3 0 R]/Count 1>>".into(),
        "<</Type/Page/Parent 2 0 R/MediaBox[0 0 595 842]/Resources<<>>/Contents 4 0 R>>".into(),
        format!("<</Length {}>>\nstream\n{drawing}\nendstream", drawing.len()),
    ];
    let (mut text, mut places) = (String::from("%PDF-1.4\n"), String::new());
    for (number, object) in (1..).zip(&objects) {
        places.push_str(&format!("{:010} 00000 n \n", text.len()));
        text.push_str(&format!("{number} 0 obj\n{object}\nendobj\n"));
    }
    let at = text.len();
    text.push_str(&format!(
        "xref\n0 5\n0000000000 65535 f \n{places}trailer\n<</Size 5/Root 1 0 R>>\nstartxref\n{at}\n%%EOF\n"
    ));
    text.into_bytes()
}

/// Every test of IPP 1.1, 2.0 and IPP Everywhere passes, none of the raster tests is skipped, and each raster becomes its sheets.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn ipptool_finds_nothing_missing_and_every_sample_is_printed() {
    if !Path::new("/usr/bin/ipptool").exists() || !Path::new(FILES).exists() {
        return Need::Queue.skip("ipptool is not installed; `cargo xtask queue` installs it");
    }
    let running = Running::start(Limits::default(), true);
    let tests = running.path("tests");
    fs::create_dir(&tests).unwrap();
    for entry in fs::read_dir(FILES).unwrap().map(|entry| entry.unwrap().path()) {
        fs::copy(&entry, tests.join(entry.file_name().unwrap())).unwrap();
    }
    // The files ask for samples at six resolutions.
    let resolutions = [150, 180, 300, 360, 600, 720];
    assert_eq!(testing::pwg::samples(&tests, &resolutions), 180);
    fs::write(tests.join("document-a4.pdf"), pdf()).unwrap();
    fs::write(tests.join("document-letter.pdf"), pdf()).unwrap();
    for name in ["color.jpg", "gray.jpg"] {
        image::RgbImage::from_fn(60, 40, |x, y| image::Rgb([(4 * x) as u8, (6 * y) as u8, 90]))
            .save(tests.join(name))
            .unwrap();
    }
    // PostScript is not offered, so these are not sent; but the files have to be there.
    for name in ["document-a4.ps", "document-letter.ps"] {
        fs::write(tests.join(name), "").unwrap();
    }
    let output = Command::new("ipptool")
        .args(["-V", "2.0", "-tf", "document-a4.pdf"])
        .arg(format!("ipp://localhost:{}/ipp/print/standard", running.address.port()))
        .arg("ipp-everywhere.test")
        .current_dir(&tests)
        .output()
        .unwrap();
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(!said.contains("[FAIL]") && !said.contains("cannot be read"), "{said}");
    let lines = |end: &str| said.lines().filter(|line| line.ends_with(end)).count();
    let rasters = |end: &str, dpi: u32| {
        let of = format!("@ {dpi}dpi");
        said.lines().filter(|line| line.contains(&of) && line.ends_with(end)).count()
    };
    for dpi in resolutions {
        // Four types of five documents and one of a photograph, some in three packings; as many as the file has.
        let text = fs::read_to_string(tests.join("ipp-everywhere.test")).unwrap();
        let asked = text.matches("NAME \"Print ").count() / resolutions.len();
        assert_eq!((rasters("[SKIP]", dpi), rasters("[PASS]", dpi)), (0, asked), "{dpi} dpi: {said}");
    }
    assert!(lines("[PASS]") > 100, "{said}");
    // All of them are printed, not only taken.
    let start = Instant::now();
    while running.server.data().open() > 0 {
        assert!(start.elapsed() < PATIENCE, "{} jobs are still open", running.server.data().open());
        std::thread::sleep(Duration::from_millis(100));
    }
    let data = running.server.data();
    let bad: BTreeSet<String> = data
        .jobs
        .values()
        .filter(|job| job.state == serve::jobs::State::Aborted)
        .map(|job| format!("{}: {}", job.name, job.message))
        .collect();
    assert!(bad.is_empty(), "{bad:?}");
}

/// The same printer encrypted: from the first byte on, and by a change in the middle, with the print system's own client.
#[test]
fn a_client_that_wants_encryption_gets_it_in_both_ways() {
    if !Path::new("/usr/bin/ipptool").exists() {
        return Need::Queue.skip("ipptool is not installed; `cargo xtask queue` installs it");
    }
    let running = Running::start(Limits::default(), false);
    let port = running.address.port();
    for (option, scheme) in [("-tv", "ipp"), ("-tvE", "ipp"), ("-tv", "ipps")] {
        let output = Command::new("ipptool")
            .args([option, &format!("{scheme}://localhost:{port}/ipp/print/standard")])
            .arg(Path::new(FILES).join("get-printer-attributes.test"))
            // The client remembers certificates in its user's folder.
            .env("HOME", running.path("."))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && said.contains("[PASS]"), "{option} {scheme}: {said}");
        // What it is told of itself is encrypted if the connection is.
        let is_encrypted = said.contains(&format!("printer-more-info (uri) = https://localhost:{port}/"));
        assert_eq!(is_encrypted, (option, scheme) != ("-tv", "ipp"), "{option} {scheme}: {said}");
    }
}
