//! The desk in a real browser, on a desk and on a phone.

use observe::Silent;
use press::inspect::inspect;
use serve::body::Limits;
use serve::jobs::State;
use testing::browser::Browser;

use super::Running;

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_desk_works_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let running = Running::start(Limits::default(), true);
    let page = format!("http://{}/", running.address);
    browser.test("desk.test.mjs", ".", page.as_ref());
    // What was printed there came out, and nothing else; and it lies where it was put.
    let data = running.server.data();
    let job = data.jobs.values().find(|job| job.state == State::Completed).expect("a job that was printed");
    let [sheet] = &running.sheets_of(job)[..] else { panic!("more or less than one sheet") };
    let found = inspect(sheet, &Silent).inspection;
    let black = found.passes.iter().find(|pass| pass.ink == "black").and_then(|pass| pass.bounds).unwrap();
    let (left, top) = job.ticket.at.unwrap();
    // The mark begins at pixel 60 of 236 in a picture of 20 mm, and the printer at 3.387 x 3.048 mm.
    let expected = [left, top].map(|at| f64::from(at) / 100.0 + 60.0 / 236.0 * 20.0);
    let corner = [80.0, f64::from(protocol::paper::Paper::Postcard.top())].map(|dots| dots * 25.4 / 600.0);
    for ((at, expected), corner) in [black.x, black.y].into_iter().zip(expected).zip(corner) {
        let mm = at as f64 * 25.4 / 600.0 + corner;
        assert!((mm - expected).abs() < 0.06, "{mm}, not {expected}");
    }
    assert_eq!(std::fs::read_dir(running.path("sheets")).unwrap().count(), 1);
}
