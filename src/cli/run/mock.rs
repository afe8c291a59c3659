//! Mock ranger of the daemon, behind a symbolic link that persists over hangups.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use tokio::{
    sync::mpsc::{self, UnboundedReceiver},
    task::JoinHandle,
};
use tokio_util::sync::CancellationToken;

use super::load::one_line;
use crate::{
    acoustics::{Air, Sensor},
    cli::{
        Failure,
        mock_world::{AssumedModel, MockWorldArgs},
        scan::mock_link,
    },
    daemon::{Relocate, Settings},
    geometry::Pose,
    mock::{EchoTable, MockBoard, MockPort, Pace},
    model::Options,
    scene::Scene,
    supervisor::{Supervisor, Task},
};

/// Returns the board in the world that `settings` describe, but for what `world` changes.
pub(super) fn board(
    world: &MockWorldArgs,
    pace: Pace,
    settings: &Settings,
) -> Result<MockBoard, Failure> {
    let start = Start::from_settings(settings)?;
    world.board_at(pace, &start.assumed(&start.scene, &settings.pose))
}

/// Returns a function that moves the mock to the scene and pose of the next scan, and the echoes
/// that its port receives.
pub(super) fn follow(
    world: MockWorldArgs,
    settings: &Settings,
) -> Result<(Relocate, UnboundedReceiver<EchoTable>), Failure> {
    let start = Arc::new(Start::from_settings(settings)?);
    let placed = Arc::new(Mutex::new((start.scene.sha256.clone(), settings.pose)));
    let (soundings, moves) = mpsc::unbounded_channel();
    let relocate = move |scene: Arc<Scene>, pose: Pose| {
        let (world, start, placed) = (world.clone(), Arc::clone(&start), Arc::clone(&placed));
        let soundings = soundings.clone();
        let moving = async move {
            let place = (scene.sha256.clone(), pose);
            if *placed.lock().unwrap_or_else(PoisonError::into_inner) == place {
                return Ok(());
            }
            let computing =
                tokio::task::spawn_blocking(move || world.soundings(&start.assumed(&scene, &pose)));
            let computed = computing.await.map_err(|error| error.to_string())?;
            let computed = computed
                .map_err(|failure| format!("the mock can't move: {}", one_line(&failure)))?;
            // The mock may have ended already.
            drop(soundings.send(computed));
            *placed.lock().unwrap_or_else(PoisonError::into_inner) = place;
            Ok(())
        };
        Box::pin(moving) as _
    };
    Ok((Box::new(relocate), moves))
}

/// World at the start. Later orders change what the daemon assumes of sensor and air, not what they
/// are.
struct Start {
    scene: Arc<Scene>,
    sensor: Sensor,
    air: Air,
    options: Options,
}

impl Start {
    fn from_settings(settings: &Settings) -> Result<Self, Failure> {
        let air = &settings.keys.air;
        let air = Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa)
            .map_err(|error| Failure::input(error, "see [air]"))?;
        // Loading has rejected a mock without a scene.
        let Some(scene) = settings.scene.clone() else {
            return Err(Failure::input("a mock needs a scene", "give --scene"));
        };
        Ok(Self { scene, sensor: settings.sensor.clone(), air, options: settings.options() })
    }

    const fn assumed<'a>(&'a self, scene: &'a Arc<Scene>, pose: &'a Pose) -> AssumedModel<'a> {
        let Self { sensor, air, options, .. } = self;
        AssumedModel { scene, pose, sensor, air, options }
    }
}

pub(super) struct Mock {
    link: PathBuf,
    stop: CancellationToken,
    playing: JoinHandle<Option<std::io::Result<()>>>,
}

impl Mock {
    /// Starts the mock; also returns the function that moves it.
    pub(super) fn start(
        world: MockWorldArgs,
        virtual_time: bool,
        settings: &Settings,
        supervisor: &Supervisor,
    ) -> Result<(Self, Relocate), Failure> {
        let pace = if virtual_time { Pace::Virtual } else { Pace::RealTime };
        let board = board(&world, pace, settings)?;
        let (relocate, moves) = follow(world, settings)?;
        let link = mock_link();
        let port = MockPort::open(board, Some(&link)).map_err(|error| {
            Failure::device(format!("cannot make a pty: {error}"), "check that /dev/pts is mounted")
        })?;
        let port = port.with_moves(moves);
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        let note = |note: crate::mock::Note| tracing::debug!("mock: {note}");
        let playing = supervisor.spawn(Task::Mock, port.run(stopped, note));
        Ok((Self { link, stop, playing }, relocate))
    }

    pub(super) fn port(&self) -> String {
        self.link.display().to_string()
    }

    pub(super) async fn stop(self) {
        self.stop.cancel();
        // The mock may have ended already.
        drop(self.playing.await);
    }
}
