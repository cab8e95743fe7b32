//! Art that would end the program or fill the computer: it ends in an error, soon.

use std::time::Instant;

use super::drawings::drawing;
use super::*;

/// What a drawing is refused with, within the time that owners wait.
fn soon(inside: &str) -> String {
    let bench = Bench::new();
    let file = bench.write("art.svg", drawing(inside));
    let begun = Instant::now();
    let said = refused(&[file]);
    assert!(begun.elapsed().as_secs() < 5, "{:?}: {said}", begun.elapsed());
    said
}

#[test]
fn what_is_nested_without_measure_is_refused() {
    let chain = |count: usize, each: &dyn Fn(usize) -> String| (0..count).map(each).collect::<String>();
    let fill = |paint: &str| format!("<rect width='30' height='30' {paint}/>");
    let clips =
        chain(3000, &|i| format!("<clipPath id='c{i}' clip-path='url(#c{})'>{}</clipPath>", i + 1, fill("")));
    assert!(
        soon(&(clips + &fill("clip-path='url(#c0)'"))).contains("deep in each other; expected at most 512")
    );
    let tile = |i: usize| {
        let next = format!("fill='url(#p{})'", i + 1);
        format!(
            "<pattern id='p{i}' width='4' height='4' patternUnits='userSpaceOnUse'>{}</pattern>",
            fill(&next)
        )
    };
    assert!(soon(&(chain(400, &tile) + &fill("fill='url(#p0)'"))).contains("deep in each other"));
    let laughs =
        chain(9, &|i| format!("<g id='g{i}'>{}</g>", format!("<use href='#g{}'/>", i + 1).repeat(10)));
    assert!(soon(&laughs).contains("more than 2000000 elements"));
    // As deep as is allowed, it is drawn, if only in one of its tiles.
    let bench = Bench::new();
    let deepest = chain(240, &tile) + &fill("fill='url(#p0)'") + "<rect width='1' height='1'/>";
    assert!(read(&[bench.write("deep.svg", drawing(&deepest))], &Options::default()).drawn.dots() > 0);
}

#[test]
fn tiles_and_layers_beyond_all_memory_are_refused() {
    for height in ["4294967295", "30000"] {
        let said = soon(&format!(
            "<pattern id='p' width='30000' height='{height}' patternUnits='userSpaceOnUse'><circle r='1'/></pattern>\
             <rect width='30' height='30' fill='url(#p)'/>"
        ));
        assert!(said.contains("MB of memory; make the tiles of its patterns smaller"), "{said}");
    }
    // Thirty layers, each 25 times as large as the drawing.
    let layers = format!(
        "<clipPath id='c'><rect x='-900' y='-900' width='9000' height='9000'/></clipPath>{}<rect x='-500' y='-500' width='9000' height='9000'/>{}",
        "<g clip-path='url(#c)'>".repeat(30),
        "</g>".repeat(30)
    );
    assert!(soon(&layers).contains("MB of memory"));
}

#[cfg(unix)]
#[test]
fn links_lead_to_ordinary_files_beside_the_drawing_only() {
    let bench = Bench::new();
    fs::create_dir(bench.path("art")).unwrap();
    let picture = bench.grey("outside.png", (2, 2), &[0; 4]);
    fs::copy(&picture, bench.path("art/in side.png")).unwrap();
    std::os::unix::fs::symlink(&picture, bench.path("art/link.png")).unwrap();
    let status = std::process::Command::new("mkfifo").arg(bench.path("art/pipe.png")).status();
    assert!(status.unwrap().success());
    let linked = |href: &str| {
        let image = format!("<image width='9' height='9' href='{href}'/>");
        let file = bench.write("art/a.svg", drawing(&image));
        let begun = Instant::now();
        let found = open(&[file], &Options::default(), &Silent);
        assert!(begun.elapsed().as_secs() < 5, "{href}");
        found.map(|art| art.drawn.dots()).map_err(|error| error.to_string())
    };
    let outside = "lies outside of the folder of the drawing, so it is not read; put it where";
    for (href, words) in [
        ("/dev/zero", outside),
        ("../outside.png", outside),
        ("link.png", outside),
        (picture.to_str().unwrap(), outside),
        ("pipe.png", "is no ordinary file"),
        (".", "is no ordinary file"),
        ("gone.png", "cannot be read"),
        ("https://example.org/a.png", "cannot be read"),
    ] {
        let said = linked(href).unwrap_err();
        assert!(said.contains(words) && said.contains(href), "{href}: {said}");
    }
    let inside = bench.path("art/in side.png");
    for href in
        ["in side.png", "in%20side.png", "../art/in side.png", &format!("file://{}", inside.display())]
    {
        assert!(linked(href).unwrap() > 0, "{href}");
    }
}

#[test]
fn what_expands_within_a_drawing_is_refused() {
    use base64::Engine as _;
    use std::io::Write as _;
    let embedded = |kind: &str, bytes: &[u8]| {
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        soon(&format!("<image width='9' height='9' href='data:image/{kind};base64,{data}'/>"))
    };
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'>").unwrap();
    (0..300).for_each(|_| packed.write_all(&vec![b' '; 1 << 20]).unwrap());
    let said = embedded("svg+xml", &packed.finish().unwrap());
    assert!(said.contains("expands to more than 256 MB"), "{said}");
    let deep =
        format!("<svg xmlns='http://www.w3.org/2000/svg'>{}{}</svg>", "<g>".repeat(900), "</g>".repeat(900));
    assert!(embedded("svg+xml", deep.as_bytes()).contains("is a drawing that is nested too deeply"));
    // A picture of 900 megapixels in a few bytes of header; its data are missing.
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 30_000, 30_000);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]).unwrap();
    drop(writer);
    assert!(embedded("png", &png).contains("has too many pixels"));
}
