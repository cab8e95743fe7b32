//! Shows a delivery to the person at a terminal, and asks them what it needs to know.
//!
//! Without a terminal every answer is no.

use std::cell::RefCell;
use std::io::{self, BufRead as _, IsTerminal as _, Write as _};

use indicatif::HumanBytes;
use protocol::ink::Ink;
use protocol::link::message::JobKind;

use super::stderr;
use crate::cli::output;
use device::deliver::{Caller, Cartridges, News, Question};
use device::encodings::PassPlace;
use device::printers::Printer;
use device::questions::cartridges::Found;
use device::transit::journal::Entry;
use device::transit::{Event, words};
use observe::Observer;

/// The caller of a delivery that a person started.
pub struct Terminal<'o> {
    force: bool,
    cartridges_shown: bool,
    by_hand: bool,
    observer: &'o dyn Observer,
    position: RefCell<Position>,
}

/// The progress shown of the job being sent.
#[derive(Default)]
struct Position {
    passes: Vec<PassPlace>,
    total: u64,
    /// The pass shown, from 1, and the position shown.
    pass: usize,
    shown: u64,
    printed: u64,
    /// The bridge that has introduced itself, and whether it is away.
    bridge: Option<u64>,
    away: bool,
}

impl<'o> Terminal<'o> {
    /// With `force`, a device that does not identify itself as an ALPS printer gets a note instead of a refusal.
    /// `cartridges_shown`: the loaded cartridges were shown before, and are not shown again.
    pub fn new(force: bool, cartridges_shown: bool, observer: &'o dyn Observer) -> Terminal<'o> {
        Terminal { force, cartridges_shown, by_hand: false, observer, position: RefCell::default() }
    }

    /// The same for a job whose paper is fed by hand, or not: the check of the cartridges looks at the lever, too.
    pub fn fed_by_hand(self, by_hand: bool) -> Terminal<'o> {
        Terminal { by_hand, ..self }
    }

    fn begin(&self, entry: &Entry) {
        let number = entry.record.job;
        output::say_on_interrupt(&format!(
            "the bridge prints what it has received. `foilpress resume {number:08x}` continues the job, \
             `foilpress cancel {number:08x}` ends the sheet"
        ));
        *self.position.borrow_mut() = Position {
            passes: entry.passes.clone(),
            total: entry.port_bytes,
            printed: entry.record.printed.into(),
            ..Position::default()
        };
    }

    fn link(&self, event: &Event<'_>) {
        let mut position = self.position.borrow_mut();
        match event {
            Event::Connected(bridge) => {
                if std::mem::take(&mut position.away) {
                    self.observer.note("the bridge is back; the job continues where the printer is");
                } else if position.bridge != Some(bridge.serial) {
                    self.observer
                        .note(&format!("bridge {:016x}, firmware {}", bridge.serial, bridge.firmware));
                }
                position.bridge = Some(bridge.serial);
            }
            Event::Away(why) => {
                if !std::mem::replace(&mut position.away, true) {
                    self.observer.note(&format!(
                        "the link to the bridge is gone ({why}); the bridge prints what it has received, and the job continues when \
                         the link is back. Nothing is lost"
                    ));
                }
            }
            Event::Moved(progress) => {
                position.printed = u64::from(progress.printed);
                position.show(self.observer);
            }
            Event::Fault(Some(fault)) => {
                let ink = words::wanted(&position.passes, position.printed);
                self.observer.note(&words::fault(*fault, ink));
            }
            Event::Fault(None) => self.observer.note("the printer continues"),
        }
    }
}

impl Position {
    /// A bar for each pass, in bytes that crossed the port.
    fn show(&mut self, observer: &dyn Observer) {
        let Some((number, ink)) = words::pass_at(&self.passes, self.printed) else { return };
        let begin = self.passes[number - 1].offset;
        if number != self.pass {
            let end = self.passes.get(number).map_or(self.total, |next| next.offset);
            observer.begin(
                &format!("pass {number} of {}, {}", self.passes.len(), ink.name()),
                end.saturating_sub(begin),
            );
            self.pass = number;
            self.shown = begin;
        }
        let before = std::mem::replace(&mut self.shown, self.printed);
        observer.advance(self.printed.saturating_sub(before));
        if self.printed >= self.total {
            observer.end();
        }
    }
}

impl Caller for Terminal<'_> {
    fn tell(&self, news: &News<'_>) {
        match news {
            News::Printer(cartridges) if !self.cartridges_shown => {
                self.observer.note(&cartridges_text(cartridges, self.by_hand));
            }
            News::Printer(_) => {}
            News::Reset => self.observer.note("the printer has been reset; if a sheet is still in it, take it out"),
            News::Queued { entry, data } => self.observer.note(&format!(
                "{} is queued as job {:08x}, {}; nothing is printed yet",
                entry.name,
                entry.record.job,
                size_text(entry.record.kind, *data, entry.port_bytes)
            )),
            News::Sending(entry) => self.begin(entry),
            News::Link(event) => self.link(event),
            News::ByteForByte => self.observer.note(
                "the bridge cannot take this page as pass streams, so the same job is sent byte for byte under a new number",
            ),
            News::SendingRaw => output::say_on_interrupt(
                "the printer may have received part of the job. Switch it off and on before the next job",
            ),
            News::Note(text) => self.observer.note(text),
        }
    }

    fn agrees(&self, question: &Question<'_>) -> bool {
        match question {
            Question::Reset(owed) => {
                let what = match owed.printer {
                    Printer::Bridge(_) => "Reset it through the bridge now?",
                    Printer::Device(_) => "Has it been switched off and on since?",
                };
                agreed(&format!("{owed}. {what}"))
            }
            Question::NotAlps { id } if self.force => {
                self.observer.note(&format!("the device does not identify itself as an ALPS printer: {id}"));
                true
            }
            Question::NotAlps { .. } => false,
        }
    }

    fn observer(&self) -> &dyn Observer {
        self.observer
    }
}

/// Asks the person at the terminal; without one the answer is no.
pub fn agreed(question: &str) -> bool {
    if !io::stdin().is_terminal() || !stderr().is_terminal() {
        return false;
    }
    let mut answer = String::new();
    let asked =
        write!(stderr(), "{question} [y/N] ").and_then(|()| io::stdin().lock().read_line(&mut answer));
    asked.is_ok() && matches!(answer.trim(), "y" | "Y" | "yes")
}

/// The size of a job on the cable and at the printer.
pub fn size_text(kind: JobKind, data: u64, printed: u64) -> String {
    match kind {
        JobKind::Streams => format!(
            "{} as pass streams, 1/{:.1} of the {} the bridge makes of them",
            HumanBytes(data),
            printed as f64 / data as f64,
            HumanBytes(printed)
        ),
        JobKind::Raw => format!("{}, byte for byte", HumanBytes(printed)),
    }
}

/// The cartridges to have at hand.
pub fn cartridges_needed(inks: &[Ink]) -> String {
    let list: Vec<String> = inks.iter().map(|ink| format!("{} ({})", ink.name(), ink.part())).collect();
    format!("cartridges needed, in this order: {}", list.join(", "))
}

/// What the printer reports about the cartridges a job needs, and about its lever if the paper is fed by hand.
pub fn cartridges_text(cartridges: &Cartridges, by_hand: bool) -> String {
    match cartridges {
        Cartridges::Known { status, .. } if by_hand && status.tray => format!(
            "{}\nThe feed lever stands at automatic: set it to M before the sheet goes in, postcards are fed by hand.",
            found_text(cartridges)
        ),
        _ => found_text(cartridges),
    }
}

fn found_text(cartridges: &Cartridges) -> String {
    let unknown = |why: &str| format!("The loaded cartridges are not known: {why}");
    match cartridges {
        Cartridges::Unknown(why) => unknown(why),
        Cartridges::Known { found: Found::All, .. } => "All cartridges of the job are in the printer.".into(),
        Cartridges::Known { found: Found::Stale, .. } => {
            unknown("the printer reports an error; `foilpress bridge status` shows it")
        }
        Cartridges::Known { found: Found::Missing(missing), .. } => {
            let names: Vec<String> = missing.iter().map(ToString::to_string).collect();
            format!(
                "Not in the printer: {}.\nIf a cartridge is missing, the printer pauses before that pass and continues once it is \
                 loaded.",
                names.join(", ")
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use device::questions::status::Status;
    use press::simulate::{Carousel, Lever, Printer};

    #[test]
    fn the_check_of_the_cartridges_tells_of_a_lever_that_stands_wrong_for_the_paper() {
        let text = |lever: Lever, by_hand: bool| {
            let printer = Printer::new(Carousel::new(&[Ink::Black.into()]).unwrap(), lever);
            let answer = printer.status().to_vec();
            let status = Status::read(&answer).unwrap();
            cartridges_text(&Cartridges::Known { answer, status, found: Found::All }, by_hand)
        };
        assert!(text(Lever::Auto, true).contains("set it to M"));
        for (lever, by_hand) in [(Lever::Manual, true), (Lever::Manual, false), (Lever::Auto, false)] {
            assert!(!text(lever, by_hand).contains("lever"), "{by_hand}");
        }
    }
}
