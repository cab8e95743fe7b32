//! Plays the scenarios of `tests/rig.toml` on a bridge with the rig at its cable: docs/bench.md.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use ::rig::Shortest;
use foilpress_tests::rig::{Bridge, Rig, dump, play, read, scenarios};

const USAGE: &str = "usage: rig FOILPRESS BRIDGE RIG_PORT [FOLDER]
  FOILPRESS  the program, such as target/debug/foilpress
  BRIDGE     what stands behind its --to: usb: or serial:/dev/ttyACM0
  RIG_PORT   the rig's serial port, such as /dev/ttyACM1
  FOLDER     where each scenario's waveform goes, as NAME.vcd";

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("failed: {error}");
            ExitCode::from(2)
        }
    }
}

/// Whether all went as they should.
fn run() -> Result<bool, Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let (program, address, port, waves) = match &args[..] {
        [program, address, port] => (program, address, port, None),
        [program, address, port, folder] => (program, address, port, Some(Path::new(folder))),
        _ => return Err(USAGE.into()),
    };
    let program = fs::canonicalize(program).map_err(|error| format!("{program}: {error}"))?;
    let mut rig = Rig::open(Path::new(port))?;
    let folder = env::temp_dir().join(format!("foilpress-rig-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    if let Some(waves) = waves {
        fs::create_dir_all(waves)?;
    }
    let bridge = Bridge { program: &program, address, folder: &folder };
    let mut good = true;
    for scenario in &read(&scenarios())?.scenario {
        match play(scenario, &mut rig, &bridge) {
            Ok(shown) => {
                println!("good   {}: {} bytes{}", scenario.name, shown.report.taken, times(&shown.shortest));
                if let Some(waves) = waves.filter(|_| !shown.words.is_empty()) {
                    let name: PathBuf =
                        waves.join(scenario.name.replace([' ', ','], "-")).with_extension("vcd");
                    fs::write(name, dump(&shown.words))?;
                }
            }
            Err(error) => {
                good = false;
                println!("WRONG  {error}");
            }
        }
    }
    fs::remove_dir_all(&folder)?;
    Ok(good)
}

/// The times of the samples, if there were any.
fn times(shortest: &Shortest) -> String {
    match (shortest.setup, shortest.strobe, shortest.hold) {
        (Some(setup), Some(strobe), Some(hold)) => {
            format!("; setup {setup}, strobe {strobe}, hold {hold} ns at least")
        }
        _ => String::new(),
    }
}
