//! Pages that devices of the house send to the server, with the real image at its end.

use std::fs;

use super::{Bench, Cartridge, Ink};
use crate::queue::document;
use crate::serve::Serving;
use testing::ipp;

/// A page by IPP crosses the port as the very bytes that the server makes for a file, and the job is completed when its sheet is out.
#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_page_that_a_device_sends_crosses_the_port() {
    let Some(mut bench) = Bench::new(&[Cartridge::from(Ink::Black)]) else { return };
    let serve = |to: &str| {
        let mut command = bench.foilpress(&["serve", "--listen", "127.0.0.1:0", "--to", to]);
        command.env("FOILPRESS_CONFIG", bench.folder.path().join("config"));
        let serving = Serving::of(command);
        serving.load("jpn_hagaki_100x148mm");
        serving
    };
    let mut preset = bench.foilpress(&["preset", "save", "card", "--paper", "postcard"]);
    let saved = preset.env("FOILPRESS_CONFIG", bench.folder.path().join("config")).output().unwrap();
    assert!(saved.status.success(), "{}", super::text(&saved));
    // A postcard of 100 x 148 mm, with a black field in its middle.
    let page = document((283, 420), "", &["0 g 110 200 40 25 re f"]);

    let kept = serve("file:sheets");
    let job = ipp::print(kept.address, "card", "page.pdf", &page).unwrap();
    assert_eq!(kept.wait_for(job), 9);
    kept.kill();
    let mut sheets = fs::read_dir(bench.folder.path().join("sheets")).unwrap();
    let file = fs::read(sheets.next().unwrap().unwrap().path()).unwrap();

    let serving = serve(&bench.to());
    let job = ipp::print(serving.address, "card", "page.pdf", &page).unwrap();
    assert_eq!(serving.wait_for(job), 9);
    assert_eq!(bench.bridge.desk().sheets.len(), 1, "completed before its sheet was out");
    bench.came_out(0, &file, 1);
    serving.kill();
    bench.check();
}
