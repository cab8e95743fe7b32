//! The board's drive: even without permission or driver for the boot loader, its disk takes a UF2 file.
//!
//! Limits: the drive accepts any file without an answer; only a bridge that is back with the new version shows that the image
//! arrived complete. The board restarts with the last block, so the drive disappears while the file is still open.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use observe::Observer;
use uf2::Chip;

/// The file that names the board of a drive.
const INFO: &str = "INFO_UF2.TXT";
const NAME: &str = "foilpress-bridge.uf2";
const PIECE: usize = 16 * 1024;

/// Why the file was not copied to the drive.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// The drive is still mounted, but the file cannot be written.
    #[error("cannot write the firmware to {}", .drive.display())]
    Refused {
        /// The drive.
        drive: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// The drive disappeared before it had the whole file.
    #[error("{} disappeared after {written} of {length} bytes; hold the board's BOOTSEL button while plugging it in, then flash it again", .drive.display())]
    Gone {
        /// The drive.
        drive: PathBuf,
        /// Bytes it took.
        written: usize,
        /// Bytes there are.
        length: usize,
    },
}

/// The chip of the board in its boot loader whose drive this is, if it is one.
pub fn board(place: &Path) -> Option<Chip> {
    const LONGEST: u64 = 4096;
    let mut text = Vec::new();
    let read = File::open(place.join(INFO)).and_then(|file| file.take(LONGEST).read_to_end(&mut text));
    read.ok()?;
    let text = String::from_utf8_lossy(&text);
    let mut entries = text.lines().filter_map(|line| line.split_once(':'));
    let (_, name) = entries.find(|(key, _)| key.trim() == "Board-ID")?;
    match name.trim() {
        "RPI-RP2" => Some(Chip::Rp2040),
        "RP2350" => Some(Chip::Rp2350),
        _ => None,
    }
}

/// The drives of boards in their boot loader, where they are mounted.
pub fn find() -> Vec<(Chip, PathBuf)> {
    let mut places = mounted();
    places.sort();
    places.dedup();
    places.into_iter().filter_map(|place| board(&place).map(|chip| (chip, place))).collect()
}

#[cfg(target_os = "linux")]
fn mounted() -> Vec<PathBuf> {
    std::fs::read_to_string("/proc/self/mounts").map(|text| mount_points(&text)).unwrap_or_default()
}

/// The mount points of FAT file systems in Linux's list.
#[cfg(any(target_os = "linux", test))]
fn mount_points(mounts: &str) -> Vec<PathBuf> {
    mounts
        .lines()
        .filter_map(|line| {
            let mut fields = line.split(' ').skip(1);
            let (place, system) = (fields.next()?, fields.next()?);
            // Blanks and the like are written as octal numbers.
            let mut bytes = Vec::new();
            let mut rest = place;
            while let Some((before, after)) = rest.split_once('\\') {
                bytes.extend_from_slice(before.as_bytes());
                let (number, after) = after.split_at_checked(3)?;
                bytes.push(u8::from_str_radix(number, 8).ok()?);
                rest = after;
            }
            bytes.extend_from_slice(rest.as_bytes());
            let place = String::from_utf8(bytes).ok()?;
            system.contains("fat").then(|| place.into())
        })
        .collect()
}

#[cfg(target_os = "macos")]
fn mounted() -> Vec<PathBuf> {
    let volumes = std::fs::read_dir("/Volumes").into_iter().flatten();
    volumes.filter_map(|entry| Some(entry.ok()?.path())).collect()
}

#[cfg(windows)]
fn mounted() -> Vec<PathBuf> {
    // A and B are floppy disks, which would make a noise.
    ('C'..='Z').map(|letter| PathBuf::from(format!("{letter}:\\"))).collect()
}

#[cfg(not(any(target_os = "linux", target_os = "macos", windows)))]
fn mounted() -> Vec<PathBuf> {
    Vec::new()
}

/// Copies the file to the drive and makes sure that the board has it.
pub fn copy(drive: &Path, file: &[u8], observer: &dyn Observer) -> Result<(), DriveError> {
    observer.begin("copying the firmware to the drive", file.len() as u64);
    let mut written = 0;
    let result = File::create(drive.join(NAME)).and_then(|mut target| {
        for piece in file.chunks(PIECE) {
            target.write_all(piece)?;
            written += piece.len();
            observer.advance(piece.len() as u64);
        }
        target.sync_all()
    });
    observer.end();
    match result {
        // The board restarts as soon as it has all blocks, before the file is closed.
        Err(_) if written == file.len() && board(drive).is_none() => Ok(()),
        Ok(()) => Ok(()),
        Err(_) if board(drive).is_none() => {
            Err(DriveError::Gone { drive: drive.into(), written, length: file.len() })
        }
        Err(source) => Err(DriveError::Refused { drive: drive.into(), source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use std::fs;

    fn drive(board: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let text = format!("UF2 Bootloader v3.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: {board}\r\n");
        fs::write(folder.path().join("INFO_UF2.TXT"), text).unwrap();
        folder
    }

    #[test]
    fn a_drive_is_known_by_what_it_says_and_not_by_its_name() {
        assert_eq!(board(drive("RPI-RP2").path()), Some(Chip::Rp2040));
        assert_eq!(board(drive("RP2350").path()), Some(Chip::Rp2350));
        assert_eq!(board(drive("RPI").path()), None);
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("RPI-RP2")).unwrap();
        assert_eq!(board(&folder.path().join("RPI-RP2")), None);
        assert_eq!(board(Path::new("/no/such/drive")), None);
    }

    #[test]
    fn the_file_is_on_the_drive_whole() {
        let drive = drive("RPI-RP2");
        let file: Vec<u8> = (0..100_000u32).map(|i| i as u8).collect();
        copy(drive.path(), &file, &Silent).unwrap();
        assert!(fs::read(drive.path().join("foilpress-bridge.uf2")).unwrap() == file);
    }

    #[test]
    fn a_drive_that_does_not_take_the_file_is_told_from_one_that_has_gone() {
        let drive = drive("RPI-RP2");
        // A folder in the file's place: the drive is there and refuses.
        fs::create_dir(drive.path().join("foilpress-bridge.uf2")).unwrap();
        assert!(matches!(copy(drive.path(), b"x", &Silent), Err(DriveError::Refused { .. })));
        let gone = copy(Path::new("/no/such/drive"), b"xyz", &Silent).unwrap_err();
        assert!(matches!(gone, DriveError::Gone { written: 0, length: 3, .. }));
    }

    #[test]
    fn mount_points_are_read_with_blanks_in_them() {
        let mounts = "/dev/sda1 / ext4 rw 0 0\n/dev/sdb1 /media/me/RPI-RP2 vfat rw 0 0\n\
                      /dev/sdc1 /media/me/My\\040Stick vfat rw 0 0\nbroken\n/dev/sdd1 /m\\0 vfat rw 0 0\n";
        assert_eq!(mount_points(mounts), [PathBuf::from("/media/me/RPI-RP2"), "/media/me/My Stick".into()]);
    }
}
