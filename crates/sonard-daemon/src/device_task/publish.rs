//! Publication of link state, settings and counters to the daemon's state and the log.

use jiff::{SignedDuration, Timestamp};
use sonard_api::{LinkState, Trouble};
use sonard_device::ranger::{device_record, provenance};
use sonard_records::EventKind;

use super::{
    super::state::{LinkSnapshot, StateEvent},
    DeviceTask,
};

impl DeviceTask {
    /// Publishes the current status, and logs a change of link state once.
    pub(super) fn publish_status(&mut self) {
        if let Some(transition) = self.machine.poll_transition() {
            self.report_transition(transition.from, transition.to);
        }
        if self.machine.state().is_up() {
            self.trouble = None;
        }
        let since = Timestamp::now()
            - SignedDuration::try_from(self.control.now().saturating_sub(self.machine.since()))
                .unwrap_or_default();
        let changed = self.control.epoch + self.machine.since();
        let (control, machine) = (&self.control, &self.machine);
        let link = LinkSnapshot {
            state: machine.state(),
            since,
            changed,
            port: control.settings.keys.device.port.clone().unwrap_or_default(),
            trouble: self.trouble.clone(),
            failures: machine.failures(),
            retry_at: machine.retry_at().map(|at| control.epoch + at),
            identity: control.identity,
            device: control.identity.as_ref().map(device_record),
            provenance: control.identity.as_ref().map(provenance),
        };
        self.out.state.apply([
            StateEvent::Link(Box::new(link)),
            control.snapshot(),
            StateEvent::SettingsInForce,
            control.next_scan_at(),
            StateEvent::LineCounted(Box::new(self.line_figures.clone())),
            StateEvent::ScansCounted(self.scans),
        ]);
        self.control.gpio.set_light(self.machine.state().is_up());
    }

    fn report_transition(&mut self, from: Option<LinkState>, to: LinkState) {
        let trouble = self.trouble.clone().unwrap_or_default();
        let was_up = from.is_some_and(LinkState::is_up);
        match to {
            LinkState::Ready => {
                tracing::info!("the ranger is ready");
                if from.is_some() {
                    let detail = "the ranger is ready again: identified and homed".to_owned();
                    self.out.event(EventKind::Reconnected, detail);
                }
            }
            LinkState::Stopped => tracing::info!("stopped"),
            LinkState::EmergencyStop => tracing::warn!("the emergency stop is pressed"),
            LinkState::AwaitingStart => {
                self.line_figures.earlier.losses += u64::from(was_up);
                tracing::warn!("{trouble}");
            }
            state => {
                tracing::warn!("{}: {trouble}", state.name());
                self.line_figures.earlier.losses += u64::from(was_up);
                let fault = state == LinkState::Down(Trouble::Fault);
                let kind = if fault { EventKind::Fault } else { EventKind::LinkLost };
                self.out.event(kind, format!("{}: {trouble}", state.name()));
            }
        }
    }
}
