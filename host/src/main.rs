//! The program. Exit codes: 0 success, 1 failure, 2 usage error, 130 interrupted.

use std::process::ExitCode;

fn main() -> ExitCode {
    let code = program::cli::main();
    #[cfg(windows)]
    window::stay();
    code
}

/// The window that Windows opens for a program that was double-clicked, or on which a file was dropped.
#[cfg(windows)]
mod window {
    use std::io::{IsTerminal as _, stderr, stdin};

    #[link(name = "kernel32")]
    unsafe extern "system" {
        fn GetConsoleProcessList(list: *mut u32, length: u32) -> u32;
    }

    /// A window that is this program's alone closes with it: so it stays until what was said has been read.
    #[expect(clippy::disallowed_methods, reason = "nothing is written but a sentence of the program's own")]
    pub fn stay() {
        if !(stdin().is_terminal() && stderr().is_terminal()) {
            return;
        }
        let mut first = 0;
        // SAFETY: `first` has room for the one number that is announced; where there are more, none is written.
        let programs = unsafe { GetConsoleProcessList(&mut first, 1) };
        if programs == 1 {
            eprint!("\nPress Enter to close this window. ");
            // Whatever ends the line closes it, an error as well.
            let _ = stdin().read_line(&mut String::new());
        }
    }
}
