//! Notifications to systemd: ready once the ranger has reported its identity, alive as long as the device task makes
//! progress.

use std::{
    io,
    os::{
        linux::net::SocketAddrExt as _,
        unix::{
            ffi::OsStrExt as _,
            net::{SocketAddr, UnixDatagram},
        },
    },
    sync::Arc,
    time::Duration,
};

use sd_notify::{NotifyState, watchdog_enabled};
use sonard_api::LinkState;
use tokio::time::interval;
use tokio_util::sync::CancellationToken;

use super::shared::Shared;

/// How often systemd is asked to wait longer for a ranger that is not there yet.
const PATIENCE: Duration = Duration::from_secs(5);

/// Notifies until `shutdown`. Does nothing where there is no systemd.
pub(super) async fn run(shared: Arc<Shared>, shutdown: CancellationToken) {
    let manager = match Manager::connect() {
        Ok(Some(manager)) => manager,
        Ok(None) => return shutdown.cancelled().await,
        Err(error) => {
            tracing::warn!("systemd can't be notified: {error}");
            return shutdown.cancelled().await;
        }
    };
    let say = |states: &[NotifyState<'_>]| manager.notify(states);
    let watchdog = watchdog_enabled();
    let mut tick = interval(watchdog.map_or(PATIENCE, |limit| (limit / 3).min(PATIENCE)));
    let mut views = shared.view.subscribe();
    let (mut ready, mut told, mut beats) = (false, None, None);
    loop {
        let (state, met, trouble) = {
            let view = views.borrow_and_update();
            let met = view.device.is_some() || view.simulation.is_some();
            (view.state, met, view.trouble.clone())
        };
        if met && !std::mem::replace(&mut ready, true) {
            say(&[NotifyState::Ready]);
        }
        if told.replace(state) != Some(state) {
            say(&[NotifyState::Status(&words(state, trouble.as_deref()))]);
        }
        tokio::select! {
            () = shutdown.cancelled() => break,
            changed = views.changed() => if changed.is_err() { break },
            _ = tick.tick() => {
                if !ready {
                    let microseconds = u32::try_from((4 * PATIENCE).as_micros()).unwrap_or(u32::MAX);
                    say(&[NotifyState::ExtendTimeoutUsec(microseconds)]);
                }
                // A scan beats with every beam, everything else once a second. What beats no more
                // is stuck.
                let now = shared.beats();
                if watchdog.is_some() && beats.replace(now) != Some(now) {
                    say(&[NotifyState::Watchdog]);
                }
            }
        }
    }
    say(&[NotifyState::Stopping]);
}

fn words(state: LinkState, trouble: Option<&str>) -> String {
    match trouble {
        Some(trouble) if state.is_settled() && !state.is_up() => {
            format!("{}: {trouble}", state.name())
        }
        _ => state.name().to_owned(),
    }
}

/// Socket of the service manager.
struct Manager(UnixDatagram);

impl Manager {
    /// Connects to the socket that `NOTIFY_SOCKET` names, if it names one.
    fn connect() -> io::Result<Option<Self>> {
        let Some(name) = std::env::var_os("NOTIFY_SOCKET") else { return Ok(None) };
        let address = match name.as_bytes().strip_prefix(b"@") {
            Some(name) => SocketAddr::from_abstract_name(name)?,
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
