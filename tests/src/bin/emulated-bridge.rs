//! The emulated bridge for people: `cargo xtask emulator --serve`.
//!
//! A bridge with a simulated MD-5500 at it, until standard input ends. Cartridges are put in as the printer asks for
//! them; every sheet that comes out is kept as the bytes that made it.

#[cfg(unix)]
fn main() -> std::process::ExitCode {
    match unix::run() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("failed: {error}");
            std::process::ExitCode::FAILURE
        }
    }
}

#[cfg(not(unix))]
fn main() {
    eprintln!("the emulated bridge needs pseudo-terminals, which this system does not have");
    std::process::exit(1);
}

#[cfg(unix)]
mod unix {
    use std::io::{self, BufRead as _};
    use std::path::PathBuf;
    use std::sync::mpsc::{RecvTimeoutError, channel};
    use std::time::Duration;

    use foilpress_tests::emulated::Emulated;
    use press::simulate::{Carousel, CarouselError, Lever, Printer, Stock, Trouble};
    use protocol::ink::Ink;
    use protocol::paper::Paper;

    const ORDERS: &str = "orders: replug (the USB cable), cover (open, then close), paper (out, then in), power (the \
                          printer's, off, then on), figures, quit";

    pub fn run() -> io::Result<()> {
        let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
        let [image, scripts, folder] = &args[..] else {
            return Err(io::Error::other("usage: emulated-bridge IMAGE.uf2 SCRIPTS FOLDER"));
        };
        std::fs::create_dir_all(folder)?;
        let printer = Printer::new(Carousel::new(&[]).map_err(io::Error::other)?, Lever::Auto);
        let mut bridge = Emulated::start(image, scripts, folder, printer, Stock::of(Paper::A4))?;
        println!("a bridge is at serial:{}\n{ORDERS}", bridge.port().display());

        let (orders, order) = channel();
        std::thread::spawn(move || {
            for line in io::stdin().lock().lines().map_while(Result::ok) {
                if orders.send(line).is_err() {
                    return;
                }
            }
        });
        let mut trouble = None;
        let (mut kept, mut resets, mut on) = (0, 0, true);
        loop {
            match order.recv_timeout(Duration::from_millis(100)) {
                Ok(order) => match order.trim() {
                    "replug" => bridge.replug()?,
                    "cover" => open_or_close(&mut bridge.desk().printer),
                    "paper" => take_or_load(&mut bridge.desk().printer),
                    "power" => {
                        on = !on;
                        bridge.desk().switch(on);
                        println!("printer: switched {}", if on { "on" } else { "off" });
                    }
                    "figures" => println!("{}", bridge.figures()?),
                    "quit" => return Ok(()),
                    _ => println!("{ORDERS}"),
                },
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let mut desk = bridge.desk();
            if trouble != desk.printer.trouble() {
                trouble = desk.printer.trouble();
                println!(
                    "printer: {}",
                    trouble.map_or_else(|| "goes on".into(), |trouble| trouble.to_string())
                );
            }
            if let Some(Trouble::RibbonMismatch { wanted }) = trouble
                && let Some(ink) = Ink::from_barcode(wanted)
            {
                println!("operator: puts in {}", ink.name());
                put_in(&mut desk.printer, ink).map_err(io::Error::other)?;
            }
            if desk.resets > resets {
                resets = desk.resets;
                println!("printer: reset through the port");
            }
            if let Some(refused) = desk.refused.take() {
                println!("printer: does not understand: {refused}; it is switched off and on");
                desk.printer.power_cycle();
                desk.printed.clear();
            }
            while kept < desk.sheets.len() {
                let passes = desk.sheets[kept].passes.len();
                kept += 1;
                let path = folder.join(format!("sheet-{kept}.rgl"));
                std::fs::write(&path, std::mem::take(&mut desk.printed))?;
                println!("printer: sheet {kept} of {passes} passes; its bytes are in {}", path.display());
            }
        }
    }

    fn open_or_close(printer: &mut Printer) {
        match printer.trouble() {
            Some(Trouble::CoverOpen) => printer.close_cover(),
            _ => printer.strike(Trouble::CoverOpen),
        }
    }

    fn take_or_load(printer: &mut Printer) {
        match printer.trouble() {
            Some(Trouble::NoPaper) => printer.load(Stock::of(Paper::A4)),
            _ => printer.strike(Trouble::NoPaper),
        }
    }

    /// Puts a cartridge in, for another one if seven are in.
    fn put_in(printer: &mut Printer, ink: Ink) -> Result<(), CarouselError> {
        match printer.insert(ink.into()) {
            Err(CarouselError::TooMany(_)) => {
                let _ = (0..0x3f).find_map(|barcode| printer.remove(barcode));
                printer.insert(ink.into())
            }
            result => result,
        }
    }
}
