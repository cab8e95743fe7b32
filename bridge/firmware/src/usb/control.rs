//! Control requests that a host gives up, those that want nothing, and those that end a halt.
//!
//! Problem: a host may give up a control request in the middle: its process has died, a serial port was closed, the cable has had a
//! glitch. `embassy_rp` 0.10 then waits for the rest of that request, and looks neither at the next one nor at a bus reset, so that the
//! board stays deaf until its supply is taken (embassy-rs #2751, #3868; upstream's cure, #6694, is in no release yet). And a
//! request to the host of length 0 has no data, so its status goes the other way; `embassy_usb` 0.6 answers none.
//! And behind CLEAR_FEATURE(ENDPOINT_HALT), which some hosts send with every transfer they give up, an endpoint has to go on with DATA0,
//! halted or not; `embassy_rp` leaves its toggle, and then the controller takes the host's next packet for a repetition and drops it.
//! Method: a driver around the driver. While a request is served, the controller is asked every millisecond whether another
//! one or a bus reset has come; then what is armed for the old one is taken back, and it fails. Behind the end of a halt what is armed is
//! taken back and armed again, as DATA0.
//! Limits: the requests that come behind one that was given up may get that one's bytes, until the host resets the bus, as hosts do
//! then. What still goes deaf is restarted by [`crate::watch`].
//! Source: RP2040 data sheet, 4.1.2.8; USB 2.0, 8.5.3, 9.3.1 and 9.4.5.

use crate::board;
use embassy_futures::select::{Either, select};
use embassy_rp::pac;
use embassy_time::Timer;
use embassy_usb::driver::{
    Bus, ControlPipe, Direction, Driver, EndpointAddress, EndpointAllocError, EndpointError, EndpointType,
    Event, Unsupported,
};

/// Longer than the longest packet takes on the bus.
const PACKET_NS: u32 = 60_000;

/// Between the other bits of a buffer's control and the one that hands it over, the controller's clock has to tick.
const HAND_OVER: u32 = 12;

/// A driver whose control pipe notices what the host has given up, and whose bus ends halts as it should.
pub struct Watchful<D>(pub D);

impl<'a, D: Driver<'a>> Driver<'a> for Watchful<D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = Pipe<D::ControlPipe>;
    type Bus = Halts<D::Bus>;

    fn alloc_endpoint_out(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        packet: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        self.0.alloc_endpoint_out(kind, address, packet, interval_ms)
    }

    fn alloc_endpoint_in(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        packet: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        self.0.alloc_endpoint_in(kind, address, packet, interval_ms)
    }

    fn start(self, packet: u16) -> (Self::Bus, Self::ControlPipe) {
        let (bus, pipe) = self.0.start(packet);
        (Halts(bus), Pipe(pipe))
    }
}

/// The bus.
pub struct Halts<B>(B);

impl<B: Bus> Bus for Halts<B> {
    async fn enable(&mut self) {
        self.0.enable().await;
    }

    async fn disable(&mut self) {
        self.0.disable().await;
    }

    async fn poll(&mut self) -> Event {
        self.0.poll().await
    }

    fn endpoint_set_enabled(&mut self, endpoint: EndpointAddress, enabled: bool) {
        self.0.endpoint_set_enabled(endpoint, enabled);
    }

    fn endpoint_set_stalled(&mut self, endpoint: EndpointAddress, stalled: bool) {
        self.0.endpoint_set_stalled(endpoint, stalled);
        if !stalled && endpoint.index() > 0 {
            begin_with_data0(endpoint);
        }
    }

    fn endpoint_is_stalled(&mut self, endpoint: EndpointAddress) -> bool {
        self.0.endpoint_is_stalled(endpoint)
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        self.0.remote_wakeup().await
    }
}

/// The next packet of an endpoint is DATA0, whether it is armed already or will be.
fn begin_with_data0(endpoint: EndpointAddress) {
    let control = match endpoint.direction() {
        Direction::In => pac::USB_DPRAM.ep_in_buffer_control(endpoint.index()),
        Direction::Out => pac::USB_DPRAM.ep_out_buffer_control(endpoint.index()),
    };
    let is_armed = control.read().available(0);
    control.modify(|w| w.set_available(0, false));
    if is_armed {
        // One that is under way comes to its end.
        cortex_m::asm::delay(board::cycles(PACKET_NS));
    }
    // A buffer to the host is full until it is sent, and one from the host when something has come.
    if is_armed && control.read().full(0) == endpoint.is_in() {
        control.modify(|w| w.set_pid(0, false));
        cortex_m::asm::delay(HAND_OVER);
        control.modify(|w| w.set_available(0, true));
    } else {
        // Whoever arms it takes the other one.
        control.modify(|w| w.set_pid(0, true));
    }
}

/// The control pipe.
pub struct Pipe<P>(P);

impl<P: ControlPipe> ControlPipe for Pipe<P> {
    fn max_packet_size(&self) -> usize {
        self.0.max_packet_size()
    }

    async fn setup(&mut self) -> [u8; 8] {
        loop {
            let setup = self.0.setup().await;
            let [kind, .., low, high] = setup;
            if kind & 0x80 == 0 || (low, high) != (0, 0) {
                return setup;
            }
            self.accept().await;
        }
    }

    async fn data_out(&mut self, buffer: &mut [u8], first: bool, last: bool) -> Result<usize, EndpointError> {
        match select(self.0.data_out(buffer, first, last), given_up()).await {
            Either::First(result) => result,
            Either::Second(()) => Err(EndpointError::Disabled),
        }
    }

    async fn data_in(&mut self, data: &[u8], first: bool, last: bool) -> Result<(), EndpointError> {
        match select(self.0.data_in(data, first, last), given_up()).await {
            Either::First(result) => result,
            Either::Second(()) => Err(EndpointError::Disabled),
        }
    }

    async fn accept(&mut self) {
        select(self.0.accept(), given_up()).await;
    }

    async fn reject(&mut self) {
        self.0.reject().await;
    }

    async fn accept_set_address(&mut self, address: u8) {
        select(self.0.accept_set_address(address), given_up()).await;
    }
}

/// Waits until the host has given up the request that is being served, and takes back what was armed for it.
async fn given_up() {
    loop {
        let status = pac::USB.sie_status().read();
        if status.bus_reset() || status.setup_rec() {
            break;
        }
        Timer::after_millis(1).await;
    }
    pac::USB_DPRAM.ep_in_buffer_control(0).write(|_| {});
    pac::USB_DPRAM.ep_out_buffer_control(0).write(|_| {});
}
