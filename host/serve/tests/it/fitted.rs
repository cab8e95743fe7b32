//! Ordinary documents on the sheet that is loaded: which way up, how large and where, judged by the marks in
//! the jobs.

use image::codecs::jpeg::{JpegEncoder, PixelDensity};
use observe::Silent;
use press::inspect::inspect;
use serve::body::Limits;
use serve::jobs::State;
use serve::template::size;
use testing::ipp::Attribute;
use testing::needs::ghostscript;

use super::Running;

const MM: f64 = 72.0 / 25.4;

/// A page of this size in millimetres with a black mark of 6 x 4 mm, 20 mm from the left and 15 from the top
/// of the part that is seen, whose lower left corner lies so far from the page's.
fn page(media: (f64, f64), (left, below): (f64, f64), seen: (f64, f64), more: &str) -> Vec<u8> {
    let [x, y] = [left + 20.0, below + seen.1 - 19.0].map(|mm| mm * MM);
    let drawing = format!("0 g {x} {y} {} {} re f", 6.0 * MM, 4.0 * MM);
    let objects = [
        "<</Type/Catalog/Pages 2 0 R>>".to_owned(),
        "<</Type/Pages/Kids[3 0 R]/Count 1>>".to_owned(),
        format!(
            "<</Type/Page/Parent 2 0 R/MediaBox[0 0 {} {}]{more}/Contents 4 0 R>>",
            media.0 * MM,
            media.1 * MM
        ),
        format!("<</Length {}>>\nstream\n{drawing}\nendstream", drawing.len()),
    ];
    pdf(&objects)
}

/// A PDF of these objects, numbered from 1, of which the first is its catalog.
pub(super) fn pdf(objects: &[String]) -> Vec<u8> {
    let (mut text, mut places) = (String::from("%PDF-1.4\n"), String::new());
    for (number, object) in (1..).zip(objects) {
        places += &format!("{:010} 00000 n \n", text.len());
        text += &format!("{number} 0 obj\n{object}\nendobj\n");
    }
    let (at, all) = (text.len(), objects.len() + 1);
    text += &format!("xref\n0 {all}\n0000000000 65535 f \n{places}");
    text += &format!("trailer\n<</Size {all}/Root 1 0 R>>\nstartxref\n{at}\n%%EOF\n");
    text.into_bytes()
}

/// A black photograph.
fn photo(width: u32, height: u32, dpi: Option<u16>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new(&mut bytes);
    if let Some(dpi) = dpi {
        encoder.set_pixel_density(PixelDensity::dpi(dpi));
    }
    let pixels = vec![0; (width * height) as usize];
    encoder.encode(&pixels, width, height, image::ExtendedColorType::L8).unwrap();
    bytes
}

/// Left, top, width and length of all that is printed, in dots of the printable area, and what is said.
fn printed(running: &Running, asked: &[Attribute<'_>], document: &[u8]) -> ([f64; 4], String) {
    let job = running.print(asked, document, State::Completed);
    let [sheet] = &running.sheets_of(&job)[..] else { panic!("{job:?}") };
    let found = inspect(sheet, &Silent).inspection;
    let bounds: Vec<_> = found.passes.iter().filter_map(|pass| pass.bounds).collect();
    let left = bounds.iter().map(|at| at.x).min().unwrap();
    let top = bounds.iter().map(|at| at.y).min().unwrap();
    let right = bounds.iter().map(|at| at.x + at.width).max().unwrap();
    let below = bounds.iter().map(|at| at.y + at.height).max().unwrap();
    ([left, top, right - left, below - top].map(|dots| dots as f64), job.message)
}

#[test]
fn ordinary_pages_lie_on_the_loaded_sheet_as_people_expect() {
    if !ghostscript() {
        return;
    }
    let running = Running::start(Limits::default(), true);
    let a4 = (210.0, 297.0);
    let whole = |size: (f64, f64), more: &str| page(size, (0.0, 0.0), size, more);
    let crop = format!("/CropBox[{} {} {} {}]", 40.0 * MM, 50.0 * MM, 250.0 * MM, 347.0 * MM);
    // What can be printed begins at 3.387, 12.023 mm, and has 203.2 x 269.748 mm.
    let documents = [
        ("A4", whole(a4, ""), [20.0, 15.0, 6.0, 4.0], "printed"),
        ("landscape", whole((297.0, 210.0), ""), [15.0, 271.0, 4.0, 6.0], "anticlockwise"),
        ("/Rotate", whole(a4, "/Rotate 90"), [20.0, 15.0, 6.0, 4.0], "anticlockwise"),
        ("A3", whole((297.0, 420.0), ""), [22.455, 21.657, 3.853, 2.569], "64.2 %"),
        ("Letter", whole((215.9, 279.4), ""), [22.211, 29.532, 5.647, 3.765], "94.1 %"),
        ("slides", whole((254.0, 143.0), ""), [48.5, 249.5, 4.0, 6.0], "anticlockwise"),
        ("card", whole((85.0, 54.0), ""), [82.5, 136.5, 6.0, 4.0], "printed"),
        ("CropBox", page((300.0, 400.0), (40.0, 50.0), a4, &crop), [20.0, 15.0, 6.0, 4.0], "printed"),
    ];
    for (name, document, expected, words) in documents {
        let (found, said) = printed(&running, &[], &document);
        let mm = found.map(|dots| dots * 25.4 / 600.0);
        let mm = [mm[0] + 3.387, mm[1] + 12.023, mm[2], mm[3]];
        assert!(
            mm.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.09),
            "{name}: {mm:?}, not {expected:?}"
        );
        assert!(said.ends_with(words), "{name}: {said}");
    }
    // Nobody has a thin page drawn that covers the sheet and is 6 m long.
    let fill: [Attribute<'_>; 1] = [(0x44, "print-scaling", b"fill")];
    let job = running.print(&fill, &whole((20.0, 600.0), ""), State::Aborted);
    assert!(job.message.contains("mm as it is to be printed, more than 9 sheets"), "{}", job.message);
    // Turned the other way.
    let asked: [Attribute<'_>; 1] = [(0x23, "orientation-requested", &[0, 0, 0, 5])];
    let (found, _) = printed(&running, &asked, &whole((297.0, 210.0), ""));
    let mm = found.map(|dots| dots * 25.4 / 600.0);
    let expected = [191.0 - 3.387, 20.0 - 12.023, 4.0, 6.0];
    assert!(mm.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.09), "{mm:?}");
}

#[test]
fn photographs_lie_on_the_loaded_sheet_whole() {
    let running = Running::start(Limits::default(), true);
    let (found, said) = printed(&running, &[], &photo(3000, 2000, Some(72)));
    assert_eq!(found, [276.0, 0.0, 4248.0, 6372.0], "{said}");
    assert!(said.ends_with("turned by 90° anticlockwise and printed at 25.5 %"), "{said}");
    // 297 x 210 mm, to .0034 mm.
    let (found, _) = printed(&running, &[], &photo(2339, 1654, Some(200)));
    assert_eq!(found, [147.0, 0.0, 4506.0, 6372.0]);
    // Small enough as it is, in the middle of the sheet: 50.8 x 25.4 mm.
    let (found, said) = printed(&running, &[], &photo(400, 200, Some(200)));
    assert_eq!((found, said.as_str()), ([1800.0, 2924.0, 1200.0, 600.0], "printed"));
    let (found, said) = printed(&running, &[], &photo(900, 600, None));
    assert_eq!(found, [276.0, 0.0, 4248.0, 6372.0]);
    assert!(said.ends_with("for it states no resolution"), "{said}");
    running.server.load((Some(size(protocol::paper::Paper::Postcard)), None), None).unwrap();
    let (found, _) = printed(&running, &[], &photo(1654, 2339, Some(200)));
    assert_eq!((found[1], found[3]), (0.0, 3082.0));
    assert!(found[2] < 2202.0, "{found:?}");
}

#[test]
fn a_job_for_another_sheet_waits_and_others_pass_it() {
    let running = Running::start_to("raw:/dev/null", Limits::default());
    let server = &running.server;
    let card: [Attribute<'_>; 1] = [(0x44, "media", b"jpn_hagaki_100x148mm")];
    let waits = running.print(&card, &super::limits::sheet(), State::Pending);
    let data = || server.data();
    assert!(data().lacks_sheet(&waits));
    assert_eq!(data().keywords(), ["media-needed"]);
    let said = data().said();
    assert!(said.contains("waits for a sheet of postcard; a4 is loaded"), "{said}");
    let passes = running.print(&[], &super::limits::sheet(), State::Pending);
    assert!(!data().lacks_sheet(&passes));
    assert_eq!(server.next().id, passes.id);
    server.load((Some(size(protocol::paper::Paper::Postcard)), None), None).unwrap();
    assert_eq!(server.next().id, waits.id);
}

#[test]
fn a_job_for_another_sheet_can_be_laid_on_the_loaded_one() {
    let running = Running::start_to("raw:/dev/null", Limits::default());
    let card: [Attribute<'_>; 1] = [(0x44, "media", b"jpn_hagaki_100x148mm")];
    let waits = running.print(&card, &super::limits::sheet(), State::Pending);
    running.server.lay_on_loaded(waits.id).unwrap();
    assert_eq!(running.server.next().id, waits.id);
    assert!(running.server.lay_on_loaded(waits.id).is_err());
}
