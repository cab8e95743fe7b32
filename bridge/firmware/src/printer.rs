//! The plain printer: a USB Printer class interface, so that any operating system prints without a program of ours.
//!
//! Bytes from the bulk endpoint go to the engine as they come; while a job of the link is open it takes none and the
//! packet in hand is offered again and again, which is a NAK to the host: one owner at a time, and nothing is lost.
//! The class knows no jobs. One is over
//!
//! * behind the reset that ends every job in the printer's language; the engine sees it go by;
//! * when the host resets the interface: what has not begun is dropped;
//! * when the cable is pulled: nobody will send the rest;
//! * after a silence of [`OPEN`] with a sheet in the printer (programs that compute a page while they print are silent for
//!   minutes at worst), of [`SHUT`] with none.
//!
//! A job that breaks off is brought to a legal end or, if it was never in the printer's language, left as it is.
//! GET_PORT_STATUS is the lines at that moment. GET_DEVICE_ID is what the printer said when it was last asked, between jobs;
//! until it has said anything, a description that any driver for it matches. Nothing is ever sent to the host by
//! the other bulk endpoint: it is there because systems prefer printers that have one.

use crate::pins;
use crate::shared::{Shared, Side};
use crate::usb::{BulkIn, BulkOut, PACKET, Usb};
use core::cell::RefCell;
use embassy_futures::select::{Either, Either3, select, select3};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use embassy_usb::Builder;
use embassy_usb::Handler;
use embassy_usb::control::{InResponse, OutResponse, Recipient, Request, RequestType};
use embassy_usb::driver::{Endpoint, EndpointOut};
use embassy_usb::types::InterfaceNumber;
use protocol::link::message::Lines;
use static_cell::StaticCell;

/// Printer, printer, both directions.
const CLASS: [u8; 3] = [0x07, 0x01, 0x02];

const GET_DEVICE_ID: u8 = 0;
const GET_PORT_STATUS: u8 = 1;
const SOFT_RESET: u8 = 2;

/// Between two looks at a job that waits for more.
const LOOK: Duration = Duration::from_secs(1);

/// Looks after which a job with a sheet in the printer is ended.
const OPEN: u32 = 300;

/// Looks after which a job without one is.
const SHUT: u32 = 5;

/// Between two offers of a packet that the engine does not take.
const AGAIN: Duration = Duration::from_millis(1);

/// Longest device ID that is kept, its length included.
pub const LONGEST: usize = 512;

/// What is said while the printer has said nothing.
const UNHEARD: &[u8] =
    b"MANUFACTURER:ALPS;COMMAND SET:RGL;MODEL:MD-5500;CLASS:PRINTER;DESCRIPTION:Foilpress bridge, printer not heard yet;";

/// What the interface shows, and what is asked of it.
pub struct Face {
    id: RefCell<([u8; LONGEST], usize)>,
    news: Signal<NoopRawMutex, News>,
}

/// Why no more of a job comes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum News {
    /// The host has thought better of it.
    Reset,
    /// The host is gone.
    Gone,
}

impl Face {
    /// Of a printer that has not been heard.
    pub fn new() -> Self {
        let face = Face { id: RefCell::new(([0; LONGEST], 0)), news: Signal::new() };
        face.forget();
        face
    }

    /// The printer's own words, with or without their length in front. False if there are none.
    pub fn learn(&self, answer: &[u8]) -> bool {
        // The length is often wrong, so what was read decides. Its bytes are below a space, as no text is.
        let text = match answer {
            [high, _, rest @ ..] if *high < b' ' => rest,
            text => text,
        };
        let printable = |byte: &u8| byte.is_ascii_graphic() || *byte == b' ';
        let end = text.iter().position(|byte| !printable(byte)).unwrap_or(text.len());
        let text = &text[..end.min(LONGEST - 2)];
        if !text.contains(&b':') {
            return false;
        }
        let mut id = self.id.borrow_mut();
        let length = text.len() + 2;
        // At most LONGEST.
        id.0[..2].copy_from_slice(&(length as u16).to_be_bytes());
        id.0[2..length].copy_from_slice(text);
        id.1 = length;
        true
    }

    /// The printer is another one from now on.
    pub fn forget(&self) {
        self.learn(UNHEARD);
    }
}

/// Bytes 3 to 5: no error, selected, paper empty.
fn port_status(lines: Lines) -> u8 {
    let bit = |on: bool, bit: u8| u8::from(on) << bit;
    // The lines of a printer that is off float; they are not its word.
    let on = lines.high(Lines::POWER);
    bit(on && lines.high(Lines::FAULT), 3)
        | bit(on && lines.high(Lines::SELECT), 4)
        | bit(on && lines.high(Lines::PAPER_OUT), 5)
}

struct Requests {
    interface: InterfaceNumber,
    face: &'static Face,
}

impl Handler for Requests {
    fn reset(&mut self) {
        self.face.news.signal(News::Gone);
    }

    fn configured(&mut self, configured: bool) {
        if !configured {
            self.face.news.signal(News::Gone);
        }
    }

    fn control_in<'a>(&'a mut self, request: Request, buffer: &'a mut [u8]) -> Option<InResponse<'a>> {
        if (request.request_type, request.recipient) != (RequestType::Class, Recipient::Interface) {
            return None;
        }
        let [low, high] = request.index.to_le_bytes();
        let number = u8::from(self.interface);
        match request.request {
            // Here, and only here, the interface is in the high byte.
            GET_DEVICE_ID if high == number => {
                let id = self.face.id.borrow();
                let answer = buffer.get_mut(..id.1)?;
                answer.copy_from_slice(&id.0[..id.1]);
                Some(InResponse::Accepted(answer))
            }
            GET_PORT_STATUS if low == number => {
                let answer = buffer.get_mut(..1)?;
                answer[0] = port_status(pins::status());
                Some(InResponse::Accepted(answer))
            }
            _ => None,
        }
    }

    fn control_out(&mut self, request: Request, _: &[u8]) -> Option<OutResponse> {
        // Version 1.0 of the class had the recipient wrong, and Linux follows it.
        let to_us = matches!(request.recipient, Recipient::Interface | Recipient::Other)
            && request.request_type == RequestType::Class
            && request.index.to_le_bytes()[0] == u8::from(self.interface);
        if !to_us || request.request != SOFT_RESET {
            return None;
        }
        self.face.news.signal(News::Reset);
        Some(OutResponse::Accepted)
    }
}

/// Adds the interface to a device.
pub fn build(builder: &mut Builder<'static, Usb>, face: &'static Face) -> (BulkOut, BulkIn) {
    static REQUESTS: StaticCell<Requests> = StaticCell::new();
    let [class, subclass, protocol] = CLASS;
    let mut function = builder.function(class, subclass, protocol);
    let mut interface = function.interface();
    let number = interface.interface_number();
    let mut setting = interface.alt_setting(class, subclass, protocol, None);
    let ends = (setting.endpoint_bulk_out(None, PACKET), setting.endpoint_bulk_in(None, PACKET));
    drop(function);
    builder.handler(REQUESTS.init(Requests { interface: number, face }));
    ends
}

/// Takes what an operating system prints.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, face: &'static Face, mut endpoint: BulkOut, _silent: BulkIn) -> ! {
    let mut packet = [0; PACKET as usize];
    loop {
        endpoint.wait_enabled().await;
        let mut looks = 0;
        loop {
            match select3(endpoint.read(&mut packet), face.news.wait(), Timer::after(LOOK)).await {
                Either3::First(Ok(count)) => {
                    looks = 0;
                    offer(shared, face, &packet[..count]).await;
                }
                Either3::First(Err(_)) => break,
                Either3::Second(news) => end(shared, news),
                Either3::Third(()) => {
                    let limit = match shared.engine(|engine| engine.local_waits()) {
                        None => u32::MAX,
                        Some(true) => OPEN,
                        Some(false) => SHUT,
                    };
                    looks = if limit == u32::MAX { 0 } else { looks + 1 };
                    if looks >= limit {
                        end(shared, News::Gone);
                    }
                }
            }
        }
        end(shared, News::Gone);
    }
}

/// Offers bytes until they are taken or the host has changed its mind.
async fn offer(shared: &Shared, face: &Face, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        let taken = shared.engine(|engine| engine.local(bytes));
        bytes = &bytes[taken..];
        if taken > 0 {
            shared.wake(Side::Work);
        } else {
            if let Either::Second(news) = select(Timer::after(AGAIN), face.news.wait()).await {
                return end(shared, news);
            }
        }
    }
}

fn end(shared: &Shared, news: News) {
    shared.engine(|engine| match news {
        News::Reset => engine.local_reset(),
        News::Gone => engine.local_end(),
    });
    shared.wake(Side::Work);
}
