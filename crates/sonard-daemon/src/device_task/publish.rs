//! Publication of link state, settings and counters to the daemon's state and the log.

use jiff::{SignedDuration, Timestamp};
use sonard_api::{LinkState, Trouble};
use sonard_device::ranger::{device_record, provenance};
use sonard_records::EventKind;

use super::{super::schedule::Due, DeviceTask};

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
        let next_at = match self.control.schedule.due(self.control.now()) {
            Due::At(at) => Some(self.control.epoch + at),
            Due::Now | Due::OnRequest => None,
        };
        let retry_at = self.machine.retry_at().map(|at| self.control.epoch + at);
        let (control, machine) = (&self.control, &self.machine);
        self.out.state.published.send_modify(|published| {
            if published.state != machine.state() {
                (published.since, published.changed) = (since, changed);
            }
            published.state = machine.state();
            published.port = control.settings.keys.device.port.clone().unwrap_or_default();
            published.trouble.clone_from(&self.trouble);
            (published.failures, published.retry_at) = (machine.failures(), retry_at);
            published.device = control.identity.as_ref().map(device_record);
            published.identity = control.identity;
            published.provenance = control.identity.as_ref().map(provenance);
            published.scanning = control.scanning.clone();
            (published.paused, published.requested) =
                (control.schedule.is_paused(), control.schedule.requested());
            published.next_at = next_at;
            (published.now, published.next) = (control.scan_settings(), control.scan_settings());
            published.configuration = control.configuration.clone();
            published.line.clone_from(&self.line_figures);
            published.scans = self.scans;
        });
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
