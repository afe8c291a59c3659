//! A ranger that the collection itself drives: met, carried from pose to pose, lost and found again.

use std::time::Duration;

use firmware_protocol::{host::BoardChange, messages::Identity};
use tokio::time::sleep;
use tokio_serial::SerialStream;

use super::{Args, load::Loaded, patience::Patience};
use crate::{
    cli::{
        Failure,
        mock_world::MockWorldArgs,
        runtime::Interrupts,
        scan::{self, Mock, emulator::Emulator, setup::Setup},
    },
    ranger::Ranger,
};

/// Who measures.
enum Kind {
    Port(String),
    Mock(Mock),
    Emulator { sensor: String, air: [f64; 3], running: Option<Emulator> },
}

pub(super) struct Own {
    kind: Kind,
    world: MockWorldArgs,
    scene: String,
    interrupts: Interrupts,
    ranger: Option<Ranger<SerialStream>>,
    /// The ranger that was met first.
    met: Option<Identity>,
}

impl Own {
    /// Gets it ready at the first pose; nothing is asked of it yet.
    pub(super) fn new(
        args: &Args,
        loaded: &Loaded,
        first: &Setup,
        interrupts: Interrupts,
    ) -> Result<Self, Failure> {
        let keys = &loaded.keys;
        let kind = if args.mock {
            let link = std::env::temp_dir().join(format!("sonard-mock-{}", std::process::id()));
            Kind::Mock(Mock::start(args.world.board(&first.belief())?, Some(&link))?)
        } else if args.emulator {
            let air = [keys.air.temperature_c, keys.air.humidity_percent, keys.air.pressure_kpa];
            Kind::Emulator { sensor: keys.sensor.sensor.clone(), air, running: None }
        } else {
            let port = args.port.clone().or_else(|| keys.device.port.clone());
            Kind::Port(port.unwrap_or_default())
        };
        let (world, scene) = (args.world.clone(), keys.place.scene.clone());
        let mut device = Self { kind, world, scene, interrupts, ranger: None, met: None };
        // A mock was made there.
        if args.emulator {
            device.carry_to(first)?;
        }
        Ok(device)
    }

    /// Lets it stand where the setup says. A real ranger stands where somebody put it.
    pub(super) fn carry_to(&mut self, setup: &Setup) -> Result<(), Failure> {
        match &mut self.kind {
            Kind::Port(_) => {}
            Kind::Mock(mock) => mock.carry_to(self.world.soundings(&setup.belief())?),
            Kind::Emulator { sensor, air, running } => {
                // An emulated board stands where it was started.
                self.ranger = None;
                *running = None;
                let [temperature_c, humidity_percent, pressure_kpa] = air;
                let mut options = self.world.emulator(self.scene.as_ref())?;
                options.extend([
                    format!("--pose={}", setup.pose_numbers()),
                    format!("--sensor={sensor}"),
                    format!("--blanking-us={}", setup.blanking_us()),
                    format!("--temperature-c={temperature_c}"),
                    format!("--humidity-percent={humidity_percent}"),
                    format!("--pressure-kpa={pressure_kpa}"),
                ]);
                *running = Some(Emulator::start(&options)?);
            }
        }
        Ok(())
    }

    /// The ranger, met if it is not yet; a failure is final.
    pub(super) async fn meet(&mut self) -> Result<&mut Ranger<SerialStream>, Failure> {
        let ranger = match self.ranger.take() {
            Some(ranger) => ranger,
            None => scan::meet(&self.port(), &self.interrupts).await?,
        };
        let identity = *ranger.identity();
        if let Some(change) = self.met.and_then(|met| BoardChange::between(&met, &identity)) {
            return Err(Failure::device(
                format!("another ranger answers than the one that measured so far: {change}"),
                "connect that one, or start the collection again: it says what it needs",
            ));
        }
        self.met = Some(identity);
        Ok(self.ranger.insert(ranger))
    }

    /// The same after it was lost: it is tried for until `patience` is over.
    pub(super) async fn find(
        &mut self,
        patience: Duration,
    ) -> Result<&mut Ranger<SerialStream>, Failure> {
        let (mut patience, mut told) = (Patience::with_absence(patience), false);
        loop {
            let report = match self.meet().await {
                // The borrow checker would keep the first borrow through the loop.
                Ok(_) => return self.meet().await,
                Err(Failure::Device(report)) => report,
                Err(failure) => return Err(failure),
            };
            let Some(wait) = patience.next_wait() else { return Err(Failure::Device(report)) };
            if !std::mem::replace(&mut told, true) {
                anstream::eprintln!("waiting for the ranger: {report}");
            }
            tokio::select! {
                () = sleep(wait) => {}
                () = self.interrupts.clone().wait() => {
                    return Err(Failure::stopped());
                }
            }
        }
    }

    /// It does not answer any more.
    pub(super) fn lose(&mut self) {
        self.ranger = None;
    }

    pub(super) async fn close(self) {
        drop(self.ranger);
        if let Kind::Mock(mock) = self.kind {
            mock.stop().await;
        }
    }

    fn port(&self) -> String {
        match &self.kind {
            Kind::Port(port) => port.clone(),
            Kind::Mock(mock) => mock.port(),
            Kind::Emulator { running, .. } => {
                running.as_ref().map(Emulator::port).unwrap_or_default()
            }
        }
    }
}
