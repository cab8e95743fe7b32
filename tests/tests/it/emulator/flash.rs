//! Flashing through the real USB library: the program finds a board in its boot loader and writes the firmware's real
//! image to it. The board is a model of the boot ROM behind the emulated USB, written from the data sheet and not from
//! the program; its own way back to a running bridge is not emulated, so the tests end where it restarts.

use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const FLASH: u32 = 0x1000_0000;
const FLASH_BYTES: usize = 2 << 20;

/// Descriptors of "RP2 Boot": a disk, and the interface of PICOBOOT with endpoints 3 out and 4 in.
const DESCRIPTORS: [u8; 73] = [
    18, 1, 0x10, 1, 0, 0, 0, 64, 0x8a, 0x2e, 3, 0, 0, 1, 1, 2, 3, 1, // device
    9, 2, 55, 0, 2, 1, 0, 0x80, 125, // configuration
    9, 4, 0, 0, 2, 8, 6, 0x50, 0, 7, 5, 0x81, 2, 64, 0, 0, 7, 5, 2, 2, 64, 0, 0, // disk
    9, 4, 1, 0, 2, 0xff, 0, 0, 0, 7, 5, 3, 2, 64, 0, 0, 7, 5, 0x84, 2, 64, 0, 0, // PICOBOOT
];

/// What outlives a connection.
struct Board {
    flash: Vec<u8>,
    restarted: bool,
    /// Requests until its cable is pulled.
    requests_left: Option<usize>,
}

/// What is to come on the bulk endpoint to the board.
enum Expected {
    Command,
    Data { at: usize, length: usize },
    Receipt,
}

/// The boot ROM on one connection of the emulated USB.
struct Rom {
    socket: UnixStream,
    /// Requests of the host for the next transfer from the board.
    asking: VecDeque<(u32, usize)>,
    /// Transfers that wait to be asked for.
    saying: VecDeque<Vec<u8>>,
    expected: Expected,
    stalled: bool,
    token: u32,
    command: u8,
    status: u32,
    /// Exclusive, and out of the mode in which programs run from flash.
    prepared: (bool, bool),
}

impl Rom {
    fn serve(socket: UnixStream, board: &Mutex<Board>) -> io::Result<()> {
        let mut rom = Rom {
            socket,
            asking: VecDeque::new(),
            saying: VecDeque::new(),
            expected: Expected::Command,
            stalled: true,
            token: 0,
            command: 0,
            status: 0,
            prepared: (false, false),
        };
        loop {
            let mut head = [0; 16];
            rom.socket.read_exact(&mut head)?;
            let word = |at: usize| u32::from_le_bytes(head[at..at + 4].try_into().unwrap());
            let (id, length) = (word(0), word(8) as usize);
            let mut attached = vec![0; word(12) as usize];
            rom.socket.read_exact(&mut attached)?;
            let mut board = board.lock().unwrap();
            if let Some(left) = &mut board.requests_left {
                *left = left.checked_sub(1).ok_or(io::ErrorKind::BrokenPipe)?;
            }
            const SUBMIT: u8 = 0;
            const CANCEL: u8 = 1;
            const CONTROL: u8 = 2;
            match (head[4], head[5], head[6]) {
                (CANCEL, ..) => {
                    let waiting = rom.asking.len();
                    rom.asking.retain(|&(asking, _)| asking != id);
                    if rom.asking.len() < waiting {
                        rom.answer(id, -2, &[])?;
                    }
                }
                (SUBMIT, CONTROL, _) => rom.control(id, &attached)?,
                (SUBMIT, _, 3) if rom.stalled => rom.answer(id, -32, &[])?,
                (SUBMIT, _, 3) => {
                    rom.answered(id, 0, attached.len(), &[])?;
                    rom.take(&attached, &mut board);
                    rom.say(&mut board)?;
                }
                (SUBMIT, _, 0x84) => {
                    rom.asking.push_back((id, length));
                    rom.say(&mut board)?;
                }
                other => panic!("{other:?} is no request for a board in its boot loader"),
            }
        }
    }

    fn answer(&mut self, id: u32, status: i32, bytes: &[u8]) -> io::Result<()> {
        self.answered(id, status, bytes.len(), bytes)
    }

    fn answered(&mut self, id: u32, status: i32, length: usize, bytes: &[u8]) -> io::Result<()> {
        let mut all = id.to_le_bytes().to_vec();
        all.extend(status.to_le_bytes());
        all.extend((length as u32).to_le_bytes());
        all.extend((bytes.len() as u32).to_le_bytes());
        all.extend(bytes);
        self.socket.write_all(&all)
    }

    fn control(&mut self, id: u32, setup: &[u8]) -> io::Result<()> {
        match setup[..6] {
            // GET_STATUS and CLEAR_FEATURE(ENDPOINT_HALT) of an endpoint.
            [0x82, 0, 0, 0, 3 | 0x84, 0] => self.answer(id, 0, &[u8::from(self.stalled), 0]),
            [0x02, 1, 0, 0, 3 | 0x84, 0] => self.answer(id, 0, &[]),
            // INTERFACE_RESET and GET_COMMAND_STATUS.
            [0x41, 0x41, 0, 0, 1, 0] => {
                (self.stalled, self.expected) = (false, Expected::Command);
                self.saying.clear();
                self.answer(id, 0, &[])
            }
            [0xc1, 0x42, 0, 0, 1, 0] => {
                let mut answer = [self.token.to_le_bytes(), self.status.to_le_bytes()].concat();
                answer.extend([self.command, 0, 0, 0, 0, 0, 0, 0]);
                self.answer(id, 0, &answer)
            }
            _ => self.answer(id, -32, &[]),
        }
    }

    fn refuse(&mut self, status: u32) {
        (self.status, self.stalled) = (status, true);
    }

    fn take(&mut self, bytes: &[u8], board: &mut Board) {
        match std::mem::replace(&mut self.expected, Expected::Command) {
            Expected::Command if bytes.len() == 32 => self.follow(bytes, board),
            Expected::Data { at, length } if bytes.len() == length => {
                // Writing only clears bits.
                board.flash[at..at + length].iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
                self.saying.push_back(vec![]);
            }
            Expected::Receipt if bytes.is_empty() => {}
            _ => self.refuse(3),
        }
    }

    fn follow(&mut self, bytes: &[u8], board: &mut Board) {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        (self.token, self.command, self.status) = (word(4), bytes[8], 0);
        let (address, length, transfer) = (word(16), word(20) as usize, word(12) as usize);
        let (size, unit) = match self.command {
            1 => (1, 0),
            2 => (12, 0),
            3 => (8, 4096),
            5 => (8, 256),
            6 => (0, 0),
            0x84 => (8, 1),
            _ => return self.refuse(1),
        };
        if word(0) != 0x431f_d10b || bytes[9] != size || bytes[10..12] != [0, 0] {
            return self.refuse(2);
        }
        let at = address.wrapping_sub(FLASH) as usize;
        if unit > 0 {
            if self.prepared != (true, true) || at >= FLASH_BYTES || length > FLASH_BYTES - at {
                return self.refuse(4);
            }
            if !at.is_multiple_of(unit) || !length.is_multiple_of(unit) {
                return self.refuse(5);
            }
        }
        if transfer != if matches!(self.command, 5 | 0x84) { length } else { 0 } {
            return self.refuse(3);
        }
        match self.command {
            1 => self.prepared.0 = bytes[16] > 0,
            6 => self.prepared.1 = true,
            3 => board.flash[at..at + length].fill(0xff),
            5 => {
                self.expected = Expected::Data { at, length };
                return;
            }
            0x84 => {
                self.saying.push_back(board.flash[at..at + length].to_vec());
                self.expected = Expected::Receipt;
                return;
            }
            // It restarts when its receipt has been taken.
            _ => {}
        }
        self.saying.push_back(vec![]);
    }

    fn say(&mut self, board: &mut Board) -> io::Result<()> {
        while let Some(&(id, room)) = self.asking.front() {
            if self.stalled {
                self.answer(id, -32, &[])?;
            } else if let Some(bytes) = self.saying.pop_front() {
                assert!(bytes.len() <= room, "more than was asked for");
                self.answer(id, 0, &bytes)?;
                board.restarted |= self.command == 2;
            } else {
                return Ok(());
            }
            self.asking.pop_front();
        }
        Ok(())
    }
}

/// A board in its boot loader on a program's USB.
struct Bench {
    folder: tempfile::TempDir,
    usbfs: PathBuf,
    program: PathBuf,
    image: PathBuf,
    board: Arc<Mutex<Board>>,
}

impl Bench {
    fn new() -> Option<Bench> {
        let (image, program) = super::parts()?;
        let Some(usbfs) = std::env::var_os("FOILPRESS_USBFS") else {
            testing::needs::Need::Usb.skip("`cargo xtask emulator` found no umockdev");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("board");
        fs::create_dir(&device).unwrap();
        fs::write(device.join("descriptors"), DESCRIPTORS).unwrap();
        fs::write(device.join("names"), "Raspberry Pi\nRP2 Boot\nE0C9125B0D9B\n").unwrap();
        let board = Arc::new(Mutex::new(Board {
            flash: vec![0x55; FLASH_BYTES],
            restarted: false,
            requests_left: None,
        }));
        let listener = UnixListener::bind(device.join("usb")).unwrap();
        let shared = board.clone();
        // Ends with the test's process; every connection ends with the program that made it, or its cable.
        std::thread::spawn(move || {
            for socket in listener.incoming() {
                let _ = Rom::serve(socket.unwrap(), &shared);
            }
        });
        Some(Bench { folder, usbfs: usbfs.into(), program, image, board })
    }

    fn foilpress(&self, args: &[&str]) -> Command {
        let mut command = Command::new(&self.usbfs);
        command.arg(self.folder.path().join("board")).arg("--").arg(&self.program).args(args);
        command
            .env("FOILPRESS_JOBS", self.folder.path().join("jobs"))
            .env("FOILPRESS_PRINTERS", self.folder.path().join("printers"));
        command
    }

    /// Starts flashing; ends when the program does or the board has restarted. What was said if the program failed.
    fn flash(&self, image: &Path) -> Result<(), String> {
        let mut flash = self.foilpress(&["bridge", "flash", "--from"]);
        let mut child = flash.arg(image).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let start = Instant::now();
        let ended = loop {
            if self.board.lock().unwrap().restarted {
                break false;
            }
            if child.try_wait().unwrap().is_some() {
                break true;
            }
            assert!(start.elapsed() < super::PATIENCE, "it neither ends nor restarts the board");
            std::thread::sleep(Duration::from_millis(5));
        };
        let text = end(child);
        if ended { Err(text) } else { Ok(()) }
    }

    /// The image is in the flash, and nothing else was touched.
    fn check(&self) {
        let file = fs::read(&self.image).unwrap();
        let mut expected = vec![0x55; FLASH_BYTES];
        for block in file.chunks(512) {
            let at = u32::from_le_bytes(block[12..16].try_into().unwrap()).wrapping_sub(FLASH) as usize;
            expected[at..at + 256].copy_from_slice(&block[32..288]);
        }
        let flash = &self.board.lock().unwrap().flash;
        let wrong = flash.iter().zip(&expected).position(|(a, b)| a != b);
        assert_eq!(wrong, None, "the first different byte");
    }
}

/// Stops the program and what it runs under; what it said.
fn end(mut child: Child) -> String {
    let _ = child.kill();
    let mut text = String::new();
    // The program itself may live on for a moment and hold the pipe.
    if child.wait().unwrap().code().is_some() {
        child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    }
    text
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_image_is_written_through_the_usb_library_and_the_board_restarted() {
    let Some(bench) = Bench::new() else { return };
    let listed = bench.foilpress(&["bridge", "list"]).output().unwrap();
    assert!(super::text(&listed).contains("1 in the boot loader"), "{}", super::text(&listed));
    bench.flash(&bench.image).unwrap();
    bench.check();
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn a_cable_pulled_while_flashing_is_told_and_the_same_command_does_it_again() {
    let Some(bench) = Bench::new() else { return };
    for requests in [3, 11, 60, 120] {
        bench.board.lock().unwrap().requests_left = Some(requests);
        let said = bench.flash(&bench.image).unwrap_err();
        assert!(said.contains("flash it again"), "after {requests}: {said}");
    }
    bench.board.lock().unwrap().requests_left = None;
    bench.flash(&bench.image).unwrap();
    bench.check();
}

#[test]
fn a_damaged_image_is_refused_before_the_board_is_touched() {
    let Some(bench) = Bench::new() else { return };
    let damaged = bench.folder.path().join("damaged.uf2");
    let file = fs::read(&bench.image).unwrap();
    let mut flipped = file.clone();
    flipped[50 * 512 + 40] ^= 1;
    for (bytes, word) in
        [(&file[..file.len() - 512], "copied completely"), (&flipped[..], "block 50 is damaged")]
    {
        fs::write(&damaged, bytes).unwrap();
        let said = bench.flash(&damaged).unwrap_err();
        assert!(said.contains("not flashed") && said.contains(word), "{said}");
    }
    assert!(bench.board.lock().unwrap().flash.iter().all(|&byte| byte == 0x55));
}
