//! A device that takes bytes as they are, and keeps them for the test: a named pipe that somebody reads.
//!
//! Problem: a regular file is no device, and the program refuses to write over one. Method: a pipe under a name, open both ways so that
//! nobody waits to open it, and a thread that empties it. What was taken is known once a mark has come through behind it.
//! Limits: Unix; the thread ends with the process.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, channel};

/// Behind everything that was taken. No job holds it.
const MARK: &[u8] = b"\0\0<the device's own mark>\0\0";

/// The device.
pub struct Device {
    pipe: File,
    pieces: Receiver<Vec<u8>>,
}

impl Device {
    /// Makes a device of this name; a pipe of this name that is there already is taken.
    pub fn at(path: &Path) -> Device {
        if !path.exists() {
            let made = Command::new("mkfifo").arg(path).status().expect("mkfifo runs");
            assert!(made.success(), "no pipe at {}", path.display());
        }
        let open = || File::options().read(true).write(true).open(path).expect("the pipe opens");
        let (mut reader, (send, pieces)) = (open(), channel());
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count) = reader.read(&mut buffer) {
                if send.send(buffer[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        Device { pipe: open(), pieces }
    }

    /// What it has taken since it was asked before.
    pub fn taken(&mut self) -> Vec<u8> {
        self.pipe.write_all(MARK).expect("it is read");
        let mut taken = Vec::new();
        while !taken.ends_with(MARK) {
            taken.extend(self.pieces.recv().expect("the reader lives"));
        }
        taken.truncate(taken.len() - MARK.len());
        taken
    }
}
