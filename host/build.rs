//! Puts the bridge's firmware into the program: the UF2 file that `FOILPRESS_FIRMWARE` names, where it is set.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-env-changed=FOILPRESS_FIRMWARE");
    println!("cargo:rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let value = match env::var_os("FOILPRESS_FIRMWARE").filter(|path| !path.is_empty()) {
        None => "None".to_owned(),
        Some(path) => {
            let path = fs::canonicalize(&path)
                .unwrap_or_else(|error| panic!("FOILPRESS_FIRMWARE={}: {error}", path.display()));
            println!("cargo:rerun-if-changed={}", path.display());
            format!("Some(include_bytes!({:?}))", path.display().to_string())
        }
    };
    let text =
        format!("/// The firmware this program was built with.\nconst FILE: Option<&[u8]> = {value};\n");
    fs::write(out.join("firmware.rs"), text).expect("OUT_DIR can be written");
}
