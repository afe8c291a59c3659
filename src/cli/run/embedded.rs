//! A daemon within another program.

use std::{io, path::PathBuf};

use axum::Router;
use clap::{Args as _, Command, FromArgMatches as _};
use tokio::{
    io::{DuplexStream, duplex},
    sync::mpsc::{self, UnboundedSender},
};
use tokio_util::sync::CancellationToken;

use super::{Args, load::Loader};
use crate::{
    cli::Failure,
    daemon::{self, Handle, Journal, OpenPort, Order, Resources},
    host_gpio::{HostGpio, NoHostGpio},
    link::{Holders, LinkError},
    mock::{MemorySocket, MockPort, Note, Pace},
    server::{Listeners, Peer, Server},
    supervisor::{Supervisor, Task},
};

/// Capacity of each direction of a client's connection, bytes.
const CONNECTION_BYTES: usize = 64 * 1024;

/// Controls of a daemon that runs within the calling program: without sockets, signals and messages
/// on standard error.
///
/// Requests go through [`router`](Self::router), or through a connection in memory with the limits
/// and timeouts of a socket. The device is a mock in memory (`--mock`), the
/// simulated array of
/// `--simulate`, or whatever is plugged into [`socket`](Self::socket). A single-threaded tokio
/// runtime with a paused clock can run it, so that tests wait for no real second.
pub struct EmbeddedDaemon {
    /// Handle for orders and state.
    pub handle: Handle,
    /// HTTP API; requests carry a [`Peer`](crate::server::Peer) as an extension.
    pub router: Router,
    /// Port that the daemon opens, whatever `device.port` is.
    pub socket: MemorySocket,
    connections: UnboundedSender<(DuplexStream, Peer)>,
    loader: Loader,
    stop: CancellationToken,
}

impl EmbeddedDaemon {
    /// Prepares a daemon with the options of `sonard run`, and the work that the caller runs as a
    /// task. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// Wrong options, configuration or files, or a log that can't be written, as for `sonard run`.
    /// The work returns the first failure of a task, or of closing the log.
    pub fn from_options(
        options: &[&str],
    ) -> Result<(Self, impl Future<Output = Result<(), String>> + Send + use<>), Failure> {
        Self::with_gpio(options, Box::new(NoHostGpio))
    }

    /// Prepares a daemon as [`from_options`](Self::from_options), with pins of the host.
    ///
    /// # Errors
    /// As [`from_options`](Self::from_options).
    pub fn with_gpio(
        options: &[&str],
        gpio: Box<dyn HostGpio>,
    ) -> Result<(Self, impl Future<Output = Result<(), String>> + Send + use<>), Failure> {
        let command = Args::augment_args(Command::new("run").no_binary_name(true));
        let matches = command.try_get_matches_from(options);
        let args = matches.and_then(|matches| Args::from_arg_matches(&matches));
        let args = args.map_err(|error| Failure::input(error, "see `sonard run --help`"))?;
        let (plays_mock, virtual_time, world) = (args.mock, args.virtual_time, args.world.clone());
        let mut loader = Loader::new(args);
        if !plays_mock {
            loader.fix_port("memory".to_owned());
        }
        let (settings, files) = loader.load()?;
        let supervisor = Supervisor::default();
        let socket = MemorySocket::default();
        // Ends after the daemon, which stops the motor first.
        let mock_stop = CancellationToken::new();
        let mut relocate = None;
        if plays_mock {
            let pace = if virtual_time { Pace::Virtual } else { Pace::RealTime };
            let board = super::mock::board(&world, pace, &settings)?;
            let (mover, moves) = super::mock::follow(world, &settings)?;
            relocate = Some(mover);
            let port = MockPort::in_memory(board, socket.clone()).with_moves(moves);
            let stop = mock_stop.clone().cancelled_owned();
            let note = |note: Note| tracing::debug!("mock: {note}");
            drop(
                supervisor
                    .spawn_finite(Task::Mock, async move { drop(port.run(stop, note).await) }),
            );
        }
        let keys = settings.keys.clone();
        let access = super::access(&settings, files.token.as_deref(), &Listeners::default())?;
        let log_folder = PathBuf::from(&keys.log.folder);
        let (journal, log) = Journal::open(&log_folder, settings.rotation(), &supervisor)
            .map_err(|error| Failure::device(error, "see log.folder"))?;
        let (daemon, handle) = match settings.simulated {
            Some(_) => daemon::prepare_simulated(journal, supervisor.clone(), settings),
            None => {
                let open_port = open_memory(socket.clone());
                let supervisor = supervisor.clone();
                let resources = Resources { open_port, relocate, gpio, journal, supervisor };
                daemon::prepare(resources, settings)
            }
        };
        let server = Server::new(handle.clone(), log_folder, access, &keys, files.fleet);
        let router = server.router();
        let (connections, accepted) = mpsc::unbounded_channel();
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        let work = async move {
            let ended = CancellationToken::new();
            let serving =
                server.run(Listeners::in_memory(accepted), ended.clone().cancelled_owned());
            let working = async {
                let outcome = daemon.run(stopped).await.map_err(|failure| failure.to_string());
                ended.cancel();
                outcome
            };
            let (outcome, ()) = tokio::join!(working, serving);
            supervisor.stopping().cancel();
            mock_stop.cancel();
            let last = tokio::task::spawn_blocking(|| log.close()).await.unwrap_or_default();
            outcome.and_then(|()| last.error.map_or(Ok(()), Err))
        };
        Ok((Self { handle, router, socket, connections, loader, stop }, work))
    }

    /// Connects a client; returns its end of the connection, which is closed at once if the daemon
    /// has ended.
    #[must_use]
    pub fn connect(&self, peer: Peer) -> DuplexStream {
        let (client, server) = duplex(CONNECTION_BYTES);
        drop(self.connections.send((server, peer)));
        client
    }

    /// Ends the daemon in order: motor stopped, scan closed, log synced.
    pub fn stop(&self) {
        self.stop.cancel();
    }

    /// Reads the configuration again, as `sonard run` does at SIGHUP.
    ///
    /// # Errors
    /// A daemon that is stopping takes no configuration. A configuration with errors is reported by
    /// the daemon.
    pub async fn reload(&mut self) -> Result<(), String> {
        let ordered = self.handle.order(Order::Reload(self.loader.reload())).await;
        ordered.map_err(|refusal| refusal.message)
    }
}

fn open_memory(socket: MemorySocket) -> OpenPort {
    Box::new(move |port| match socket.connect() {
        Ok(stream) => Ok(Box::new(stream)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Err(LinkError::NotFound { port: port.to_owned(), present: Ok(Vec::new()) })
        }
        Err(error) if error.kind() == io::ErrorKind::ResourceBusy => {
            Err(LinkError::Busy { port: port.into(), holders: Holders::default() })
        }
        Err(source) => Err(LinkError::Io { port: port.into(), source }),
    })
}
