//! A boot ROM for tests: flash, PICOBOOT, and what the chip does when it is switched on again. Written from the data
//! sheet; it refuses whatever the data sheet says is refused, and may go away at any transfer.

use std::cell::RefCell;
use std::io::{self, ErrorKind};
use std::rc::Rc;

use super::image::tests::crc_mpeg_2;
use super::picoboot::Pipe;
use uf2::Chip;

const FLASH: u32 = 0x1000_0000;

/// The part of the board that outlives a lost cable.
pub struct Board {
    pub chip: Chip,
    pub flash: Vec<u8>,
    /// What was asked of it: command and address.
    pub log: Vec<(u8, u32)>,
    pub restarted: bool,
    /// Transfers until it goes away.
    pub transfers_left: Option<usize>,
    /// The answer to erase, write or read at this address, instead of doing it.
    pub refusal: Option<(u32, u32)>,
    /// A cell that does not take its bits.
    pub worn: Option<u32>,
}

impl Board {
    pub fn new() -> Rc<RefCell<Board>> {
        Board::for_chip(Chip::Rp2040)
    }

    pub fn for_chip(chip: Chip) -> Rc<RefCell<Board>> {
        let bytes = if chip == Chip::Rp2040 { 2 << 20 } else { 4 << 20 };
        Rc::new(RefCell::new(Board {
            chip,
            flash: vec![0xff; bytes],
            log: Vec::new(),
            restarted: false,
            transfers_left: None,
            refusal: None,
            worn: None,
        }))
    }

    /// What the chip does when it is switched on: starts the program in flash, or stays in its boot loader.
    pub fn starts(&self) -> bool {
        if self.chip == Chip::Rp2350 {
            let block = b"\xd3\xde\xff\xff\x42\x01\x21\x10\xff\x01\0\0\0\0\0\0\x79\x35\x12\xab";
            return self.flash[..4096].windows(20).any(|bytes| bytes == block);
        }
        crc_mpeg_2(&self.flash[..252]).to_le_bytes() == self.flash[252..256]
    }
}

enum Phase {
    Command,
    DataOut { at: usize, length: usize },
    DataIn { at: usize, length: usize },
    AckOut,
    AckIn,
}

pub struct Rom {
    board: Rc<RefCell<Board>>,
    phase: Phase,
    stalled: bool,
    exclusive: bool,
    out_of_xip: bool,
    token: [u8; 4],
    command: u8,
    status: u32,
}

impl Rom {
    pub fn new(board: &Rc<RefCell<Board>>) -> Rom {
        Rom {
            board: board.clone(),
            phase: Phase::Command,
            stalled: true,
            exclusive: false,
            out_of_xip: false,
            token: [0; 4],
            command: 0,
            status: 0,
        }
    }

    fn transfer(&mut self) -> io::Result<()> {
        let mut board = self.board.borrow_mut();
        if board.restarted {
            return Err(ErrorKind::NotFound.into());
        }
        if let Some(left) = &mut board.transfers_left {
            *left = left.checked_sub(1).ok_or(ErrorKind::NotFound)?;
        }
        if self.stalled { Err(ErrorKind::BrokenPipe.into()) } else { Ok(()) }
    }

    /// Refuses: both endpoints stall until the interface is reset.
    fn refuse(&mut self, status: u32) -> io::Result<()> {
        self.status = status;
        self.stalled = true;
        Ok(())
    }

    fn start(&mut self, message: &[u8]) -> io::Result<()> {
        let word = |at: usize| u32::from_le_bytes(message[at..at + 4].try_into().unwrap());
        if message.len() != 32 || word(0) != 0x431f_d10b || word(10) & 0xffff != 0 {
            return self.refuse(8);
        }
        self.token.copy_from_slice(&message[4..8]);
        self.command = message[8];
        self.status = 0;
        let (size, transfer) = (message[9], word(12) as usize);
        let (address, length) = (word(16), word(20) as usize);
        self.board.borrow_mut().log.push((self.command, address));
        let expected = match self.command {
            0x01 => 1,
            0x02 if self.board.borrow().chip == Chip::Rp2040 => 12,
            0x0a if self.board.borrow().chip == Chip::Rp2350 => 16,
            0x03 | 0x84 | 0x05 => 8,
            0x06 => 0,
            _ => return self.refuse(1),
        };
        if size != expected {
            return self.refuse(2);
        }
        let data = matches!(self.command, 0x84 | 0x05);
        if transfer != if data { length } else { 0 } {
            return self.refuse(3);
        }
        let refusal = self.board.borrow().refusal;
        if let Some((place, status)) = refusal
            && matches!(self.command, 0x03 | 0x84 | 0x05)
            && (address..address + length as u32).contains(&place)
        {
            return self.refuse(status);
        }
        if matches!(self.command, 0x03 | 0x84 | 0x05) {
            let at = address.wrapping_sub(FLASH) as usize;
            let unit = match self.command {
                0x03 => 4096,
                0x05 => 256,
                _ => 1,
            };
            let bytes = self.board.borrow().flash.len();
            if at >= bytes || length > bytes - at {
                return self.refuse(4);
            }
            if !at.is_multiple_of(unit) || !length.is_multiple_of(unit) {
                return self.refuse(5);
            }
            assert!(self.exclusive, "the drive may write in between");
            assert!(self.out_of_xip, "the flash is not prepared");
            self.phase = match self.command {
                0x84 => Phase::DataIn { at, length },
                0x05 => Phase::DataOut { at, length },
                _ => {
                    self.board.borrow_mut().flash[at..at + length].fill(0xff);
                    Phase::AckIn
                }
            };
            return Ok(());
        }
        match self.command {
            0x01 => self.exclusive = message[16] > 0,
            0x06 => self.out_of_xip = true,
            0x0a => assert_eq!((word(16), word(20), word(24), word(28)), (0, 500, 0, 0), "a plain restart"),
            _ => assert_eq!((word(16), word(20)), (0, 0x2004_2000), "a plain restart"),
        }
        self.phase = Phase::AckIn;
        Ok(())
    }
}

impl Pipe for Rom {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.transfer()?;
        match std::mem::replace(&mut self.phase, Phase::Command) {
            Phase::Command => self.start(bytes),
            Phase::AckOut if bytes.is_empty() => Ok(()),
            Phase::DataOut { at, length } if bytes.len() == length => {
                let board = &mut *self.board.borrow_mut();
                for (at, (cell, byte)) in (at..).zip(board.flash[at..at + length].iter_mut().zip(bytes)) {
                    // Writing only clears bits, and a page is cut short with the cable.
                    if board.worn != Some(FLASH + at as u32) {
                        *cell &= byte;
                    }
                }
                self.phase = Phase::AckIn;
                Ok(())
            }
            _ => self.refuse(3),
        }
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.transfer()?;
        match std::mem::replace(&mut self.phase, Phase::Command) {
            Phase::AckIn => {
                self.board.borrow_mut().restarted = matches!(self.command, 0x02 | 0x0a);
                Ok(0)
            }
            Phase::DataIn { at, length } => {
                assert_eq!(buffer.len(), length);
                buffer.copy_from_slice(&self.board.borrow().flash[at..at + length]);
                self.phase = Phase::AckOut;
                Ok(length)
            }
            _ => Err(ErrorKind::TimedOut.into()),
        }
    }

    fn status(&mut self) -> io::Result<[u8; 16]> {
        if self.board.borrow().transfers_left == Some(0) {
            return Err(ErrorKind::NotFound.into());
        }
        let mut answer = [0; 16];
        answer[..4].copy_from_slice(&self.token);
        answer[4..8].copy_from_slice(&self.status.to_le_bytes());
        answer[8] = self.command;
        Ok(answer)
    }

    fn reset(&mut self) -> io::Result<()> {
        if self.board.borrow().transfers_left == Some(0) {
            return Err(ErrorKind::NotFound.into());
        }
        self.stalled = false;
        self.phase = Phase::Command;
        Ok(())
    }
}
