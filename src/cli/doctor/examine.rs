//! The examination of one board: each check needs the ones before it.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use firmware_protocol::{
    host::{Command, HostConfig, HostError, HostEvent, Outcome},
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
    line::{self, Questions},
    report::{Cause, Check, Report},
    speaker::Speaker,
    surroundings::Surroundings,
    tap::Tap,
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
    let surroundings = Surroundings::new(port, &line);
    report.checks.push(surroundings.check_port());
    if report.worst().is_some() {
        report.checks.push(Check::skipped("rest", "another program uses the port"));
        return report;
    }
    report.checks.extend(surroundings.check_adapter());
    let config = HostConfig { max_attempts: ATTEMPTS, ..HostConfig::new(BAUD, rand::random()) };
    let driver = Driver::new(Tap::new(line), config);
    let mut patient = Patient { driver, restarts: 0, exchanges: Vec::new() };
    tokio::select! {
        examined = patient.examine(args, &mut report.checks) => {
            match examined {
                // The cause stands before its consequences.
                Ok(()) => {
                    let broken = report.worst().is_some();
                    let cause = surroundings.check_settings().or_else(|| {
                        Some(surroundings.check_port()).filter(|check| broken && check.cause.is_some())
                    });
                    report.checks.splice(1..1, cause);
                }
                Err(error) => {
                    let check = explain_silence(&error, patient, &surroundings).await;
                    report.checks.push(check);
                }
            }
            return report;
        }
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
        LinkError::NotFound { .. } | LinkError::OtherDevice { .. } => Cause::NotFound,
        LinkError::Ambiguous { .. } => Cause::Ambiguous,
        LinkError::Permission(_) | LinkError::DevicePolicy(_) => Cause::Permission,
        LinkError::Busy { .. } => Cause::Busy,
        LinkError::NotSerial(_) => Cause::NotSerial,
        LinkError::NotListed { .. } | LinkError::Io { .. } => Cause::PortError,
    };
    Check::failed("port", cause, error.to_string(), error.help())
}

struct Patient {
    driver: Driver<Tap<SerialStream>>,
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
    /// # Errors
    /// If no board identifies itself.
    async fn examine(&mut self, args: &Args, checks: &mut Vec<Check>) -> Result<(), DriveError> {
        let identity = self.identify().await?;
        checks.push(answered(&identity));
        checks.push(last_restart(&identity));
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
        let gone = matches!(echo.cause, Some(Cause::Cable | Cause::Power));
        checks.push(echo);
        checks.push(match gone {
            true => Check::skipped("clock", "the board has to stay for that"),
            false => self.clock(&identity).await,
        });
        Ok(())
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

/// Time allowed for a terminal or modem to react to an empty line.
const REACTION: Duration = Duration::from_millis(700);

/// The check of a board that did not identify itself: what else acts on the line comes first, because
/// it costs less to remedy than a board without firmware.
async fn explain_silence(
    error: &DriveError,
    patient: Patient,
    surroundings: &Surroundings,
) -> Check {
    use HostError as Host;
    let DriveError::Host(host @ (Host::NoAnswer { .. } | Host::NotADevice { .. })) = error else {
        return no_answer(error);
    };
    let mut line = patient.driver.into_line();
    // A login or a modem that is silent answers an empty line.
    let _ = timeout(REACTION, async {
        line.write_all(b"\r\n").await?;
        let mut buffer = [0; 256];
        while line.read(&mut buffer).await? > 0 {}
        Ok::<(), std::io::Error>(())
    })
    .await;
    if let Some(check) = surroundings.explain(&line.received, &line.sent) {
        return check;
    }
    let check = no_answer(&DriveError::Host(*host));
    match (surroundings.may_hide_programs(), check.help) {
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
            "silence: the port is there, but not a byte came back",
            "check that the port is the ranger's and, on a separate serial adapter, that the board \
             has power and TX and RX are crossed; if the port is the board's USB, its program is not \
             running: flash the firmware (firmware/README.md)",
        ),
        DriveError::Host(HostError::NotADevice { bytes }) => Check::failed(
            "board",
            Cause::WrongFirmware,
            format!("{bytes} bytes came back, but none of them makes sense"),
            Speaker::OtherRate.help(),
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
