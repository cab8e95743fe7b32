//! The program. Exit codes: 0 success, 1 failure, 2 usage error, 130 interrupted.

use std::process::ExitCode;

fn main() -> ExitCode {
    foilpress::cli::main()
}
