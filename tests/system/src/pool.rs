//! Jobs to send, made once: to check and to code one takes longer than to print it in this world.

use device::deliver::{Job, Packed};
use device::encodings::{self, Checked, Content};
use model::{Planes, seeded};
use observe::Silent;
use std::sync::LazyLock;

/// Jobs there are.
pub const SIZE: usize = 32;

/// A job.
pub struct Prepared {
    /// Its bytes at the port.
    pub bytes: Vec<u8>,
    checked: Checked,
}

static JOBS: LazyLock<Vec<Prepared>> = LazyLock::new(|| {
    let prepare = |seed| {
        let bytes = Planes::random(&mut seeded(seed)).printed();
        let checked = encodings::check(&bytes, &Silent).ok()?;
        (bytes.len() < 12_000).then_some(Prepared { bytes, checked })
    };
    (0..).filter_map(prepare).take(SIZE).collect()
});

static PACKED: LazyLock<Vec<Packed<'static>>> = LazyLock::new(|| {
    let pack = |(which, job): (usize, &'static Prepared)| {
        let job = Job { name: "sheet", content: Content::Bytes(&job.bytes), checked: &job.checked };
        if which % 3 == 0 { Packed::raw(job) } else { Packed::new(job, &Silent) }
    };
    JOBS.iter().enumerate().map(pack).collect()
});

/// The job of this number, modulo [`SIZE`].
pub fn job(which: usize) -> &'static Prepared {
    &JOBS[which % SIZE]
}

/// The same as it crosses the link.
pub fn packed(which: usize) -> &'static Packed<'static> {
    &PACKED[which % SIZE]
}
