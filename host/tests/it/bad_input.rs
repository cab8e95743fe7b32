//! What strangers feed the program: every mistake has exit code 1 (2 in the arguments), a message with the file and the field, and leaves
//! the folder as it was.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use testing::program::{Bench, entries, small_document, text};

/// As small a print as there is.
const SMALL: &str = "--size 2x2mm --paper postcard";

/// A PNG that says it has so many pixels and has none.
fn boast(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let header =
        [b"IHDR".to_vec(), width.to_be_bytes().to_vec(), height.to_be_bytes().to_vec(), vec![8, 2, 0, 0, 0]];
    for chunk in [header.concat(), b"IDAT".to_vec(), b"IEND".to_vec()] {
        bytes.extend((chunk.len() as u32 - 4).to_be_bytes());
        bytes.extend(&chunk);
        let crc = !chunk.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
        });
        bytes.extend(crc.to_be_bytes());
    }
    bytes
}

/// The scan-line EXR header of a picture of so many pixels, without the picture.
fn exr_header(width: i32, height: i32) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
    };
    let channel = |name: &str| [name.as_bytes(), b"\0\x02\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0"].concat();
    attribute("channels", "chlist", &[channel("B"), channel("G"), channel("R"), vec![0]].concat());
    attribute("compression", "compression", &[0]);
    let window = [0, 0, width - 1, height - 1].map(i32::to_le_bytes).concat();
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    bytes.push(0);
    bytes
}

/// Puts bytes in the place of a map of a fresh small document and prints it; returns what was said.
fn with_map(remove: &str, name: &str, bytes: &[u8]) -> String {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::remove_file(bench.path("tile").join(remove)).unwrap();
    fs::write(bench.path("tile").join(name), bytes).unwrap();
    let said = bench.refused(1, &format!("print tile {SMALL}"));
    assert!(said.contains(name), "{said}");
    assert_eq!(bench.entries(), ["tile"], "{said}");
    said
}

#[test]
fn a_file_without_a_command_is_told_the_commands_for_files() {
    let bench = Bench::new();
    fs::write(bench.path("red fish.svg"), "").unwrap();
    let said = bench.command_of(["red fish.svg"]).output().unwrap();
    let text = text(&said.stderr);
    assert_eq!(said.status.code(), Some(2), "{text}");
    for words in ["red fish.svg", "expected a command", "foilpress layers FILE", "foilpress print FILE"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(bench.refused(2, "layerz").contains("layers"));
}

#[test]
fn pictures_that_claim_to_be_huge_are_refused_before_they_are_decoded() {
    for (width, height) in [(40_000, 40_000), (16_384, 16_384), (1, 16_385)] {
        let said = with_map("base_color.png", "base_color.png", &boast(width, height));
        assert!(said.contains("pixels"), "{said}");
    }
    with_map("base_color.png", "base_color.png", &boast(0, 10));
    let said = with_map("base_color.png", "base_color.exr", &exr_header(40_000, 40_000));
    assert!(said.contains("40000"), "{said}");
    with_map("base_color.png", "base_color.exr", &exr_header(i32::MAX, i32::MAX));
    with_map("base_color.png", "base_color.exr", &exr_header(8192, 8192));
}

/// The header of a TIFF picture of 8-bit RGB whose one strip would begin behind the file's end.
fn tiff_header(side: u32) -> Vec<u8> {
    let mut bytes = b"II\x2a\0\x08\0\0\0".to_vec();
    let entries = [
        (256u16, side),
        (257, side),
        (258, 8),
        (259, 1),
        (262, 2),
        (273, 4096),
        (277, 3),
        (278, side),
        (279, 3 * side * side),
    ];
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        bytes.extend([tag.to_le_bytes(), 4u16.to_le_bytes()].concat());
        bytes.extend([1u32.to_le_bytes(), value.to_le_bytes()].concat());
    }
    bytes.extend([0; 4]);
    bytes
}

/// The header of a JPEG picture without a scan.
fn jpeg_header(width: u16, height: u16) -> Vec<u8> {
    let mut bytes = vec![0xff, 0xd8, 0xff, 0xc0, 0, 17, 8];
    bytes.extend([height.to_be_bytes(), width.to_be_bytes()].concat());
    bytes.extend([3, 1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0, 0xff, 0xd9]);
    bytes
}

/// Every reader, on the largest sizes it takes and on larger ones, with nothing behind the header: an answer within two
/// gigabytes.
#[test]
#[cfg(target_os = "linux")]
fn files_that_only_claim_to_be_large_are_answered_within_bounds_of_memory() {
    let bench = Bench::new();
    let within = |command: &str, name: &str| {
        let mut shell = std::process::Command::new("sh");
        let program = testing::program::path().display();
        shell.args(["-c", &format!("ulimit -v 2000000; exec {program} {command}")]);
        shell.env("FOILPRESS_CONFIG", bench.path("config")).env("FOILPRESS_JOBS", bench.path("jobs"));
        shell.env("FOILPRESS_PRINTERS", bench.path("printers"));
        let output = shell.current_dir(bench.path("")).stdin(Stdio::null()).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command}, {name}: {said}");
        assert!(said.contains(name) && !said.contains("panicked"), "{command}, {name}: {said}");
    };
    let maps: [(&str, Vec<u8>); 8] = [
        ("base_color.png", boast(8192, 8192)),
        ("base_color.exr", exr_header(8192, 8192)),
        ("base_color.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 8192\n".to_vec()),
        ("base_color.tif", tiff_header(8192)),
        ("base_color.tif", tiff_header(30_000)),
        ("base_color.jpg", jpeg_header(16_384, 4096)),
        ("base_color.jpg", jpeg_header(65_535, 65_535)),
        ("material.toml", b"size_mm = [1e300, 1e300]\n".to_vec()),
    ];
    for (name, bytes) in maps {
        let _ = fs::remove_dir_all(bench.path("tile"));
        small_document(&bench.path("tile"));
        if name != "material.toml" {
            fs::remove_file(bench.path("tile/base_color.png")).unwrap();
        }
        fs::write(bench.path("tile").join(name), bytes).unwrap();
        within("factor tile -o x.foil -q", name);
    }
    fs::create_dir(bench.path("a.foil")).unwrap();
    let bases: String = (0..16).map(|basis| format!("{basis},0,1,1,1\n{basis},90,1,1,1\n")).collect();
    fs::write(bench.path("a.foil/bases.csv"), format!("basis,theta_h_deg,r,g,b\n{bases}")).unwrap();
    for side in [8192, 1 << 31] {
        let maps = vec!["\"w.png\""; 16].join(",");
        let index = format!(
            "format = 1\nname = \"a\"\nwidth = {side}\nheight = {side}\nsamples = 4096\nbases = \"bases.csv\"\n\
             maps = [{maps}]\n"
        );
        fs::write(bench.path("a.foil/document.toml"), index).unwrap();
        within("map a.foil -o x.mix -q", "a.foil");
    }
    let mut tensor = b"tensor_file\0\x01\0\x01\0\0\0\x03\0rgb\x02\0\x0a".to_vec();
    tensor.extend([64, 1 << 40, 1 << 40].map(u64::to_le_bytes).concat());
    let gltf = br#"{"asset":{"version":"2.0"},"images":[{"bufferView":0}],"textures":[{"source":0}],
        "buffers":[{"byteLength":18446744073709551615}],
        "bufferViews":[{"buffer":0,"byteOffset":18446744073709551615,"byteLength":18446744073709551615}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}"#;
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend([u32::MAX, u32::MAX].map(u32::to_le_bytes).concat());
    glb.extend(b"JSON{}  ");
    let files: [(&str, Vec<u8>); 5] = [
        ("a.binary", [1 << 12, 1 << 12, 1].map(i32::to_le_bytes).concat()),
        ("b.binary", [i32::MAX; 3].map(i32::to_le_bytes).concat()),
        ("a.bsdf", tensor),
        ("a.gltf", gltf.to_vec()),
        ("a.glb", glb),
    ];
    for (name, bytes) in files {
        fs::write(bench.path(name), bytes).unwrap();
        within(&format!("factor {name} -o x.foil -q"), name);
    }
    assert!(!bench.path("x.foil").exists() && !bench.path("x.mix").exists());
}

#[test]
fn a_number_that_is_none_is_named_with_its_pixel() {
    let picture = image::Rgb32FImage::from_fn(24, 16, |x, y| {
        image::Rgb([0.5, if (x, y) == (7, 5) { f32::NAN } else { 0.5 }, 0.5])
    });
    let bench = Bench::new();
    let path = bench.path("nan.exr");
    picture.save(&path).unwrap();
    let said = with_map("base_color.png", "base_color.exr", &fs::read(path).unwrap());
    assert!(said.contains("(7, 5)") && said.contains("NaN"), "{said}");
}

#[test]
fn a_map_of_a_kind_that_is_not_read_is_refused() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    fs::rename(bench.path("tile/base_color.png"), bench.path("tile/base_color.dds")).unwrap();
    let said = bench.refused(1, &format!("print tile {SMALL}"));
    assert!(
        said.contains("base_color.dds is the base colour map by its name") && said.contains("PNG"),
        "{said}"
    );
}

#[test]
fn every_description_refuses_keys_it_does_not_know() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("factor tile -o t.foil -q");
    bench.done("map t.foil -o t.mix -q");
    bench.done("halftone t.mix --size 2x2mm -o t.dots -q");
    bench.done("layout t.dots --paper postcard -o t.sheet -q");
    bench.done("separate t.sheet -o t.passes -q");
    fs::create_dir(bench.path("lib")).unwrap();
    fs::write(bench.path("lib/library.toml"), "format = 1\nbased_on = \"built-in\"\n").unwrap();
    fs::write(bench.path("tile/material.toml"), "").unwrap();
    let before = bench.entries();
    for (file, command) in [
        ("tile/material.toml", format!("print tile {SMALL}")),
        ("t.foil/document.toml", "map t.foil -o x.mix".into()),
        ("t.mix/mix.toml", "halftone t.mix --size 2x2mm -o x.dots".into()),
        ("t.dots/dots.toml", "layout t.dots --paper postcard -o x.sheet".into()),
        ("t.sheet/layout.toml", "separate t.sheet -o x.passes".into()),
        ("t.sheet/sheet.toml", "separate t.sheet -o x.passes".into()),
        ("t.passes/passes.toml", "encode t.passes -o x.rgl".into()),
        ("lib/library.toml", format!("print sample:ladder {SMALL} --library lib")),
    ] {
        let path = bench.path(file);
        let whole = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("surprise = 1\n{whole}")).unwrap();
        let said = bench.refused(1, &command);
        assert!(said.contains(file) && said.contains("surprise"), "{said}");
        fs::write(&path, whole).unwrap();
    }
    assert_eq!(bench.entries(), before);
}

#[test]
fn painted_weights_that_do_not_sum_to_one_are_named_once() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("factor tile -o t.foil -q");
    let path = bench.path("t.foil/weights-00.png");
    let mut map = image::open(&path).unwrap().into_luma16();
    let weight = map.get_pixel(5, 3).0[0];
    map.put_pixel(5, 3, image::Luma([if weight > 30_000 { weight - 200 } else { weight + 200 }]));
    map.save(&path).unwrap();
    for command in [format!("print t.foil {SMALL}"), "map t.foil -o t.mix".into()] {
        let said = bench.refused(1, &command);
        assert!(said.contains("t.foil") && said.contains("pixel (5, 3)"), "{said}");
        assert_eq!(said.matches("not 1").count(), 1, "{said}");
    }
    assert_eq!(bench.entries(), ["t.foil", "tile"]);
}

#[test]
fn inks_that_make_no_stack_are_refused_at_once() {
    let bench = Bench::new();
    for (inks, code, says) in [("-all", 2, "no ink"), ("white", 1, "white"), ("tin", 2, "tin")] {
        let said = bench.refused(code, &format!("print sample:leaf --inks {inks}"));
        assert!(said.contains(says) && !said.contains("basis"), "{said}");
    }
}

#[test]
fn damaged_jobs_are_answered_with_a_byte_and_never_a_panic() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done(&format!("print tile {SMALL} -q --to file:job.rgl"));
    let job = fs::read(bench.path("job.rgl")).unwrap();
    let before = bench.entries();
    for round in 0..24 {
        let at = (round * 7919 + 13) % job.len();
        let mut damaged = job.clone();
        match round % 3 {
            0 => damaged.truncate(at),
            1 => damaged[at] ^= 1 << (round % 8),
            _ => damaged.splice(at..at, [0x1b, 0x1a, round as u8]).for_each(drop),
        }
        fs::write(bench.path("job.rgl"), &damaged).unwrap();
        for command in ["inspect job.rgl -q", "simulate job.rgl -o x.sheet -q"] {
            let output = bench.run(command);
            let said = text(&output.stderr);
            match output.status.code() {
                // A flipped dot is another picture, not a fault.
                Some(0) if round % 3 == 1 => {}
                Some(1) => assert!(said.contains("job.rgl: byte "), "{command}: {said}"),
                other => panic!("{command}: {other:?} {said}"),
            }
        }
        if bench.path("x.sheet").exists() {
            fs::remove_dir_all(bench.path("x.sheet")).unwrap();
        }
        assert_eq!(bench.entries(), before);
    }
}

/// Nothing the user has is ever replaced by something else.
#[test]
fn outputs_never_take_the_place_of_what_the_user_has() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    bench.done("factor tile -o t.foil -q");
    fs::write(bench.path("notes"), "words").unwrap();
    fs::create_dir(bench.path("mine")).unwrap();
    fs::write(bench.path("mine/report.json"), "{}").unwrap();
    fs::write(bench.path("mine/thesis"), "words").unwrap();
    let before = bench.entries();
    for (command, says) in [
        (format!("print tile {SMALL} -o mine"), "mine"),
        (format!("print tile {SMALL} -o tile"), "tile"),
        (format!("print tile {SMALL} -o t.foil"), "t.foil"),
        (format!("print tile {SMALL} -o notes"), "notes is a file"),
        (format!("print tile {SMALL} -o ."), "."),
        (format!("print tile {SMALL} -o no/where"), "there is no folder no"),
        (format!("print tile {SMALL} --to file:t.foil"), "t.foil is a folder"),
        (format!("print tile {SMALL} --to file:no/job.rgl"), "there is no folder no"),
        (format!("print tile {SMALL} -o both --to file:both"), "--to both"),
        (format!("print tile {SMALL} -o both --to file:both/job2.rgl"), "--to both/job2.rgl"),
        ("sample leaf -o mine".into(), "mine"),
        ("map t.foil -o t.foil".into(), "t.foil"),
        ("inks show MS --plot mine".into(), "mine is a folder"),
        #[cfg(unix)]
        (format!("print tile {SMALL} --to file:/dev/null"), "device"),
    ] {
        let said = bench.refused(1, &command);
        assert!(said.contains(says), "{command}: {said}");
        assert_eq!(bench.entries(), before, "{command}");
    }
    assert_eq!(entries(&bench.path("mine")), ["report.json", "thesis"]);
    assert_eq!(fs::read_to_string(bench.path("notes")).unwrap(), "words");
}

#[test]
fn a_documents_name_does_not_choose_where_the_print_goes() {
    let bench = Bench::new();
    let inner = bench.path("a/b");
    small_document(&inner.join("tile"));
    fs::write(inner.join("tile/material.toml"), "name = \"../../evil\\u001b[2J\"\n").unwrap();
    let output = bench.command(&format!("print tile {SMALL} -q")).current_dir(&inner).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!text(&output.stdout).contains('\u{1b}'));
    assert_eq!(bench.entries(), ["a"]);
    assert_eq!(entries(&bench.path("a")), ["b"]);
    assert!(entries(&inner).iter().all(|name| !name.starts_with('.')), "{:?}", entries(&inner));
}

#[test]
fn notes_are_said_once() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let output = bench.run(&format!("print tile {SMALL} -q"));
    let said = text(&output.stderr);
    assert_eq!(said.matches("read as sRGB").count(), 1, "{said}");
    let mut lines: Vec<&str> = said.lines().collect();
    lines.sort_unstable();
    lines.dedup();
    assert_eq!(lines.len(), said.lines().count(), "{said}");
}

/// Where nobody listens to progress the work goes on.
#[test]
#[cfg(target_os = "linux")]
fn a_full_standard_error_is_no_panic_and_a_full_standard_output_is_a_failure() {
    let bench = Bench::new();
    small_document(&bench.path("tile"));
    let full = || fs::OpenOptions::new().write(true).open(Path::new("/dev/full")).unwrap();
    let mut command = bench.command(&format!("print tile {SMALL}"));
    assert_eq!(command.stdout(Stdio::null()).stderr(full()).status().unwrap().code(), Some(0));
    let output = bench.command("inks list").stdout(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("standard output"), "{}", text(&output.stderr));
}

#[test]
fn the_smallest_documents_print_with_every_method() {
    let bench = Bench::new();
    fs::create_dir(bench.path("dot")).unwrap();
    for (name, value) in
        [("base_color.png", [180, 30, 25]), ("roughness.png", [90; 3]), ("metallic.png", [0; 3])]
    {
        image::RgbImage::from_pixel(1, 1, image::Rgb(value)).save(bench.path("dot").join(name)).unwrap();
    }
    for method in ["archetypes", "kmeans", "sacls"] {
        bench.done(&format!("print dot --size 1mm --paper postcard -q --factor {method} --bases 5"));
    }
    for intent in ["basis", "clamp", "blend"] {
        bench.done(&format!("print dot --size 1mm --paper postcard -q --intent {intent} --bases 1"));
    }
}
