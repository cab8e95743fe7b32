//! A job at a device that takes the printer's bytes as they are, such as `/dev/usb/lp0`.
//!
//! Such a device tells nothing. A job that was interrupted there may have left a part in the printer, and only its switch helps.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use super::{Delivery, Failure, Job, News, Question, ResetOwed};
use crate::printers::Printer;
use crate::transit::Wish;
use crate::transit::raw::{self, RawError};

impl Delivery<'_> {
    /// Sends a job to a device. False if the caller ended it early, so that the sheet comes out unfinished and the printer is ready
    /// for the next job. Whether the bytes are printed only the printer shows.
    pub fn send_raw(&self, job: Job<'_>, device: &Path) -> Result<bool, Failure> {
        if let Some(warning) = self.printers.warning() {
            self.note(&warning);
        }
        let noted = self.printers.noted(Some(device))?;
        if !noted.is_empty() {
            let owed = ResetOwed { printer: Printer::Device(device.to_path_buf()), job: 0 };
            if !self.caller.agrees(&Question::Reset(&owed)) {
                return Err(Failure::ResetOwed(owed));
            }
            self.printers.close(&noted)?;
        }
        loop {
            if self.caller.wish() != Wish::GoOn {
                return Ok(false);
            }
            let Err(error) = raw::try_open(device) else { break };
            let failure = Failure::from(error);
            if !failure.may_pass() || !self.caller.waits(&failure, false) {
                return Err(failure);
            }
        }
        // A device has no numbers for jobs; the moment and the process make one.
        let moment = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let number = format!("raw-{}-{}", moment.as_nanos(), std::process::id());
        self.caller.tell(&News::SendingRaw);
        let note = self.printers.begin(device, &number)?;
        self.count(&number, job.checked, job.content.bytes().len() as u64);
        let stop = || self.caller.wish() != Wish::GoOn;
        let sent = raw::send_while(job.content.bytes(), device, self.caller.observer(), &stop);
        let (taken, whole) = match &sent {
            Ok(sent) => (sent.taken, sent.whole),
            Err(RawError::Write { taken, .. }) => (*taken, false),
            Err(RawError::Open { .. } | RawError::NoDevice { .. }) => (0, false),
        };
        self.counted(&number, taken as u64, whole);
        if sent.is_ok() || taken == 0 {
            self.close(note);
        }
        Ok(sent?.whole)
    }
}
