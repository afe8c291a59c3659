//! `sonard run`.

mod broker;
mod files;
mod load;
mod mock;
mod ros;

use std::{
    io::{self, IsTerminal as _},
    path::PathBuf,
};

use rustix::process::Signal;
use tokio::signal::unix::{Signal as Hangups, SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;

use super::{
    Failure, Outcome,
    mock_world::MockWorldArgs,
    runtime::{self, Interrupts},
};
use crate::{
    daemon::{self, Handle, Journal, Order, Resources, Settings},
    host_gpio, link,
    server::{Access, Listeners, Server},
};
use files::Files;
use load::Loader;
use mock::Mock;
use ros::Ros;

/// Options of `sonard run`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Configuration file [default: /etc/sonard/sonard.toml if it is there]
    #[arg(long, value_name = "FILE", env = "SONARD_CONFIG")]
    config: Option<PathBuf>,
    /// Override a key of the file; over the environment, too; may be given several times
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    set: Vec<String>,
    /// Check all that is named, and exit; says what is in force
    #[arg(long)]
    check: bool,
    /// Print the configuration file that documents every key, and exit
    #[arg(long)]
    print_config: bool,
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number; sets
    /// device.port
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Use a mock ranger instead of a real one; in real time, with sound from the scene
    #[arg(long, conflicts_with = "port")]
    mock: bool,
    /// Simulate an array of rangers with the model, in real time, instead of using a device
    #[arg(long, conflicts_with_all = ["port", "mock"])]
    simulate: bool,
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data;
    /// what --simulate plays (simulate.array)
    #[arg(long, value_name = "NAME|FILE", requires = "simulate")]
    array: Option<String>,
    /// Let the mock's time run as fast as the computer can
    #[arg(long, requires = "mock", conflicts_with = "realtime")]
    virtual_time: bool,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); predicts in it
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
    /// Unix socket of the daemon; sets server.socket; a dead one of that name is replaced, no other
    /// file
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    #[command(flatten)]
    world: MockWorldArgs,
}

pub(super) const ABOUT: &str = "\
Run the daemon: scan by plan, keep logs, serve the API.

The daemon finds the ranger by its stable name, homes it, and scans continuously, on a schedule or on request. \
It waits for a ranger that disconnects, and measures nothing that can't be logged. SIGHUP reloads the \
configuration; SIGTERM and SIGINT stop the motor, close the scan and sync the log. Control it with `sonard \
status`, `sonard watch` and curl.

With --simulate there is no device: the model simulates an array of rangers at fixed bearings on a robot, fired \
in turn (pioneer-8: one every 40 ms, so each of the eight every 320 ms), round after round unless scanning.mode \
says otherwise. Every record is marked as simulated. PUT /v1/pose moves the robot, simulate.course drives it.";

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
Exit codes: 0 stopped by a signal, 2 wrong configuration, 3 the log or a socket is another's, or the disk gave up.";

pub(super) fn run(args: Args) -> Outcome {
    if args.print_config {
        return print(&crate::config::document::<crate::config::Keys>());
    }
    say_on_stderr();
    let (check, mock, virtual_time) = (args.check, args.mock, args.virtual_time);
    let world = args.world.clone();
    let mut loader = Loader::new(args);
    let (mut settings, files) = loader.load()?;
    if check {
        files::check_places(&settings.keys)?;
        return print(&load::in_force(&settings));
    }
    runtime::new()?.block_on(async move {
        let interrupts = Interrupts::listen();
        let mock = match mock {
            true => Some(Mock::start(&world, virtual_time, &settings)?),
            false => None,
        };
        if let Some(mock) = &mock {
            loader.fix_port(mock.port());
            settings.keys.device.port = Some(mock.port());
        }
        let outcome = serve(loader, settings, files, interrupts).await;
        if let Some(mock) = mock {
            mock.stop().await;
        }
        outcome
    })
}

/// Gets hold of everything, and lets daemon and server run until an interrupt.
async fn serve(
    loader: Loader,
    settings: Settings,
    files: Files,
    interrupts: Interrupts,
) -> Outcome {
    // With a handler, a file that gets too large is an error of the write and not the end.
    let _too_large = signal(SignalKind::from_raw(Signal::XFSZ.as_raw()));
    // Whoever sees that it answers may send one: until there is a handler it would end the process,
    // or be lost where whoever started it ignores hangups.
    let hangups = signal(SignalKind::hangup());
    let keys = &settings.keys;
    let gpio = match settings.simulated {
        // What is made up touches no pins.
        Some(_) => None,
        None => Some(
            host_gpio::open(&keys.gpio).map_err(|error| Failure::input(&error, error.help()))?,
        ),
    };
    // Sockets first: they are removed when a later step fails, which a log is not.
    let listeners =
        Listeners::open(&keys.server).map_err(|error| Failure::device(&error, error.help()))?;
    let Files { token, fleet, mut broker } = files;
    let access = access(&settings, token.as_deref(), &listeners)?;
    let log_folder = PathBuf::from(&keys.log.folder);
    let (journal, thread) = Journal::open(&log_folder, settings.rotation())?;
    let keys = keys.clone();
    let (daemon, handle) = match gpio {
        Some(gpio) => {
            let resources = Resources { open_port: Box::new(link::open), gpio, journal };
            daemon::prepare(resources, settings.clone())
        }
        None => daemon::prepare_simulated(journal, settings.clone()),
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
    let reloading = tokio::spawn(reload_on_hangup(loader, handle, hangups));
    let ended = CancellationToken::new();
    let serving = tokio::spawn(server.run(listeners, ended.clone().cancelled_owned()));
    daemon.run(interrupts.wait()).await;
    ended.cancel();
    reloading.abort();
    // It ends by itself; a panic in it is printed already.
    drop(serving.await);
    ros.stop().await;
    let last = tokio::task::spawn_blocking(|| thread.close()).await.unwrap_or_default();
    broker.stop().await;
    match last.error {
        Some(error) => Err(Failure::device(format!("the log was not closed well: {error}"), "")),
        None => Ok(()),
    }
}

/// Who may write over TCP, and under which names the server is asked.
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
                format!("the socket unit's {address} can be reached from other computers"),
                "let it listen on 127.0.0.1, or set server.token_file",
            ));
        }
        access = access.with_address(address.ip());
    }
    Ok(access)
}

/// Reads the configuration again at each SIGHUP.
async fn reload_on_hangup(mut loader: Loader, daemon: Handle, hangups: io::Result<Hangups>) {
    let Ok(mut hangups) = hangups else { return };
    while hangups.recv().await.is_some() {
        let loaded = loader.load().map(|(settings, _)| Box::new(settings));
        let loaded = loaded.map_err(|failure| load::words(&failure));
        match &loaded {
            Ok(_) => tracing::info!("the configuration was read again"),
            Err(error) => tracing::error!("the configuration stays as it was: {error}"),
        }
        // A daemon that is stopping needs no new configuration.
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

/// What is said unless `SONARD_LOG` asks for something else: libraries say much.
const BY_DEFAULT: &str = "info,rustdds=off";

/// What the daemon says goes to standard error; under systemd the journal knows the time.
fn say_on_stderr() {
    let filter =
        EnvFilter::try_from_env("SONARD_LOG").unwrap_or_else(|_| EnvFilter::new(BY_DEFAULT));
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false);
    let done = if std::env::var_os("JOURNAL_STREAM").is_some() {
        subscriber.without_time().try_init()
    } else {
        subscriber.try_init()
    };
    // Somebody who set up another subscriber wants that one.
    drop(done);
}
