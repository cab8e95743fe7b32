//! The whole system under a seed that is drawn anew, and under the seeds that once broke a promise.

use std::time::{Duration, Instant};
use system::{report, run};

/// `FOILPRESS_SEED` and `FOILPRESS_SECONDS` choose what is tried, and for how long.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
fn every_promise_is_kept_whatever_happens() {
    let first = number("FOILPRESS_SEED").unwrap_or_else(|| {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        now.as_nanos() as u64 % 1_000_000_007 * 1_000_000
    });
    let time = Duration::from_secs(number("FOILPRESS_SECONDS").unwrap_or(20));
    println!("from seed {first} on, for {time:?}");
    let start = Instant::now();
    let (mut steps, mut sheets, mut broken) = (0, 0, Vec::new());
    for seed in first.. {
        let found = run(seed, None);
        (steps, sheets) = (steps + found.steps, sheets + found.sheets);
        if found.broken.is_some() {
            println!("after {steps} steps, {:?}:\n{}", start.elapsed(), report(seed, &found));
            broken.push(seed);
        }
        if start.elapsed() > time || broken.len() >= 5 {
            println!("{} seeds, {steps} steps, {sheets} sheets in {:?}", seed - first + 1, start.elapsed());
            break;
        }
    }
    assert!(broken.is_empty(), "promises were broken under {broken:?}");
}
