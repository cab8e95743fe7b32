//! On Windows the program takes and gives text as UTF-8, and opens paths of any length.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_CFG_WINDOWS").is_some() {
        use embed_manifest::manifest::{ActiveCodePage, Setting};
        let manifest = embed_manifest::new_manifest("Foilpress")
            .active_code_page(ActiveCodePage::Utf8)
            .long_path_aware(Setting::Enabled);
        embed_manifest::embed_manifest(manifest).expect("the build's folder can be written");
    }
}
