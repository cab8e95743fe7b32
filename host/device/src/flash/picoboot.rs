//! PICOBOOT: writing a board's flash through its boot ROM.
//!
//! Problem: write an image to the flash and verify it; after an interruption at any point it must be possible to flash the
//! board again, without its BOOTSEL button where possible.
//! Method: the boot ROM starts the program in flash only if one page is right, and waits in its boot loader otherwise: the first
//! page with its checksum on an RP2040, the one with the image's block on an RP2350 ([`Image::boot_page`]). So the sector with that
//! page, which is the first, is erased first and the page itself is written last, after everything else was read back and compared. An interruption leaves the old program, the boot loader, or the whole new program.
//! Cost: an erase (some 50 ms) and a write for each 4096 bytes, 25 of them for the bridge's firmware; then a read.
//! Limits: the image's own sectors; nothing else in the flash is touched.
//! Source: RP2040 data sheet, 2.8.5; RP2350 data sheet, 5.6.

use std::io;

use uf2::{Chip, Image, PAGE, SECTOR, START};

use observe::Observer;

const MAGIC: u32 = 0x431f_d10b;
const SECTOR_BYTES: usize = SECTOR as usize;
/// Where the stack of an RP2040's program that is started begins, and when: after this answer has left.
const STACK: u32 = 0x2004_2000;
const REBOOT_MS: u32 = 500;

/// The USB side of a board in its boot loader: one interface with two bulk endpoints.
pub trait Pipe {
    /// Sends these bytes, all of them, as one transfer; none as an empty packet.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Receives one transfer of at most the buffer's length.
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// The result of the last command (GET_COMMAND_STATUS).
    fn status(&mut self) -> io::Result<[u8; 16]>;

    /// Resets the interface (INTERFACE_RESET), including stalled endpoints.
    fn reset(&mut self) -> io::Result<()>;
}

impl Pipe for Box<dyn Pipe> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        (**self).receive(buffer)
    }

    fn status(&mut self) -> io::Result<[u8; 16]> {
        (**self).status()
    }

    fn reset(&mut self) -> io::Result<()> {
        (**self).reset()
    }
}

/// A command, as messages name it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Take exclusive access, so that the drive cannot write.
    Exclusive,
    /// Start the program.
    Reboot,
    /// The same, as an RP2350 has it.
    Reboot2,
    /// Erase sectors.
    Erase,
    /// Read flash.
    Read,
    /// Write pages.
    Write,
    /// Take the flash out of the mode in which programs run from it.
    ExitXip,
}

impl Command {
    fn id(self) -> u8 {
        match self {
            Command::Exclusive => 0x01,
            Command::Reboot => 0x02,
            Command::Reboot2 => 0x0a,
            Command::Erase => 0x03,
            Command::Read => 0x84,
            Command::Write => 0x05,
            Command::ExitXip => 0x06,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Command::Exclusive => "to give this program exclusive access",
            Command::Reboot | Command::Reboot2 => "to restart",
            Command::Erase => "to erase",
            Command::Read => "to read",
            Command::Write => "to write",
            Command::ExitXip => "to prepare the flash",
        }
    }
}

/// Why the board does not have the new firmware. It is in its boot loader or can enter it again, so flashing can be repeated.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The board was unplugged or does not answer.
    #[error("the board disappeared while it was {doing}; plug it in and flash it again")]
    Gone {
        /// What it was doing.
        doing: String,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The boot ROM refused.
    #[error("the board refuses {} at {address:#010x}: {}; flash it again", .command.words(), status_words(*.status))]
    Refused {
        /// What it was asked.
        command: Command,
        /// Where.
        address: u32,
        /// Its answer.
        status: u32,
    },
    /// The flash does not hold what was written.
    #[error(
        "the flash holds {found:#04x} at {address:#010x} where {expected:#04x} was written; flash it again, and if that does not \
         help, the board's flash is worn out"
    )]
    Different {
        /// Where.
        address: u32,
        /// What was written.
        expected: u8,
        /// What was read.
        found: u8,
    },
}

fn status_words(status: u32) -> String {
    let words = match status {
        1 => "unknown command",
        2 | 3 => "invalid length",
        4 => "invalid address",
        5 => "the address is not the start of a sector or page",
        6 => "the drive is being written at the same time",
        7 => "the board is restarting",
        _ => return format!("status {status}"),
    };
    words.into()
}

/// A command's data.
enum Data<'a> {
    None,
    Out(&'a [u8]),
    In(&'a mut [u8]),
}

/// A board in its boot loader.
pub struct Picoboot<P> {
    pipe: P,
    token: u32,
}

impl<P: Pipe> Picoboot<P> {
    /// Puts an image into the flash, reads it back, and starts it.
    pub fn write(pipe: P, image: &Image, observer: &dyn Observer) -> Result<(), WriteError> {
        let mut board = Picoboot { pipe, token: 0 };
        let result = board.write_all(image, observer);
        if result.is_err() {
            // Gives the drive back, so that it can be used instead. A board that has gone forgets the lock by itself.
            let _ = board.pipe.reset();
            let _ = board.command(Command::Exclusive, 0, &[0], Data::None);
        }
        result
    }

    /// Starts what is in the flash of a board.
    pub fn restart(pipe: P, chip: Chip) -> Result<(), WriteError> {
        let mut board = Picoboot { pipe, token: 0 };
        board.pipe.reset().map_err(|source| WriteError::Gone { doing: "being contacted".into(), source })?;
        board.reboot(chip)
    }

    fn reboot(&mut self, chip: Chip) -> Result<(), WriteError> {
        let bytes = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        match chip {
            Chip::Rp2040 => self.command(Command::Reboot, 0, &bytes(&[0, STACK, REBOOT_MS]), Data::None),
            // A normal start, which needs no parameters.
            Chip::Rp2350 => self.command(Command::Reboot2, 0, &bytes(&[0, REBOOT_MS, 0, 0]), Data::None),
        }
    }

    fn write_all(&mut self, image: &Image, observer: &dyn Observer) -> Result<(), WriteError> {
        self.pipe.reset().map_err(|source| WriteError::Gone { doing: "being contacted".into(), source })?;
        self.command(Command::Exclusive, 0, &[1], Data::None)?;
        self.command(Command::ExitXip, 0, &[], Data::None)?;

        let sectors: Vec<u32> = image.sectors().into_iter().collect();
        let steps = sectors.len() as u64;
        observer.begin("writing the firmware", steps);
        // First the sector without which the board does not start the old program.
        let last = (image.boot_page() - START) as usize;
        let last = last..last + PAGE;
        self.erase(START)?;
        for &sector in &sectors {
            let bytes = contents(image, sector);
            if sector == START {
                for part in
                    [0..last.start, last.end..SECTOR_BYTES].into_iter().filter(|part| !part.is_empty())
                {
                    self.write_at(sector + part.start as u32, &bytes[part])?;
                }
            } else {
                self.erase(sector)?;
                self.write_at(sector, &bytes)?;
            }
            observer.advance(1);
        }
        observer.end();

        observer.begin("verifying the firmware", steps);
        for &sector in &sectors {
            let mut expected = contents(image, sector);
            if sector == START {
                expected[last.clone()].fill(0xff);
            }
            self.compare(sector, &expected)?;
            observer.advance(1);
        }
        observer.end();

        let first = contents(image, START);
        self.write_at(START + last.start as u32, &first[last])?;
        self.compare(START, &first)?;
        self.reboot(image.chip())
    }

    fn erase(&mut self, sector: u32) -> Result<(), WriteError> {
        self.command(Command::Erase, sector, &range(sector, SECTOR_BYTES), Data::None)
    }

    fn write_at(&mut self, address: u32, bytes: &[u8]) -> Result<(), WriteError> {
        self.command(Command::Write, address, &range(address, bytes.len()), Data::Out(bytes))
    }

    fn compare(&mut self, address: u32, expected: &[u8]) -> Result<(), WriteError> {
        let mut found = vec![0; expected.len()];
        self.command(Command::Read, address, &range(address, found.len()), Data::In(&mut found))?;
        match (address..).zip(expected.iter().zip(&found)).find(|(_, (expected, found))| expected != found) {
            None => Ok(()),
            Some((address, (&expected, &found))) => Err(WriteError::Different { address, expected, found }),
        }
    }

    /// One command: 32 bytes, its data, and an empty packet from whoever received last.
    fn command(
        &mut self,
        command: Command,
        address: u32,
        arguments: &[u8],
        data: Data<'_>,
    ) -> Result<(), WriteError> {
        self.token = self.token.wrapping_add(1);
        let length = match &data {
            Data::None => 0,
            Data::Out(bytes) => bytes.len(),
            Data::In(bytes) => bytes.len(),
        };
        let mut message = [0; 32];
        message[..4].copy_from_slice(&MAGIC.to_le_bytes());
        message[4..8].copy_from_slice(&self.token.to_le_bytes());
        message[8] = command.id();
        message[9] = arguments.len() as u8;
        message[12..16].copy_from_slice(&(length as u32).to_le_bytes());
        message[16..16 + arguments.len()].copy_from_slice(arguments);
        self.exchange(&message, data).map_err(|source| self.judge(command, address, source))
    }

    fn exchange(&mut self, message: &[u8; 32], data: Data<'_>) -> io::Result<()> {
        self.pipe.send(message)?;
        let wrong = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
        match data {
            Data::In(buffer) => {
                if self.pipe.receive(buffer)? != buffer.len() {
                    return Err(wrong("the board sent less data than it was asked for"));
                }
                return self.pipe.send(&[]);
            }
            Data::Out(bytes) => self.pipe.send(bytes)?,
            Data::None => {}
        }
        match self.pipe.receive(&mut [0; PAGE])? {
            0 => Ok(()),
            _ => Err(wrong("the board sent unexpected data")),
        }
    }

    /// A transfer failed: because the ROM refused and stalled it, or because the board is gone.
    fn judge(&mut self, command: Command, address: u32, source: io::Error) -> WriteError {
        if let Ok(answer) = self.pipe.status() {
            let word =
                |at: usize| u32::from_le_bytes([answer[at], answer[at + 1], answer[at + 2], answer[at + 3]]);
            if word(0) == self.token && word(4) != 0 {
                return WriteError::Refused { command, address, status: word(4) };
            }
        }
        WriteError::Gone { doing: format!("asked {}", command.words()), source }
    }
}

fn range(address: u32, length: usize) -> [u8; 8] {
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&address.to_le_bytes());
    bytes[4..].copy_from_slice(&(length as u32).to_le_bytes());
    bytes
}

/// What a whole sector is to hold: pages that are not in the image stay erased.
fn contents(image: &Image, sector: u32) -> Vec<u8> {
    let mut bytes = vec![0xff; SECTOR_BYTES];
    for (page, slot) in (sector..).step_by(PAGE).zip(bytes.chunks_exact_mut(PAGE)) {
        let page = image.read(page, PAGE);
        slot[..page.len()].copy_from_slice(&page);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::image::{Firmware, tests::file, tests::file_2350, tests::program};
    use super::super::rom::{Board, Rom};
    use super::*;
    use observe::Silent;

    const LENGTH: usize = 30_000;

    fn image(seed: u32) -> Image {
        Firmware::read(&file("foilpress-bridge", "1", LENGTH, seed)).unwrap().image().clone()
    }

    /// What the flash is to hold, made without the code under test.
    fn expected(seed: u32) -> Vec<u8> {
        let mut bytes = program("foilpress-bridge", "1", LENGTH, seed);
        bytes.resize(LENGTH.next_multiple_of(4096), 0xff);
        bytes
    }

    fn flash(board: &std::rc::Rc<std::cell::RefCell<Board>>, seed: u32) -> Result<(), WriteError> {
        Picoboot::write(Rom::new(board), &image(seed), &Silent)
    }

    #[test]
    fn the_image_is_in_the_flash_and_started_and_nothing_else_was_touched() {
        let board = Board::new();
        board.borrow_mut().flash.fill(0x55);
        flash(&board, 1).unwrap();
        let board = board.borrow();
        let expected = expected(1);
        assert!(board.flash[..expected.len()] == expected);
        assert!(board.flash[expected.len()..].iter().all(|&byte| byte == 0x55));
        assert!(board.restarted && board.starts());
    }

    #[test]
    fn the_first_sector_is_erased_first_and_its_first_page_written_last_after_all_was_read() {
        let board = Board::new();
        flash(&board, 1).unwrap();
        let log = &board.borrow().log;
        let place = |wanted: &dyn Fn(&(u8, u32)) -> bool| log.iter().position(wanted).unwrap();
        let first_erase = place(&|&(command, _)| command == 3);
        assert_eq!(log[first_erase], (3, 0x1000_0000));
        let last_write = log.iter().rposition(|&(command, _)| command == 5).unwrap();
        assert_eq!(log[last_write], (5, 0x1000_0000));
        for sector in (0..LENGTH as u32).step_by(4096) {
            let read = place(&|&entry| entry == (0x84, 0x1000_0000 + sector));
            assert!(read < last_write, "sector {sector:#x}");
        }
        assert_eq!(log[log.len() - 2..], [(0x84, 0x1000_0000), (2, 0)]);
    }

    #[test]
    fn a_pico_2_cut_off_at_any_transfer_starts_a_whole_program_or_waits_to_be_flashed_again() {
        let image = |seed| Firmware::read(&file_2350("1 (Pico 2)", LENGTH, seed)).unwrap().image().clone();
        let whole = |image: &Image| image.pages().flat_map(|(_, page)| *page).collect::<Vec<u8>>();
        let (old, new) = (image(1), image(2));
        let mut waits = 0;
        for transfers in 0.. {
            let board = Board::for_chip(Chip::Rp2350);
            Picoboot::write(Rom::new(&board), &old, &Silent).unwrap();
            assert!(board.borrow().restarted && board.borrow().starts());
            (board.borrow_mut().restarted, board.borrow_mut().transfers_left) = (false, Some(transfers));
            let result = Picoboot::write(Rom::new(&board), &new, &Silent);
            let board = board.borrow();
            let holds = |image: &Image| board.flash.starts_with(&whole(image));
            assert!(!board.starts() || holds(&old) || holds(&new), "after {transfers} transfers");
            waits += u32::from(!board.starts());
            if result.is_ok() {
                assert!(holds(&new) && board.starts() && board.log.last().unwrap().0 == 0x0a);
                break;
            }
        }
        assert!(waits > 20, "the cable was cut in the middle {waits} times");
    }

    #[test]
    fn cut_off_at_any_transfer_the_board_starts_a_whole_program_or_waits_to_be_flashed_again() {
        let whole = {
            let board = Board::new();
            flash(&board, 2).unwrap();
            board.borrow().log.len() * 3
        };
        let (old, new) = (expected(1), expected(2));
        let mut waits = 0;
        for transfers in 0..whole {
            let board = Board::new();
            flash(&board, 1).unwrap();
            board.borrow_mut().restarted = false;
            board.borrow_mut().transfers_left = Some(transfers);
            if flash(&board, 2).is_ok() {
                break;
            }
            {
                let board = board.borrow();
                let holds = |image: &[u8]| board.flash[..image.len()] == *image;
                assert!(!board.starts() || holds(&old) || holds(&new), "after {transfers} transfers");
                waits += u32::from(!board.starts());
            }
            let mut again = board.borrow_mut();
            (again.transfers_left, again.restarted) = (None, false);
            drop(again);
            flash(&board, 2).unwrap();
            assert!(board.borrow().flash[..new.len()] == new, "after {transfers} transfers and once more");
        }
        assert!(waits > 20, "the cable was cut in the middle {waits} times");
    }

    #[test]
    fn what_the_flash_does_not_keep_is_noticed_and_the_program_is_not_started() {
        for worn in [0x1000_0003, 0x1000_0100, 0x1000_1fff, 0x1000_6000] {
            let board = Board::new();
            board.borrow_mut().worn = Some(worn);
            match flash(&board, 1) {
                Err(WriteError::Different { address, found: 0xff, .. }) => assert_eq!(address, worn),
                other => panic!("{worn:#x}: {other:?}"),
            }
            assert!(!board.borrow().restarted);
            assert!(!board.borrow().starts());
        }
    }

    #[test]
    fn a_refusal_is_told_with_the_command_and_the_reason_and_the_drive_is_given_back() {
        for (place, command) in [(0x1000_3000, Command::Erase), (0x1000_0000, Command::Erase)] {
            let board = Board::new();
            board.borrow_mut().refusal = Some((place, 6));
            let error = flash(&board, 1).unwrap_err();
            assert!(
                matches!(error, WriteError::Refused { command: c, address, status: 6 } if c == command && address == place),
                "{error}"
            );
            assert!(error.to_string().contains("drive is being written"));
            assert_eq!(board.borrow().log.last(), Some(&(1, 0)), "exclusive access is given up");
        }
    }

    #[test]
    fn a_board_that_goes_away_is_said_to_have_gone() {
        let board = Board::new();
        board.borrow_mut().transfers_left = Some(9);
        let error = flash(&board, 1).unwrap_err();
        assert!(matches!(error, WriteError::Gone { .. }), "{error}");
    }
}
