//! Separation of a full A4 page in five passes, and the way back.
//!
//! Run `cargo bench --bench separate`. The stacks are those of the paper's oak leaf, each on an eighth of the dots, in
//! clusters of 3 x 3.

use divan::Bencher;
use inks::Library;
use observe::Silent;
use press::separate::{compose, separate};
use protocol::paper::Paper;
use sheet::Sheet;

fn main() {
    divan::main();
}

/// Metallic silver and three process inks, with finish on some; five passes.
fn page() -> Sheet {
    let text = ["substrate", "C", "M", "Y", "MS", "MS+C", "MS+M+Y", "MS+Y+F"];
    let stacks = text.map(|stack| stack.parse().expect("known inks")).to_vec();
    let (width, length) = (usize::from(Paper::A4.width()), usize::from(Paper::A4.length()));
    let of = |x: usize, y: usize| ((x / 3 * 7919 + y / 3 * 104_729) as u32).wrapping_mul(0x9e37_79b1) >> 29;
    let index = (0..width * length).map(|i| of(i % width, i / width) as u8).collect();
    Sheet::new(Paper::A4, stacks, index).expect("a page of dots")
}

/// Planes, and checks on cluster sizes.
#[divan::bench(sample_count = 5)]
fn five_passes(bencher: Bencher) {
    let (sheet, library) = (page(), Library::builtin());
    let separate = || separate(&sheet, library.rules(), &Silent).expect("five inks");
    assert_eq!(separate().passes.len(), 5);
    bencher.bench(separate);
}

/// The same back to a sheet.
#[divan::bench(sample_count = 5)]
fn five_passes_back(bencher: Bencher) {
    let sheet = page();
    let separation = separate(&sheet, &[], &Silent).expect("five inks");
    bencher.bench(|| compose(sheet.paper(), &separation.passes, sheet.stacks()).expect("the same sheet"));
}
