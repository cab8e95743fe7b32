//! Pages of PWG raster, as clients send them: a writer for tests.
//!
//! Problem: the test files of IPP Everywhere print samples that no package has. Method: header and runs as PWG 5102.4 lays them down,
//! written without a look at the program's reader. Limits: chunky pixels; rows alike are counted, runs are not sought in literals.

/// How a pixel is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// One bit, set is black.
    Black1,
    /// Grey.
    Sgray8,
    /// Red, green, blue.
    Srgb8,
    /// The same with sixteen bits.
    Srgb16,
    /// Cyan, magenta, yellow, black.
    Cmyk8,
}

impl Kind {
    /// All of them, with their names in files.
    pub const ALL: [(Kind, &'static str); 5] = [
        (Kind::Black1, "black-1"),
        (Kind::Cmyk8, "cmyk-8"),
        (Kind::Sgray8, "sgray-8"),
        (Kind::Srgb8, "srgb-8"),
        (Kind::Srgb16, "srgb-16"),
    ];

    /// Colour space, bits of a colour, bits of a pixel.
    fn numbers(self) -> (u32, u32, u32) {
        match self {
            Kind::Black1 => (3, 1, 1),
            Kind::Sgray8 => (18, 8, 8),
            Kind::Srgb8 => (19, 8, 24),
            Kind::Srgb16 => (19, 16, 48),
            Kind::Cmyk8 => (6, 8, 32),
        }
    }

    fn pixel(self, [r, g, b]: [u8; 3]) -> Vec<u8> {
        match self {
            Kind::Black1 => vec![u8::from(r < 128)],
            Kind::Sgray8 => vec![r],
            Kind::Srgb8 => vec![r, g, b],
            Kind::Srgb16 => vec![r, r, g, g, b, b],
            Kind::Cmyk8 => vec![255 - r, 255 - g, 255 - b, 0],
        }
    }
}

/// A document of one page for each function, which gives the colour at a pixel; so many rows are alike.
pub fn document(
    kind: Kind,
    dpi: u32,
    (width, height): (u32, u32),
    alike: u32,
    pages: &[&dyn Fn(u32, u32) -> [u8; 3]],
) -> Vec<u8> {
    let (space, bits, pixel) = kind.numbers();
    let mut stream = b"RaS2".to_vec();
    for page in pages {
        let mut header = vec![0; 1796];
        header[..9].copy_from_slice(b"PwgRaster");
        let fields = [
            (276, dpi),
            (280, dpi),
            (340, 1),
            (352, width * 72 / dpi),
            (356, height * 72 / dpi),
            (372, width),
            (376, height),
            (384, bits),
            (388, pixel),
            (392, (width * pixel).div_ceil(8)),
            (400, space),
            (452, pages.len() as u32),
        ];
        for (at, value) in fields {
            header[at..at + 4].copy_from_slice(&value.to_be_bytes());
        }
        stream.extend(header);
        for y in (0..height).step_by(alike as usize) {
            let row = packed(kind, (0..width).map(|x| kind.pixel(page(x, y))).collect());
            let rows = vec![(); alike.min(height - y) as usize];
            for times in rows.chunks(256) {
                stream.push((times.len() - 1) as u8);
                stream.extend(&row);
            }
        }
    }
    stream
}

/// A row in runs.
fn packed(kind: Kind, pixels: Vec<Vec<u8>>) -> Vec<u8> {
    let units: Vec<Vec<u8>> = match kind {
        Kind::Black1 => pixels
            .chunks(8)
            .map(|eight| {
                let bits = eight.iter().zip(0..).fold(0, |bits, (pixel, at)| bits | pixel[0] << (7 - at));
                vec![bits]
            })
            .collect(),
        _ => pixels,
    };
    let (mut row, mut at) = (Vec::new(), 0);
    while at < units.len() {
        let alike = units[at..].iter().take(128).take_while(|unit| **unit == units[at]).count();
        if alike > 1 || at + 1 == units.len() {
            row.push((alike - 1) as u8);
            row.extend(&units[at]);
            at += alike;
            continue;
        }
        let different = units[at..].windows(2).take(127).take_while(|pair| pair[0] != pair[1]).count();
        match different {
            0 | 1 => {
                row.push(0);
                row.extend(&units[at]);
                at += 1;
            }
            count => {
                row.push((257 - count) as u8);
                units[at..at + count].iter().for_each(|unit| row.extend(unit));
                at += count;
            }
        }
    }
    row
}

/// Writes the samples that `ipp-everywhere.test` asks for at these resolutions into a folder, under its
/// names. Returns their number.
pub fn samples(folder: &std::path::Path, resolutions: &[u32]) -> usize {
    let mut count = 0;
    // Two tenths of an inch of each colour across the page, an inch below its top.
    let drawing = |dpi: u32, grey: bool| {
        move |x: u32, y: u32| match (y / (dpi / 10), x / (dpi / 10)) {
            (10..12, at @ 5..11) => match (grey, at % 3) {
                (true, 0) => [0; 3],
                (true, _) => [128; 3],
                (false, 0) => [0, 255, 255],
                (false, 1) => [255, 0, 255],
                (false, _) => [0, 0, 0],
            },
            _ => [255; 3],
        }
    };
    for &dpi in resolutions {
        let (a4, letter, index) =
            ((dpi * 827 / 100, dpi * 1169 / 100), (dpi * 85 / 10, dpi * 11), (dpi * 4, dpi * 6));
        for (kind, name) in Kind::ALL {
            let into = folder.join(format!("pwg-raster-samples-{dpi}dpi")).join(name);
            std::fs::create_dir_all(&into).expect("a folder");
            let (colour, grey) = (drawing(dpi, false), drawing(dpi, true));
            for (file, size, pages) in [
                ("color.jpg-4x6", index, 1),
                ("gray.jpg-4x6", index, 1),
                ("document-a4", a4, 2),
                ("document-letter", letter, 2),
                ("onepage-a4", a4, 1),
                ("onepage-letter", letter, 1),
            ] {
                let page: &dyn Fn(u32, u32) -> [u8; 3] =
                    if file.starts_with("gray") { &grey } else { &colour };
                let document = document(kind, dpi, size, dpi / 10, &vec![page; pages]);
                std::fs::write(into.join(format!("{file}-{name}-{dpi}dpi.pwg")), document).expect("a file");
                count += 1;
            }
        }
    }
    count
}
