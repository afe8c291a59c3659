//! The `sonard` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    sonard::cli::main()
}
