//! A test in a system of its own: other mounts, another network.
//!
//! Problem: a full disk and other addresses cannot be had in the system where tests run. Method: the test
//! starts itself again in new namespaces, in which it is root. Limits: Linux; where namespaces are not
//! allowed the test says so and does nothing.

use std::path::PathBuf;
use std::process::Command;

/// Variable with the folder of a test that runs inside.
const FOLDER: &str = "FOILPRESS_TEST_INSIDE";

/// The folder of the test `name` once it runs inside, after `prepare` with this folder behind it was run
/// there as root; `None` outside, where the test has been run inside and has passed. `unshare` has the
/// namespaces, such as `-rm`.
///
/// # Panics
/// The test fails inside.
pub fn inside(name: &str, unshare: &str, prepare: &str) -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os(FOLDER) {
        return Some(folder.into());
    }
    let is_allowed = Command::new("unshare").args([unshare, "true"]).output();
    if !is_allowed.is_ok_and(|done| done.status.success()) {
        println!("skipped: no namespaces can be made here");
        return None;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let script = format!("{prepare} \"$1\" && exec \"$0\" --exact \"$2\" --nocapture");
    let done = Command::new("unshare")
        .args([unshare, "sh", "-c", &script])
        .arg(std::env::current_exe().expect("this program"))
        .args([folder.path().as_os_str(), name.as_ref()])
        .env(FOLDER, folder.path())
        .output()
        .expect("it starts");
    let text = [done.stdout, done.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(done.status.success() && text.contains("1 passed"), "{text}");
    None
}
