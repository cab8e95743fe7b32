//! Documents that never end, and interrupted work, end in time and leave nothing behind.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use testing::needs::ghostscript;
use testing::program::{Bench, entries, text};

/// Whether any process has this text in its arguments.
fn runs(what: &str) -> bool {
    let listing = fs::read_dir("/proc").into_iter().flatten().filter_map(Result::ok);
    listing
        .filter_map(|entry| fs::read(entry.path().join("cmdline")).ok())
        .any(|arguments| text(&arguments).contains(what))
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn endless_pages_end_at_the_limit_in_every_path_and_nothing_runs_on() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let scratch = bench.path("scratch");
    fs::create_dir(&scratch).unwrap();
    // Calculates for ever, and shows pages for ever.
    for (name, body) in [("loop.ps", "{} loop"), ("pages.ps", "{showpage} loop")] {
        fs::write(bench.path(name), format!("%!PS\n{body}\n")).unwrap();
        let file = bench.path(name).display().to_string();
        for command in [
            format!("layers {name}"),
            format!("layers {name} --page 1"),
            format!("plan layers {name} --pages white,gold"),
            format!("cups-filter 1 me title 1 FoilpressSpots=Named {file}"),
            format!("cups-filter 1 me title 1 FoilpressSpots=Off {file}"),
        ] {
            let begun = Instant::now();
            let output = bench
                .command(&command)
                .env("FOILPRESS_TIME_LIMIT", "2")
                .env("TMPDIR", &scratch)
                .output()
                .unwrap();
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{command}: {said}");
            // A page, or all pages together.
            let time = said.contains("took more than 2 s and was stopped")
                || said.contains("took more than 20 s altogether and was stopped");
            let number = said.contains("more than 1000 pages");
            assert!(time && said.contains("FOILPRESS_TIME_LIMIT") || number, "{command}: {said}");
            assert!(begun.elapsed() < Duration::from_secs(60), "{command}: {:?}", begun.elapsed());
            assert!(!runs(&file), "{command}: Ghostscript goes on");
            assert!(entries(&scratch).is_empty(), "{command}: {:?}", entries(&scratch));
        }
    }
}

#[test]
fn a_drawing_with_endless_filters_ends_at_the_limit() {
    let bench = Bench::new();
    let dilate =
        r#"<feMorphology operator="dilate" radius="50"/><feMorphology operator="erode" radius="50"/>"#
            .repeat(200);
    let svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="190mm" height="260mm"><filter id="f" x="0" y="0" width="1" height="1">{dilate}</filter>
        <g id="white"><rect width="700" height="900" filter="url(#f)"/></g></svg>"##
    );
    fs::write(bench.path("heavy.svg"), svg).unwrap();
    for command in ["layers heavy.svg", "plan layers heavy.svg"] {
        let begun = Instant::now();
        let output = bench.command(command).env("FOILPRESS_TIME_LIMIT", "1").output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("heavy.svg: drawing it took more than 1 s"), "{said}");
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
    }
}

#[test]
fn a_drawing_on_which_the_renderer_fails_is_an_error_like_any_other() {
    let bench = Bench::new();
    // Its noise overflows in builds that check.
    let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"><filter id="f">
        <feTurbulence baseFrequency="0.05" numOctaves="200"/></filter><g id="white"><rect width="9" height="9" filter="url(#f)"/></g></svg>"##;
    fs::write(bench.path("noise.svg"), svg).unwrap();
    let output = bench.run("plan layers noise.svg --paper postcard");
    let said = text(&output.stderr);
    assert!(!said.contains("panicked"), "{said}");
    assert!(output.status.success() || said.contains("noise.svg: the drawing cannot be rendered"), "{said}");
}

#[test]
fn a_cancelled_filter_leaves_neither_folders_nor_a_ghostscript() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    fs::create_dir(bench.path("scratch")).unwrap();
    fs::write(bench.path("loop.ps"), "%!PS\n{} loop\n").unwrap();
    let file = bench.path("loop.ps").display().to_string();
    let mut child = bench
        .command(&format!("cups-filter 1 me title 1 FoilpressSpots=Named {file}"))
        .env("TMPDIR", bench.path("scratch"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !runs(&format!("-f\0{file}")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "Ghostscript is never started");
        std::thread::sleep(Duration::from_millis(20));
    }
    // As the print system ends it.
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert_ne!(child.wait().unwrap().code(), Some(0));
    assert!(!runs(&format!("-f\0{file}")), "Ghostscript goes on");
    assert!(entries(&bench.path("scratch")).is_empty(), "{:?}", entries(&bench.path("scratch")));
}

/// Runs the program, and how long it took and how many megabytes it had in memory at its most.
#[cfg(target_os = "linux")]
fn measured(bench: &Bench, command: &str) -> (Option<i32>, String, Duration, u64) {
    let begun = Instant::now();
    let mut program = bench.command(command);
    let mut child = program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let (about, mut peak) = (format!("/proc/{}/status", child.id()), 0);
    let code = loop {
        // The system keeps the highest value itself; only what is taken in the last moment may be missed.
        let said = fs::read_to_string(&about).unwrap_or_default();
        let high = said
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        peak = peak.max(high.unwrap_or(0));
        match child.try_wait().unwrap() {
            Some(status) => break status.code(),
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    let took = begun.elapsed();
    let said = text(&child.wait_with_output().unwrap().stderr);
    (code, said, took, peak / 1024)
}

#[cfg(target_os = "linux")]
#[test]
fn hostile_art_of_each_kind_ends_within_five_seconds_and_500_megabytes() {
    use std::io::Write as _;
    use zip::write::SimpleFileOptions;
    let bench = Bench::new();
    let chain = |count: usize, each: &dyn Fn(usize) -> String| (0..count).map(each).collect::<String>();
    let drawing = |name: &str, inside: &str| {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"30mm\" height=\"30mm\">{inside}</svg>"
        );
        fs::write(bench.path(name), svg).unwrap();
    };
    let fill = |paint: &str| format!("<rect width='30' height='30' {paint}/>");
    let clip = |i: usize| format!("<clipPath id='c{i}' clip-path='url(#c{})'>{}</clipPath>", i + 1, fill(""));
    drawing("clips.svg", &(chain(3000, &clip) + &fill("clip-path='url(#c0)'")));
    let tile = |i: usize| {
        let next = format!("fill='url(#p{})'", i + 1);
        format!(
            "<pattern id='p{i}' width='4' height='4' patternUnits='userSpaceOnUse'>{}</pattern>",
            fill(&next)
        )
    };
    drawing("patterns.svg", &(chain(400, &tile) + &fill("fill='url(#p0)'")));
    let huge = "<pattern id='p' width='30000' height='30000' patternUnits='userSpaceOnUse'><circle r='1'/></pattern>";
    drawing("tile.svg", &(huge.to_owned() + &fill("fill='url(#p)'")));
    drawing("deep.svg", &("<g>".repeat(200_000) + &"</g>".repeat(200_000)));
    drawing("device.svg", "<image width='9' height='9' href='/dev/zero'/>");
    let laughs =
        chain(9, &|i| format!("<g id='g{i}'>{}</g>", format!("<use href='#g{}'/>", i + 1).repeat(10)));
    drawing("laughs.svg", &laughs);

    // 600 megabytes behind every part of an archive that is read.
    let bomb = |name: &str, kind: &str, part: &str| {
        let mut zip = zip::ZipWriter::new(fs::File::create(bench.path(name)).unwrap());
        // Stored, by which the kind is known.
        let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        zip.start_file("mimetype", stored).unwrap();
        zip.write_all(kind.as_bytes()).unwrap();
        let about = "<DOC><IMAGE width='60' height='40' x-res='600' y-res='600'/></DOC>";
        zip.start_file("maindoc.xml", SimpleFileOptions::default()).unwrap();
        zip.write_all(about.as_bytes()).unwrap();
        if kind.ends_with("openraster") && part != "stack.xml" {
            let list = "<image w='60' h='40'><stack><layer name='white' src='data/a.png'/></stack></image>";
            zip.start_file("stack.xml", SimpleFileOptions::default()).unwrap();
            zip.write_all(list.as_bytes()).unwrap();
        }
        zip.start_file(part, SimpleFileOptions::default().compression_level(Some(1))).unwrap();
        let zeros = vec![b' '; 1 << 22];
        (0..150).for_each(|_| zip.write_all(&zeros).unwrap());
        zip.finish().unwrap();
    };
    bomb("picture.ora", "image/openraster", "data/a.png");
    bomb("list.ora", "image/openraster", "stack.xml");
    bomb("merged.kra", "application/x-krita", "mergedimage.png");

    // 3 600 megapixels in a header, and strips of four gigabytes in a file of a few bytes.
    let tiff = |name: &str, side: u32, strip: u32| {
        let mut file = b"II*\0\x08\0\0\0".to_vec();
        let fields: [(u16, u16, u32, u32); 9] = [
            (256, 4, 1, side),
            (257, 4, 1, side),
            (258, 3, 1, 8),
            (259, 3, 1, 8),
            (262, 3, 1, 1),
            (273, 4, 1, 8),
            (277, 3, 1, 1),
            (278, 4, 1, side),
            (279, 4, 1, strip),
        ];
        file.extend((fields.len() as u16).to_le_bytes());
        for (tag, kind, count, value) in fields {
            file.extend(tag.to_le_bytes().into_iter().chain(kind.to_le_bytes()));
            file.extend(count.to_le_bytes().into_iter().chain(value.to_le_bytes()));
        }
        file.extend([0; 4]);
        fs::write(bench.path(name), file).unwrap();
    };
    tiff("size.tif", 60_000, 100);
    tiff("strip.tif", 100, u32::MAX);

    // A profile of 600 megabytes in a picture of four pixels.
    let mut profile = flate2::write::ZlibEncoder::new(b"x\0\0".to_vec(), flate2::Compression::fast());
    let zeros = vec![0; 1 << 22];
    (0..150).for_each(|_| profile.write_all(&zeros).unwrap());
    let profile = profile.finish().unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(bench.path("profile.png")).unwrap(), 2, 2);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_chunk(png::chunk::iCCP, &profile).unwrap();
    writer.write_image_data(&[0; 4]).unwrap();
    writer.finish().unwrap();

    for name in [
        "clips.svg",
        "patterns.svg",
        "tile.svg",
        "deep.svg",
        "device.svg",
        "laughs.svg",
        "picture.ora",
        "list.ora",
        "merged.kra",
        "size.tif",
        "strip.tif",
        "profile.png",
    ] {
        let (code, said, took, megabytes) = measured(&bench, &format!("plan layers {name}"));
        assert!(!said.contains("found an archive"), "{name} is not read as what it is");
        println!("{name}: {took:.1?}, {megabytes} MB, {code:?}: {said}");
        assert!(code == Some(1) && said.contains(name), "{name}: {code:?} {said}");
        assert!(took < Duration::from_secs(5), "{name} took {took:?}");
        assert!((1..500).contains(&megabytes), "{name} took {megabytes} MB");
    }
}
