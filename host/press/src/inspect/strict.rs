//! The strict reader: the dialect of the established open driver, which is ours.

use observe::Observer;
use protocol::ink::Ink;
use protocol::rgl::{Command, Compression, Fault, Mode, Order, Step, parse};

use super::report::{Inspected, PassReport, Setup, measure, mode_name};
use crate::separate::Pass;
use crate::simulate::Canvas;

/// A pass being read.
struct Open {
    report: PassReport,
    canvas: Canvas,
}

/// Inspects one sheet's job.
pub(super) fn inspect(stream: &[u8], observer: &dyn Observer) -> Inspected {
    observer.begin("inspect", stream.len() as u64);
    let mut reader = Reader { order: Order::new(), open: None, reports: Vec::new(), passes: Vec::new() };
    let (mut at, mut reported) = (0, 0);
    let fault = loop {
        if at == stream.len() {
            break (!reader.order.is_complete()).then_some((Fault::Truncated, at));
        }
        match parse(&stream[at..]) {
            Ok(Step::Command(command, length)) => {
                if let Err(refusal) = reader.order.accept(&command) {
                    break Some((refusal.fault, at + refusal.at));
                }
                reader.take(&command, at, length);
                at += length;
            }
            Ok(Step::More(_)) => break Some((Fault::Truncated, stream.len())),
            Err(refusal) => break Some((refusal.fault, at + refusal.at)),
        }
        if at - reported >= 1 << 16 {
            observer.advance((at - reported) as u64);
            reported = at;
        }
    };
    reader.close(at);
    observer.end();
    let setup = setup(&reader.order);
    Inspected::of(stream, None, setup, (reader.reports, reader.passes), fault)
}

struct Reader {
    order: Order,
    open: Option<Open>,
    reports: Vec<PassReport>,
    passes: Vec<Pass>,
}

impl Reader {
    /// Takes a legal command at offset `at`.
    fn take(&mut self, command: &Command<'_>, at: usize, length: usize) {
        match *command {
            Command::InkSelect { ink, last } => self.begin(ink, last, at),
            Command::RasterStart if self.order.declared().mode == Some(Mode::BlackRaster) => {
                self.begin(Ink::Black, true, at + length);
            }
            Command::Row { data, .. } => {
                if let Some(open) = &mut self.open {
                    let compression = self.order.compression();
                    open.canvas.put(self.order.row(), compression, data);
                    open.report.rows += 1;
                    match compression {
                        Some(Compression::Packed) => open.report.packed_rows += 1,
                        _ => open.report.plain_rows += 1,
                    }
                }
            }
            Command::BackFeed | Command::RasterEnd => self.close(at),
            _ => {}
        }
    }

    fn begin(&mut self, ink: Ink, last: bool, at: usize) {
        let declared = self.order.declared();
        let shift = (declared.shift_x.into(), declared.shift_y.into());
        let canvas = Canvas::new(declared.width.into(), declared.length.into(), shift, usize::MAX, 1);
        let report = PassReport::begin(self.reports.len() + 1, ink, last, at);
        self.open = Some(Open { report, canvas });
    }

    fn close(&mut self, at: usize) {
        let Some(Open { mut report, canvas }) = self.open.take() else { return };
        let plane = canvas.into_plane();
        let dpi = self.order.declared().resolution.unwrap_or_default().dpi();
        (report.dots, report.bounds) = measure(&plane, dpi);
        report.bytes = at as u64 - report.offset;
        // The report has only the name of the ink.
        self.passes.push(Pass { ink: self.order.ink(), plane });
        self.reports.push(report);
    }
}

fn setup(order: &Order) -> Setup {
    let declared = order.declared();
    let dpi = declared.resolution.map(|resolution| resolution.dpi());
    let paper = declared.paper.zip(dpi).map(|(code, (across, along))| {
        let width = u32::from(declared.width) * 600 / u32::from(across);
        let length = u32::from(declared.length) * 600 / u32::from(along);
        code.paper(width as u16, length as u16).name()
    });
    Setup {
        resolution: dpi,
        media: declared.media.map(|media| media.name()),
        paper,
        width: declared.width,
        length: declared.length,
        shift_x: declared.shift_x,
        shift_y: declared.shift_y,
        curl_correction: declared.curl,
        built_in_gloss: declared.gloss,
        mode: declared.mode.map(mode_name),
        cartridges: declared.cartridges.map(|list| list.inks().iter().map(|ink| ink.name()).collect()),
    }
}

/// The length of the first job including its final reset; `None` if it is incomplete.
pub(super) fn first_sheet(stream: &[u8]) -> Option<usize> {
    let mut at = 0;
    let mut left = false;
    loop {
        match parse(stream.get(at..)?) {
            Ok(Step::Command(Command::Reset, length)) if left => return Some(at + length),
            _ if left => return Some(at),
            Ok(Step::Command(command, length)) => {
                left = command == Command::LeaveRgl;
                at += length;
            }
            _ => return None,
        }
    }
}
