//! A boot loader's replies: whatever it answers, flashing ends, and reports success only if the flash reads back as the image.
//!
//! The board takes what it is sent, and then a script decides what it says: less or more data than asked for, other data, a stall, a status
//! of any kind, nothing any more.

use arbitrary::Unstructured;
use device::flash::picoboot::{Picoboot, Pipe};
use observe::Silent;
use std::cell::RefCell;
use std::io;
use uf2::{Chip, decode, encode};

/// A script.
pub fn check(bytes: &[u8]) {
    let program: Vec<u8> = (0..9_000u32).map(|at| (at * 7 % 253) as u8).collect();
    let file = encode(Chip::Rp2040, &[(uf2::START.into(), &program)]).expect("an image");
    let image = decode(&file).expect("what was encoded");
    let board = RefCell::new(Board {
        script: Unstructured::new(bytes),
        flash: vec![0; 0x10000],
        sent: Vec::new(),
        calls: 0,
    });
    if Picoboot::write(Cable(&board), &image, &Silent).is_ok() {
        let board = board.borrow();
        let whole = board.flash[..program.len()] == program[..];
        assert!(whole, "success, but something else is in the flash");
    }
    assert!(board.borrow().calls < 1_000);
    let _ = Picoboot::restart(Cable(&board), Chip::Rp2350);
}

struct Board<'s> {
    script: Unstructured<'s>,
    flash: Vec<u8>,
    /// The command under way and its data.
    sent: Vec<u8>,
    calls: usize,
}

impl Board<'_> {
    /// Whether it does otherwise than it should; it does as it should once the script is at its end.
    fn errs(&mut self) -> bool {
        self.calls += 1;
        !self.script.is_empty() && self.script.ratio(1u8, 24u8).unwrap_or(false)
    }

    fn word(&self, at: usize) -> usize {
        u32::from_le_bytes([self.sent[at], self.sent[at + 1], self.sent[at + 2], self.sent[at + 3]]) as usize
    }

    /// Erases and writes as it was told.
    fn obey(&mut self) {
        if self.sent.len() < 32 {
            return;
        }
        let from = self.word(16).saturating_sub(uf2::START as usize);
        let to = (from + self.word(20)).min(self.flash.len());
        match self.sent[8] {
            3 => self.flash[from.min(to)..to].fill(0xff),
            5 if self.sent.len() >= 32 + to - from.min(to) => {
                let data = self.sent[32..32 + to - from.min(to)].to_vec();
                self.flash[from.min(to)..to].copy_from_slice(&data);
            }
            _ => {}
        }
    }
}

struct Cable<'b, 's>(&'b RefCell<Board<'s>>);

impl Pipe for Cable<'_, '_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut board = self.0.borrow_mut();
        if board.errs() {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        if bytes.starts_with(&0x431f_d10b_u32.to_le_bytes()) && bytes.len() == 32 {
            board.sent.clear();
        }
        board.sent.extend_from_slice(bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut board = self.0.borrow_mut();
        if board.errs() {
            return match board.script.int_in_range(0..=2u8) {
                Ok(0) => Err(io::ErrorKind::TimedOut.into()),
                Ok(1) => Ok(board.script.int_in_range(0..=buffer.len()).unwrap_or(0)),
                _ => {
                    buffer.fill(board.script.arbitrary().unwrap_or(0));
                    Ok(buffer.len())
                }
            };
        }
        if board.sent.get(8) == Some(&0x84) {
            let from = board.word(16).saturating_sub(uf2::START as usize);
            let to = (from + board.word(20)).min(board.flash.len());
            let length = buffer.len().min(to.saturating_sub(from));
            buffer[..length].copy_from_slice(&board.flash[from..from + length]);
            return Ok(length);
        }
        board.obey();
        Ok(0)
    }

    fn status(&mut self) -> io::Result<[u8; 16]> {
        let mut board = self.0.borrow_mut();
        if board.errs() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        Ok(board.script.arbitrary().unwrap_or([0; 16]))
    }

    fn reset(&mut self) -> io::Result<()> {
        if self.0.borrow_mut().errs() { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
    }
}
