//! What the owner of a bridge does between sheets: the wiring test, the firmware's log, the state as it changes.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use press::simulate::{Cartridge, Trouble};
use serde_json::Value;

use super::{Bench, INKS, job, text};

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_log_tells_of_the_start_and_of_every_job_in_words() {
    let Some(bench) = Bench::new(&INKS.map(Cartridge::from)) else { return };
    let job = job();
    fs::write(bench.folder.path().join("job.rgl"), &job).unwrap();
    bench.well(&["send", "job.rgl", "--to", &bench.to()]);
    let elf = super::parts().unwrap().0.with_extension("elf");
    let args = ["bridge", "log", "--elf", elf.to_str().unwrap(), "--to", &bench.to()];
    let words = bench.well(&args);
    let entry = |needle: &str| {
        words
            .lines()
            .find(|line| line.contains(needle))
            .unwrap_or_else(|| panic!("no `{needle}` in: {words}"))
    };
    assert!(entry("up on a Pico, after power or reset").contains("info"), "{words}");
    entry(": Printing");
    // To the byte, and later than the start.
    assert!(entry(": Done").contains(&format!("{} bytes printed", job.len())), "{words}");
    let seconds = |line: &str| line.trim().split(' ').next().unwrap().parse::<f64>().unwrap();
    assert!(seconds(entry(": Done")) > seconds(entry("up on a Pico")), "{words}");
    // As JSON the same.
    let output = bench.run(&[&args[..], &["--json"]].concat());
    let lines: Vec<Value> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.last().unwrap()["unreadable"], 0);
    assert!(lines.iter().any(|line| line["text"].as_str().is_some_and(|text| text.contains(": Done"))));
    // Another program's words do not fit, and that is said and not made up.
    let other = bench.run(&["bridge", "log", "--elf", "job.rgl", "--to", &bench.to()]);
    assert!(
        !other.status.success() && text(&other).contains("no program whose log can be read"),
        "{}",
        text(&other)
    );
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_wiring_is_tried_in_every_position_of_the_plug_and_never_on_a_printer() {
    let Some(mut bench) = Bench::new(&INKS.map(Cartridge::from)) else { return };
    // A printer in place of the plug: not a byte, and no reset.
    let with_printer = bench.run(&["bridge", "test", "--to", &bench.to()]);
    let words = text(&with_printer);
    assert!(!with_printer.status.success() && words.contains("no loop-back plug answers"), "{words}");
    let pattern = bench.run(&["bridge", "test", "--pattern", "--to", &bench.to()]);
    let words = text(&pattern);
    assert!(!pattern.status.success() && words.contains("take the cable off the printer"), "{words}");
    assert_eq!((bench.printed(), bench.bridge.desk().refused.clone()), (0, None));
    for position in 1..=3 {
        bench.bridge.plug(position).unwrap();
        let words = bench.well(&["bridge", "test", "--to", &bench.to()]);
        assert!(words.contains(&format!("position {position}: good")), "{words}");
        let json = bench.run(&["bridge", "test", "--json", "--to", &bench.to()]);
        let verdict: Value = serde_json::from_slice(&json.stdout).unwrap();
        assert_eq!(
            (&verdict["good"], &verdict["positions"][0]),
            (&Value::Bool(true), &Value::from(position))
        );
    }
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn what_is_watched_changes_when_the_printer_does() {
    let Some(bench) = Bench::new(&INKS.map(Cartridge::from)) else { return };
    let mut child = bench
        .foilpress(&["bridge", "status", "--watch", "--json", "--to", &bench.to()])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut next = || -> Value { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    let first = next();
    assert!(first["fault"].is_null() && first["device_id"].as_str().unwrap().contains("MD-5500"), "{first}");
    bench.bridge.desk().printer.strike(Trouble::CoverOpen);
    let opened = std::iter::repeat_with(&mut next).find(|state| !state["fault"].is_null()).unwrap();
    assert!(opened["fault"].as_str().unwrap().contains("off line"), "{opened}");
    bench.bridge.desk().printer.close_cover();
    std::iter::repeat_with(&mut next).find(|state| state["fault"].is_null()).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
}
