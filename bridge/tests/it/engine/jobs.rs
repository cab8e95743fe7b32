//! Jobs from their first byte to their end: printed, cancelled, or broken off by a defect.

use super::{Rig, a_raw_job};
use bridge::engine::Engine;
use model::{IDENTITY, Job, NONE, Planes, is_a_whole_job, memory, rested, run, seeded};
use protocol::link::message::{DefectKind, Fault, JobKind, JobState, Lines, PastJob, ToBridge};
use protocol::walk::Placed;

#[test]
fn streams_come_out_as_the_encoder_that_writes_files_would_have_it() {
    for seed in 0..100 {
        let planes = Planes::random(&mut seeded(seed));
        let mut rig = Rig::new();
        let progress = rig.send(1, JobKind::Streams, &planes.streams());
        assert_eq!(progress.state, JobState::Done);
        assert!(rig.printed == planes.printed(), "seed {seed}");
        assert_eq!(progress.printed as usize, rig.printed.len());
    }
}

#[test]
fn real_streams_pass_through_unchanged() {
    let Some(folder) = testing::needs::golden() else { return };
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|name| name == "bin") {
            let stream = std::fs::read(&path).unwrap();
            let mut rig = Rig::new();
            assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
            assert!(rig.printed == stream, "{path:?}");
        }
    }
}

#[test]
fn several_jobs_follow_each_other() {
    let (mut rig, mut random) = (Rig::new(), seeded(9));
    let mut expected = Vec::new();
    for id in 1..20 {
        let job = Job::random(id, &mut random);
        assert_eq!(rig.send(id, job.kind, &job.data).state, JobState::Done);
        expected.extend(job.expected);
        // A late repetition of the one before changes nothing.
        rig.tell(ToBridge::Begin { job: id, kind: job.kind, length: job.data.len() as u32 });
        rig.tell(ToBridge::Data { job: id, offset: 0, bytes: &job.data[..1] });
        assert_eq!(rig.engine.progress().state, JobState::Done);
    }
    assert!(rig.printed == expected);
}

#[test]
fn an_undisturbed_run_of_the_model_is_the_job() {
    for seed in 0..50 {
        let mut random = seeded(seed);
        let job = Job::random(3, &mut random);
        assert!(run(&job, &NONE, None, &mut random).printed == job.expected);
    }
}

#[test]
fn positions_on_the_sheet_rise_to_the_last_pass() {
    let planes = Planes::random(&mut seeded(5));
    let mut rig = Rig::new();
    let progress = rig.send(1, JobKind::Streams, &planes.streams());
    assert_eq!(usize::from(progress.pass) + 1, planes.inks.len());
}

#[test]
fn a_finished_job_is_remembered_through_a_reset() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.send(1, JobKind::Raw, &stream);
    let mut rig = rig.restarted();
    // The host has not heard of the end and sends it again.
    assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    assert!(rig.printed.is_empty(), "the sheet was printed twice");
}

#[test]
fn a_raw_job_cancelled_before_its_first_row_has_not_touched_the_printer() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, 60);
    rig.print();
    rig.tell(ToBridge::Cancel { job: 1 });
    rig.print();
    assert_eq!((rig.engine.progress().state, rig.printed.len()), (JobState::Cancelled, 0));
    assert_eq!(rig.engine.task(), None);
}

#[test]
fn a_cancel_that_comes_too_late_changes_nothing() {
    let stream = Planes {
        width: 8,
        rows: 1,
        inks: vec![protocol::ink::Ink::Black],
        bits: vec![vec![1]],
        walk: Placed::whole(8, 1),
    }
    .printed();
    let mut rig = Rig::new();
    rig.open(1, &stream, stream.len());
    while rig.engine.work() {}
    assert_eq!(rig.tell(ToBridge::Cancel { job: 1 }).progress.unwrap().state, JobState::Printing);
    rig.print();
    assert_eq!(rig.engine.progress().state, JobState::Done);
    assert!(rig.printed == stream);
}

#[test]
fn a_stream_that_ends_too_early_is_brought_to_an_end() {
    let stream = a_raw_job();
    for cut in (100..stream.len() - 2).step_by(97) {
        let mut rig = Rig::new();
        let state = rig.send(1, JobKind::Raw, &stream[..cut]).state;
        assert!(
            matches!(state, JobState::Broken(defect) if defect.what == DefectKind::Truncated),
            "{state:?}"
        );
        assert!(rig.printed.is_empty() || is_a_whole_job(&rig.printed), "cut at {cut}");
    }
}

#[test]
fn pass_streams_with_a_defect_are_brought_to_an_end() {
    let mut outcomes = std::collections::BTreeSet::new();
    for seed in 0..300u64 {
        let mut data = Planes::random(&mut seeded(seed)).streams();
        match seed % 3 {
            0 => data.truncate(data.len() - 1),
            1 => data.push(0),
            _ => {
                let at = (seed as usize * 7919) % data.len();
                data[at] ^= 1 << (seed / 3 % 8);
            }
        }
        let mut rig = Rig::new();
        let state = rig.send(1, JobKind::Streams, &data).state;
        outcomes.insert(match state {
            JobState::Broken(defect) => format!("{:?}", defect.what),
            state => format!("{state:?}"),
        });
        assert!(rig.printed.is_empty() || is_a_whole_job(&rig.printed), "seed {seed}: {state:?}");
        assert!(seed % 3 == 2 || matches!(state, JobState::Broken(_)), "seed {seed}: {state:?}");
    }
    for kind in ["Excess", "Truncated", "Stream", "Header"] {
        assert!(outcomes.contains(kind), "never {kind}: {outcomes:?}");
    }
}

#[test]
fn a_page_too_wide_for_the_memory_is_refused_before_the_first_byte() {
    let planes = Planes {
        width: 4800,
        rows: 10,
        inks: vec![protocol::ink::Ink::Black],
        bits: vec![vec![1; 6000]],
        walk: Placed::whole(4800, 10),
    };
    let mut rig = Rig::with(rested(memory(2048, 2048, 38_399), IDENTITY));
    let state = rig.send(1, JobKind::Streams, &planes.streams()).state;
    assert!(matches!(state, JobState::Broken(defect) if defect.what == DefectKind::TooLarge));
    assert!(rig.printed.is_empty());
    let mut rig = Rig::with(rested(memory(2048, 2048, 38_400), IDENTITY));
    assert_eq!(rig.send(1, JobKind::Streams, &planes.streams()).state, JobState::Done);
}

#[test]
fn the_engine_fits_a_microcontroller() {
    assert!(size_of::<Engine>() <= 14 * 1024, "{} bytes", size_of::<Engine>());
}

#[test]
fn a_reset_from_outside_loses_a_job_whose_bytes_were_flowing_and_no_other() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(7, &stream, stream.len().min(900));
    while rig.engine.work() {}
    rig.engine.port(Lines::IDLE, Some(Fault::PaperOut));
    let stopped = rig.engine.checkpoint();
    assert_eq!(stopped.reset_from_outside(), stopped, "nothing is strobed");
    rig.engine.port(Lines::IDLE, None);
    let flowing = rig.engine.checkpoint();
    let again = Engine::resume(memory(2048, 2048, 40_000), IDENTITY, flowing.reset_from_outside());
    assert_eq!((again.progress().state, again.standing().job()), (JobState::Lost, 7));
    assert_eq!(again.checkpoint().past[0], PastJob { job: 7, state: JobState::Lost, printed: 0 });
    rig.print();
    let waits = rig.engine.checkpoint();
    assert_eq!(waits.reset_from_outside(), waits, "nothing is on its way");
}
