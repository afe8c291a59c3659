//! Task that keeps the configured endpoints of the server open.

use std::{collections::BTreeMap, time::Duration};

use sonard_api::ServerReport;
use tokio::{task::spawn_blocking, time::sleep};
use tokio_util::sync::CancellationToken;

use super::{LISTEN, SOCKET, tcp::TcpEndpoint, unix::SocketState, unix::UnixEndpoint};
use crate::Handle;

/// Interval between checks of the endpoints.
const CHECK_INTERVAL: Duration = Duration::from_secs(2);

/// Owns the endpoints: binds those that could not be bound before or were removed, and logs each
/// change once. Socket files created by this process are removed on drop.
#[derive(Debug, Default)]
pub(in crate::server) struct Keeper {
    pub(super) unix: Vec<UnixEndpoint>,
    pub(super) tcp: Vec<TcpEndpoint>,
    /// Reasons of unreachable endpoints, by endpoint.
    pub(super) troubles: BTreeMap<String, String>,
}

impl Keeper {
    /// Checks the endpoints periodically until `stop` is cancelled.
    pub(in crate::server) async fn run(mut self, daemon: Handle, stop: CancellationToken) {
        loop {
            daemon.report_server(self.report());
            tokio::select! {
                () = stop.cancelled() => return,
                () = sleep(CHECK_INTERVAL) => {}
            }
            // File system calls can block.
            let checking = spawn_blocking(move || {
                self.check();
                self
            });
            self = tokio::select! {
                // A panic has been logged already; the listeners remain unchanged.
                checked = checking => match checked { Ok(keeper) => keeper, Err(_) => return },
                () = stop.cancelled() => return,
            };
        }
    }

    fn check(&mut self) {
        let Self { unix, tcp, troubles } = self;
        for endpoint in unix {
            let name = format!("{SOCKET} {}", endpoint.path().display());
            match endpoint.check() {
                SocketState::Unreachable(why) => report_trouble(troubles, name, why),
                SocketState::Rebound => {
                    troubles.remove(&name);
                    tracing::warn!("{name}: socket file was removed; bound again");
                }
                SocketState::Unchanged => {
                    if troubles.remove(&name).is_some() {
                        tracing::info!("{name}: reachable again");
                    }
                }
            }
        }
        for endpoint in tcp {
            let name = format!("{LISTEN} {}", endpoint.address());
            match endpoint.check() {
                Ok(false) => {}
                Ok(true) => {
                    troubles.remove(&name);
                    endpoint.announce();
                }
                Err(error) => {
                    report_trouble(troubles, name, format!("cannot be bound yet: {error}"));
                }
            }
        }
    }

    fn report(&self) -> ServerReport {
        let sockets = self.unix.iter().map(|endpoint| endpoint.path().display().to_string());
        let reachable =
            sockets.filter(|path| !self.troubles.contains_key(&format!("{SOCKET} {path}")));
        let addresses =
            self.tcp.iter().filter_map(TcpEndpoint::bound).map(|at| format!("http://{at}"));
        ServerReport {
            listening: reachable.chain(addresses).collect(),
            errors: self.troubles.iter().map(|(name, why)| format!("{name}: {why}")).collect(),
        }
    }
}

impl TcpEndpoint {
    /// Logs the bound address.
    pub(super) fn announce(&self) {
        if let Some(address) = self.bound() {
            tracing::info!("listening on http://{address}");
        }
    }
}

/// Records and logs a problem unless it is unchanged.
pub(super) fn report_trouble(troubles: &mut BTreeMap<String, String>, name: String, why: String) {
    if troubles.get(&name) != Some(&why) {
        tracing::warn!("{name}: {why}; checked again every {} s", CHECK_INTERVAL.as_secs());
        troubles.insert(name, why);
    }
}
