//! `sonard doctor`.

mod clock;
mod echo;
mod examine;
mod foreign_sender;
mod line;
mod port_monitor;
mod report;
mod tap;

use super::{Failure, Outcome, interruptible};
use crate::link::{self, SerialPortInfo};
use report::Report;

/// Options of `sonard doctor`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Do not move the motor
    #[arg(long)]
    no_motion: bool,
    /// Number of pings
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pings: u32,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
}

pub(super) const ABOUT: &str = "\
Diagnose a ranger: port, firmware, motor, echo.

With --port it opens that port, identifies the board, tests the serial line, turns the motor a few \
steps back and forth, transmits some pings, and compares the board's clock with this computer's. \
Each check reports its result and, if something is wrong, what to do. If another program visible \
to this user has the port open, it is named, and nothing is moved. Without --port it lists the \
serial ports by their stable names and opens none of them, because other devices may react to \
it.";

const EXAMPLES: &str = "\
Examples:
  sonard doctor                                  # which ports are there?
  sonard doctor --port /dev/ttyACM0
  sonard doctor --port LAB-000042 --no-motion --json

Point the ranger at a wall 0.5 to 5 m away. The motor turns by 25 steps at 200 steps/s; keep clear \
of the transducer, which carries 400 V while it fires.

With --json, `checks` holds objects {check, status, detail, cause, help}. status is ok, warning, \
failed or skipped; cause is null or one of not_found, ambiguous, permission, busy (another program \
has the port open), not_serial, port_error, cable, silent, wrong_firmware, wrong_version, \
login_prompt, modem (commands or replies of one), echo (the line returns what is sent), settings \
(another program changed the line's), power, line, latency, emergency_stop, motor, missing_echo, stuck_echo, echo_time (before the end of the blanking or after the window), scatter (readings \
that disagree), clock (stopped, or wrong rate), device.

Exit codes: 0 all checks passed, or warnings only (or ports listed), 1 the board works but a check failed, 2 wrong \
usage, 3 no port, no board or no link to it.";

pub(super) fn run(args: &Args) -> Outcome {
    let Some(port) = &args.port else {
        let candidates =
            link::list_ports().map_err(|error| Failure::device(&error, error.help()))?;
        return list(&candidates, args.json);
    };
    let report = interruptible::run_interruptible(async |interrupts| {
        Ok(examine::examine(port, args, interrupts).await)
    })?;
    report.print(args.json)?;
    report.outcome()
}

/// Checks a port and the board on it without motion, and returns the checks as JSON.
///
/// # Errors
///
/// An interrupt, or a failed start of the runtime.
pub(super) fn check_without_motion(port: &str) -> Result<String, Failure> {
    let args = Args { port: Some(port.to_owned()), no_motion: true, pings: 10, json: true };
    let report = interruptible::run_interruptible(async |interrupts| {
        Ok(examine::examine(port, &args, interrupts).await)
    })?;
    Ok(serde_json::to_string_pretty(&report).unwrap_or_default())
}

fn list(candidates: &[SerialPortInfo], json: bool) -> Outcome {
    if json {
        let text = serde_json::json!({ "port": null, "candidates": candidates }).to_string();
        print_line!("{text}");
    } else {
        for SerialPortInfo { port, id, usb } in candidates {
            let name = id.as_deref().unwrap_or(port);
            let path = id.as_ref().map_or_else(String::new, |_| format!("  ({port})"));
            let usb = usb.as_ref().map_or_else(String::new, |usb| format!("  {usb}"));
            print_line!("{name}{path}{usb}");
        }
    }
    if candidates.is_empty() {
        return Err(Failure::device(
            "no serial port found",
            "connect the board; if it is connected, the cable may be for charging only, or `dmesg` \
             shows why it is not recognised",
        ));
    }
    if !json {
        notice!("no port was opened; `sonard doctor --port NAME` checks one");
    }
    Ok(())
}

impl Report {
    /// Returns the exit code of the report.
    fn outcome(&self) -> Outcome {
        match self.worst() {
            None => Ok(()),
            Some(check) if check.reaches_device() => Err(Failure::Found(None)),
            Some(check) => Err(Failure::device(&check.detail, check.help.as_deref().unwrap_or(""))),
        }
    }
}
