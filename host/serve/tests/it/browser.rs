//! The desk in a real browser, on a desk and on a phone.

use serve::body::Limits;
use testing::browser::Browser;

use super::Running;

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_desk_works_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let running = Running::start(Limits::default(), true);
    let page = format!("http://{}/", running.address);
    browser.test("desk.test.mjs", ".", page.as_ref());
    // What was printed there came out, and nothing else.
    let kept = std::fs::read_dir(running.path("sheets")).unwrap().count();
    assert_eq!(kept, 1);
}
