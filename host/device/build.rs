//! Puts the bridge's firmware into the program: the UF2 file that `FOILPRESS_FIRMWARE` names, where it is set, and the
//! program it was made of, which `cargo xtask firmware` leaves beside it and which the log is read with.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-env-changed=FOILPRESS_FIRMWARE");
    println!("cargo:rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let (mut file, mut program) = ("None".to_owned(), "None".to_owned());
    if let Some(path) = env::var_os("FOILPRESS_FIRMWARE").filter(|path| !path.is_empty()) {
        let path = fs::canonicalize(&path)
            .unwrap_or_else(|error| panic!("FOILPRESS_FIRMWARE={}: {error}", path.display()));
        let include = |path: &Path| {
            println!("cargo:rerun-if-changed={}", path.display());
            format!("Some(include_bytes!({:?}))", path.display().to_string())
        };
        file = include(&path);
        let elf = path.with_extension("elf");
        if elf.exists() {
            program = include(&elf);
        }
    }
    let text = format!(
        "/// The firmware this program was built with.\nconst FILE: Option<&[u8]> = {file};\n\
         /// The same as the linker left it.\nconst PROGRAM: Option<&[u8]> = {program};\n"
    );
    fs::write(out.join("firmware.rs"), text).expect("OUT_DIR can be written");
}
