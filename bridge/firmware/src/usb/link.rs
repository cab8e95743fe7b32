//! The link's endpoints: packets to and from the library's [`Links`](bridge::links::Links), which decides who is answered.

use super::{BulkIn, BulkOut, PACKET, Usb};
use crate::shared::{Shared, Side};
use crate::{retained, stack, trace};
use bridge::links::Way;
use embassy_futures::select::{Either, select};
use embassy_usb::class::cdc_acm::{ControlChanged, Receiver, Sender};
use embassy_usb::driver::{Endpoint, EndpointError, EndpointIn, EndpointOut};
use protocol::link::frame::MAX;
use protocol::link::message::{DATA_MAX, Usage};
use static_cell::StaticCell;

/// One less than a packet: a full one would have to be followed by an empty one for the host to stop waiting.
const PORTION: usize = PACKET as usize - 1;

/// Reads the serial port.
#[embassy_executor::task]
pub async fn serial(
    shared: &'static Shared,
    mut serial: Receiver<'static, Usb>,
    lines: ControlChanged<'static>,
) -> ! {
    let mut packet = [0; PACKET as usize];
    loop {
        serial.wait_connection().await;
        loop {
            match select(serial.read_packet(&mut packet), lines.control_changed()).await {
                Either::First(Ok(count)) => shared.hear(Way::Serial, &packet[..count]),
                Either::First(Err(_)) => break,
                Either::Second(()) => {
                    shared.links(|links, engine| links.data_terminal_ready(serial.dtr(), engine));
                }
            }
        }
        shared.links(|links, engine| links.lost(Way::Serial, engine));
    }
}

/// Reads the bulk endpoint.
#[embassy_executor::task]
pub async fn bulk(shared: &'static Shared, mut endpoint: BulkOut) -> ! {
    let mut packet = [0; PACKET as usize];
    loop {
        endpoint.wait_enabled().await;
        while let Ok(count) = endpoint.read(&mut packet).await {
            shared.hear(Way::Bulk, &packet[..count]);
        }
        shared.links(|links, engine| links.lost(Way::Bulk, engine));
    }
}

/// Writes frames to whoever is to be answered.
#[embassy_executor::task]
pub async fn answer(shared: &'static Shared, mut serial: Sender<'static, Usb>, mut bulk: BulkIn) -> ! {
    static FRAME: StaticCell<[u8; MAX]> = StaticCell::new();
    let frame = FRAME.init([0; MAX]);
    loop {
        shared.wait(Side::Link).await;
        while let Some(way) = shared.links(|links, _| links.speaker()) {
            let length = shared.engine(|engine| {
                if let Some(from) = engine.log_wanted() {
                    let (at, end, count) = retained::read_log(from, &mut frame[..DATA_MAX]);
                    engine.log(at, end, &frame[..count]);
                }
                if engine.usage_wanted() {
                    engine.usage(Usage {
                        fixed: stack::fixed(),
                        stack: stack::size(),
                        stack_used: stack::used(),
                        longest_us: trace::longest_us(),
                    });
                }
                engine.transmit(frame)
            });
            if length == 0 {
                break;
            }
            shared.speaker_changed.reset();
            let send = async {
                for portion in frame[..length].chunks(PORTION) {
                    match way {
                        Way::Serial => serial.write_packet(portion).await?,
                        Way::Bulk => bulk.write(portion).await?,
                    }
                }
                Ok::<(), EndpointError>(())
            };
            // A host that has gone silent must not keep the other one from being answered. What it misses of a frame
            // it finds out by the checksum.
            match select(send, shared.speaker_changed.wait()).await {
                Either::First(Ok(())) | Either::Second(()) => {}
                Either::First(Err(_)) => shared.links(|links, engine| links.silence(way, engine)),
            }
        }
    }
}
