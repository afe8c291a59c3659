//! What others get to know.

use jiff::{SignedDuration, Timestamp};
use sonard_api::{LinkState, Trouble};
use sonard_device::ranger::{device_record, provenance};
use sonard_records::EventKind;

use super::{super::agenda::Due, Operator};

impl Operator {
    /// Tells of a change of state, once, and publishes what is in force.
    pub(super) fn tell(&mut self) {
        if let Some(transition) = self.machine.poll_transition() {
            self.tell_transition(transition.from, transition.to);
        }
        if self.machine.state().is_up() {
            self.trouble = None;
        }
        let since = Timestamp::now()
            - SignedDuration::try_from(self.control.now().saturating_sub(self.machine.since()))
                .unwrap_or_default();
        let changed = self.control.epoch + self.machine.since();
        let next_at = match self.control.agenda.due(self.control.now()) {
            Due::At(at) => Some(self.control.epoch + at),
            Due::Now | Due::OnRequest => None,
        };
        let retry_at = self.machine.retry_at().map(|at| self.control.epoch + at);
        let (control, machine) = (&self.control, &self.machine);
        self.out.shared.view.send_modify(|view| {
            if view.state != machine.state() {
                (view.since, view.changed) = (since, changed);
            }
            view.state = machine.state();
            view.port = control.settings.keys.device.port.clone().unwrap_or_default();
            view.trouble.clone_from(&self.trouble);
            (view.failures, view.retry_at) = (machine.failures(), retry_at);
            view.device = control.identity.as_ref().map(device_record);
            view.identity = control.identity;
            view.provenance = control.identity.as_ref().map(provenance);
            view.scanning = control.scanning.clone();
            (view.paused, view.requested) =
                (control.agenda.is_paused(), control.agenda.requested());
            view.next_at = next_at;
            (view.now, view.next) = (control.terms(), control.terms());
            view.configuration = control.configuration.clone();
            view.line.clone_from(&self.line_figures);
            view.scans = self.scans;
        });
        self.control.gpio.set_light(self.machine.state().is_up());
    }

    fn tell_transition(&mut self, from: Option<LinkState>, to: LinkState) {
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
