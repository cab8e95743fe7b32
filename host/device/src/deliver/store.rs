//! A job into a bridge's flash, to be printed there without this computer.
//!
//! Nothing is kept on disk here, since nothing is printed: a job that does not arrive as a whole does not count, and is stored again. What
//! goes wrong with the link meanwhile is repaired by the [session](crate::transit::session), as for any other job.

use std::convert::Infallible;
use std::time::Duration;

use protocol::link::message::NAME_MAX;

use super::{Caller, Failure, Packed};
use crate::connection::Address;
use crate::questions::query::{Query, Shelf};
use crate::transit::journal::fresh_number;
use crate::transit::session::{Outcome, Record, Session};
use crate::transit::{self, Event, RunError};

/// How long a bridge may take to answer.
const BRIDGE: Duration = Duration::from_secs(3);

/// What a bridge has in its flash.
pub fn shelf(address: &Address, caller: &dyn Caller) -> Result<Shelf, Failure> {
    let mut link = caller.open(address, None)?;
    Ok(Query::new(&mut *link, BRIDGE)?.shelf(BRIDGE)?)
}

/// Whether a job of so many bytes of data fits in.
pub fn fits(shelf: &Shelf, bytes: usize) -> Result<(), Failure> {
    if shelf.total == 0 {
        return Err(Failure::NoStore);
    }
    match bytes > shelf.room as usize {
        true => Err(Failure::NoRoom { needs: bytes, room: shelf.room, total: shelf.total }),
        false => Ok(()),
    }
}

/// Stores a job in the bridge at `address`, and returns the number it was stored under. Nothing is printed.
pub fn store(packed: &Packed<'_>, address: &Address, caller: &dyn Caller) -> Result<u32, Failure> {
    let (data, observer) = (packed.data(), caller.observer());
    fits(&shelf(address, caller)?, data.len())?;
    let number = fresh_number(protocol::link::frame::checksum(data), address.to_string().as_bytes());
    // As much of it as the bridge keeps.
    let ends = packed.name().char_indices().map(|(at, letter)| at + letter.len_utf8());
    let name = &packed.name()[..ends.take_while(|&end| end <= NAME_MAX).last().unwrap_or(0)];
    let record = Record::new(number, packed.kind(), data.len() as u32);
    let mut session = Session::storing(record, data, name);
    observer.begin("storing in the bridge", data.len() as u64);
    let mut shown = 0;
    let result = transit::run_at(
        &mut session,
        &mut |bridge| caller.open(address, bridge),
        &mut |time| caller.pause(time),
        &mut |_| Ok::<(), Infallible>(()),
        &mut |event| match event {
            Event::Moved(progress) => {
                observer.advance(u64::from(progress.accepted.saturating_sub(shown)));
                shown = shown.max(progress.accepted);
            }
            Event::Away(why) => observer.note(&format!("the link to the bridge is gone ({why})")),
            Event::Connected(_) | Event::Fault(_) => {}
        },
        &mut || caller.wish(),
    );
    observer.end();
    match result {
        Ok(Outcome::Stored) => Ok(number),
        Ok(outcome) => Err(Failure::NotStored(outcome)),
        Err(RunError::Left) => Err(Failure::Left),
        Err(RunError::Session(error)) => Err(error.into()),
        Err(RunError::Open(error)) => Err(error.into()),
        Err(error @ RunError::NoAnswer(_)) => Err(Failure::NoAnswer(error.to_string())),
        Err(RunError::Save(never)) => match never {},
    }
}
