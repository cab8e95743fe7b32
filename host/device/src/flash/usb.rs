//! A board's boot loader on USB, as a [`Pipe`].

use std::io::{self, ErrorKind};
use std::time::Duration;

use uf2::Chip;

use rusb::{Direction, Recipient, RequestType};

use super::picoboot::Pipe;
use crate::connection::usb::{Attached, Pair, attached, translated};

/// The boot ROM of a chip.
fn numbers(chip: Chip) -> (u16, u16) {
    match chip {
        Chip::Rp2040 => (0x2e8a, 0x0003),
        Chip::Rp2350 => (0x2e8a, 0x000f),
    }
}

/// Control requests of PICOBOOT.
const INTERFACE_RESET: u8 = 0x41;
const COMMAND_STATUS: u8 = 0x42;
/// The standard request for an endpoint's state, whose lowest bit says that it is stalled.
const GET_STATUS: u8 = 0x00;

const CONTROL_PATIENCE: Duration = Duration::from_secs(1);
/// Erasing a sector takes up to 0.4 s, by its data sheet; the command is answered when it is done.
const PATIENCE: Duration = Duration::from_secs(10);

/// The boards that wait in their boot loader. Those of one kind may all have the same serial number.
pub fn boards() -> io::Result<Vec<(Chip, Attached)>> {
    let mut all = Vec::new();
    for chip in Chip::ALL {
        all.extend(attached(numbers(chip))?.into_iter().map(|board| (chip, board)));
    }
    Ok(all)
}

/// Opens a board's boot loader for this program alone.
pub fn open(board: &Attached) -> io::Result<impl Pipe + use<>> {
    Pair::claim(&board.device).map(Loader)
}

struct Loader(Pair);

impl Loader {
    fn is_stalled(&self, endpoint: u8) -> bool {
        let request = rusb::request_type(Direction::In, RequestType::Standard, Recipient::Endpoint);
        let mut state = [0; 2];
        let read =
            self.0.handle.read_control(request, GET_STATUS, 0, endpoint.into(), &mut state, CONTROL_PATIENCE);
        read == Ok(2) && state[0] & 1 == 1
    }
}

impl Pipe for Loader {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.0.handle.write_bulk(self.0.out, bytes, PATIENCE).map_err(translated)? {
            count if count == bytes.len() => Ok(()),
            _ => Err(ErrorKind::TimedOut.into()),
        }
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.handle.read_bulk(self.0.into, buffer, PATIENCE).map_err(translated)
    }

    fn status(&mut self) -> io::Result<[u8; 16]> {
        let request = rusb::request_type(Direction::In, RequestType::Vendor, Recipient::Interface);
        let mut answer = [0; 16];
        let interface = self.0.interface.into();
        match self.0.handle.read_control(request, COMMAND_STATUS, 0, interface, &mut answer, CONTROL_PATIENCE)
        {
            Ok(16) => Ok(answer),
            Ok(_) => Err(ErrorKind::InvalidData.into()),
            Err(error) => Err(translated(error)),
        }
    }

    fn reset(&mut self) -> io::Result<()> {
        for endpoint in [self.0.into, self.0.out] {
            // Only a stalled one: clearing starts its packets' count anew on both sides.
            if self.is_stalled(endpoint) {
                self.0.handle.clear_halt(endpoint).map_err(translated)?;
            }
        }
        let request = rusb::request_type(Direction::Out, RequestType::Vendor, Recipient::Interface);
        let interface = self.0.interface.into();
        self.0
            .handle
            .write_control(request, INTERFACE_RESET, 0, interface, &[], CONTROL_PATIENCE)
            .map_err(translated)?;
        Ok(())
    }
}
