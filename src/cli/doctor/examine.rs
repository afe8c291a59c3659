//! The examination of one board: each check needs the ones before it.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use firmware_protocol::{
    host::{Command, HostConfig, HostError, HostEvent, Outcome},
    messages::{Blanking, Capabilities, Identity, NakReason, Reading, ResetCause, Settings},
};
use tokio::time::{sleep, timeout};
use tokio_serial::SerialStream;

use super::{
    Args,
    clock::{self, Exchange},
    echo,
    line::{self, Questions},
    report::{Cause, Check, Report},
};
use crate::{
    cli::{runtime::Interrupts, scan::ATTEMPTS},
    link::{self, BAUD, LinkError},
    ranger::{DriveError, Driver, Ended, hold_s, serial_text},
};

/// Steps that the motor is turned by, there and back.
const TURN_STEPS: i32 = 25;
/// Exchanges that the line is judged by.
const EXCHANGES: u32 = 20;
/// Least time over which the board's clock is judged, microseconds.
const CLOCK_SPAN_US: u64 = 1_500_000;
/// How long an answer that came late may take at most to be awaited.
const LATEST: Duration = Duration::from_secs(5);

/// Gentle to the motor, and as far as the module hears: 62 ms, 10.7 m.
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

/// Examines the board at `port`, as far as one gets.
pub(super) async fn examine(port: &str, args: &Args, interrupts: Interrupts) -> Report {
    let mut report = Report { port: port.to_owned(), checks: Vec::new() };
    let line = match link::open(port) {
        Ok(line) => line,
        Err(error) => {
            report.checks.push(no_port(&error));
            return report;
        }
    };
    report.checks.push(Check::ok("port", "opened, and nobody else has it"));
    let config = HostConfig { max_attempts: ATTEMPTS, ..HostConfig::new(BAUD, rand::random()) };
    let driver = Driver::new(line, config);
    let mut patient = Patient { driver, restarts: 0, exchanges: Vec::new() };
    tokio::select! {
        () = patient.examine(args, &mut report.checks) => {}
        () = interrupts.wait() => {
            report.checks.push(Check::skipped("rest", "interrupted"));
            // Whatever turns must not go on turning.
            let _ = patient.perform(Command::Stop).await;
        }
    }
    report
}

fn no_port(error: &LinkError) -> Check {
    let cause = match error {
        LinkError::NotFound { .. } => Cause::NotFound,
        LinkError::Permission(_) => Cause::Permission,
        LinkError::Busy(_) => Cause::Busy,
        LinkError::NotSerial(_) => Cause::NotSerial,
        LinkError::Io { .. } => Cause::PortError,
    };
    Check::failed("port", cause, error.to_string(), error.help())
}

struct Patient {
    driver: Driver<SerialStream>,
    /// Restarts noticed.
    restarts: u32,
    /// What both clocks showed, since the board's last restart.
    exchanges: Vec<Exchange>,
}

/// What came of a command, beside its end.
#[derive(Default)]
struct Seen {
    readings: Vec<Reading>,
}

impl Patient {
    async fn examine(&mut self, args: &Args, checks: &mut Vec<Check>) {
        let identity = match self.identify().await {
            Ok(identity) => identity,
            Err(error) => return checks.push(no_answer(&error)),
        };
        checks.push(answered(&identity));
        checks.push(last_restart(&identity));
        let line = self.line().await;
        let broken = line.cause == Some(Cause::Cable);
        checks.push(line);
        if broken {
            return;
        }
        let settings = Settings { hold_s: hold_s(&identity), ..SETTINGS };
        checks.push(match args.no_motion {
            true => Check::skipped("motor", "--no-motion"),
            false => self.motor(&identity, settings).await,
        });
        if checks.last().is_some_and(|check| check.cause == Some(Cause::Cable)) {
            return;
        }
        let echo = self.echo(args.pings, settings).await;
        let gone = matches!(echo.cause, Some(Cause::Cable | Cause::Power));
        checks.push(echo);
        checks.push(match gone {
            true => Check::skipped("clock", "the board has to stay for that"),
            false => self.clock(&identity).await,
        });
    }

    /// Who it is; whatever it still does is stopped.
    async fn identify(&mut self) -> Result<Identity, DriveError> {
        let Self { driver, restarts, exchanges } = self;
        let identified = driver.take_over(|event| {
            if matches!(event, HostEvent::Rebooted { .. }) {
                *restarts += 1;
                exchanges.clear();
            }
            ControlFlow::Continue(())
        });
        identified.await
    }

    /// Round trips, loss and damage.
    async fn line(&mut self) -> Check {
        let before = *self.driver.host().stats();
        let mut longest = Duration::ZERO;
        for _ in 0..EXCHANGES {
            let began = Instant::now();
            if let Err(error) = self.perform(Command::Status).await {
                return gone("line", &error);
            }
            longest = longest.max(began.elapsed());
        }
        if self.driver.host().stats().retries > before.retries {
            // What is still under way is late, and no loss.
            let _ = timeout((2 * longest).min(LATEST), self.driver.idle()).await;
        }
        let after = *self.driver.host().stats();
        line::judge(&Questions { asked: EXCHANGES, before, after, longest })
    }

    /// The board's ticks beside this computer's clock, over the examination so far.
    async fn clock(&mut self, identity: &Identity) -> Check {
        if identity.capabilities.has(Capabilities::VIRTUAL_CLOCK) {
            return Check::skipped("clock", "it is virtual and jumps");
        }
        let began_us = self.exchanges.first().map_or(0, |exchange| exchange.sent_us);
        let spent_us = self.driver.now_us().saturating_sub(began_us);
        sleep(Duration::from_micros(CLOCK_SPAN_US.saturating_sub(spent_us))).await;
        for _ in 0..EXCHANGES {
            if let Err(error) = self.perform(Command::Status).await {
                return gone("clock", &error);
            }
        }
        clock::judge(&self.exchanges, identity.tick_hz)
    }

    async fn motor(&mut self, identity: &Identity, settings: Settings) -> Check {
        let has_index = identity.capabilities.has(Capabilities::INDEX_SENSOR);
        // With an index, home from where it stands: a motor that misses as much on its way back as
        // on its way there would look right.
        let back = if has_index { Command::Home } else { Command::MoveTo { step: 0 } };
        let turn = Command::MoveTo { step: TURN_STEPS };
        let mut drift = None;
        for command in [Command::Configure(settings), Command::Home, turn, back] {
            match self.perform(command).await {
                Ok((Ended::Done(Outcome::Homed { drift_steps }), _)) => drift = Some(drift_steps),
                Ok(_) => {}
                Err(error) => return motor_failed(&error),
            }
        }
        let turned = format!("turned by {TURN_STEPS} steps and back");
        if !has_index {
            return Check::ok(
                "motor",
                format!("{turned}; without an index sensor nobody checks it"),
            );
        }
        match drift.unwrap_or(0) {
            0 => Check::ok("motor", format!("{turned}; the index is where it was")),
            drift => Check::failed(
                "motor",
                Cause::Motor,
                format!("{turned}, but the index was {drift} steps off"),
                "the motor misses steps: check its supply and the driver's current, that nothing \
                 holds it, and its four wires; or the index sensor reads at two places",
            ),
        }
    }

    async fn echo(&mut self, pings: u32, settings: Settings) -> Check {
        // What befell the board before is told already.
        if self.driver.host().identity().is_none()
            && let Err(error) = self.identify().await
        {
            return gone("echo", &error);
        }
        if let Err(error) = self.perform(Command::Configure(settings)).await {
            return gone("echo", &error);
        }
        let before = self.restarts;
        let mut readings = Vec::new();
        for _ in 0..pings {
            match self.perform(Command::Ping).await {
                Ok((_, seen)) => readings.extend(seen.readings),
                Err(DriveError::Host(HostError::Rebooted)) => {
                    return weak_supply(self.restarts - before, &readings);
                }
                Err(error) => return gone("echo", &error),
            }
        }
        echo::judge(&readings, SETTINGS.window_ticks)
    }

    async fn perform(&mut self, command: Command) -> Result<(Ended, Seen), DriveError> {
        let mut seen = Seen::default();
        let Self { driver, restarts, exchanges } = self;
        let ended = driver
            .perform(command, |event| {
                match event {
                    HostEvent::Reading { reading, .. } => seen.readings.push(reading),
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
        Ok((ended, seen))
    }
}

fn no_answer(error: &DriveError) -> Check {
    match error {
        DriveError::Host(HostError::NoAnswer { .. }) => Check::failed(
            "board",
            Cause::Silent,
            "silence: the port is there, but not a byte came back",
            "if the port is the board's USB, its program is not running: flash the firmware \
             (firmware/README.md); on a separate serial adapter, check that the board has power, \
             and that TX and RX are crossed",
        ),
        DriveError::Host(HostError::NotADevice { bytes }) => Check::failed(
            "board",
            Cause::WrongFirmware,
            format!("{bytes} bytes came back, but none of them makes sense"),
            "another program runs on this board, or this is another device: check the port; if it \
             is the ranger's, flash the firmware (firmware/README.md)",
        ),
        DriveError::Host(HostError::WrongIdentity(_)) => {
            Check::failed("board", Cause::WrongFirmware, error.to_string(), error.help())
        }
        DriveError::Host(HostError::WrongVersion { .. }) => {
            Check::failed("board", Cause::WrongVersion, error.to_string(), error.help())
        }
        error => gone("board", error),
    }
}

/// A failure that any check may meet.
fn gone(check: &'static str, error: &DriveError) -> Check {
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
    let kind = if identity.capabilities.has(Capabilities::SIMULATED) {
        " (a mock)"
    } else if identity.capabilities.has(Capabilities::EMULATED) {
        " (an emulator)"
    } else {
        ""
    };
    Check::ok(
        "board",
        format!(
            "{}{kind}, firmware {}.{}.{}, protocol {}, {} steps a revolution",
            serial_text(identity),
            firmware.major,
            firmware.minor,
            firmware.patch,
            identity.protocol.version,
            identity.steps_per_revolution,
        ),
    )
}

fn last_restart(identity: &Identity) -> Check {
    match identity.reset_cause {
        ResetCause::BrownOut => Check::warning(
            "restart",
            Cause::Power,
            "the board last restarted because its supply sagged",
            "the module draws 2 A while it fires: put 1000 uF beside it, and feed it from a supply \
             of its own, not from USB",
        ),
        ResetCause::Watchdog => Check::warning(
            "restart",
            Cause::Device,
            "the board last restarted because its program hung",
            "report it, with what the board was doing",
        ),
        cause => Check::ok("restart", format!("last restart: {cause:?}")),
    }
}

fn motor_failed(error: &DriveError) -> Check {
    let refused = |reason| matches!(error, DriveError::Host(HostError::Refused(r)) if *r == reason);
    if refused(NakReason::IndexNotFound) {
        return Check::failed(
            "motor",
            Cause::Motor,
            "no index within a turn",
            "if the motor did not turn: check its supply, the driver's ENABLE and current, and its \
             wires; if it did: check the index sensor, and what the EEPROM says of its level",
        );
    }
    if refused(NakReason::EmergencyStop) {
        let stop = DriveError::Host(HostError::EmergencyStop);
        return gone("motor", &stop);
    }
    match error {
        DriveError::Host(HostError::Rebooted) => {
            let check = weak_supply(1, &[]);
            Check {
                check: "motor",
                detail: "the board restarted as the motor turned".into(),
                ..check
            }
        }
        DriveError::Host(HostError::MotionFault) => {
            Check::failed("motor", Cause::Motor, error.to_string(), error.help())
        }
        error => gone("motor", error),
    }
}

fn weak_supply(restarts: u32, readings: &[Reading]) -> Check {
    Check::failed(
        "echo",
        Cause::Power,
        format!("the board restarted ({restarts}) after {} firings", readings.len()),
        "its supply sags when the module draws its 2 A: put 1000 uF beside the module, and feed it \
         from a supply of its own, not from USB",
    )
}
