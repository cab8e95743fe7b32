//! The task at the store: runs the library's [`Alone`] on this board.

use crate::flash::Area;
use crate::shared::{Shared, Side};
use bridge::alone::Alone;
use embassy_futures::select::select;
use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer};

/// Between two looks while nothing is due: the window of the link lasts for three times as long at the port's highest rate.
const PAUSE: Duration = Duration::from_millis(10);

/// Serves the store.
#[embassy_executor::task]
pub async fn serve(shared: &'static Shared, alone: &'static mut Alone<Area>) -> ! {
    loop {
        if shared.engine(|engine| alone.poll(engine, Instant::now().as_ticks())) {
            shared.wake(Side::Work);
            shared.wake(Side::Link);
            yield_now().await;
        } else {
            select(Timer::after(PAUSE), shared.wait(Side::Store)).await;
        }
    }
}
