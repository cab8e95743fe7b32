//! A job's sheets at a device that tells nothing: what it may have got of an interrupted job is not known.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use super::{Delivery, Stopped};
use crate::queue::call::Exit;
use crate::queue::messages::Reason;
use device::send::Checked;
use device::send::raw::{self, RawError};

impl<W: Write + Send> Delivery<'_, W> {
    /// Prints a sheet, unless it is already. False when it was ended early.
    pub(super) fn raw_prints(
        &mut self,
        data: &[u8],
        checked: &Checked,
        device: &Path,
        folder: &Path,
    ) -> Result<bool, Stopped> {
        let (begun, done) = (folder.join("begun"), folder.join("done"));
        if done.exists() {
            return Ok(true);
        }
        let mark = |path: &Path| {
            fs::create_dir_all(folder)
                .and_then(|()| File::create(path))
                .and_then(|file| file.sync_all())
                .map_err(|error| {
                    self.fail(
                        Exit::Stop,
                        &format!("cannot keep the job's record in {}: {error}", folder.display()),
                    )
                })
        };
        if begun.exists() {
            // Said once; who releases the job wants the sheet.
            let _ = fs::remove_file(&begun);
            return Err(self.fail(
                Exit::Hold,
                &"the job was interrupted, and this device does not tell what it has printed. Switch the printer off and \
                  on, then release the job to print this sheet again, or cancel it",
            ));
        }
        while let Err(error) = fs::OpenOptions::new().write(true).open(device) {
            match error.kind() {
                io::ErrorKind::PermissionDenied => {
                    return Err(self.fail(
                        Exit::Stop,
                        &format!(
                            "{}: permission denied; the package's udev rule lets the print system in",
                            device.display()
                        ),
                    ));
                }
                _ if self.call.in_class => return Err(self.fail(Exit::Failed, &error)),
                _ => {}
            }
            self.messages.reasons(&[Reason::Connecting, Reason::OffLine]);
            self.messages.info(&format!("{}: {error}; waiting for it", device.display()));
            if !self.pause() {
                return Ok(false);
            }
        }
        mark(&begun)?;
        self.messages.reasons(&[]);
        let names: Vec<&str> = checked.inks.iter().map(|ink| ink.name()).collect();
        self.messages.info(&format!("sending; cassettes in this order: {}", names.join(", ")));
        match raw::send_while(data, device, self.messages, self.stop) {
            Ok(true) => {
                mark(&done)?;
                Ok(true)
            }
            Ok(false) => {
                self.messages.info(
                    "cancelled; the sheet comes out unfinished and the printer is ready for the next job",
                );
                let _ = fs::remove_file(&begun);
                Ok(false)
            }
            Err(error @ RawError::Open { .. }) => {
                let _ = fs::remove_file(&begun);
                Err(self.fail(Exit::Stop, &error))
            }
            Err(error @ RawError::Write { .. }) => {
                let _ = fs::remove_file(&begun);
                Err(self.fail(
                    Exit::Hold,
                    &format!("{error}. The job is held; release it to print this sheet again"),
                ))
            }
        }
    }
}
