//! Puts the memory map of the board where the linker looks for it.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let map = if env::var_os("CARGO_FEATURE_PICO2").is_some() { "rp2350.x" } else { "rp2040.x" };
    let map = PathBuf::from("src/board").join(map);
    fs::copy(&map, out.join("memory.x")).expect("the map can be read, and OUT_DIR written");
    println!("cargo:rustc-link-search={}", out.display());
    if env::var_os("CARGO_FEATURE_PICO").is_some() {
        // Places the second-stage boot loader, which the RP2350 does not have.
        println!("cargo:rustc-link-arg-bins=-Tlink-rp.x");
    }
    println!("cargo:rerun-if-changed={}", map.display());
}
