//! The whole system under a seed that is drawn anew, and under the seeds that once broke a promise.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use system::promises::{Promise, Table, tried};
use system::{report, run};

/// For how long it is tried on an ordinary day; the gate says for how long then.
const EVERYDAY_SECONDS: u64 = 10;

/// In a minute each promise is endangered so often that it would break; all that can happen has happened in
/// a quarter of an hour, in two worlds at once.
const MINUTE: u64 = 60;
const OFTEN: u64 = 100;
const ALL_SECONDS: u64 = 900;

/// `FOILPRESS_SEED` and `FOILPRESS_SECONDS` choose what is tried, and for how long. Without the first the
/// seed is that of the property tests, which the gate draws from the commit; without either it is drawn from
/// the clock.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// What all seeds together have come to.
#[derive(Default)]
struct Sum {
    steps: u64,
    sheets: usize,
    broken: Vec<u64>,
    endangered: Table,
}

#[test]
fn every_promise_is_kept_whatever_happens() {
    let first = number("FOILPRESS_SEED").or_else(|| number("PROPTEST_RNG_SEED")).unwrap_or_else(|| {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        now.as_nanos() as u64 % 1_000_000_007 * 1_000_000
    });
    let time = Duration::from_secs(number("FOILPRESS_SECONDS").unwrap_or(EVERYDAY_SECONDS));
    println!("from seed {first} on, for {time:?}");
    let (start, next, all) = (Instant::now(), AtomicU64::new(first), Mutex::new(Sum::default()));
    // A world waits for one of its processes at a time: two at once keep two cores at work.
    let live = || {
        while start.elapsed() <= time && all.lock().expect("nobody fails").broken.len() < 5 {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            let found = run(seed, None);
            let told = found.broken.as_ref().map(|_| report(seed, &found));
            let mut all = all.lock().expect("nobody fails");
            (all.steps, all.sheets) = (all.steps + found.steps, all.sheets + found.sheets);
            all.endangered.add(&found.endangered);
            if let Some(told) = told {
                println!("after {} steps in all, {:?}:\n{told}", all.steps, start.elapsed());
                all.broken.push(seed);
            }
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(live);
        live();
    });
    let Sum { steps, sheets, broken, endangered } = all.into_inner().expect("nobody fails");
    let seeds = next.into_inner() - first;
    println!("{seeds} seeds, {steps} steps, {sheets} sheets in {:?}", start.elapsed());
    println!("{}", endangered.text());
    assert!(broken.is_empty(), "promises were broken under {broken:?}");
    if time >= Duration::from_secs(MINUTE) {
        for promise in Promise::ALL {
            assert!(endangered.total(promise) >= OFTEN, "{promise:?} was hardly endangered");
        }
    }
    if time >= Duration::from_secs(ALL_SECONDS) {
        assert_eq!(endangered.gaps(), Vec::<String>::new());
    }
}

/// All sources of tests in a folder.
fn sources(folder: &std::path::Path, text: &mut String) {
    for item in std::fs::read_dir(folder).expect("a folder").filter_map(Result::ok) {
        let (path, name) = (item.path(), item.file_name());
        let name = name.to_string_lossy();
        if path.is_dir() {
            if !matches!(&*name, "target" | "node_modules") && !name.starts_with('.') {
                sources(&path, text);
            }
        } else if name.ends_with(".rs") || name.ends_with(".mjs") {
            text.push_str(&std::fs::read_to_string(&path).unwrap_or_default());
        }
    }
}

/// The words of a text, one space between them.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_promise_of_the_documents_stands_there_and_names_a_test_that_exists() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let table = std::fs::read_to_string(root.join("docs/promises.md")).expect("the table");
    let mut text = String::new();
    sources(&root, &mut text);
    // What the simulation has tried by then; [`Table::gaps`] holds a run of a quarter of an hour to it.
    assert!(table.ends_with(&tried()), "the states are now:\n{}", tried());
    let sentences = table.split("\n## ").next().expect("a beginning");
    let rows: Vec<&str> = sentences.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    assert!(rows.len() > 10);
    let mut bound = Vec::new();
    for row in rows {
        let mut columns = row.trim_matches(['|', ' ']).split(" | ");
        let (sentence, place) = (columns.next().expect("a sentence"), columns.next().expect("a place"));
        let path = place.split_once("](").and_then(|(_, path)| path.strip_suffix(')')).expect("a link");
        let document = std::fs::read_to_string(root.join("docs").join(path)).expect("a document");
        assert!(words(&document).contains(&words(sentence)), "{path} does not say: {sentence}");
        let mut columns = row.trim_end_matches('|').rsplit('|');
        let (promises, held) = (columns.next().expect("states"), columns.next().expect("tests"));
        let names: Vec<&str> = held.split('`').skip(1).step_by(2).collect();
        let promises: Vec<&str> = promises.split(',').map(str::trim).filter(|name| *name != "-").collect();
        assert_eq!(promises.is_empty(), !names.contains(&"every_promise_is_kept_whatever_happens"), "{row}");
        bound.extend(promises);
        assert!(!names.is_empty(), "no test: {row}");
        for name in names {
            let exists = text.contains(&format!("fn {name}(")) || text.contains(&format!("test('{name}'"));
            assert!(exists, "no test is called {name}");
        }
    }
    bound.sort_unstable();
    bound.dedup();
    let mut known = Promise::ALL.map(|promise| format!("{promise:?}"));
    known.sort_unstable();
    assert_eq!(bound, known, "promises of the simulation that a sentence is bound to");
}
