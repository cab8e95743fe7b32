//! Text and line art as people get them: pages through every path, decoded from their jobs, against what was drawn.

use std::path::Path;
use std::process::{Command, Stdio};

use image::{GrayImage, Luma, Rgb, RgbImage};
use observe::Silent;
use press::inspect::inspect;
use protocol::ink::Ink;

use testing::needs::{Need, ghostscript, md5k, starts};
use testing::program::Bench;

/// Dots row by row.
#[derive(Clone, PartialEq)]
struct Dots {
    width: usize,
    set: Vec<bool>,
}

impl Dots {
    fn new(width: usize, length: usize, is: impl Fn(usize, usize) -> bool) -> Dots {
        Dots { width, set: (0..width * length).map(|at| is(at % width, at / width)).collect() }
    }

    fn at(&self, x: usize, y: usize) -> bool {
        self.set[y * self.width + x]
    }

    fn length(&self) -> usize {
        self.set.len() / self.width
    }

    /// First and last column and row of what is set, the last excluded.
    fn bounds(&self) -> [usize; 4] {
        let set = || (0..self.set.len()).filter(|&at| self.set[at]);
        let columns = || set().map(|at| at % self.width);
        let rows = || set().map(|at| at / self.width);
        [columns().min(), rows().min(), columns().max(), rows().max()]
            .map(|side| side.expect("something is drawn"))
    }

    /// A part of it.
    fn part(&self, [left, top, right, bottom]: [usize; 4]) -> Dots {
        Dots::new(right + 1 - left, bottom + 1 - top, |x, y| self.at(left + x, top + y))
    }

    fn differences(&self, other: &Dots) -> usize {
        assert_eq!((self.width, self.length()), (other.width, other.length()));
        self.set.iter().zip(&other.set).filter(|(a, b)| a != b).count()
    }
}

/// The dots of a job that have any of these inks, cut to what is printed at all.
fn printed(job: &[u8], inks: &[Ink]) -> Dots {
    let passes = inspect(job, &Silent).passes;
    let of = |wanted: &dyn Fn(Ink) -> bool| {
        let planes: Vec<_> = passes.iter().filter(|pass| wanted(pass.ink)).map(|pass| &pass.plane).collect();
        let (width, length) = (passes[0].plane.width, passes[0].plane.length);
        let is = |x: usize, y: usize| {
            planes.iter().any(|plane| plane.bits[y * plane.stride + x / 8] << (x % 8) & 0x80 != 0)
        };
        Dots::new(width, length, is)
    };
    let all = of(&|_| true);
    of(&|ink| inks.contains(&ink)).part(all.bounds())
}

/// Art that must be exact: squares of three dots, black or bare, and a coloured box without which nothing is hard.
const MODULES: (usize, usize) = (60, 40);
const BOX: usize = 90;

fn module(x: usize, y: usize) -> bool {
    let corner = (x == 0 || x + 1 == MODULES.0) && (y == 0 || y + 1 == MODULES.1);
    corner || (x * 7919 + y * 104_729 + x * y * 31) % 11 < 5
}

fn pixel(x: u32, y: u32) -> [u8; 3] {
    let (x, y) = (x as usize / 3, y as usize / 3);
    match x < MODULES.0 {
        true if module(x, y) => [0; 3],
        true => [255; 3],
        false => [200, 120, 60],
    }
}

const SIZE: (u32, u32) = (3 * MODULES.0 as u32 + BOX as u32, 3 * MODULES.1 as u32);

/// Fails if a module is not exactly as drawn, or anything but black is on one.
fn assert_exact(job: &[u8], path: &str) {
    let drawn = Dots::new(3 * MODULES.0, 3 * MODULES.1, |x, y| module(x / 3, y / 3));
    let part = [0, 0, drawn.width - 1, drawn.length() - 1];
    let (black, all) = (printed(job, &[Ink::Black]), printed(job, &Ink::ALL));
    assert_eq!((all.width, all.length()), (SIZE.0 as usize, SIZE.1 as usize), "{path}");
    assert_eq!(black.part(part).differences(&drawn), 0, "{path}: wrong dots of black");
    assert_eq!(all.part(part).differences(&drawn), 0, "{path}: dots of other inks");
}

fn job(bench: &Bench, arguments: &str) -> Vec<u8> {
    // A folder of an earlier job is not replaced.
    let _ = std::fs::remove_dir_all(bench.path("art.print"));
    bench.done(&format!("layers {arguments} -o art.print"));
    std::fs::read(bench.path("art.print/job.rgl")).expect("a job")
}

#[test]
fn one_bit_art_is_exact_beside_tones_in_pictures_and_drawings() {
    let bench = Bench::new();
    let picture = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| Rgb(pixel(x, y)));
    for name in ["art.png", "art.tif"] {
        picture.save(bench.path(name)).expect("a picture");
        assert_exact(&job(&bench, &format!("{name} --dpi 600")), name);
    }
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{}in' height='{}in' viewBox='0 0 {} {}'>",
        f64::from(SIZE.0) / 600.0,
        f64::from(SIZE.1) / 600.0,
        SIZE.0,
        SIZE.1
    );
    for (x, y) in
        (0..MODULES.1).flat_map(|y| (0..MODULES.0).map(move |x| (x, y))).filter(|&(x, y)| module(x, y))
    {
        svg.push_str(&format!("<path d='M{} {}h3v3h-3z'/>", 3 * x, 3 * y));
    }
    svg.push_str(&format!(
        "<rect x='{}' width='{BOX}' height='{}' fill='#c8783c'/></svg>",
        3 * MODULES.0,
        SIZE.1
    ));
    std::fs::write(bench.path("art.svg"), svg).expect("a drawing");
    assert_exact(&job(&bench, "art.svg"), "art.svg");
}

/// Whether Ghostscript is here; else the test is left out.
/// A page as PostScript, in points from its lower left corner.
fn page((width, length): (f64, f64), drawing: &str) -> String {
    format!(
        "%!PS\n%%BoundingBox: 0 0 {} {}\n<</PageSize[{width} {length}]>>setpagedevice\n{drawing}\nshowpage\n",
        width.ceil(),
        length.ceil()
    )
}

/// The job that a queue makes of a file.
fn queued(bench: &Bench, file: &str) -> Vec<u8> {
    let mut command = bench.command_of(["cups-filter", "1", "user", "title", "1", "", file]);
    let output = command.stdin(Stdio::null()).output().expect("the filter starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn run(program: &mut Command) -> Vec<u8> {
    let output = program.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn drawn_by(device: &str, file: &Path) -> Vec<u8> {
    let device = format!("-sDEVICE={device}");
    run(Command::new("gs")
        .args(["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-r600", &device, "-sOutputFile=-"])
        .arg(file))
}

#[test]
fn one_bit_art_is_exact_beside_tones_in_pages() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    // In dots from the lower left corner of a sheet of 4 x 3 inches, clear of the margins.
    let mut drawing = String::from(".12 .12 scale 300 700 translate 0 setgray\n");
    for (x, y) in
        (0..MODULES.1).flat_map(|y| (0..MODULES.0).map(move |x| (x, y))).filter(|&(x, y)| module(x, y))
    {
        // A pixel that an area only touches is drawn, too.
        let (left, bottom) = (3 * x, 3 * (MODULES.1 - 1 - y));
        drawing.push_str(&format!("{left}.25 {bottom}.25 2.5 2.5 rectfill\n"));
    }
    drawing.push_str(&format!(
        ".784 .471 .235 setrgbcolor {}.25 .25 {BOX} .5 sub {} .5 sub rectfill\n",
        3 * MODULES.0,
        SIZE.1
    ));
    std::fs::write(bench.path("art.ps"), page((288.0, 216.0), &drawing)).expect("a page");
    assert_exact(&queued(&bench, "art.ps"), "queue");
    assert_exact(&job(&bench, "art.ps"), "layers");
}

const LINE: &str = "The quick brown fox jumps over the lazy dog";
const FONTS: [&str; 3] = ["Times-Roman", "Helvetica", "Helvetica-Bold"];
const SIZES: [f64; 4] = [6.0, 8.0, 10.0, 14.0];
/// A whole number of dots on each side, and of the coarse pixels by which `layers` learns a page's size.
const SHEET: (f64, f64) = (396.0, 264.0);

/// Lines in all fonts and sizes, after these commands.
fn lines(before: &str) -> String {
    let mut drawing = format!("{before}\n");
    let mut y = SHEET.1 - 54.0;
    for font in FONTS {
        for size in SIZES {
            drawing.push_str(&format!(
                "/{font} findfont {size} scalefont setfont 20 {y} moveto ({LINE}) show\n"
            ));
            y -= 1.4 * size;
        }
    }
    // Marks at the corners, where every version of the page has them.
    drawing + "12 48 3 3 rectfill 380 48 3 3 rectfill 12 222 3 3 rectfill 380 222 3 3 rectfill"
}

/// The lines that Tesseract reads in averages of 2 x 2 dots, as a scanner sees them.
fn read(bench: &Bench, text: &Dots) -> Vec<String> {
    let margin = 30;
    let (width, length) = (text.width.div_ceil(2) + 2 * margin, text.length().div_ceil(2) + 2 * margin);
    let picture = GrayImage::from_fn(width as u32, length as u32, |x, y| {
        let at = |v: u32, part: usize| (2 * v as usize + part).checked_sub(2 * margin);
        let is_ink = |part: usize| {
            let place = at(x, part % 2).zip(at(y, part / 2));
            place.is_some_and(|(x, y)| x < text.width && y < text.length() && text.at(x, y))
        };
        Luma([255 - 63 * (0..4).filter(|&part| is_ink(part)).count() as u8])
    });
    picture.save(bench.path("text.png")).expect("a picture");
    let mut reader = Command::new("tesseract");
    reader.arg(bench.path("text.png")).args(["-", "--psm", "6", "--dpi", "300"]).env("OMP_THREAD_LIMIT", "1");
    let words = run(&mut reader);
    let words = String::from_utf8_lossy(&words);
    words.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

/// Letters to insert, leave out or replace to make one text of another.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let least = (row[j] + 1).min(row[j + 1] + 1).min(corner + usize::from(x != y));
            corner = std::mem::replace(&mut row[j + 1], least);
        }
    }
    row[b.len()]
}

/// The page without its marks.
fn without_marks(page: &Dots) -> Dots {
    page.part([60, 60, page.width - 61, page.length() - 61])
}

#[test]
fn solid_text_has_the_dots_it_was_drawn_with_and_all_text_is_read_without_error() {
    if !ghostscript() {
        return;
    }
    let tesseract = starts("tesseract");
    if !tesseract {
        Need::Reading.skip("there is no Tesseract (Debian: tesseract-ocr)");
    }
    let bench = Bench::new();
    let file = |text: &str| {
        std::fs::write(bench.path("page.ps"), page(SHEET, text)).expect("a page");
        std::fs::write(bench.path("page.pdf"), drawn_by("pdfwrite", &bench.path("page.ps"))).expect("a PDF");
    };
    file(&lines("0 setgray"));
    let bitmap = image::load_from_memory_with_format(
        &drawn_by("pbmraw", &bench.path("page.pdf")),
        image::ImageFormat::Pnm,
    );
    let bitmap = bitmap.expect("a bitmap").into_luma8();
    let drawn = Dots::new(bitmap.width() as usize, bitmap.height() as usize, |x, y| {
        bitmap.get_pixel(x as u32, y as u32).0[0] == 0
    });
    let drawn = without_marks(&drawn.part(drawn.bounds()));
    // Colour, whether a stack prints it, whether the letters are what is not printed.
    let ground = "0 0 .6 setrgbcolor 12 48 371 177 rectfill 1 setgray";
    let colours = [
        ("K", "0 0 0 1 setcmykcolor", true, false),
        ("RGB black", "0 0 0 setrgbcolor", true, false),
        ("grey", ".5 setgray", false, false),
        ("blue", "0 0 .6 setrgbcolor", false, false),
        ("cyan", "1 0 0 0 setcmykcolor", true, false),
        ("white on blue", ground, true, true),
    ];
    for (name, before, solid, reversed) in colours {
        file(&lines(before));
        let text = |job: &[u8]| {
            let mut dots = without_marks(&printed(job, &Ink::ALL));
            if reversed {
                dots.set.iter_mut().for_each(|dot| *dot = !*dot);
            }
            dots
        };
        let driver = md5k().then(|| text(&drawn_by("md5k", &bench.path("page.pdf"))));
        let at_queue = text(&queued(&bench, "page.pdf"));
        let by_layers = text(&job(&bench, "page.pdf"));
        for (path, found) in [("queue", &at_queue), ("layers", &by_layers)] {
            assert!(!solid || found.differences(&drawn) == 0, "{name}, {path}");
        }
        if !tesseract {
            continue;
        }
        let whole = [LINE; 12].join("\n");
        let errors = |found: &Dots, ours: bool| {
            let read = read(&bench, found);
            if ours && solid {
                assert_eq!(read.len(), 12, "{name}: {read:?}");
                for (line, size) in
                    read.iter().zip(SIZES.into_iter().cycle()).filter(|(_, size)| *size >= 8.0)
                {
                    assert_eq!(edits(line, LINE), 0, "{name}, {size} points: {line}");
                }
            }
            edits(&read.join("\n"), &whole)
        };
        let ours = [&at_queue, &by_layers].map(|found| errors(found, true));
        let driver = driver.map(|found| errors(&found, false));
        println!("{name}: errors of queue and layers {ours:?}, of md5k {driver:?}");
        assert!(driver.is_none_or(|most| ours.into_iter().all(|found| found <= most)), "{name}");
    }
}

#[test]
fn coloured_letters_have_as_much_ink_as_a_panel_in_their_colour_and_none_beyond() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let text = |drawing: &str| {
        // Black marks: a tone need not reach the outermost row, by which pages are laid over each other.
        let drawing = drawing.replace("12 48 3 3", "0 setgray 12 48 3 3");
        std::fs::write(bench.path("page.ps"), page(SHEET, &drawing)).expect("a page");
        without_marks(&printed(&queued(&bench, "page.ps"), &Ink::ALL))
    };
    let drawn = text(&lines("0 setgray"));
    for colour in [
        ".5 setgray",
        ".85 setgray",
        ".93 setgray",
        ".9 .5 .13 setrgbcolor",
        ".8 .9 1 setrgbcolor",
        "1 .9 .8 setrgbcolor",
        "0 0 0 .3 setcmykcolor",
    ] {
        let found = text(&lines(colour));
        let share = |is: &dyn Fn(usize) -> bool| {
            let all = (0..drawn.set.len()).filter(|&at| drawn.set[at]);
            all.clone().filter(|&at| is(at)).count() as f64 / all.count() as f64
        };
        // Behind the letters, so at the same places.
        let panel = text(&lines(&format!("{colour} 14 48 366 177 rectfill")));
        let (letters, panel) = (share(&|at| found.set[at]), share(&|at| panel.set[at]));
        let beyond = (0..drawn.set.len()).filter(|&at| found.set[at] && !drawn.set[at]).count();
        println!("{colour}: ink {letters:.3} and {panel:.3}");
        assert_eq!(beyond, 0, "{colour}");
        assert!((letters - panel).abs() <= 0.05, "{colour}: {letters:.3} of letters, {panel:.3} of a panel");
    }
}

/// Adds a patch of white between the marks, so that the page has a plate of its own beside what `drawing` draws.
fn with_plate(drawing: &str) -> String {
    format!(
        "{drawing}\n[/Separation (White) /DeviceCMYK {{pop 0 0 0 0}}] setcolorspace 1 setcolor 200 49 2 2 rectfill"
    )
}

#[test]
fn text_on_a_page_with_a_plate_of_white_keeps_its_dots() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let text = |drawing: &str, by_queue: bool| {
        std::fs::write(bench.path("page.ps"), page(SHEET, drawing)).expect("a page");
        let job = if by_queue { queued(&bench, "page.ps") } else { job(&bench, "page.ps") };
        // Marks may end on either side of a dot; the letters begin where they are drawn.
        let inks: Vec<Ink> = Ink::ALL.into_iter().filter(|&ink| ink != Ink::White).collect();
        let page = without_marks(&printed(&job, &inks));
        page.part(page.bounds())
    };
    let drawn = text(&lines("0 setgray"), true);
    for (name, before, exact) in [
        ("K", "0 0 0 1 setcmykcolor", true),
        ("RGB black", "0 0 0 setrgbcolor", true),
        ("half of K", "0 0 0 .5 setcmykcolor", false),
    ] {
        let (with, without) = (with_plate(&lines(before)), lines(before));
        for (path, by_queue) in [("queue", true), ("layers", false)] {
            let found = text(&with, by_queue);
            let wanted = if exact { drawn.clone() } else { text(&without, by_queue) };
            assert_eq!(found.differences(&wanted), 0, "{name}, {path}");
        }
    }
}

#[test]
fn a_mask_of_one_colour_is_exact_on_pages_and_in_pictures() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let drawn = Dots::new(3 * MODULES.0, 3 * MODULES.1, |x, y| module(x / 3, y / 3));
    let rows = (0..MODULES.1).map(|y| {
        let bit = |x: usize| u8::from(x < MODULES.0 && module(x, y));
        let byte = |at: usize| (0..8).fold(0, |byte, x| byte << 1 | bit(8 * at + x));
        (0..MODULES.0.div_ceil(8)).map(|at| format!("{:02x}", byte(at))).collect::<String>()
    });
    let mask = format!(
        "{} {} true [{0} 0 0 -{1} 0 {1}] {{<{}>}} imagemask",
        MODULES.0,
        MODULES.1,
        rows.collect::<String>()
    );
    let colours = [
        "0 0 0 1 setcmykcolor",
        "1 0 0 0 setcmykcolor",
        "0 1 1 0 setcmykcolor",
        "0 0 1 setrgbcolor",
        "1 1 0 setrgbcolor",
    ];
    for colour in colours {
        let (wide, high) = (drawn.width, drawn.length());
        let drawing = format!("{colour} .12 .12 scale 300 700 translate {wide} {high} scale {mask}");
        std::fs::write(bench.path("mask.ps"), page((288.0, 216.0), &drawing)).expect("a page");
        for (path, job) in [("queue", queued(&bench, "mask.ps")), ("layers", job(&bench, "mask.ps"))] {
            let found = printed(&job, &Ink::ALL);
            assert_eq!((found.width, found.length()), (wide, high), "{colour}, {path}");
            assert_eq!(found.differences(&drawn), 0, "{colour}, {path}: wrong dots");
        }
    }
    let blue = RgbImage::from_fn(drawn.width as u32, drawn.length() as u32, |x, y| {
        Rgb(if drawn.at(x as usize, y as usize) { [0, 0, 255] } else { [255; 3] })
    });
    blue.save(bench.path("blue.png")).expect("a picture");
    assert_eq!(printed(&job(&bench, "blue.png --dpi 600"), &Ink::ALL).differences(&drawn), 0);
}

#[test]
fn text_of_a_drawing_is_read_without_error() {
    if !starts("tesseract") {
        return Need::Reading.skip("there is no Tesseract (Debian: tesseract-ocr)");
    }
    let bench = Bench::new();
    let fonts = [
        "font-family='DejaVu Serif'",
        "font-family='DejaVu Sans'",
        "font-family='DejaVu Sans' font-weight='bold'",
    ];
    let text = |fill: &str| {
        let mut svg = String::from(
            "<svg xmlns='http://www.w3.org/2000/svg' width='5.5in' height='3.5in' viewBox='0 0 396 252'>",
        );
        let mut y = 20.0;
        for font in fonts {
            for size in SIZES {
                y += 1.45 * size;
                svg.push_str(&format!(
                    "<text x='12' y='{y}' {font} font-size='{size}' fill='{fill}'>{LINE}</text>"
                ));
            }
        }
        std::fs::write(bench.path("text.svg"), svg + "</svg>").expect("a drawing");
        printed(&job(&bench, "text.svg"), &Ink::ALL)
    };
    if !Path::new("/usr/share/fonts/truetype/dejavu/DejaVuSerif.ttf").exists() {
        return Need::Reading.skip("there are no DejaVu fonts (Debian: fonts-dejavu)");
    }
    let black = text("#000");
    let lines = read(&bench, &black);
    assert_eq!(lines.len(), 12, "{lines:?}");
    for (line, size) in lines.iter().zip(SIZES.into_iter().cycle()).filter(|(_, size)| *size >= 8.0) {
        assert_eq!(edits(line, LINE), 0, "{size} points: {line}");
    }
    for fill in ["#000099", "#808080"] {
        assert_eq!(edits(&read(&bench, &text(fill)).join("\n"), &lines.join("\n")), 0, "{fill}");
    }
}
