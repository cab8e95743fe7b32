//! The printer: what has crossed its port since it last stood between two jobs, and what it says of itself.
//!
//! Its status lags: it says idle for seconds behind the last byte of a sheet, and then prints for half a minute (as the MD-5000
//! does on a parallel port). A sheet that comes while another one waits or is printed follows that one at once. Time is in µs.

use model::is_a_whole_job;

/// The printer.
pub struct Printer {
    /// Bytes since it stood between two jobs; with a part of a sheet it waits for the rest.
    pub since: Vec<u8>,
    /// The job whose bytes these are, as the bridge numbers it.
    pub owner: u32,
    /// Its +5 V are absent at the port until then.
    pub off_until: u64,
    /// They are a whole job: what comes next begins another one.
    complete: bool,
    /// From when until when it prints what has come whole.
    prints: (u64, u64),
    /// How long its status says idle behind a sheet, and for how long it then prints.
    lag: (u64, u64),
}

impl Printer {
    /// A printer between two jobs, with this lag.
    pub fn new(lag: (u64, u64)) -> Printer {
        Printer { since: Vec::new(), owner: 0, off_until: 0, complete: false, prints: (0, 0), lag }
    }

    /// Whether it waits for the rest of a sheet, or of a question.
    pub fn holds_a_part(&self) -> bool {
        !self.since.is_empty() && !is_a_whole_job(&self.since)
    }

    /// It was reset, or switched off: the job that is lost with that, if it had a part of one. What has come
    /// whole it prints.
    pub fn reset(&mut self) -> Option<u32> {
        let part = self.holds_a_part();
        if part {
            self.since.clear();
        }
        self.settle();
        part.then_some(self.owner)
    }

    /// Something happened between its bytes: those that come next are of another job if it has a whole one.
    pub fn settle(&mut self) {
        self.complete = !self.since.is_empty() && !self.holds_a_part();
    }

    /// Whether bytes of this job begin a sheet.
    pub fn begins(&self, job: u32) -> bool {
        self.owner != job || self.since.is_empty() || self.complete
    }

    /// A sheet, or a question, begins.
    pub fn begin(&mut self, job: u32) {
        self.since.clear();
        (self.owner, self.complete) = (job, false);
    }

    /// A whole sheet has come: when it will be out.
    pub fn whole(&mut self, now: u64) -> u64 {
        self.since.clear();
        let (from, until) = self.prints;
        let from = if now < until { from } else { now + self.lag.0 };
        self.prints = (from, until.max(from) + self.lag.1);
        self.prints.1
    }

    /// Its answer to the status question.
    pub fn status(&self, now: u64) -> [u8; 38] {
        let prints = (self.prints.0..self.prints.1).contains(&now);
        let mut answer = [0xff; 38];
        answer[..5].copy_from_slice(&[2, 0x80, 33, 0, if prints { 0x18 } else { 0x10 }]);
        answer[32..37].fill(0);
        answer[37] = 3;
        answer
    }
}
