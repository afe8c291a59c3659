//! Checks of one board, in order: each needs the previous ones.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use firmware_protocol::{
    host::{Command, HostError, HostEvent, Outcome},
    messages::{Blanking, Capabilities, Identity, NakReason, Reading, ResetCause, Settings},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    time::{sleep, timeout},
};
use tokio_serial::SerialStream;

use super::{
    Args,
    clock::{self, Exchange},
    echo,
    foreign_sender::ForeignSender,
    line::{self, RequestStats},
    port_monitor::PortMonitor,
    report::{Cause, Check, Report},
    tap::Tap,
};
use crate::{
    cli::{runtime::Interrupts, scan::ATTEMPTS},
    link::{self, LinkError},
    ranger::{CommandResult, DriveError, Driver, hold_s, serial_text},
};

/// Steps that the motor is turned forth and back.
const TURN_STEPS: i32 = 25;
/// Number of requests for the check of the line.
const REQUESTS: u32 = 20;
/// Minimum time over which the board's clock is compared, microseconds.
const CLOCK_SPAN_US: u64 = 1_500_000;
/// Time allowed for a late reply.
const LATEST: Duration = Duration::from_secs(5);

/// Settings gentle to the motor, with the module's full range: 62 ms, 10.7 m.
const SETTINGS: Settings = Settings {
    window_ticks: 124_000,
    min_interval_ticks: 200_000,
    settle_ticks: 20_000,
    max_echoes: 1,
    blanking: Blanking::Internal,
    speed: 200,
    acceleration: 2_000,
    hold_s: 0,
};

/// Examines the board at `port` until a check makes the following ones impossible.
pub(super) async fn examine(port: &str, args: &Args, interrupts: Interrupts) -> Report {
    let mut report = Report { port: port.to_owned(), checks: Vec::new() };
    let line = match link::open(port) {
        Ok(line) => line,
        Err(error) => {
            report.checks.push(no_port(&error));
            return report;
        }
    };
    let monitor = PortMonitor::new(port, &line);
    report.checks.push(monitor.check_port());
    if report.worst().is_some() {
        report.checks.push(Check::skipped("rest", "another program uses the port"));
        return report;
    }
    report.checks.extend(monitor.check_adapter());
    let driver = Driver::new(Tap::new(line), link::host_config(ATTEMPTS));
    let mut board = BoardUnderTest { driver, restarts: 0, exchanges: Vec::new() };
    tokio::select! {
        examined = board.examine(args, &mut report.checks) => {
            match examined {
                // The cause is listed before its consequences.
                Ok(()) => {
                    let broken = report.worst().is_some();
                    let cause = monitor.check_settings().or_else(|| {
                        Some(monitor.check_port()).filter(|check| broken && check.cause.is_some())
                    });
                    report.checks.splice(1..1, cause);
                }
                Err(error) => {
                    let check = explain_missing_identity(&error, board, &monitor).await;
                    report.checks.push(check);
                }
            }
            return report;
        }
        () = interrupts.wait() => {
            report.checks.push(Check::skipped("rest", "interrupted"));
            // A running scan or motion must not continue.
            let _ = board.perform(Command::Stop).await;
        }
    }
    report
}

fn no_port(error: &LinkError) -> Check {
    let cause = match error {
        LinkError::NotFound { .. } | LinkError::OtherDevice { .. } => Cause::NotFound,
        LinkError::Ambiguous { .. } => Cause::Ambiguous,
        LinkError::Permission(_) | LinkError::DevicePolicy(_) => Cause::Permission,
        LinkError::Busy { .. } => Cause::Busy,
        LinkError::NotSerial(_) => Cause::NotSerial,
        LinkError::NotListed { .. } | LinkError::Io { .. } => Cause::PortError,
    };
    Check::failed("port", cause, error.to_string(), error.help())
}

struct BoardUnderTest {
    driver: Driver<Tap<SerialStream>>,
    /// Number of observed resets.
    restarts: u32,
    /// Clock readings since the board's last reset.
    exchanges: Vec<Exchange>,
}

/// Readings received during a command.
#[derive(Default)]
struct CommandReadings {
    readings: Vec<Reading>,
}

impl BoardUnderTest {
    async fn examine(&mut self, args: &Args, checks: &mut Vec<Check>) -> Result<(), DriveError> {
        let identity = self.identify().await?;
        checks.push(answered(&identity));
        checks.push(last_reset(&identity));
        let line = self.line().await;
        let broken = line.cause == Some(Cause::Cable);
        checks.push(line);
        if broken {
            return Ok(());
        }
        let settings = Settings { hold_s: hold_s(&identity), ..SETTINGS };
        checks.push(match args.no_motion {
            true => Check::skipped("motor", "--no-motion"),
            false => self.motor(&identity, settings).await,
        });
        if checks.last().is_some_and(|check| check.cause == Some(Cause::Cable)) {
            return Ok(());
        }
        let echo = self.echo(args.pings, settings).await;
        let device_failed = matches!(echo.cause, Some(Cause::Cable | Cause::Power));
        checks.push(echo);
        checks.push(match device_failed {
            true => Check::skipped("clock", "needs a connected board"),
            false => self.clock(&identity).await,
        });
        Ok(())
    }

    /// Identifies the board and stops its current operation.
    async fn identify(&mut self) -> Result<Identity, DriveError> {
        let Self { driver, restarts, exchanges } = self;
        let identified = driver.identify_and_stop(|event| {
            if matches!(event, HostEvent::Rebooted { .. }) {
                *restarts += 1;
                exchanges.clear();
            }
            ControlFlow::Continue(())
        });
        identified.await
    }

    /// Checks round-trip time, loss and damage of frames.
    async fn line(&mut self) -> Check {
        let before = *self.driver.host().stats();
        let mut longest = Duration::ZERO;
        for _ in 0..REQUESTS {
            let began = Instant::now();
            if let Err(error) = self.perform(Command::Status).await {
                return device_failed("line", &error);
            }
            longest = longest.max(began.elapsed());
        }
        if self.driver.host().stats().retries > before.retries {
            // Replies still under way are late, not lost.
            let _ = timeout((2 * longest).min(LATEST), self.driver.idle()).await;
        }
        let after = *self.driver.host().stats();
        line::check_line(&RequestStats { requests: REQUESTS, before, after, longest })
    }

    /// Compares the board's clock with this computer's, over all requests so far.
    async fn clock(&mut self, identity: &Identity) -> Check {
        if identity.capabilities.has(Capabilities::VIRTUAL_CLOCK) {
            return Check::skipped("clock", "virtual clock");
        }
        let began_us = self.exchanges.first().map_or(0, |exchange| exchange.sent_us);
        let spent_us = self.driver.now_us().saturating_sub(began_us);
        sleep(Duration::from_micros(CLOCK_SPAN_US.saturating_sub(spent_us))).await;
        for _ in 0..REQUESTS {
            if let Err(error) = self.perform(Command::Status).await {
                return device_failed("clock", &error);
            }
        }
        clock::check_clock(&self.exchanges, identity.tick_hz)
    }

    async fn motor(&mut self, identity: &Identity, settings: Settings) -> Check {
        let has_index = identity.capabilities.has(Capabilities::INDEX_SENSOR);
        // With an index sensor, home from the current position: a motor that loses the same number
        // of steps in both directions would otherwise pass.
        let back = if has_index { Command::Home } else { Command::MoveTo { step: 0 } };
        let turn = Command::MoveTo { step: TURN_STEPS };
        let mut drift = None;
        for command in [Command::Configure(settings), Command::Home, turn, back] {
            match self.perform(command).await {
                Ok((CommandResult::Done(Outcome::Homed { drift_steps }), _)) => {
                    drift = Some(drift_steps);
                }
                Ok(_) => {}
                Err(error) => return motor_failed(&error),
            }
        }
        let turned = format!("turned by {TURN_STEPS} steps and back");
        if !has_index {
            return Check::ok("motor", format!("{turned}; not verified, no index sensor"));
        }
        match drift.unwrap_or(0) {
            0 => Check::ok("motor", format!("{turned}; no index error")),
            drift => Check::failed(
                "motor",
                Cause::Motor,
                format!("{turned}, but with an index error of {drift} steps"),
                "the motor loses steps: check its supply and the driver's current, that it turns \
                 freely, and its four wires; or the index sensor triggers at two positions",
            ),
        }
    }

    async fn echo(&mut self, pings: u32, settings: Settings) -> Check {
        // A reset of the board before this check has been reported.
        if self.driver.host().identity().is_none()
            && let Err(error) = self.identify().await
        {
            return device_failed("echo", &error);
        }
        if let Err(error) = self.perform(Command::Configure(settings)).await {
            return device_failed("echo", &error);
        }
        let before = self.restarts;
        let mut readings = Vec::new();
        for _ in 0..pings {
            match self.perform(Command::Ping).await {
                Ok((_, collected)) => readings.extend(collected.readings),
                Err(DriveError::Host(HostError::Rebooted)) => {
                    return weak_supply(self.restarts - before, &readings);
                }
                Err(error) => return device_failed("echo", &error),
            }
        }
        echo::check_echoes(&readings, SETTINGS.window_ticks)
    }

    async fn perform(
        &mut self,
        command: Command,
    ) -> Result<(CommandResult, CommandReadings), DriveError> {
        let mut collected = CommandReadings::default();
        let Self { driver, restarts, exchanges } = self;
        let ended = driver
            .perform(command, |event| {
                match event {
                    HostEvent::Reading { reading, .. } => collected.readings.push(reading),
                    HostEvent::Rebooted { .. } => {
                        *restarts += 1;
                        exchanges.clear();
                    }
                    HostEvent::ClockSample {
                        sent_us,
                        received_us,
                        device_ticks,
                        retried: false,
                    } => {
                        exchanges.push(Exchange { sent_us, received_us, device_ticks });
                    }
                    _ => {}
                }
                ControlFlow::Continue(())
            })
            .await?;
        Ok((ended, collected))
    }
}

/// Time allowed for a terminal or modem to react to an empty line.
const REACTION: Duration = Duration::from_millis(700);

/// Explains why a board did not identify itself. Other users of the line are considered first,
/// because they are easier to remedy than a missing firmware.
async fn explain_missing_identity(
    error: &DriveError,
    board: BoardUnderTest,
    monitor: &PortMonitor,
) -> Check {
    use HostError as Host;
    let DriveError::Host(host @ (Host::NoAnswer { .. } | Host::NotADevice { .. })) = error else {
        return no_answer(error);
    };
    let mut line = board.driver.into_line();
    // A silent login or modem responds to an empty line.
    let _ = timeout(REACTION, async {
        line.write_all(b"\r\n").await?;
        let mut buffer = [0; 256];
        while line.read(&mut buffer).await? > 0 {}
        Ok::<(), std::io::Error>(())
    })
    .await;
    if let Some(check) = monitor.explain(&line.received, &line.sent) {
        return check;
    }
    let check = no_answer(&DriveError::Host(*host));
    match (monitor.may_hide_programs(), check.help) {
        (true, Some(help)) => Check {
            help: Some(format!(
                "programs of other users are hidden: `sudo sonard doctor` or `sudo fuser -v PORT` \
                 shows whether one reads the port; if none does, {help}"
            )),
            ..check
        },
        (_, help) => Check { help, ..check },
    }
}

fn no_answer(error: &DriveError) -> Check {
    match error {
        DriveError::Host(HostError::NoAnswer { .. }) => Check::failed(
            "board",
            Cause::Silent,
            "no reply: the port exists, but not a byte was received",
            "check that the port is the ranger's and, on a separate serial adapter, that the board \
             has power and TX and RX are crossed; if the port is the board's USB, its program is not \
             running: flash the firmware (firmware/README.md)",
        ),
        DriveError::Host(HostError::NotADevice { bytes }) => Check::failed(
            "board",
            Cause::WrongFirmware,
            format!("{bytes} bytes were received, but no valid frame"),
            ForeignSender::OtherRate.help(),
        ),
        DriveError::Host(HostError::InvalidIdentity(_)) => {
            Check::failed("board", Cause::WrongFirmware, error.to_string(), error.help())
        }
        DriveError::Host(HostError::WrongVersion { .. }) => {
            Check::failed("board", Cause::WrongVersion, error.to_string(), error.help())
        }
        error => device_failed("board", error),
    }
}

/// Check failed by a device error.
fn device_failed(check: &'static str, error: &DriveError) -> Check {
    let cause = match error {
        DriveError::Host(HostError::Hangup) => Cause::Cable,
        DriveError::Host(HostError::Rebooted) => Cause::Power,
        DriveError::Host(HostError::NoAnswer { .. }) => Cause::Cable,
        DriveError::Host(HostError::EmergencyStop) => Cause::EmergencyStop,
        _ => Cause::Device,
    };
    Check::failed(check, cause, error.to_string(), error.help())
}

fn answered(identity: &Identity) -> Check {
    let firmware = identity.firmware;
    let kind = if identity.capabilities.has(Capabilities::REPLAYED) {
        " (a replayed log)"
    } else if identity.capabilities.has(Capabilities::SIMULATED) {
        " (a mock)"
    } else if identity.capabilities.has(Capabilities::EMULATED) {
        " (an emulator)"
    } else {
        ""
    };
    Check::ok(
        "board",
        format!(
            "{}{kind}, firmware {}.{}.{}, protocol {}, {} steps per revolution",
            serial_text(identity),
            firmware.major,
            firmware.minor,
            firmware.patch,
            identity.protocol.version,
            identity.steps_per_revolution,
        ),
    )
}

fn last_reset(identity: &Identity) -> Check {
    let cause = match identity.reset_cause {
        ResetCause::Unknown => "unknown",
        ResetCause::PowerOn => "power-on",
        ResetCause::External => "reset pin",
        ResetCause::BrownOut => "brown-out",
        ResetCause::Watchdog => "watchdog (the firmware hung)",
        ResetCause::Requested => "requested by a host",
    };
    let detail = format!("last reset: {cause}");
    match identity.reset_cause {
        ResetCause::BrownOut => Check::warning(
            "restart",
            Cause::Power,
            detail,
            "the module draws 2 A while it transmits: put 1000 uF next to it, and use a separate \
             supply instead of USB",
        ),
        ResetCause::Watchdog => Check::warning(
            "restart",
            Cause::Device,
            detail,
            "report it, with what the board was doing",
        ),
        _ => Check::ok("restart", detail),
    }
}

fn motor_failed(error: &DriveError) -> Check {
    let refused =
        |reason| matches!(error, DriveError::Host(HostError::Rejected(r)) if *r == reason);
    if refused(NakReason::IndexNotFound) {
        return Check::failed(
            "motor",
            Cause::Motor,
            "no index within one revolution",
            "if the motor did not turn: check its supply, the driver's ENABLE and current, and its \
             wires; if it did: check the index sensor, and its level in the EEPROM",
        );
    }
    if refused(NakReason::EmergencyStop) {
        let stop = DriveError::Host(HostError::EmergencyStop);
        return device_failed("motor", &stop);
    }
    match error {
        DriveError::Host(HostError::Rebooted) => {
            let check = weak_supply(1, &[]);
            Check {
                check: "motor",
                detail: "the board reset while the motor turned".into(),
                ..check
            }
        }
        DriveError::Host(HostError::MotionFault) => {
            Check::failed("motor", Cause::Motor, error.to_string(), error.help())
        }
        error => device_failed("motor", error),
    }
}

fn weak_supply(restarts: u32, readings: &[Reading]) -> Check {
    Check::failed(
        "echo",
        Cause::Power,
        format!("the board reset ({restarts}) after {} pings", readings.len()),
        "its supply sags when the module draws its 2 A: put 1000 uF next to the module, and use a \
         separate supply instead of USB",
    )
}
