//! Mock ranger of the daemon, behind a symbolic link that persists over hangups.

use std::path::PathBuf;

use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use crate::{
    acoustics::Air,
    cli::{
        Failure,
        mock_world::{AssumedModel, MockWorldArgs},
    },
    daemon::Settings,
    mock::{MockBoard, MockPort, Pace},
    supervisor::{Supervisor, Task},
};

/// The board in the world that `settings` describe, but for what `world` changes.
pub(super) fn board(
    world: &MockWorldArgs,
    pace: Pace,
    settings: &Settings,
) -> Result<MockBoard, Failure> {
    let air = &settings.keys.air;
    let air = Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa)
        .map_err(|error| Failure::input(error, "see [air]"))?;
    // Loading has rejected a mock without a scene.
    let Some(scene) = &settings.scene else {
        return Err(Failure::input("a mock needs a scene", "give --scene"));
    };
    let assumed = AssumedModel {
        scene,
        pose: &settings.pose,
        sensor: &settings.sensor,
        air: &air,
        options: &settings.options(),
    };
    world.board_at(pace, &assumed)
}

pub(super) struct Mock {
    link: PathBuf,
    stop: CancellationToken,
    playing: JoinHandle<Option<std::io::Result<()>>>,
}

impl Mock {
    pub(super) fn start(
        world: &MockWorldArgs,
        virtual_time: bool,
        settings: &Settings,
        supervisor: &Supervisor,
    ) -> Result<Self, Failure> {
        let pace = if virtual_time { Pace::Virtual } else { Pace::RealTime };
        let board = board(world, pace, settings)?;
        let link = std::env::temp_dir().join(format!("sonard-mock-{}", std::process::id()));
        let port = MockPort::open(board, Some(&link)).map_err(|error| {
            Failure::device(format!("cannot make a pty: {error}"), "check that /dev/pts is mounted")
        })?;
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        let note = |note: crate::mock::Note| tracing::debug!("mock: {note}");
        let playing = supervisor.spawn(Task::Mock, port.run(stopped, note));
        Ok(Self { link, stop, playing })
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
