//! `sonard run`.

mod broker;
mod embedded;
mod files;
mod load;
mod mock;
mod ros;
mod sandbox;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
    time::Duration,
};

use rustix::process::Signal;
use tokio::signal::unix::{Signal as Hangups, SignalKind, signal};
use tokio_util::sync::CancellationToken;

use super::{
    Failure, Outcome, interruptible,
    mock_world::MockWorldArgs,
    runtime::{self, Interrupts},
    socket,
};
use crate::{
    config::Keys,
    daemon::{self, Handle, Journal, OpenPort, Order, Relocate, Resources, Settings},
    host_gpio,
    interrupts::{FORCED_END, Hangup},
    link::PortOpener,
    messages,
    scan::EventKind,
    server::{Access, Listeners, Server},
    supervisor::{Supervisor, Task},
};
pub use embedded::EmbeddedDaemon;
use files::Files;
use load::Loader;
pub(super) use load::{file_and_environment, one_line};
use mock::Mock;
use ros::Ros;

/// Time allowed for an orderly shutdown; the units' `TimeoutStopSec` is longer.
const SHUTDOWN_LIMIT: Duration = Duration::from_secs(35);
/// Time allowed for tasks and blocking calls that are left after it.
const TASKS_LIMIT: Duration = Duration::from_millis(500);

/// Options of `sonard run`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Configuration file [default: /etc/sonard/sonard.toml, if it exists]
    #[arg(long, value_name = "FILE", env = "SONARD_CONFIG")]
    config: Option<PathBuf>,
    /// Override a key of the file (repeatable); takes precedence over the environment
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    set: Vec<String>,
    /// Validate the file and all that it names, and exit; prints the effective values
    #[arg(long)]
    check: bool,
    /// Print a configuration file that documents every key, and exit
    #[arg(long)]
    print_config: bool,
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number; sets
    /// device.port
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Use a mock ranger instead of a real one; in real time, with echoes from the scene
    #[arg(long, conflicts_with = "port")]
    mock: bool,
    /// Simulate an array of rangers with the model, in real time, instead of using a device
    #[arg(long, conflicts_with_all = ["port", "mock"])]
    simulate: bool,
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data; simulated
    /// by --simulate (simulate.array)
    #[arg(long, value_name = "NAME|FILE", requires = "simulate")]
    array: Option<String>,
    /// Let the mock's time advance as fast as possible
    #[arg(long, requires = "mock", conflicts_with = "realtime")]
    virtual_time: bool,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions
    /// (place.scene)
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene; sets
    /// place.pose
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Folder of the logs (log.folder)
    #[arg(long, value_name = "DIR")]
    log: Option<PathBuf>,
    /// Unix socket of the daemon; sets server.socket; a stale socket is replaced, no other file
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    #[command(flatten)]
    world: MockWorldArgs,
}

pub(super) const ABOUT: &str = "\
Run the daemon: scan continuously, keep logs, serve the API.

The daemon finds the ranger by its stable name, homes it, and scans continuously, on a schedule or \
on request. If the ranger disconnects, it waits for it; readings that can't be logged are not \
taken. SIGHUP reloads the configuration; SIGTERM and SIGINT stop the motor, close the scan and \
sync the log. Control it with `sonard status`, `sonard watch` and curl.

With --mock a mock ranger takes the place of the device. It follows PUT /v1/pose, unless --truth-pose pins it.

With --simulate there is no device: the model simulates an array of rangers at fixed bearings on a \
robot, fired in turn (pioneer-8: one every 40 ms, so each of the eight every 320 ms), round after \
round unless scanning.mode differs. Every record is marked as simulated. PUT /v1/pose moves the \
robot, simulate.course drives it.";

const EXAMPLES: &str = "\
Examples:
  sonard run --mock --scene simple-room --pose fig9 --log log --socket /tmp/sonard.sock \\
      --set scanning.mode=continuous --set model.max_range_m=4
  curl --unix-socket /tmp/sonard.sock http://localhost/v1/status
  curl --unix-socket /tmp/sonard.sock -N http://localhost/v1/live/records
  curl --unix-socket /tmp/sonard.sock -H 'Content-Type: application/json' -d '{\"scans\": 1}' \\
      http://localhost/v1/start
  sonard run --simulate --array pioneer-8 --scene mcgill-lab --pose fig4 --log log --socket /tmp/s.sock
  curl --unix-socket /tmp/s.sock -N 'http://localhost/v1/live/records?moved_m=0.05'
  sonard run --print-config > sonard.toml
  sonard run --config sonard.toml --check

SONARD_LOG sets the level of messages on standard error: error, warn, info (default), debug.
Exit codes: 0 stopped by a signal, 1 forced to stop by a second signal, 2 wrong configuration, 3 \
log or socket in use by another process, disk error, or a task of the daemon failed.";

pub(super) fn run(args: Args) -> Outcome {
    if args.print_config {
        return print(&crate::config::document::<crate::config::Keys>());
    }
    let _drain = messages::log_to_stderr();
    let (check, mock, virtual_time) = (args.check, args.mock, args.virtual_time);
    let world = args.world.clone();
    let mut loader = Loader::new(args);
    let (mut settings, files) = loader.load()?;
    if check {
        files::check_places(&settings.keys)?;
        return print(&load::effective_configuration(&settings));
    }
    let hangup = Hangup::for_this_process();
    let supervisor = Supervisor::default();
    let runtime = runtime::new()?;
    let outcome = runtime.block_on(async {
        let (interrupts, handlers) = Interrupts::install(hangup);
        drop(supervisor.spawn(Task::Signals, handlers.receive()));
        let (mock, relocate) = match mock {
            true => Some(Mock::start(world, virtual_time, &settings, &supervisor)?),
            false => None,
        }
        .unzip();
        if let Some(mock) = &mock {
            loader.fix_port(mock.port());
            settings.keys.device.port = Some(mock.port());
        }
        let served = async {
            let outcome =
                serve(loader, settings, files, relocate, (&interrupts, hangup), supervisor.clone())
                    .await;
            supervisor.stopping().cancel();
            if let Some(mock) = mock {
                mock.stop().await;
            }
            outcome
        };
        tokio::select! {
            biased;
            outcome = served => outcome,
            () = interrupts.clone().wait_overdue() => Err(interruptible::abandoned()),
            () = overdue(supervisor.stopping()) => Err(Failure::device(
                format!("the shutdown took longer than {} s and was abandoned", SHUTDOWN_LIMIT.as_secs()),
                "see the messages before this one",
            )),
        }
    });
    runtime.shutdown_timeout(TASKS_LIMIT);
    match supervisor.first_failure() {
        Some(failure) => Err(Failure::device(failure, "this is a bug: please report it")),
        None => outcome,
    }
}

/// Completes when the shutdown has taken too long.
async fn overdue(stopping: &CancellationToken) {
    stopping.cancelled().await;
    tokio::time::sleep(SHUTDOWN_LIMIT).await;
}

/// Acquires all resources, and runs daemon and server until an interrupt or until a task fails.
async fn serve(
    loader: Loader,
    settings: Settings,
    files: Files,
    relocate: Option<Relocate>,
    (interrupts, hangup): (&Interrupts, Hangup),
    supervisor: Supervisor,
) -> Outcome {
    // With a handler, exceeding the file-size limit is an error of the write instead of the end of
    // the process.
    let _too_large = signal(SignalKind::from_raw(Signal::XFSZ.as_raw()));
    // Installed before the API is served, because clients may send SIGHUP from then on.
    let hangups = (hangup == Hangup::Reload).then(|| signal(SignalKind::hangup()));
    let keys = &settings.keys;
    let gpio = match settings.simulated {
        // A simulation uses no pins.
        Some(_) => None,
        None => Some(
            host_gpio::open(&keys.gpio).map_err(|error| Failure::input(&error, error.help()))?,
        ),
    };
    announce_user_places(keys)?;
    // Sockets first: unlike a log, they are removed if a later step fails.
    let listeners =
        Listeners::open(&keys.server).map_err(|error| Failure::device(&error, error.help()))?;
    let Files { token, fleet, mut broker } = files;
    let access = access(&settings, token.as_deref(), &listeners)?;
    let log_folder = PathBuf::from(&keys.log.folder);
    let (journal, thread) = Journal::open(&log_folder, settings.rotation(), &supervisor)
        .map_err(|error| sandbox::log_failure(&log_folder, error))?;
    sandbox::warn_of_private_folder(&log_folder);
    // A rejected start stops the log's thread.
    let _stopping = supervisor.stopping().clone().drop_guard();
    let keys = keys.clone();
    let (daemon, handle) = match gpio {
        Some(gpio) => {
            let announced = Arc::new(OnceLock::<Handle>::new());
            let open_port = open_and_announce(Arc::clone(&announced));
            let supervisor = supervisor.clone();
            let resources = Resources { open_port, relocate, gpio, journal, supervisor };
            let prepared = daemon::prepare(resources, settings.clone());
            drop(announced.set(prepared.1.clone()));
            prepared
        }
        None => daemon::prepare_simulated(journal, supervisor.clone(), settings.clone()),
    };
    let begun = Ros::start(&keys.ros, &handle)
        .and_then(|ros| broker.start(&settings, &handle, &log_folder).map(|()| ros));
    let ros = match begun {
        Ok(ros) => ros,
        Err(failure) => {
            files::remove_empty_log(thread);
            return Err(failure);
        }
    };
    let server = Server::new(handle.clone(), log_folder, access, &keys, fleet);
    if let Some(Ok(hangups)) = hangups {
        drop(supervisor.spawn_finite(Task::Reload, reload_on_hangup(loader, handle, hangups)));
    }
    let ended = CancellationToken::new();
    let serving = server.run(listeners, ended.clone().cancelled_owned());
    let working = async {
        let outcome = daemon.run(interrupts.clone().wait()).await;
        ended.cancel();
        outcome
    };
    // Clients and brokers are waited for, unless the shutdown is forced; the log is closed in
    // either case.
    let leaving = async {
        let (outcome, ()) = tokio::join!(working, serving);
        ros.stop().await;
        outcome
    };
    let forced = async {
        interrupts.clone().wait_forced().await;
        tokio::time::sleep(FORCED_END / 2).await;
    };
    tokio::select! {
        _outcome = leaving => {}
        () = forced => {}
    }
    let last = tokio::task::spawn_blocking(|| thread.close()).await.unwrap_or_default();
    broker.stop().await;
    match last.error {
        Some(error) => Err(Failure::device(format!("cannot close the log: {error}"), "")),
        None => Ok(()),
    }
}

/// Creates the folder of the user's socket, and reports the places that replace the system's.
fn announce_user_places(keys: &Keys) -> Outcome {
    let socket = Path::new(&keys.server.socket);
    if socket == socket::user_socket() {
        socket::create_user_folder(socket).map_err(|error| {
            let help = "give --socket a path in a folder of yours";
            Failure::device(format!("cannot use {}: {error}", socket.display()), help)
        })?;
        tracing::info!("no rights to /run/sonard; the socket is {}", socket.display());
    } else if socket == Path::new(socket::SYSTEM_SOCKET) {
        socket::create_system_folder();
    }
    if socket::user_logs().is_some_and(|logs| logs == Path::new(&keys.log.folder)) {
        tracing::info!("no rights to /var/lib/sonard; the logs are in {}", keys.log.folder);
    }
    Ok(())
}

/// Opens ports; a changed device becomes an event of the daemon.
fn open_and_announce(daemon: Arc<OnceLock<Handle>>) -> OpenPort {
    let mut ports = PortOpener::default();
    Box::new(move |port| {
        let line = ports.open(port)?;
        if let Some(daemon) = daemon.get() {
            daemon.report_latency_timer(ports.latency_timer_ms());
        }
        if let Some(change) = ports.take_change() {
            tracing::warn!("{change}");
            if let Some(daemon) = daemon.get() {
                daemon.event(EventKind::Reconnected, change);
            }
        }
        Ok(Box::new(line))
    })
}

/// Determines which clients may write over TCP, and the accepted host names.
fn access(
    settings: &Settings,
    token: Option<&str>,
    listeners: &Listeners,
) -> Result<Access, Failure> {
    let mut access = Access::new(&settings.keys.server.hosts, token);
    if settings.keys.foxglove.enabled {
        access = access.with_viewers(&settings.keys.foxglove.origins);
    }
    for address in listeners.addresses() {
        // Checked with the configuration, except for sockets of systemd.
        if !address.ip().is_loopback() && token.is_none() {
            return Err(Failure::input(
                format!("the socket unit's {address} is reachable from other computers"),
                "bind it to 127.0.0.1, or set server.token_file",
            ));
        }
        access = access.with_address(address.ip());
    }
    Ok(access)
}

/// Reloads the configuration at each SIGHUP.
async fn reload_on_hangup(mut loader: Loader, daemon: Handle, mut hangups: Hangups) {
    while hangups.recv().await.is_some() {
        let loaded = loader.reload();
        match &loaded {
            Ok(_) => tracing::info!("configuration reloaded"),
            Err(error) => tracing::error!("configuration unchanged: {error}"),
        }
        // A stopping daemon ignores new configurations.
        drop(daemon.order(Order::Reload(loaded)).await);
        let waiting = daemon.status().configuration.needs_restart;
        if !waiting.is_empty() {
            tracing::warn!("these changes take effect after a restart: {}", waiting.join(", "));
        }
    }
}

fn print(text: &str) -> Outcome {
    use std::io::Write as _;
    let written = std::io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))
}
