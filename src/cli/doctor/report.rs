//! Results of the checks.

use serde::Serialize;

use crate::cli::{Failure, Outcome};

/// Result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Status {
    Ok,
    Warning,
    Failed,
    Skipped,
}

/// Cause of a failure or warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Cause {
    NotFound,
    Ambiguous,
    Permission,
    Busy,
    NotSerial,
    PortError,
    Cable,
    Silent,
    WrongFirmware,
    WrongVersion,
    LoginPrompt,
    Modem,
    Echo,
    Settings,
    Power,
    Line,
    Latency,
    EmergencyStop,
    Motor,
    MissingEcho,
    StuckEcho,
    EchoTime,
    Scatter,
    Clock,
    Device,
}

/// Check with its result.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Check {
    pub(super) check: &'static str,
    pub(super) status: Status,
    pub(super) detail: String,
    pub(super) cause: Option<Cause>,
    pub(super) help: Option<String>,
}

impl Check {
    pub(super) fn ok(check: &'static str, detail: impl Into<String>) -> Self {
        Self { check, status: Status::Ok, detail: detail.into(), cause: None, help: None }
    }

    pub(super) fn skipped(check: &'static str, detail: impl Into<String>) -> Self {
        Self { status: Status::Skipped, ..Self::ok(check, detail) }
    }

    pub(super) fn warning(
        check: &'static str,
        cause: Cause,
        detail: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        let (cause, help) = (Some(cause), Some(help.into()));
        Self { check, status: Status::Warning, detail: detail.into(), cause, help }
    }

    pub(super) fn failed(
        check: &'static str,
        cause: Cause,
        detail: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self { status: Status::Failed, ..Self::warning(check, cause, detail, help) }
    }

    /// Returns `true` if the board responded before the failure.
    pub(super) const fn reaches_device(&self) -> bool {
        !matches!(
            self.cause,
            Some(
                Cause::NotFound
                    | Cause::Ambiguous
                    | Cause::Permission
                    | Cause::Busy
                    | Cause::NotSerial
                    | Cause::PortError
                    | Cause::Cable
                    | Cause::Silent
                    | Cause::WrongFirmware
                    | Cause::WrongVersion
                    | Cause::LoginPrompt
                    | Cause::Modem
                    | Cause::Echo
                    | Cause::Settings
            )
        )
    }
}

/// All checks, in order.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) port: String,
    pub(super) checks: Vec<Check>,
}

impl Report {
    /// Returns the first failure.
    pub(super) fn worst(&self) -> Option<&Check> {
        self.checks.iter().find(|check| check.status == Status::Failed)
    }

    pub(super) fn print(&self, json: bool) -> Outcome {
        if json {
            let text = serde_json::to_string(self)
                .map_err(|error| Failure::device(error, "this is a bug: report it"))?;
            print_line!("{text}");
            return Ok(());
        }
        for Check { check, status, detail, help, .. } in &self.checks {
            let word = match status {
                Status::Ok => "ok",
                Status::Warning => "WARNING",
                Status::Failed => "FAILED",
                Status::Skipped => "skipped",
            };
            print_line!("{check:<9} {word:<8} {detail}");
            if let Some(help) = help {
                print_line!("{:<18} -> {help}", "");
            }
        }
        Ok(())
    }
}
