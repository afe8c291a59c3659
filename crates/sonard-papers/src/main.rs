//! The program `sonard-papers`.

use std::process::ExitCode;

mod cli;

fn main() -> ExitCode {
    cli::main()
}
