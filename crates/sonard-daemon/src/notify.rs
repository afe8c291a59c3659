//! Notifications to systemd: ready once the ranger has reported its identity, alive as long as the
//! device task makes progress.

use std::{
    io,
    os::unix::{
        ffi::OsStrExt as _,
        net::{SocketAddr, UnixDatagram},
    },
    sync::Arc,
    time::Duration,
};

use sd_notify::{NotifyState, watchdog_enabled};
use sonard_api::LinkState;
use tokio::time::interval;
use tokio_util::sync::CancellationToken;

use super::{platform::abstract_address, state::DaemonState};

/// Interval at which the start-up timeout of systemd is extended while the ranger is absent.
const EXTENSION_INTERVAL: Duration = Duration::from_secs(5);

/// Notifies until `shutdown`. Does nothing where there is no systemd.
pub(super) async fn run(state: Arc<DaemonState>, shutdown: CancellationToken) {
    let manager = match ServiceManager::connect() {
        Ok(Some(manager)) => manager,
        Ok(None) => return shutdown.cancelled().await,
        Err(error) => {
            tracing::warn!("systemd can't be notified: {error}");
            return shutdown.cancelled().await;
        }
    };
    let watchdog = watchdog_enabled();
    let mut tick =
        interval(watchdog.map_or(EXTENSION_INTERVAL, |limit| (limit / 3).min(EXTENSION_INTERVAL)));
    let mut changes = state.subscribe();
    let (mut ready, mut notified, mut beats) = (false, None, None);
    loop {
        let (link, is_identified, trouble) = {
            let published = changes.borrow_and_update();
            let is_identified = published.link.device.is_some() || published.simulation.is_some();
            (published.link.state, is_identified, published.link.trouble.clone())
        };
        if is_identified && !std::mem::replace(&mut ready, true) {
            manager.notify(&[NotifyState::Ready]);
        }
        if notified.replace(link) != Some(link) {
            manager.notify(&[NotifyState::Status(&describe_link(link, trouble.as_deref()))]);
        }
        tokio::select! {
            () = shutdown.cancelled() => break,
            changed = changes.changed() => if changed.is_err() { break },
            _ = tick.tick() => {
                if !ready {
                    let microseconds = u32::try_from((4 * EXTENSION_INTERVAL).as_micros()).unwrap_or(u32::MAX);
                    manager.notify(&[NotifyState::ExtendTimeoutUsec(microseconds)]);
                }
                // The heartbeat counts every beam of a scan, and once a second otherwise.
                let now = state.beats();
                if watchdog.is_some() && beats.replace(now) != Some(now) {
                    manager.notify(&[NotifyState::Watchdog]);
                }
            }
        }
    }
    manager.notify(&[NotifyState::Stopping]);
}

fn describe_link(state: LinkState, trouble: Option<&str>) -> String {
    match trouble {
        Some(trouble) if state.is_settled() && !state.is_up() => {
            format!("{}: {trouble}", state.name())
        }
        _ => state.name().to_owned(),
    }
}

/// Socket of the service manager.
struct ServiceManager(UnixDatagram);

impl ServiceManager {
    /// Connects to the socket that `NOTIFY_SOCKET` names, if it names one.
    fn connect() -> io::Result<Option<Self>> {
        let Some(name) = std::env::var_os("NOTIFY_SOCKET") else { return Ok(None) };
        let address = match name.as_bytes().strip_prefix(b"@") {
            Some(name) => abstract_address(name)?,
            None => SocketAddr::from_pathname(&name)?,
        };
        let socket = UnixDatagram::unbound()?;
        socket.connect_addr(&address)?;
        // A service manager that does not read must not stop what it supervises.
        socket.set_nonblocking(true)?;
        Ok(Some(Self(socket)))
    }

    fn notify(&self, states: &[NotifyState<'_>]) {
        let message: String = states.iter().map(|state| format!("{state}\n")).collect();
        if let Err(error) = self.0.send(message.as_bytes()) {
            tracing::debug!("a notification to systemd was dropped: {error}");
        }
    }
}
