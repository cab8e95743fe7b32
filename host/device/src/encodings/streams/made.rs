//! Jobs that were just made, against the same jobs as bytes: other ways to the planes and to the frame.

use super::tests::expanded;
use super::*;
use appearance::document::{self, Options};
use appearance::{factor, gamut};
use halftone::Method;
use inks::{InkSet, Library, Stack};
use observe::Silent;
use press::job::Handling;
use press::layout::{Layout, Position, Profile, Repeat};
use press::pipeline::Request;
use press::pipeline::document::{Settings, halftoned};
use proptest::prelude::*;
use protocol::paper::Paper;
use protocol::rgl::Media;
use protocol::walk::{Frame, Walk};
use sheet::DotMap;

/// Dots of three stacks: in clusters of eight and more along the walk, or each by itself.
fn dots(width: u16, length: u16, clustered: bool, mut random: u64) -> DotMap {
    let stacks = ["C", "M+Y"].map(|stack| stack.parse().unwrap());
    let mut index = vec![0; usize::from(width) * usize::from(length)];
    let walk = Walk::new(width, length);
    let (mut left, mut stack) = (0, 0);
    for at in 0..walk.len() {
        if left == 0 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (left, stack) =
                (if clustered { 8 + (random >> 62) } else { 1 }, [0, 0, 1, 2][(random >> 40 & 3) as usize]);
        }
        left -= 1;
        let (x, y) = walk.at(at).unwrap();
        index[usize::from(y) * usize::from(width) + usize::from(x)] = stack;
    }
    DotMap::new(width.into(), length.into(), [&[Stack::SUBSTRATE], &stacks[..]].concat(), index).unwrap()
}

fn made(dots: &DotMap, layout: &Layout) -> Option<pipeline::Job> {
    let request = Request {
        name: "made",
        dots,
        layout,
        handling: Handling { media: Media::Plain, curl_correction: true },
        allowed: InkSet::default(),
        library: &Library::builtin(),
    };
    pipeline::job(&request, &Silent).ok()
}

fn frame(streams: &[u8]) -> Frame {
    Header::read(streams).unwrap().unwrap().0.walk().frame()
}

fn layouts() -> impl Strategy<Value = Layout> {
    let corner = (-9.0..9.0f64, -9.0..9.0f64);
    let grid = prop_oneof![Just((1, 1)), (1..3u16, 1..3u16)];
    let printer = prop_oneof![
        Just(Profile::default()),
        (-2.0..2.0f64, -2.0..2.0f64, 0.99..1.01f64).prop_map(|(x, y, feed)| Profile {
            offset_mm: [x, y],
            feed,
            ..Profile::default()
        })
    ];
    (corner, grid, printer, any::<bool>(), any::<bool>(), any::<bool>()).prop_map(
        |((x, y), (columns, rows), profile, fine, mirror, crop_marks)| Layout {
            resolution: if fine { Resolution::Dpi1200 } else { Resolution::Dpi600 },
            position: Position::FromPrintable(format!("{x:.2}mm,{y:.2}mm").parse().unwrap()),
            repeat: Repeat::Grid(columns, rows),
            mirror: mirror && crop_marks,
            crop_marks,
            cut: true,
            profile,
            ..Layout::centred(Paper::Custom { width: 640, length: 600 })
        },
    )
}

proptest! {
    #[test]
    fn what_is_known_of_a_job_gives_the_streams_of_its_bytes(
        layout in layouts(),
        size in (8..400u16, 8..400u16),
        clustered in any::<bool>(),
        random in any::<u64>(),
    ) {
        let across = layout.resolution.across(1);
        let Some(job) = made(&dots(size.0 * across, size.1, clustered, random), &layout) else { return Ok(()) };
        let known = of(Content::Made(&job), &Silent).expect("streams");
        prop_assert!(expanded(&known) == job.bytes);
        let found = of(Content::Bytes(&job.bytes), &Silent).expect("streams");
        // One of several copies may be found, and another be the first.
        prop_assert!(frame(&known) != frame(&found) || known == found);
    }
}

#[test]
fn the_frame_of_a_copy_is_found_again_wherever_it_lies() {
    for (fine, mirror) in [(false, false), (false, true), (true, false)] {
        let across = if fine { 2 } else { 1 };
        let dots = dots(930 * across, 1100, true, 7);
        for (place, corner) in [("5x3mm", (118, 71)), ("0x0mm", (0, 0)), ("-2x-1mm", (17, 104))] {
            let layout = Layout {
                resolution: if fine { Resolution::Dpi1200 } else { Resolution::Dpi600 },
                position: Position::FromPrintable(place.parse().unwrap()),
                cut: true,
                mirror,
                ..Layout::centred(Paper::Custom { width: 1400, length: 1300 })
            };
            let job = made(&dots, &layout).unwrap();
            if !fine && !mirror {
                assert_eq!((job.frame.x, job.frame.y), corner, "{place}");
            }
            let known = of(Content::Made(&job), &Silent).unwrap();
            let found = of(Content::Bytes(&job.bytes), &Silent).unwrap();
            assert_eq!(frame(&known), frame(&found), "{place}, {across}, {mirror}");
            assert!(known == found, "{place}, {across}, {mirror}");
            let is_whole = frame(&known) == Frame::whole(1400 * across, 1300);
            assert_eq!(is_whole, place == "0x0mm" && !mirror, "{place}, {across}, {mirror}");
        }
    }
}

/// Samples on and beside their own walk.
#[test]
fn streams_of_samples_are_those_of_their_bytes_or_no_longer() {
    for (sample, method, layout) in [
        ("leaf", Method::Cells, Layout::centred(Paper::A4)),
        ("leaf", Method::Walk, Layout { mirror: true, ..Layout::centred(Paper::A4) }),
        ("ladder", Method::Walk, Layout::centred(Paper::Postcard)),
    ] {
        let document = document::open(&format!("sample:{sample}"), &Options::default(), &Silent).unwrap();
        let settings = Settings {
            factor: factor::FactorSettings::default(),
            gamut: gamut::GamutSettings::default(),
            inks: InkSet::default(),
            held_back: InkSet::EMPTY,
            halftone: method,
            size: Some("40mm".parse().unwrap()),
        };
        let library = Library::builtin();
        let dots = halftoned(&document, &library, &settings, &layout, &Silent).unwrap().dots;
        let job = made(&dots, &layout).unwrap();
        let known = of(Content::Made(&job), &Silent).unwrap();
        let found = of(Content::Bytes(&job.bytes), &Silent).unwrap();
        println!(
            "{sample}: job {}, streams {} and {}, {:?} and {:?}",
            job.bytes.len(),
            known.len(),
            found.len(),
            frame(&known),
            frame(&found)
        );
        assert!(expanded(&known) == job.bytes, "{sample}");
        assert!(frame(&known) != frame(&found) || known == found, "{sample}");
        // Dots that follow no walk seem by chance to follow one that begins elsewhere.
        assert!(known.len() <= found.len() + found.len() / 100, "{sample}");
    }
}
