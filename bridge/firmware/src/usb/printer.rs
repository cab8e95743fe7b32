//! The printer interface's endpoints and requests: packets to the library's [`Intake`], requests to its answers.

use super::{BulkIn, BulkOut, PACKET, Usb};
use crate::shared::{Shared, Side};
use bridge::printer_class::{CLASS, End, Intake, Next, Request, Setup, port_status};
use embassy_futures::select::{Either, Either3, select, select3};
use embassy_time::{Instant, Timer};
use embassy_usb::control::{InResponse, OutResponse, Recipient, Request as Control};
use embassy_usb::driver::{Direction, Endpoint, EndpointOut};
use embassy_usb::types::InterfaceNumber;
use embassy_usb::{Builder, Handler};
use static_cell::StaticCell;

struct Requests {
    interface: InterfaceNumber,
    shared: &'static Shared,
}

impl Requests {
    fn parse(&self, control: &Control) -> Option<Request> {
        let direction = if control.direction == Direction::In { 0x80 } else { 0 };
        let recipient = match control.recipient {
            Recipient::Device => 0,
            Recipient::Interface => 1,
            Recipient::Endpoint => 2,
            Recipient::Other => 3,
            Recipient::Reserved => 4,
        };
        let request_type = direction | (control.request_type as u8) << 5 | recipient;
        let setup = Setup { request_type, request: control.request, index: control.index };
        Request::parse(&setup, self.interface.into())
    }
}

impl Handler for Requests {
    fn reset(&mut self) {
        self.shared.printer_end.signal(End::Gone);
    }

    fn configured(&mut self, configured: bool) {
        if !configured {
            self.shared.printer_end.signal(End::Gone);
        }
    }

    fn control_in<'a>(&'a mut self, control: Control, buffer: &'a mut [u8]) -> Option<InResponse<'a>> {
        let length = match self.parse(&control)? {
            Request::DeviceId => self.shared.device_id(|id| {
                let bytes = id.bytes();
                buffer.get_mut(..bytes.len())?.copy_from_slice(bytes);
                Some(bytes.len())
            })?,
            Request::PortStatus => {
                // As they were last read: a conversation with the printer has other uses for them.
                *buffer.first_mut()? = port_status(self.shared.engine(|engine| engine.lines()));
                1
            }
            Request::SoftReset => return None,
        };
        Some(InResponse::Accepted(&buffer[..length]))
    }

    fn control_out(&mut self, control: Control, _: &[u8]) -> Option<OutResponse> {
        if self.parse(&control)? != Request::SoftReset {
            return None;
        }
        self.shared.printer_end.signal(End::Reset);
        Some(OutResponse::Accepted)
    }
}

/// Adds the interface to a device.
pub fn build(builder: &mut Builder<'static, Usb>, shared: &'static Shared) -> (BulkOut, BulkIn) {
    static REQUESTS: StaticCell<Requests> = StaticCell::new();
    let [class, subclass, protocol] = CLASS;
    let mut function = builder.function(class, subclass, protocol);
    let mut interface = function.interface();
    let number = interface.interface_number();
    let mut setting = interface.alt_setting(class, subclass, protocol, None);
    let ends = (setting.endpoint_bulk_out(None, PACKET), setting.endpoint_bulk_in(None, PACKET));
    drop(function);
    builder.handler(REQUESTS.init(Requests { interface: number, shared }));
    ends
}

/// What has come to the intake.
enum Came {
    Packet(usize),
    End(End),
    Time,
    /// The endpoint is disabled.
    Nothing,
}

/// Takes what an operating system prints.
#[embassy_executor::task]
pub async fn run(shared: &'static Shared, mut endpoint: BulkOut, _silent: BulkIn) -> ! {
    let mut intake = Intake::new();
    let now_us = || Instant::now().as_ticks();
    loop {
        endpoint.wait_enabled().await;
        intake.connect(now_us());
        loop {
            let came = match intake.next() {
                Next::Packet(until_us) => {
                    let time = Timer::at(Instant::from_ticks(until_us));
                    match select3(endpoint.read(intake.buffer()), shared.printer_end.wait(), time).await {
                        Either3::First(Ok(count)) => Came::Packet(count),
                        Either3::First(Err(_)) => Came::Nothing,
                        Either3::Second(end) => Came::End(end),
                        Either3::Third(()) => Came::Time,
                    }
                }
                Next::Time(at_us) => {
                    let time = Timer::at(Instant::from_ticks(at_us));
                    match select(time, shared.printer_end.wait()).await {
                        Either::First(()) => Came::Time,
                        Either::Second(end) => Came::End(end),
                    }
                }
            };
            shared.engine(|engine| match came {
                Came::Packet(count) => intake.receive(count, engine, now_us()),
                Came::End(end) => intake.end(end, engine, now_us()),
                Came::Time => intake.wake(engine, now_us()),
                Came::Nothing => intake.end(End::Gone, engine, now_us()),
            });
            shared.wake(Side::Work);
            if matches!(came, Came::Nothing) {
                break;
            }
        }
    }
}
