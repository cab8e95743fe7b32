//! What it costs to send a full A4 page of eight clustered planes: making its pass streams, and talking to a bridge.
//!
//! Run `cargo bench --bench send`. `read_the_job` is what any sender has to do before the first byte; the bridge here
//! takes everything at once, so that only the host is timed.

use device::encodings::{Content, check, streams};
use device::transit::session::{Outcome, Record, Session};
use divan::Bencher;
use divan::counter::BytesCount;
use foilpress_tests::planes::{self, ROWS, WIDTH, planes};
use halftone::Method;
use inks::{InkSet, Library};
use observe::Silent;
use press::job::Handling;
use press::job::stream::write_job;
use press::layout::Layout;
use press::pipeline::{self, Request};
use press::separate::Pass;
use protocol::ink::Ink;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{JobKind, JobState, Progress, SCHEMA, ToBridge, ToHost, VERSION};
use protocol::paper::Paper;
use protocol::rgl::{Media, Page};
use sheet::Plane;
use std::convert::Infallible;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

fn main() {
    let (job, streams) = (job(), streams::of_bytes(job(), &Silent).expect("a job of our own"));
    println!(
        "eight planes: job {} bytes, as pass streams {}, 1/{:.2}",
        job.len(),
        streams.len(),
        job.len() as f64 / streams.len() as f64
    );
    // Both several times, in turn.
    let (mut known, mut read_back) = (Duration::ZERO, Duration::ZERO);
    for _ in 0..5 {
        let timed = |content, time: &mut Duration| {
            let start = Instant::now();
            let streams = streams::of(content, &Silent).expect("a job of our own");
            *time += start.elapsed();
            streams
        };
        let known = timed(Content::Made(made()), &mut known);
        assert!(known == timed(Content::Bytes(&made().bytes), &mut read_back));
    }
    println!(
        "seven planes: streams of a job that was just made take {:.2} of the time that those of its bytes do",
        known.as_secs_f64() / read_back.as_secs_f64()
    );
    divan::main();
}

/// The page as a job. Seven cartridges are the most, so one ink is used twice.
fn job() -> &'static [u8] {
    static JOB: OnceLock<Vec<u8>> = OnceLock::new();
    JOB.get_or_init(|| {
        let inks = Ink::ALL.iter().take(7).chain(&Ink::ALL[..1]);
        let passes: Vec<Pass> = inks
            .zip(planes())
            .map(|(&ink, bits)| {
                let (width, length) = (usize::from(WIDTH), usize::from(ROWS));
                Pass { ink, plane: Plane { width, length, stride: width / 8, bits: bits.clone() } }
            })
            .collect();
        let mut job = Vec::new();
        write_job(Page::plain(Paper::A4), None, &passes, &mut job, &Silent).expect("a legal job");
        job
    })
}

#[divan::bench(sample_count = 5)]
fn read_the_job(bencher: Bencher) {
    bencher.counter(BytesCount::of_slice(job())).bench_local(|| check(job(), &Silent));
}

/// A page of as many inks as there are cartridges, just made.
fn made() -> &'static pipeline::Job {
    static JOB: OnceLock<pipeline::Job> = OnceLock::new();
    JOB.get_or_init(|| {
        let inks = [
            Ink::Cyan,
            Ink::Magenta,
            Ink::Yellow,
            Ink::Black,
            Ink::White,
            Ink::MetallicGold,
            Ink::MetallicSilver,
        ];
        let dots = planes::dots(Method::Walk, &inks, (600, 800), (190.0, 230.0), Paper::A4);
        let request = Request {
            name: "seven planes",
            dots: &dots,
            layout: &Layout::centred(Paper::A4),
            handling: Handling { media: Media::Plain, curl_correction: true },
            allowed: InkSet::of(inks),
            library: &Library::builtin(),
        };
        pipeline::job(&request, &Silent).expect("a legal job")
    })
}

#[divan::bench(sample_count = 5)]
fn make_the_streams_of_a_job_just_made(bencher: Bencher) {
    bencher
        .counter(BytesCount::of_slice(&made().bytes))
        .bench_local(|| streams::of(Content::Made(made()), &Silent));
}

#[divan::bench(sample_count = 5)]
fn make_the_streams_of_its_bytes(bencher: Bencher) {
    let content = Content::Bytes(&made().bytes);
    bencher.counter(BytesCount::of_slice(content.bytes())).bench_local(|| streams::of(content, &Silent));
}

#[divan::bench(sample_count = 5)]
fn make_its_streams(bencher: Bencher) {
    bencher.counter(BytesCount::of_slice(job())).bench_local(|| streams::of_bytes(job(), &Silent));
}

/// A megabyte through a session.
#[divan::bench(sample_count = 20)]
fn talk(bencher: Bencher) {
    let data = &job()[..1 << 20];
    bencher.counter(BytesCount::of_slice(data)).bench_local(|| {
        let record = Record::new(1, JobKind::Raw, data.len() as u32);
        assert_eq!(talk_over(&mut Session::new(record, data), data.len() as u32), Outcome::Printed);
    });
}

/// The conversation with a bridge that has endless memory and a printer without mechanics.
fn talk_over(session: &mut Session<'_>, length: u32) -> Outcome {
    let mut reader = Reader::new();
    let (mut accepted, mut open) = (0, false);
    session.connected(Duration::ZERO);
    for step in 0.. {
        let now = Duration::from_millis(step);
        let mut out = Vec::new();
        let Ok(()) = session.speak(now, &mut out, &mut |_| Ok::<(), Infallible>(()));
        if let Some(outcome) = session.outcome() {
            return outcome;
        }
        let (mut answer, mut left) = (Vec::new(), &out[..]);
        let mut say = |message: ToHost<'_>| {
            let mut buffer = [0; MAX];
            let length = frame::write(&message, &mut buffer).expect("a frame");
            answer.extend_from_slice(&buffer[..length]);
        };
        while let Read::Message(message, rest) = reader.read(left) {
            left = rest;
            match frame::decode(message).expect("a message of ours") {
                ToBridge::Hello { .. } => {
                    say(ToHost::Hello {
                        version: VERSION,
                        schema: SCHEMA,
                        boot: 1,
                        serial: 2,
                        firmware: "bench",
                    });
                }
                ToBridge::Begin { .. } => open = true,
                ToBridge::Data { bytes, .. } => accepted += bytes.len() as u32,
                _ => {}
            }
        }
        let state = match open {
            false => JobState::None,
            true if accepted == length => JobState::Done,
            true => JobState::Printing,
        };
        say(ToHost::Progress(Progress {
            job: open.into(),
            state,
            accepted,
            limit: length,
            printed: accepted,
            pass: 0,
            row: 0,
        }));
        session.hear(now, &answer).expect("nothing to complain of");
    }
    unreachable!("the steps do not end")
}
