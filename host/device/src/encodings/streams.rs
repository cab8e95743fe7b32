//! A job as the pass streams a bridge makes the same bytes from.
//!
//! Problem: the bytes for a printer are several times those that have to cross the cable to a bridge that can pack rows itself.
//! Method: the planes of the job are coded ([`protocol::runs`]), and what a bridge would make of the code is made here and
//! compared with the job, byte for byte. A job that was just made has its planes, its page and its frame. Of [bytes](of_bytes)
//! they are read back, and the frame is searched. A job that does not come back the same
//! (another driver's packing, a leading reset, one plane of black in its own mode) is sent byte for byte instead.
//! Cost: the job is coded and compared once. Bytes are also parsed once for their commands and twice for their dots; one plane for
//! each thread is held at a time. Limits: the job must be one whole legal one.
//! Source: `docs/wire-format.md`, section 4.

use std::borrow::Cow;

use press::pipeline;
use protocol::ink::{Ink, Kind};
use protocol::packbits;
use protocol::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use protocol::rgl::order::Declared;
use protocol::rgl::{
    Command, Compression, Fault, FoilConsent, JobWriter, Order, Page, Resolution, Step, parse,
};
use protocol::runs::{self, Decoder, Header, MAX_BAND, MAX_HEADER, band_bytes, encode, stride};
use rayon::prelude::*;

use super::Content;
use super::frame_search::{Places, Traces};
use observe::Observer;

/// The pass streams that stand for a job, or nothing if none do.
pub fn of(content: Content<'_>, observer: &dyn Observer) -> Option<Vec<u8>> {
    match content {
        Content::Made(job) => of_made(job, observer),
        Content::Bytes(bytes) => of_bytes(bytes, observer),
    }
}

/// The pass streams that stand for a job that was just made, or nothing if none do.
fn of_made(job: &pipeline::Job, observer: &dyn Observer) -> Option<Vec<u8>> {
    let page = job.page;
    if (page.shift_x, page.shift_y) != (0, 0) {
        // Planes are the page's size, but those of a shifted page end before it.
        return of_bytes(&job.bytes, observer);
    }
    let (inks, planes): (Vec<Ink>, Vec<&[u8]>) =
        job.passes().map(|pass| (pass.ink, &pass.plane.bits[..])).unzip();
    let header = header(page, &inks, page.width(), page.length())?;
    observer.begin("pass streams", 3 * job.bytes.len() as u64);
    let plane = |number: usize| Some(Cow::Borrowed(planes[number]));
    coded(header, planes.len(), &plane, &Places::known(job.frame), &job.bytes, observer)
}

/// The pass streams that stand for the bytes of a job, or nothing if none do.
pub fn of_bytes(job: &[u8], observer: &dyn Observer) -> Option<Vec<u8>> {
    let Parts { header, passes } = Parts::read(job)?;
    observer.begin("pass streams", 3 * job.len() as u64);
    let plane = |number: usize| {
        let columns = header.columns();
        let mut plane = vec![0; stride(columns) * usize::from(header.rows())];
        draw(passes[number], columns, &mut plane).map(|()| plane.into())
    };
    coded(header.clone(), passes.len(), &plane, &Places::all(), job, observer)
}

/// Codes the planes of a job along the walk that begins at the best of some places, and compares what comes of it.
fn coded<'p>(
    header: Header,
    passes: usize,
    plane: &(dyn Fn(usize) -> Option<Cow<'p, [u8]>> + Sync),
    places: &Places,
    job: &[u8],
    observer: &dyn Observer,
) -> Option<Vec<u8>> {
    let (columns, rows) = (header.columns(), header.rows());
    // The steps are those of the job's bytes, three times over.
    let share = job.len() as u64 / passes.max(1) as u64;
    let traces = (0..passes)
        .into_par_iter()
        .map(|number| {
            let traces = Traces::of(&plane(number)?, columns, places);
            observer.advance(share);
            Some(traces)
        })
        .try_reduce(|| Traces::none(places), |one, other| Some(one.and(other)))?;
    let header = header.framed(traces.frame(places, columns, rows))?;
    let mut head = [0; MAX_HEADER];
    let length = header.write(&mut head);
    let mut streams = head[..length].to_vec();
    let coded: Option<Vec<Vec<u8>>> = (0..passes)
        .into_par_iter()
        .map(|number| {
            let plane = plane(number)?;
            let (mut stream, mut buffer) = (Vec::new(), vec![0; MAX_BAND]);
            encode(header.walk(), &plane, &mut buffer, |band| stream.extend_from_slice(band)).ok()?;
            observer.advance(share);
            Some(stream)
        })
        .collect();
    streams.extend(coded?.concat());
    let mut left = job;
    let mut same = true;
    expand(&streams, &mut |bytes| {
        observer.advance(bytes.len() as u64);
        match left.strip_prefix(bytes) {
            Some(rest) => left = rest,
            None => same = false,
        }
        same
    })
    .ok()?;
    observer.end();
    (same && left.is_empty()).then_some(streams)
}

/// The header of a job with these inks, whose planes have so many dots.
fn header(page: Page, inks: &[Ink], columns: u16, rows: u16) -> Option<Header> {
    // Whoever sends a job with foil has agreed to it when it was made; a stranger's job is as legal without us.
    let consent = inks.iter().any(|ink| ink.kind() == Kind::Foil).then(FoilConsent::given_by_the_user);
    Header::new(page, inks, consent, columns, rows).ok()
}

/// Bytes that are not the data of a job of pass streams.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NoStreams {
    /// They do not begin with a header that can be printed.
    #[error("the pass streams have no header")]
    Header,
    /// What follows is not one stream for each pass.
    #[error("the pass streams are damaged")]
    Stream,
}

impl From<Fault> for NoStreams {
    fn from(_: Fault) -> NoStreams {
        NoStreams::Stream
    }
}

/// The job that a bridge makes of pass streams, piece by piece, for as long as `put` wants more.
pub fn expand(streams: &[u8], put: &mut dyn FnMut(&[u8]) -> bool) -> Result<(), NoStreams> {
    let (header, length) = Header::read(streams).ok().flatten().ok_or(NoStreams::Header)?;
    let mut left = &streams[length..];
    let (columns, stride) = (header.columns(), stride(header.columns()));
    let mut writer = JobWriter::new(header.setup().clone(), header.rows())?;
    let mut decoder = Decoder::new(*header.walk());
    let mut memory = vec![0; band_bytes(columns)];
    let mut out = vec![0; COMMAND_ROOM.max(ROW_ROOM + stride)];
    let count = writer.begin(&mut out)?;
    let mut wanted = put(&out[..count]);
    for _ in header.setup().passes() {
        let count = writer.next_pass(&mut out)?;
        wanted = wanted && put(&out[..count]);
        decoder.restart();
        while wanted && !decoder.ended() {
            let (used, step) = decoder.step(left, &mut memory).map_err(|_| NoStreams::Stream)?;
            left = &left[used..];
            match step {
                runs::Step::More => return Err(NoStreams::Stream),
                runs::Step::Blank { rows, .. } => writer.blank_rows(rows)?,
                runs::Step::Band { rows, reach, .. } => {
                    for row in memory.chunks_exact(stride).take(rows.into()) {
                        let count = writer.row(&row[..reach], &mut out)?;
                        wanted = wanted && put(&out[..count]);
                    }
                }
                runs::Step::End => {}
            }
        }
        if !wanted {
            return Ok(());
        }
    }
    if !left.is_empty() {
        return Err(NoStreams::Stream);
    }
    let count = writer.end(&mut out)?;
    put(&out[..count]);
    Ok(())
}

/// A job taken apart.
struct Parts<'j> {
    header: Header,
    /// The commands of each pass, without its ink-select.
    passes: Vec<&'j [u8]>,
}

impl<'j> Parts<'j> {
    fn read(job: &'j [u8]) -> Option<Parts<'j>> {
        let (mut order, mut at) = (Order::new(), 0);
        let (mut inks, mut passes, mut begin) = (Vec::new(), Vec::new(), 0);
        // Only the last row of an image is sent as such, and a pass may end above it.
        let mut image: Option<u16> = None;
        while at < job.len() {
            let Ok(Step::Command(command, length)) = parse(&job[at..]) else { return None };
            order.accept(&command).ok()?;
            match command {
                Command::InkSelect { ink, .. } => {
                    inks.push(ink);
                    begin = at + length;
                }
                Command::BackFeed | Command::RasterEnd => passes.push(&job[begin..at]),
                Command::Row { last: true, .. } => image = Some((order.row() + 1).try_into().ok()?),
                _ => {}
            }
            at += length;
        }
        let page = page(order.declared())?;
        let (right, down) = (page.resolution.across(page.shift_x), page.resolution.along(page.shift_y));
        let columns = page.width().checked_sub(right)?;
        let rows = image.or(page.length().checked_sub(down))?;
        Some(Parts { header: header(page, &inks, columns, rows)?, passes })
    }
}

/// The page a setup declares; distances are turned back into 1/600 inch.
fn page(declared: &Declared) -> Option<Page> {
    let resolution = declared.resolution?;
    let across = |dots: u16| match resolution {
        Resolution::Dpi300 => dots.checked_mul(2),
        Resolution::Dpi600 => Some(dots),
        Resolution::Dpi1200 => Some(dots / 2),
    };
    let along = |rows: u16| match resolution {
        Resolution::Dpi300 => rows.checked_mul(2),
        Resolution::Dpi600 | Resolution::Dpi1200 => Some(rows),
    };
    Some(Page {
        paper: declared.paper?.paper(across(declared.width)?, along(declared.length)?),
        media: declared.media?,
        resolution,
        curl_correction: declared.curl?,
        shift_x: across(declared.shift_x)?,
        shift_y: along(declared.shift_y)?,
    })
}

/// Draws the rows of a pass on a blank plane; nothing if one does not fit it.
fn draw(mut commands: &[u8], columns: u16, plane: &mut [u8]) -> Option<()> {
    let stride = stride(columns);
    let mut rows = plane.chunks_exact_mut(stride);
    let mut compression = Compression::Plain;
    while !commands.is_empty() {
        let Ok(Step::Command(command, length)) = parse(commands) else { return None };
        match command {
            Command::Compression(now) => compression = now,
            Command::Skip(count) => drop(rows.nth(usize::from(count).checked_sub(1)?)?),
            Command::Row { data, .. } => {
                let row = rows.next()?;
                match compression {
                    Compression::Plain => row.get_mut(..data.len())?.copy_from_slice(data),
                    Compression::Packed => drop(packbits::unpack_into(data, row).ok()?),
                }
            }
            _ => return None,
        }
        commands = &commands[length..];
    }
    Some(())
}

#[cfg(test)]
mod made;

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use press::job::stream::write_job;
    use press::separate::Pass;
    use proptest::prelude::*;
    use protocol::paper::Paper;
    use protocol::rgl::{JobSetup, Media};
    use sheet::Plane;

    fn pass(ink: Ink, page: &Page, dots: &[(u16, u16)]) -> Pass {
        let (width, length) = (usize::from(page.width()), usize::from(page.length()));
        let mut plane =
            Plane { width, length, stride: width.div_ceil(8), bits: vec![0; width.div_ceil(8) * length] };
        let (right, down) = (page.resolution.across(page.shift_x), page.resolution.along(page.shift_y));
        for &(x, y) in dots {
            let (x, y) = (usize::from(x % (page.width() - right)), usize::from(y % (page.length() - down)));
            plane.bits[y * plane.stride + x / 8] |= 0x80 >> (x % 8);
        }
        Pass { ink, plane }
    }

    fn written(page: Page, passes: &[Pass]) -> Vec<u8> {
        let mut job = Vec::new();
        let foil = Some(FoilConsent::given_by_the_user());
        write_job(page, foil, passes, &mut job, &Silent).unwrap();
        job
    }

    pub(super) fn expanded(streams: &[u8]) -> Vec<u8> {
        let mut job = Vec::new();
        expand(streams, &mut |bytes| {
            job.extend_from_slice(bytes);
            true
        })
        .unwrap();
        job
    }

    fn pages() -> impl Strategy<Value = Page> {
        let paper = (8..200u16, 4..150u16)
            .prop_map(|(width, length)| Paper::Custom { width: 2 * width, length: 2 * length });
        let resolution =
            prop_oneof![Just(Resolution::Dpi300), Just(Resolution::Dpi600), Just(Resolution::Dpi1200)];
        (paper, resolution, any::<bool>(), 0..4u16, 0..4u16).prop_map(
            |(paper, resolution, curl_correction, x, y)| Page {
                paper,
                media: Media::Cardboard,
                resolution,
                curl_correction,
                shift_x: 2 * x,
                shift_y: 2 * y,
            },
        )
    }

    proptest! {
        #[test]
        fn every_job_of_ours_has_streams_that_become_it_again(
            page in pages(),
            passes in prop::collection::vec((0..4usize, prop::collection::vec((any::<u16>(), any::<u16>()), 1..60)), 1..7),
            last_row in any::<bool>(),
        ) {
            let inks = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black];
            let mut passes: Vec<Pass> = passes.iter().map(|(ink, dots)| pass(inks[*ink], &page, dots)).collect();
            if last_row {
                passes.push(pass(Ink::Black, &page, &[(0, page.length() - page.resolution.along(page.shift_y) - 1)]));
            }
            let job = written(page, &passes);
            let streams = of_bytes(&job, &Silent).expect("streams");
            prop_assert!(expanded(&streams) == job);
        }
    }

    #[test]
    fn foils_and_lists_of_cartridges_go_too() {
        let page = Page::plain(Paper::Custom { width: 64, length: 40 });
        let inks = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black, Ink::White, Ink::GoldFoil];
        let passes = inks.map(|ink| pass(ink, &page, &[(3, 5), (60, 39)]));
        let job = written(page, &passes);
        assert_eq!(expanded(&of_bytes(&job, &Silent).unwrap()), job);
    }

    #[test]
    fn jobs_made_in_another_way_go_as_they_are() {
        let page = Page::plain(Paper::Custom { width: 64, length: 40 });
        let row = (0..64).map(|x| (x, 7)).collect::<Vec<_>>();
        let job = written(page, &[pass(Ink::White, &page, &row)]);
        assert!(of_bytes(&job, &Silent).is_some());
        let reset_first = [b"\x1be", &job[..]].concat();
        assert_eq!(of_bytes(&reset_first, &Silent), None);
        assert_eq!(of_bytes(&job[..job.len() - 2], &Silent), None, "no reset at the end");
        // The row is packed as ff f9; another driver sends it plain.
        let at = job.windows(6).position(|bytes| bytes == b"\x1b*b\x02\0M").unwrap();
        let (row, data) = (b"\x1b*b\x02\0W\xf9\xff", b"\x1b*b\x08\0W\xff\xff\xff\xff\xff\xff\xff\xff");
        let from = job.windows(8).position(|bytes| bytes == row).unwrap();
        let mut plain = job.clone();
        plain.splice(from..from + 8, data.iter().copied());
        plain[at + 3] = 0;
        assert!(crate::encodings::check(&plain, &Silent).is_ok(), "legal all the same");
        assert_eq!(of_bytes(&plain, &Silent), None);
        assert_eq!(of_bytes(b"text", &Silent), None);
        assert_eq!(of_bytes(b"", &Silent), None);
    }

    #[test]
    fn one_plane_of_black_in_its_own_mode_goes_as_it_is() {
        let page = Page::plain(Paper::A4);
        let mut writer = JobWriter::new(JobSetup::black_raster(page).unwrap(), 10).unwrap();
        let (mut out, mut job) = (vec![0; 200], Vec::new());
        let mut put = |count: usize, out: &[u8]| job.extend_from_slice(&out[..count]);
        put(writer.begin(&mut out).unwrap(), &out);
        put(writer.next_pass(&mut out).unwrap(), &out);
        put(writer.row(&[1, 2, 3], &mut out).unwrap(), &out);
        put(writer.end(&mut out).unwrap(), &out);
        assert!(crate::encodings::check(&job, &Silent).is_ok());
        assert_eq!(of_bytes(&job, &Silent), None);
    }

    #[test]
    fn damaged_streams_are_no_job() {
        let page = Page::plain(Paper::Custom { width: 64, length: 40 });
        let streams = of_bytes(&written(page, &[pass(Ink::White, &page, &[(9, 9)])]), &Silent).unwrap();
        let outcome = |bytes: &[u8]| expand(bytes, &mut |_| true);
        assert_eq!(outcome(&streams), Ok(()));
        assert_eq!(outcome(&streams[..streams.len() - 1]), Err(NoStreams::Stream));
        assert_eq!(outcome(&[&streams[..], &[0]].concat()), Err(NoStreams::Stream));
        assert_eq!(outcome(&streams[..10]), Err(NoStreams::Header));
        assert_eq!(outcome(&[9; 40]), Err(NoStreams::Header));
    }

    #[test]
    fn real_streams_that_are_taken_come_back_byte_for_byte() {
        let Some(folder) = testing::needs::golden() else { return };
        let (mut taken, mut all) = (0, 0);
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|name| name == "bin") {
                let job = std::fs::read(&path).unwrap();
                all += 1;
                if let Some(streams) = of_bytes(&job, &Silent) {
                    taken += 1;
                    assert!(expanded(&streams) == job, "{path:?}");
                    println!("{path:?}: {} for {}", streams.len(), job.len());
                } else {
                    println!("{path:?}: as it is");
                }
            }
        }
        assert!(taken > 0 && all > 0);
    }
}
