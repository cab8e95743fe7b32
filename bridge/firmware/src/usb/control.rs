//! Control requests that a host gives up, and those that want nothing.
//!
//! Problem: a host may give up a control request in the middle: its process has died, a serial port was closed, the cable has had a
//! glitch. `embassy_rp` 0.10 then waits for the rest of that request, and looks neither at the next one nor at a bus reset, so that the
//! board stays deaf until its supply is taken (embassy-rs #2751, #3868; upstream's cure, #6694, is in no release yet). And a
//! request to the host of length 0 has no data, so its status goes the other way; `embassy_usb` 0.6 answers none.
//! Method: a driver around the driver. While a request is served, the controller is asked every millisecond whether another
//! one or a bus reset has come; then what is armed for the old one is taken back, and it fails.
//! Limits: the requests that come behind one that was given up may get that one's bytes, until the host resets the bus, as hosts do
//! then. What still goes deaf is restarted by [`crate::watch`].
//! Source: RP2040 data sheet, 4.1.2.8; USB 2.0, 8.5.3 and 9.3.1.

use embassy_futures::select::{Either, select};
use embassy_rp::pac;
use embassy_time::Timer;
use embassy_usb::driver::{
    ControlPipe, Driver, EndpointAddress, EndpointAllocError, EndpointError, EndpointType,
};

/// A driver whose control pipe notices what the host has given up.
pub struct Watchful<D>(pub D);

impl<'a, D: Driver<'a>> Driver<'a> for Watchful<D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = Pipe<D::ControlPipe>;
    type Bus = D::Bus;

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
        (bus, Pipe(pipe))
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
