//! Flashing as a whole, at a computer with simulated boards.

use std::cell::RefCell;
use std::rc::Rc;

use super::image::tests::{file, file_2350};
use super::rom::{Board, Rom};
use super::*;
use observe::Silent;

const NUMBER: u64 = 0xe661_4103_e745_3d2a;

#[derive(PartialEq, Eq)]
enum State {
    /// The firmware runs.
    Running,
    /// In its boot loader.
    Loader,
    /// Not to be seen.
    Away,
}

/// A computer with one board, perhaps in company.
struct Desk {
    board: Rc<RefCell<Board>>,
    state: State,
    other_bridges: Vec<u64>,
    other_boards: usize,
    /// Why the boot loader cannot be opened.
    closed: Option<ErrorKind>,
    drive: Option<tempfile::TempDir>,
    printing: Option<u32>,
    /// Where the board goes when it is asked to its boot loader, and when it has been written.
    goes_to: State,
    comes_back: bool,
    says: Option<&'static str>,
    asked: u32,
    greeted: Vec<u64>,
    clock: Duration,
}

fn desk(state: State) -> Desk {
    Desk {
        board: Board::new(),
        state,
        other_bridges: vec![],
        other_boards: 0,
        closed: None,
        drive: None,
        printing: None,
        goes_to: State::Loader,
        comes_back: true,
        says: None,
        asked: 0,
        greeted: vec![],
        clock: Duration::ZERO,
    }
}

fn candidate(number: u64) -> Candidate {
    let text = format!("{number:016X}");
    Candidate { serial_number: Some(text.clone()), addresses: vec![Address::Usb(Some(text))] }
}

impl Desk {
    fn with_drive(mut self) -> Desk {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("INFO_UF2.TXT"), "Board-ID: RPI-RP2\n").unwrap();
        self.drive = Some(folder);
        self
    }

    fn copied(&self) -> Option<Vec<u8>> {
        std::fs::read(self.drive.as_ref()?.path().join("foilpress-bridge.uf2")).ok()
    }

    /// What the board does by itself.
    fn live(&mut self) {
        if self.state == State::Loader && (self.board.borrow().restarted || self.copied().is_some()) {
            self.state = if self.comes_back { State::Running } else { State::Away };
        }
    }

    fn flash(&mut self, version: &str, to: Option<&Address>) -> Result<Bridge, FlashError> {
        let images = [file("foilpress-bridge", version, 20_000, 5), file_2350(version, 20_000, 5)];
        run(&images.map(|file| Firmware::read(&file).unwrap()), to, self, &Silent)
    }
}

impl Computer for Desk {
    type Board = Rom;

    fn bridges(&mut self) -> Vec<Candidate> {
        self.live();
        let own = (self.state == State::Running).then_some(NUMBER);
        own.into_iter().chain(self.other_bridges.iter().copied()).map(candidate).collect()
    }

    fn boards(&mut self) -> Vec<Chip> {
        self.live();
        let chip = self.board.borrow().chip;
        vec![chip; self.other_boards + usize::from(self.state == State::Loader)]
    }

    fn open(&mut self) -> io::Result<Rom> {
        match self.closed {
            Some(kind) => Err(kind.into()),
            None => Ok(Rom::new(&self.board)),
        }
    }

    fn drives(&mut self) -> Vec<(Chip, PathBuf)> {
        self.live();
        let there = self.drive.as_ref().filter(|_| self.state == State::Loader);
        there
            .map(|drive| (drive::board(drive.path()).unwrap(), drive.path().to_path_buf()))
            .into_iter()
            .collect()
    }

    fn enter(&mut self, bridge: &Candidate) -> Result<u64, FlashError> {
        assert_eq!(bridge.addresses, candidate(NUMBER).addresses);
        if let Some(job) = self.printing {
            return Err(FlashError::Printing(job));
        }
        self.asked += 1;
        self.state = std::mem::replace(&mut self.goes_to, State::Away);
        Ok(NUMBER)
    }

    fn greet(&mut self, candidate: &Candidate) -> Option<Bridge> {
        let serial = candidate.number().unwrap();
        self.greeted.push(serial);
        // The version is where the test's program has it.
        let flash = match self.copied() {
            Some(file) => uf2::decode(&file).unwrap().read(0x1000_0000, 20_000),
            None => self.board.borrow().flash.clone(),
        };
        let text = flash[0x700..].split(|&byte| byte == 0).next().unwrap();
        let firmware = self.says.map_or_else(|| String::from_utf8_lossy(text).into_owned(), str::to_owned);
        Some(Bridge { version: 1, boot: 7, serial, firmware })
    }

    fn wait(&mut self, time: Duration) {
        self.clock += time;
    }
}

#[test]
fn a_running_bridge_is_flashed_and_says_its_new_version() {
    let mut desk = desk(State::Running);
    assert_eq!(desk.flash("9.8.7", None).unwrap().firmware, "9.8.7");
    assert_eq!(desk.asked, 1);
}

#[test]
fn a_pico_2_is_known_in_its_boot_loader_and_gets_its_own_image() {
    for state in [State::Running, State::Loader] {
        let mut desk = desk(state);
        desk.board = Board::for_chip(Chip::Rp2350);
        assert_eq!(desk.flash("9.8.7 (Pico 2)", None).unwrap().firmware, "9.8.7 (Pico 2)");
        let board = desk.board.borrow();
        assert!(board.starts() && board.flash[0x124..0x128] == *b"\xd3\xde\xff\xff");
    }
    // And through its drive.
    let mut desk = desk(State::Running);
    desk.board = Board::for_chip(Chip::Rp2350);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("INFO_UF2.TXT"), "Board-ID: RP2350\n").unwrap();
    (desk.drive, desk.closed) = (Some(folder), Some(ErrorKind::PermissionDenied));
    desk.flash("9.8.8", None).unwrap();
    assert_eq!(uf2::decode(&desk.copied().unwrap()).unwrap().chip(), Chip::Rp2350);
}

#[test]
fn a_board_without_an_image_is_left_as_it_was_and_started_again() {
    let mut desk = desk(State::Running);
    desk.board = Board::for_chip(Chip::Rp2350);
    let pico = Firmware::read(&file("foilpress-bridge", "1", 20_000, 5)).unwrap();
    let error = run(&[pico], None, &mut desk, &Silent).unwrap_err();
    assert!(error.to_string().contains("this board is a Pico 2, but the firmware is for a Pico;"), "{error}");
    let board = desk.board.borrow();
    assert!(board.restarted && board.flash.iter().all(|&byte| byte == 0xff));
}

#[test]
fn a_board_in_its_boot_loader_is_flashed_and_bridges_that_run_are_left_alone() {
    let mut desk = desk(State::Loader);
    desk.other_bridges = vec![1, 2];
    let bridge = desk.flash("2.0", None).unwrap();
    assert_eq!((bridge.serial, bridge.firmware.as_str()), (NUMBER, "2.0"));
    assert_eq!((desk.asked, &desk.greeted[..]), (0, &[NUMBER][..]));
}

#[test]
fn one_of_several_bridges_is_flashed_only_when_it_is_named() {
    let mut desk = desk(State::Running);
    desk.other_bridges = vec![1];
    let error = desk.flash("2.0", None).unwrap_err();
    assert!(error.to_string().contains("usb:E6614103E7453D2A, usb:0000000000000001"), "{error}");
    assert_eq!(desk.asked, 0);
    desk.flash("2.0", Some(&candidate(NUMBER).addresses[0])).unwrap();
    assert_eq!(desk.greeted, [NUMBER]);
}

#[test]
fn nothing_is_touched_where_it_is_not_clear_what_is_meant() {
    assert!(matches!(desk(State::Away).flash("1", None), Err(FlashError::Nothing)));
    let mut two = desk(State::Loader);
    two.other_boards = 1;
    assert!(matches!(two.flash("1", None), Err(FlashError::SeveralBoards(2))));
    let mut other = desk(State::Running);
    other.other_boards = 1;
    let to = &candidate(NUMBER).addresses[0];
    assert!(matches!(other.flash("1", Some(to)), Err(FlashError::AnotherBoard)));
    for desk in [two, other] {
        assert_eq!((desk.asked, desk.board.borrow().log.len()), (0, 0));
    }
}

#[test]
fn a_bridge_that_prints_is_left_alone() {
    let mut desk = desk(State::Running);
    desk.printing = Some(0xabcd);
    let error = desk.flash("2.0", None).unwrap_err();
    assert!(error.to_string().contains("foilpress cancel 0000abcd"), "{error}");
    assert!(desk.state == State::Running && desk.board.borrow().log.is_empty());
}

#[test]
fn a_boot_loader_that_may_not_be_opened_is_flashed_through_its_drive() {
    let mut desk = desk(State::Running).with_drive();
    desk.closed = Some(ErrorKind::PermissionDenied);
    assert_eq!(desk.flash("3.1", None).unwrap().firmware, "3.1");
    assert!(desk.board.borrow().log.is_empty());
}

#[test]
fn without_permission_and_without_a_drive_it_says_so_and_the_board_waits() {
    let mut desk = desk(State::Loader);
    desk.closed = Some(ErrorKind::PermissionDenied);
    assert!(matches!(desk.flash("1", None), Err(FlashError::Closed(_))));
    assert!(desk.clock >= Duration::from_secs(5), "the system has time to mount the drive");
    desk.closed = None;
    desk.flash("1", None).unwrap();
}

#[test]
fn a_board_that_does_not_show_itself_is_waited_for_with_a_limit() {
    let mut lost = desk(State::Running);
    lost.goes_to = State::Away;
    assert!(matches!(lost.flash("1", None), Err(FlashError::NoLoader)));
    let mut silent = desk(State::Running);
    silent.comes_back = false;
    assert!(matches!(silent.flash("1", None), Err(FlashError::NotBack)));
    assert!(silent.clock < Duration::from_secs(60));
}

#[test]
fn a_bridge_that_says_another_version_than_was_written_is_no_success() {
    let mut desk = desk(State::Running);
    desk.says = Some("0.0.1");
    let error = desk.flash("2.0", None).unwrap_err();
    assert!(error.to_string().contains("2.0") && error.to_string().contains("0.0.1"), "{error}");
}

#[test]
fn an_interrupted_flash_is_repeated_from_the_boot_loader() {
    let mut desk = desk(State::Running);
    desk.board.borrow_mut().transfers_left = Some(40);
    assert!(matches!(desk.flash("2.0", None), Err(FlashError::Write(WriteError::Gone { .. }))));
    assert!(!desk.board.borrow().starts(), "the board waits in its boot loader when it is plugged in again");
    desk.board.borrow_mut().transfers_left = None;
    assert_eq!(desk.flash("2.0", None).unwrap().firmware, "2.0");
}
