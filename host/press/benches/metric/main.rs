//! Tables for decisions on the metric, in words and figures: no times.
//!
//! `FOILPRESS_DATA=... cargo bench -p foilpress-press --bench metric -- weights`, or `bounds`, `widths`, `balls`, `prints`.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

mod balls;
mod light;
mod prints;

use std::path::PathBuf;

fn main() {
    let Some(data) = std::env::var_os("FOILPRESS_DATA").map(PathBuf::from) else {
        eprintln!("FOILPRESS_DATA names no folder of measurements and texture sets");
        return;
    };
    for table in std::env::args().skip(1) {
        match table.as_str() {
            "weights" => light::weights(&data),
            "bounds" => light::bounds(&data),
            "widths" => light::widths(&data),
            "balls" => balls::balls(&data),
            "prints" => prints::prints(&data),
            // Cargo's own.
            "--bench" => {}
            other => {
                eprintln!("there is no table `{other}`; there are weights, bounds, widths, balls, prints")
            }
        }
    }
}
