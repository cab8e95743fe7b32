//! The emulated bridge as a device: a serial port with a path, a USB socket, and the simulated printer at its pins.
//!
//! `tests/emulator/bridge.mjs` runs the firmware's image; this joins the ends of its cables to the things a program
//! meets. The serial port is a pseudo-terminal under the name [`Emulated::port`], which, as with a real device, hangs
//! up and gets another terminal behind it when the cable is pulled. Opening and closing it raise and lower the port's
//! lines. The parallel port leads to a [`Printer`] with a buffer: while that is full or the printer is in trouble, Busy
//! stays up and the status lines say why. It can be switched off, too.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use press::simulate::{Printer, Printout, Stock, Trouble};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use serde_json::{Value, json};

/// What the printer answers in nibble mode when asked who it is.
const DEVICE_ID: &str = "MANUFACTURER:ALPS   ;COMMAND SET:RGL;MODEL:MD-5500_T-03   ;CLASS:PRINTER;";

/// Bytes the printer takes before it looks at them.
const BUFFER: u64 = 4096;

/// A program that has the port open but does not read is not waited for beyond this.
const TERMINAL: usize = 4096;

/// The serial port's name in its folder.
const TTY: &str = "tty";

/// How often a quiet end is looked at.
const TICK: Duration = Duration::from_millis(5);

/// The printer and what came of it.
pub struct Desk {
    /// The printer itself.
    pub printer: Printer,
    /// The sheet that is laid in whenever one has come out.
    pub stock: Stock,
    /// Everything that crossed the port.
    pub printed: Vec<u8>,
    /// The sheets, in order.
    pub sheets: Vec<Printout>,
    /// The printer's refusal: what follows is taken and thrown away.
    pub refused: Option<String>,
    /// How often it was reset through the port.
    pub resets: usize,
    /// The printer's own switch.
    on: bool,
}

/// An emulated bridge with a simulated printer. Dropping it switches it off.
pub struct Emulated {
    folder: PathBuf,
    board: Child,
    orders: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    desk: Arc<Mutex<Desk>>,
    stop: Arc<AtomicBool>,
    ends: Vec<JoinHandle<io::Result<()>>>,
}

impl Emulated {
    /// Boots `image` with its ends in `folder`. `scripts` is `tests/emulator`, with its packages installed.
    ///
    /// Errors: Node cannot be started, the image does not come up, no pseudo-terminal can be had.
    pub fn start(
        image: &Path,
        scripts: &Path,
        folder: &Path,
        printer: Printer,
        stock: Stock,
    ) -> io::Result<Emulated> {
        let mut board = node(&scripts.join("bridge.mjs"), &[image, folder])?;
        let missing = || io::Error::other("a pipe to Node is missing");
        let orders = board.stdin.take().ok_or_else(missing)?;
        let answers = BufReader::new(board.stdout.take().ok_or_else(missing)?);
        let mut desk = Desk {
            printer,
            stock,
            printed: Vec::new(),
            sheets: Vec::new(),
            refused: None,
            resets: 0,
            on: true,
        };
        desk.printer.load(stock);
        let mut emulated = Emulated {
            folder: folder.to_path_buf(),
            board,
            orders: Some(orders),
            answers,
            desk: Arc::new(Mutex::new(desk)),
            stop: Arc::default(),
            ends: Vec::new(),
        };
        emulated.answer()?;
        let socket = UnixStream::connect(folder.join("printer"))?;
        let (desk, stop) = (emulated.desk.clone(), emulated.stop.clone());
        emulated.ends.push(std::thread::spawn(move || serve_printer(&socket, &desk, &stop)));
        emulated.ends.push(serve_terminal(folder, &emulated.stop)?);
        Ok(emulated)
    }

    /// Where the serial port is.
    pub fn port(&self) -> PathBuf {
        self.folder.join(TTY)
    }

    /// The printer and what has come of it; it stands still while this is held.
    pub fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Pulls the USB cable and plugs it in again; the bridge keeps its power.
    pub fn replug(&mut self) -> io::Result<()> {
        self.order("replug").map(drop)
    }

    /// Puts a loop-back plug in the printer's place, in this position. For good: no printer is connected any more.
    pub fn plug(&mut self, position: u8) -> io::Result<()> {
        self.order(&format!("plug {position}")).map(drop)
    }

    /// What has been measured: see `figures` in bridge.mjs.
    pub fn figures(&mut self) -> io::Result<Value> {
        self.order("figures")
    }

    fn order(&mut self, order: &str) -> io::Result<Value> {
        let orders = self.orders.as_mut().ok_or_else(|| io::Error::other("the board is off"))?;
        writeln!(orders, "{order}")?;
        self.answer()
    }

    fn answer(&mut self) -> io::Result<Value> {
        let mut line = String::new();
        if self.answers.read_line(&mut line)? == 0 {
            return Err(io::Error::other(
                "the emulated board has ended; its last words are on standard error",
            ));
        }
        Ok(serde_json::from_str(&line)?)
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // The end of its standard input is the board's end.
        drop(self.orders.take());
        let _ = self.board.wait();
        for end in self.ends.drain(..) {
            match end.join() {
                Ok(Ok(())) => {}
                Ok(Err(error)) if std::thread::panicking() => eprintln!("the emulated bridge: {error}"),
                // At the end the sockets close in any order.
                _ => {}
            }
        }
    }
}

/// An emulated bridge with the rig at its cable. Dropping it switches both off.
pub struct EmulatedRig {
    boards: Child,
    stop: Arc<AtomicBool>,
    ends: Vec<JoinHandle<io::Result<()>>>,
    /// The serial ports of bridge and rig.
    pub ports: [PathBuf; 2],
}

impl EmulatedRig {
    /// Boots the images of bridge and rig, with the ends of each in a folder of its own. `scripts` as for [`Emulated::start`].
    ///
    /// Errors: as there.
    pub fn start(images: [&Path; 2], scripts: &Path, folders: [&Path; 2]) -> io::Result<EmulatedRig> {
        let ([bridge, rig], [here, there]) = (images, folders);
        let mut boards = node(&scripts.join("rig.mjs"), &[bridge, here, rig, there])?;
        let ports = folders.map(|folder| folder.join(TTY));
        let stop = Arc::<AtomicBool>::default();
        let up = boards.stdout.take().map(|stdout| BufReader::new(stdout).read_line(&mut String::new()));
        let mut emulated = EmulatedRig { boards, stop, ends: Vec::new(), ports };
        if !matches!(up, Some(Ok(1..))) {
            return Err(io::Error::other(
                "the emulated boards do not come up; their last words are on standard error",
            ));
        }
        for folder in folders {
            emulated.ends.push(serve_terminal(folder, &emulated.stop)?);
        }
        Ok(emulated)
    }
}

impl Drop for EmulatedRig {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // The end of their standard input is the boards' end.
        drop(self.boards.stdin.take());
        let _ = self.boards.wait();
        for end in self.ends.drain(..) {
            let _ = end.join();
        }
    }
}

/// Node with a script, to be talked to.
fn node(script: &Path, args: &[&Path]) -> io::Result<Child> {
    Command::new(std::env::var_os("FOILPRESS_NODE").unwrap_or_else(|| "node".into()))
        .arg(script)
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
}

/// Serves the serial port of the board whose ends are in this folder.
fn serve_terminal(folder: &Path, stop: &Arc<AtomicBool>) -> io::Result<JoinHandle<io::Result<()>>> {
    let mut terminal = Terminal::new(folder)?;
    let stop = stop.clone();
    Ok(std::thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            terminal.serve()?;
        }
        Ok(())
    }))
}

/// The printer's end of the parallel cable.
fn serve_printer(socket: &UnixStream, desk: &Mutex<Desk>, stop: &AtomicBool) -> io::Result<()> {
    socket.set_read_timeout(Some(TICK))?;
    let mut lines = BufReader::new(socket);
    let mut line = Vec::new();
    let mut waiting: Vec<u8> = Vec::new();
    let mut taken = 0;
    let mut id = (DEVICE_ID.len() as u16 + 2).to_be_bytes().to_vec();
    id.extend_from_slice(DEVICE_ID.as_bytes());
    let mut told = json!({ "id": BASE64.encode(&id) });
    let say = |message: Value| {
        let mut text = message.to_string();
        text.push('\n');
        (&*socket).write_all(text.as_bytes())
    };
    say(told.clone())?;
    while !stop.load(Ordering::Relaxed) {
        match lines.read_until(b'\n', &mut line) {
            Ok(0) => return Ok(()),
            Ok(_) if line.ends_with(b"\n") => {
                let message: Value = serde_json::from_slice(&line)?;
                line.clear();
                let mut desk = desk.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(bytes) = message["bytes"].as_str() {
                    let bytes = BASE64.decode(bytes).map_err(io::Error::other)?;
                    desk.printed.extend_from_slice(&bytes);
                    waiting.extend_from_slice(&bytes);
                }
                if message["init"] == true {
                    desk.resets += 1;
                    desk.printer.power_cycle();
                    taken += std::mem::take(&mut waiting).len() as u64;
                }
            }
            Ok(_) => {}
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
        let mut desk = desk.lock().unwrap_or_else(PoisonError::into_inner);
        taken += desk.take(&mut waiting);
        let trouble = desk.printer.trouble();
        let answers = desk.printer.answers();
        let on = desk.on;
        drop(desk);
        if !answers.is_empty() {
            say(json!({ "answer": BASE64.encode(&answers) }))?;
        }
        // The lines as IEEE 1284 defines them; which of them this printer moves for which trouble is not known.
        let now = json!({
            "room": taken + BUFFER,
            "power": on,
            "lines": {
                "paperOut": u8::from(trouble == Some(Trouble::NoPaper)),
                "select": u8::from(trouble.is_none()),
                "fault": u8::from(trouble.is_none()),
            },
        });
        if now != told {
            say(now.clone())?;
            told = now;
        }
    }
    Ok(())
}

impl Desk {
    /// Switches the printer off, or on again. What it was at work on is lost.
    pub fn switch(&mut self, on: bool) {
        self.on = on;
        self.printer.power_cycle();
    }

    /// Gives the printer what waits; says how many bytes it took.
    fn take(&mut self, waiting: &mut Vec<u8>) -> u64 {
        let mut taken = 0;
        loop {
            if self.refused.is_some() || !self.on {
                taken += std::mem::take(waiting).len();
                break;
            }
            match self.printer.feed(waiting) {
                Ok(count) => {
                    taken += count;
                    waiting.drain(..count);
                    match self.printer.take_printout() {
                        Some(sheet) => {
                            self.sheets.push(sheet);
                            self.printer.load(self.stock);
                        }
                        None => break,
                    }
                }
                Err(refused) => self.refused = Some(refused.to_string()),
            }
        }
        taken as u64
    }
}

/// The serial port's two ends: a terminal for programs, a socket for the board.
struct Terminal {
    folder: PathBuf,
    master: File,
    board: Option<UnixStream>,
    to_board: Vec<u8>,
    to_program: Vec<u8>,
}

impl Terminal {
    fn new(folder: &Path) -> io::Result<Terminal> {
        Ok(Terminal {
            folder: folder.to_path_buf(),
            master: open_terminal(folder)?,
            board: None,
            to_board: Vec::new(),
            to_program: Vec::new(),
        })
    }

    /// Moves bytes once, waiting a little for them.
    fn serve(&mut self) -> io::Result<()> {
        let when = |wanted: bool, flags| if wanted { flags } else { PollFlags::empty() };
        let tick = Timespec { tv_sec: 0, tv_nsec: TICK.as_nanos() as _ };
        let terminal = when(self.to_board.is_empty(), PollFlags::IN)
            | when(!self.to_program.is_empty() && self.board.is_some(), PollFlags::OUT);
        let line = when(self.to_program.len() < TERMINAL, PollFlags::IN)
            | when(!self.to_board.is_empty(), PollFlags::OUT);
        let mut fds = vec![PollFd::new(&self.master, terminal)];
        if let Some(board) = &self.board {
            fds.push(PollFd::new(board, line));
        }
        poll(&mut fds, Some(&tick))?;
        let terminal = fds[0].revents();
        let line = fds.get(1).map_or(PollFlags::empty(), PollFd::revents);

        let mut buffer = [0; TERMINAL];
        if terminal.contains(PollFlags::IN) {
            let count = self.master.read(&mut buffer)?;
            self.to_board.extend_from_slice(&buffer[..count]);
        } else if terminal.contains(PollFlags::HUP) {
            // Nobody has the port open: its lines fall, and what it was to be told is lost.
            if self.to_board.is_empty() {
                self.board = None;
            }
            self.to_program.clear();
            std::thread::sleep(TICK);
        }
        if self.board.is_none() && !terminal.contains(PollFlags::HUP) || !self.to_board.is_empty() {
            self.connect()?;
        }
        let Some(board) = &mut self.board else { return Ok(()) };
        if !self.to_board.is_empty() {
            let count = not_now(board.write(&self.to_board))?;
            self.to_board.drain(..count);
        }
        if line.intersects(PollFlags::IN | PollFlags::HUP) && self.to_program.len() < TERMINAL {
            match board.read(&mut buffer) {
                Ok(0) | Err(_) => return self.unplugged(),
                Ok(count) => self.to_program.extend_from_slice(&buffer[..count]),
            }
        }
        if terminal.contains(PollFlags::OUT) && !self.to_program.is_empty() {
            let count = not_now(self.master.write(&self.to_program))?;
            self.to_program.drain(..count);
        }
        Ok(())
    }

    fn connect(&mut self) -> io::Result<()> {
        if self.board.is_none() {
            let board = UnixStream::connect(self.folder.join("serial"))?;
            board.set_nonblocking(true)?;
            self.board = Some(board);
        }
        Ok(())
    }

    /// The board has closed its end: programs are to see their port hang up.
    fn unplugged(&mut self) -> io::Result<()> {
        *self = Terminal::new(&self.folder)?;
        Ok(())
    }
}

fn not_now(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(0),
        other => other,
    }
}

/// A new pseudo-terminal behind the port's name.
fn open_terminal(folder: &Path) -> io::Result<File> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let path = Path::new(name.to_str().map_err(io::Error::other)?).to_path_buf();
    // Opened and closed once: from now on a terminal that nobody has open says so. Raw, so that nothing is echoed.
    let slave = File::options().read(true).write(true).open(&path)?;
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    drop(slave);
    rustix::io::ioctl_fionbio(&master, true)?;
    let (fresh, name) = (folder.join("tty.new"), folder.join(TTY));
    let _ = fs::remove_file(&fresh);
    symlink(path, &fresh)?;
    fs::rename(fresh, name)?;
    Ok(master.into())
}
