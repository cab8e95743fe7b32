//! Puts the bridge's firmware into the program: the UF2 file that `FOILPRESS_FIRMWARE` names, where it is set, that of the other
//! board beside it, and the programs they were made of, which `cargo xtask firmware` leaves there and which logs are read with.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-env-changed=FOILPRESS_FIRMWARE");
    println!("cargo:rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let mut files = String::new();
    if let Some(path) = env::var_os("FOILPRESS_FIRMWARE").filter(|path| !path.is_empty()) {
        let path = fs::canonicalize(&path)
            .unwrap_or_else(|error| panic!("FOILPRESS_FIRMWARE={}: {error}", path.display()));
        let include = |path: &Path| {
            println!("cargo:rerun-if-changed={}", path.display());
            format!("include_bytes!({:?})", path.display().to_string())
        };
        for file in [path.clone(), path.with_file_name("foilpress-bridge-pico2.uf2")] {
            if file.exists() {
                let elf = file.with_extension("elf");
                let program = if elf.exists() { format!("Some({})", include(&elf)) } else { "None".into() };
                files += &format!("({}, {program}), ", include(&file));
            }
        }
    }
    let text = format!(
        "/// The firmware this program was built with, for each board, and the same as the linker left it.\n\
         const FILES: &[(&[u8], Option<&[u8]>)] = &[{files}];\n"
    );
    fs::write(out.join("firmware.rs"), text).expect("OUT_DIR can be written");
}
