//! The program. Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.

use std::process::ExitCode;

fn main() -> ExitCode {
    foilpress::cli::main()
}
