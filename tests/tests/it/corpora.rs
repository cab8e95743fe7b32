//! Everything the fuzzer has found worth keeping, tried again: the same checks without the fuzzer.

use std::path::Path;

fn replay(target: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    let mut inputs = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        println!("{}", path.display());
        check(&std::fs::read(&path).unwrap());
        inputs += 1;
    }
    assert!(inputs > 1, "{} is empty", folder.display());
}

#[test]
fn frames_hold() {
    replay("frame", properties::frame::check);
}

#[test]
fn pass_streams_hold() {
    replay("runs", properties::runs::check);
}

#[test]
fn the_printers_language_holds() {
    replay("rgl", properties::rgl::check);
}

#[test]
fn the_engine_holds() {
    replay("engine", properties::engine::check);
}

#[test]
fn firmware_images_hold() {
    replay("uf2", properties::uf2::check);
}

#[test]
fn the_workstations_session_holds() {
    replay("host", properties::host::check);
}

#[test]
fn what_is_kept_over_restarts_holds() {
    replay("kept", properties::kept::check);
}

#[test]
fn a_boot_loaders_replies_hold() {
    replay("picoboot", properties::picoboot::check);
}

#[test]
fn art_holds() {
    replay("art", properties::art::check);
}

#[test]
fn a_negotiations_answers_hold() {
    replay("talk", properties::talk::check);
}
