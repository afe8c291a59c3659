//! The task that keeps the server reachable at the places that are configured.

use std::{collections::BTreeMap, time::Duration};

use sonard_api::ServerReport;
use tokio::{task::spawn_blocking, time::sleep};
use tokio_util::sync::CancellationToken;

use super::{LISTEN, SOCKET, tcp::TcpPlace, unix::Outcome, unix::UnixPlace};
use crate::Handle;

/// From one look at the places to the next.
const LOOK: Duration = Duration::from_secs(2);

/// Owns the places: binds what could not be bound yet and what was removed, and reports each change once. The socket
/// files that this process made are removed when it is dropped.
#[derive(Debug, Default)]
pub(in crate::server) struct Keeper {
    pub(super) unix: Vec<UnixPlace>,
    pub(super) tcp: Vec<TcpPlace>,
    /// By place, why clients do not reach this process there.
    pub(super) troubles: BTreeMap<String, String>,
}

impl Keeper {
    /// Looks after the places until `stop` is cancelled.
    pub(in crate::server) async fn run(mut self, daemon: Handle, stop: CancellationToken) {
        loop {
            daemon.report_server(self.report());
            tokio::select! {
                () = stop.cancelled() => return,
                () = sleep(LOOK) => {}
            }
            // A file system may be slow to answer.
            let looking = spawn_blocking(move || {
                self.look();
                self
            });
            self = tokio::select! {
                // A panic is printed already; the listeners stay as they are.
                looked = looking => match looked { Ok(keeper) => keeper, Err(_) => return },
                () = stop.cancelled() => return,
            };
        }
    }

    fn look(&mut self) {
        let Self { unix, tcp, troubles } = self;
        for place in unix {
            let name = format!("{SOCKET} {}", place.path().display());
            match place.look() {
                Outcome::Unreachable(why) => note(troubles, name, why),
                Outcome::Bound => {
                    troubles.remove(&name);
                    tracing::warn!("{name}: its file was removed; it has been bound again");
                }
                Outcome::Same => {
                    if troubles.remove(&name).is_some() {
                        tracing::info!("{name}: clients reach this daemon there again");
                    }
                }
            }
        }
        for place in tcp {
            let name = format!("{LISTEN} {}", place.address());
            match place.look() {
                Ok(false) => {}
                Ok(true) => {
                    troubles.remove(&name);
                    place.announce();
                }
                Err(error) => note(troubles, name, format!("cannot be bound yet: {error}")),
            }
        }
    }

    fn report(&self) -> ServerReport {
        let sockets = self.unix.iter().map(|place| place.path().display().to_string());
        let reached =
            sockets.filter(|path| !self.troubles.contains_key(&format!("{SOCKET} {path}")));
        let addresses =
            self.tcp.iter().filter_map(TcpPlace::bound).map(|at| format!("http://{at}"));
        ServerReport {
            listening: reached.chain(addresses).collect(),
            trouble: self.troubles.iter().map(|(name, why)| format!("{name}: {why}")).collect(),
        }
    }
}

impl TcpPlace {
    /// Logs that it is listened on.
    pub(super) fn announce(&self) {
        if let Some(address) = self.bound() {
            tracing::info!("listening on http://{address}");
        }
    }
}

/// Logs a trouble unless it is known.
pub(super) fn note(troubles: &mut BTreeMap<String, String>, name: String, why: String) {
    if troubles.get(&name) != Some(&why) {
        tracing::warn!("{name}: {why}; checked again every {} s", LOOK.as_secs());
        troubles.insert(name, why);
    }
}
