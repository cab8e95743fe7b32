//! Several ways to one engine: who is answered.
//!
//! Problem: the bridge has a serial port and bulk endpoints, and a host may change from one to the other in a job, or
//! leave one of them open and silent. Method: each way has its own frame reader, so bytes of one cannot damage a
//! frame of the other. Answers go to the way that spoke last; when that goes, answers that were due are dropped, since
//! they would reach another conversation. The job goes on.

use crate::engine::Engine;
use protocol::link::frame::Reader;

/// A way to the bridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Way {
    /// The serial port.
    Serial,
    /// The bulk endpoints.
    Bulk,
}

/// The ways to an engine.
pub struct Links {
    readers: [Reader; 2],
    speaker: Option<Way>,
    /// The level of the serial port's DTR line.
    ready: bool,
}

impl Links {
    /// Nobody has spoken.
    pub const fn new() -> Self {
        Links { readers: [Reader::new(), Reader::new()], speaker: None, ready: false }
    }

    /// The way to be answered, if there is one.
    pub fn speaker(&self) -> Option<Way> {
        self.speaker
    }

    /// Bytes have come. Returns whether with them a message was complete.
    pub fn receive(&mut self, way: Way, bytes: &[u8], engine: &mut Engine<'_>) -> bool {
        self.speaker = Some(way);
        engine.receive(&mut self.readers[way as usize], bytes)
    }

    /// The host is gone from this way.
    pub fn lost(&mut self, way: Way, engine: &mut Engine<'_>) {
        self.readers[way as usize].reset();
        if self.speaker == Some(way) {
            self.silence(way, engine);
        }
    }

    /// The serial port's DTR line has this level. A host that closes the port drops it. Some hosts never raise it, so only
    /// its fall counts.
    pub fn data_terminal_ready(&mut self, ready: bool, engine: &mut Engine<'_>) {
        if core::mem::replace(&mut self.ready, ready) && !ready {
            self.lost(Way::Serial, engine);
        }
    }

    /// A frame could not be written to this way.
    pub fn silence(&mut self, way: Way, engine: &mut Engine<'_>) {
        if self.speaker == Some(way) {
            self.speaker = None;
        }
        engine.link_lost();
    }
}

impl Default for Links {
    fn default() -> Self {
        Self::new()
    }
}
