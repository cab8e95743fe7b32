//! Whatever happens to the link, the host, the bridge and the printer: the bytes at the port are those of an
//! undisturbed run.

use model::{ALL, Job, Mischief, NONE, is_a_whole_job, run, seeded};
use protocol::link::message::JobState;
use rand::RngExt;

fn disturbed(seeds: core::ops::Range<u64>) {
    let mut accidents = [0; 3];
    for seed in seeds.clone() {
        let mut random = seeded(seed);
        let job = Job::random(random.random_range(1..=u32::MAX), &mut random);
        let run = run(&job, &ALL, None, &mut random);
        assert_eq!(run.state, JobState::Done, "seed {seed}");
        assert!(run.printed == job.expected, "seed {seed}: other bytes at the port");
        assert!(!run.initialised, "seed {seed}: the printer was reset");
        for (sum, count) in accidents.iter_mut().zip(run.accidents) {
            *sum += count;
        }
    }
    println!(
        "seeds {seeds:?}: cut {}, host killed {}, bridge reset {}",
        accidents[0], accidents[1], accidents[2]
    );
    assert!(accidents.iter().all(|&count| count > 0), "nothing went wrong, so nothing was tried");
}

#[test]
fn the_paper_does_not_notice_a_bad_link() {
    disturbed(0..1_000);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_paper_does_not_notice_ten_thousand_bad_links() {
    disturbed(1_000..11_000);
}

fn cancelled(seeds: core::ops::Range<u64>, mischief: &Mischief) {
    let (mut early, mut late, mut never) = (0, 0, 0);
    for seed in seeds {
        let mut random = seeded(seed);
        let job = Job::random(7, &mut random);
        let at = random.random_range(0..job.expected.len() * 5 / 4).saturating_sub(job.expected.len() / 4);
        let run = run(&job, mischief, Some(at), &mut random);
        assert!(!run.initialised, "seed {seed}: the printer was reset");
        match run.state {
            JobState::Done => assert!(run.printed == job.expected, "seed {seed}"),
            JobState::Cancelled if run.printed.is_empty() => never += 1,
            JobState::Cancelled => {
                assert!(is_a_whole_job(&run.printed), "seed {seed}: the next job will not work")
            }
            state => panic!("seed {seed}: {state:?}"),
        }
        *(if run.state == JobState::Done { &mut late } else { &mut early }) += 1;
    }
    println!("cancelled in time {early}, of them before the first byte {never}, too late {late}");
    assert!(early > never && never > 0 && late > 0);
}

#[test]
fn a_cancelled_sheet_is_a_whole_job_to_the_printer() {
    cancelled(20_000..20_300, &NONE);
}

#[test]
fn a_cancelled_sheet_is_a_whole_job_on_a_bad_link_too() {
    cancelled(30_000..30_300, &ALL);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn ten_thousand_cancelled_sheets_are_whole_jobs() {
    cancelled(40_000..50_000, &ALL);
}
