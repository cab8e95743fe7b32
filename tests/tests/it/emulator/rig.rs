//! The rig's image plays the printer at the bridge's image, two boards on one cable: every scenario of `tests/rig.toml`.

use std::path::{Path, PathBuf};

use foilpress_tests::emulated::EmulatedRig;
use foilpress_tests::rig::{Bridge, Rig, dump, play, read, scenarios};

use super::parts;

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn every_scenario_of_the_rig_goes_as_it_should() {
    let Some((image, program)) = parts() else { return };
    let rig_image =
        PathBuf::from(std::env::var_os("FOILPRESS_RIG").expect("`cargo xtask emulator` builds it"));
    let folder = tempfile::tempdir().unwrap();
    let [here, there, files] = ["bridge", "rig", "files"].map(|name| folder.path().join(name));
    for folder in [&here, &there, &files] {
        std::fs::create_dir(folder).unwrap();
    }
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("emulator");
    let boards = EmulatedRig::start([&image, &rig_image], &scripts, [&here, &there]).unwrap();
    let address = format!("serial:{}", boards.ports[0].display());
    let bridge = Bridge { program: &program, address: &address, folder: &files };
    let mut rig = Rig::open(&boards.ports[1]).unwrap();
    let scenarios = read(&scenarios()).unwrap().scenario;
    assert!(scenarios.len() >= 10);
    for scenario in &scenarios {
        let shown = play(scenario, &mut rig, &bridge).unwrap();
        if !shown.words.is_empty() {
            // A change of nStrobe for each edge of the bytes of a millisecond.
            let dump = dump(&shown.words);
            assert!(dump.lines().filter(|line| line.ends_with('s')).count() > 50, "{}", scenario.name);
        }
    }
}
