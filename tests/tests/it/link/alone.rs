//! Printing without a computer, as its users do it: `send --store`, `bridge jobs`, the button.

use super::process::Bench;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The number that follows `word` in a text.
fn number_after(word: &str, said: &str) -> String {
    let at = said.find(word).unwrap_or_else(|| panic!("no {word:?} in {said}")) + word.len();
    said[at..at + 8].into()
}

fn wait(what: &str, done: impl Fn() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(20), "never {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until so many sheets have come out, and nothing else.
fn wait_for_sheets(bench: &Bench, count: usize) {
    wait("so many sheets", || bench.printed().len() >= count * bench.job.len());
    assert_eq!(bench.sheets(), count);
}

fn store(bench: &Bench) -> String {
    let said = bench.says(0, "send job.rgl --to BRIDGE --store");
    assert!(said.contains("as pass streams, 1/") && said.contains("room for"), "{said}");
    number_after("is stored in the bridge as job ", &said)
}

#[test]
fn a_job_is_stored_listed_printed_by_button_and_by_command_and_deleted() {
    let bench = Bench::new(8, 2000);
    let (_, said) = bench.answered("bridge jobs --to BRIDGE", "");
    assert!(said.starts_with("no jobs, room for 1.72 MiB of 1.72 MiB"), "{said}");
    let number = store(&bench);
    assert!(bench.printed().is_empty());
    let (_, said) = bench.answered("bridge jobs --to BRIDGE", "");
    assert!(
        said.starts_with("1 job, room for") && said.contains(&number) && said.contains("job.rgl"),
        "{said}"
    );
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(
        said.contains(&format!("job {number} was stored")) && said.contains("stored: 1 job, room"),
        "{said}"
    );
    let (_, said) = bench.answered("bridge jobs --to BRIDGE --json", "");
    let listed: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(listed["jobs"][0]["name"], "job.rgl");

    bench.bridge.port.press.store(true, Ordering::Relaxed);
    wait_for_sheets(&bench, 1);
    let (code, said) = bench.answered(&format!("bridge jobs --to BRIDGE --print {number}"), "");
    assert_eq!(code, Some(0), "{said}");
    wait_for_sheets(&bench, 2);
    // By its diary the printer stood between two jobs.
    assert_eq!(bench.bridge.port.resets.load(Ordering::Relaxed), 0);

    for (what, word) in
        [("--print 00000007", "no stored job 00000007"), ("--delete 7", "no stored job 00000007")]
    {
        let said = bench.says(1, &format!("bridge jobs --to BRIDGE {what}"));
        assert!(said.contains(word) && said.contains("foilpress bridge jobs"), "{said}");
    }
    let said = bench.says(2, "bridge jobs --to BRIDGE --print leaf");
    assert!(said.contains("eight digits"), "{said}");
    let (_, said) = bench.answered(&format!("bridge jobs --to BRIDGE --delete {number}"), "");
    assert!(said.contains("is deleted"), "{said}");
    let (_, said) = bench.answered("bridge jobs --to BRIDGE", "");
    assert!(said.starts_with("no jobs"), "{said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_job_that_does_not_fit_is_refused_before_it_is_sent() {
    let bench = Bench::new(8, 2000);
    for _ in 0..16 {
        store(&bench);
    }
    let said = bench.says(1, "send job.rgl --to BRIDGE --store");
    assert!(said.contains("job.rgl is not stored") && said.contains("which has room for 0 of"), "{said}");
    assert!(said.contains("`foilpress bridge jobs` lists the jobs there"), "{said}");
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("stored: 16 jobs") && said.contains("was stored"), "nothing was opened: {said}");
    let said = bench.says(1, "send job.rgl --to file:x.rgl --store");
    assert!(said.contains("needs a bridge"), "{said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_link_may_break_while_a_job_is_stored() {
    let bench = Bench::new(8, 2000);
    let port = bench.bridge.port.clone();
    let ended = AtomicBool::new(false);
    let breaks = std::thread::scope(|scope| {
        // On a computer with much else to do the job goes slowly: each break finds a further part of it stored.
        let disturb = scope.spawn(|| {
            let (mut breaks, mut before, begin) = (0, port.written(), Instant::now());
            while !ended.load(Ordering::Relaxed) && breaks < 6 && begin.elapsed() < Duration::from_secs(20) {
                std::thread::sleep(Duration::from_millis(5));
                if port.written() > before {
                    port.garbage.store(true, Ordering::Relaxed);
                    std::thread::sleep(Duration::from_millis(60));
                    port.cut.store(true, Ordering::Relaxed);
                    (breaks, before) = (breaks + 1, port.written());
                }
            }
            breaks
        });
        store(&bench);
        ended.store(true, Ordering::Relaxed);
        disturb.join().unwrap()
    });
    assert!(breaks > 0, "nothing broke");
    bench.bridge.port.press.store(true, Ordering::Relaxed);
    wait_for_sheets(&bench, 1);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_supply_that_goes_in_the_middle_of_a_sheet_costs_that_sheet_and_not_the_next_users() {
    let bench = Bench::new(8, 40);
    let number = store(&bench);
    bench.keep_busy(true);
    bench.bridge.port.press.store(true, Ordering::Relaxed);
    bench.until_it_prints();
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("printing job fffffffe"), "{said}");
    // Another user's job, and another to store, have to wait.
    for args in ["send job.rgl --to BRIDGE", "send job.rgl --to BRIDGE --store"] {
        let said = bench.says(1, args);
        assert!(said.contains("printing another job (fffffffe)"), "{args}: {said}");
    }
    bench.bridge.strike(|port| &port.forget);
    let half = bench.printed().len();
    let (_, said) = bench.answered("bridge status --to BRIDGE", "");
    assert!(said.contains("job fffffffe was lost"), "{said}");
    let said = bench.says(1, "send job.rgl --to BRIDGE");
    assert!(said.contains("may hold part of a job that its button has started"), "{said}");
    assert_eq!(bench.printed().len(), half);
    bench.says(0, "bridge reset --to BRIDGE");
    assert_eq!(*bench.bridge.port.reset_at.lock().unwrap(), [half]);
    bench.bridge.port.printed.lock().unwrap().clear();
    bench.keep_busy(false);
    bench.bridge.port.rate.store(2000, Ordering::Relaxed);
    bench.says(0, "send job.rgl --to BRIDGE");
    assert_eq!(bench.sheets(), 1);
    let (_, said) = bench.answered("bridge jobs --to BRIDGE", "");
    assert!(said.contains(&number), "it is still stored: {said}");
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_held_job_says_what_lets_it_go_on() {
    let bench = Bench::new(8, 40);
    store(&bench);
    bench.bridge.port.press.store(true, Ordering::Relaxed);
    bench.until_it_prints();
    bench.bridge.port.press.store(true, Ordering::Relaxed);
    let held = || bench.answered("bridge status --to BRIDGE", "").1;
    wait("held", || held().contains("held with the bridge's button: press it once more"));
    bench.bridge.port.rate.store(2000, Ordering::Relaxed);
    bench.bridge.port.press.store(true, Ordering::Relaxed);
    wait_for_sheets(&bench, 1);
}
