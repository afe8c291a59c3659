//! A ranger that the collection itself drives: met, carried from pose to pose, lost and found again.

use std::time::Duration;

use firmware_protocol::{host::BoardChange, messages::Identity};
use tokio::time::sleep;
use tokio_serial::SerialStream;

use super::Args;
use crate::{
    api::AirOrder,
    cli::{
        mock_world::MockWorldArgs,
        runtime::Interrupts,
        scan::{self, Mock, emulator::Emulator, setup::assumed},
    },
    collect::{Borrowed, Connected, Device, Halt, Patience, Plan, ScanOrder, Taken, take},
    link::PortOpener,
    ranger::{PreparedScan, Ranger, ScanError, device_record, provenance},
    scan::Session,
};

/// Who measures.
enum Kind {
    Port(String),
    Mock(Option<Mock>),
    Emulator { sensor: String, air: [f64; 3], running: Option<Emulator> },
}

/// A ranger that the collection itself drives.
pub(super) struct LocalDevice {
    kind: Kind,
    ports: PortOpener,
    world: MockWorldArgs,
    scene: String,
    patience: Duration,
    interrupts: Interrupts,
    ranger: Option<Ranger<SerialStream>>,
    /// The ranger that was met first.
    met: Option<Identity>,
}

impl LocalDevice {
    /// The one that the options or the plan name.
    pub(super) fn new(args: &Args, plan: &Plan, interrupts: Interrupts) -> Self {
        let keys = &plan.keys;
        let kind = if args.mock {
            Kind::Mock(None)
        } else if args.emulator {
            let air = [keys.air.temperature_c, keys.air.humidity_percent, keys.air.pressure_kpa];
            Kind::Emulator { sensor: keys.sensor.sensor.clone(), air, running: None }
        } else {
            let port = args.port.clone().or_else(|| keys.device.port.clone());
            Kind::Port(port.unwrap_or_default())
        };
        let (world, scene) = (args.world.clone(), keys.place.scene.clone());
        let patience = Duration::ZERO;
        let ports = PortOpener::default();
        Self { kind, ports, world, scene, patience, interrupts, ranger: None, met: None }
    }

    /// The ranger, met if it is not yet; a failure is final.
    async fn ranger(&mut self) -> Result<&mut Ranger<SerialStream>, Halt> {
        let ranger = match self.ranger.take() {
            Some(ranger) => ranger,
            None => {
                let port = self.port();
                scan::meet(&mut self.ports, &port, &self.interrupts).await?
            }
        };
        let identity = *ranger.identity();
        if let Some(change) = self.met.and_then(|met| BoardChange::between(&met, &identity)) {
            return Err(Halt::failed(
                format!("another ranger answers than the one that measured so far: {change}"),
                "connect that one, or start the collection again: it says what it needs",
            ));
        }
        self.met = Some(identity);
        Ok(self.ranger.insert(ranger))
    }

    /// The same after it was lost: it is tried for until the plan's patience is over.
    async fn find(&mut self) -> Result<&mut Ranger<SerialStream>, Halt> {
        let (mut patience, mut told) = (Patience::with_absence(self.patience), false);
        loop {
            let halt = match self.ranger().await {
                // The borrow checker would keep the first borrow through the loop.
                Ok(_) => return self.ranger().await,
                Err(halt @ Halt::Failed { .. }) => halt,
                Err(halt) => return Err(halt),
            };
            let Some(wait) = patience.next_wait() else { return Err(halt) };
            if !std::mem::replace(&mut told, true) {
                notice!("waiting for the ranger: {halt}");
            }
            tokio::select! {
                () = sleep(wait) => {}
                () = self.interrupts.clone().wait() => return Err(Halt::on_request()),
            }
        }
    }

    /// An emulated board stands where it was started.
    fn start_emulator(&mut self, at: &PreparedScan) -> Result<(), Halt> {
        let Kind::Emulator { sensor, air, running } = &mut self.kind else { return Ok(()) };
        self.ranger = None;
        *running = None;
        let [temperature_c, humidity_percent, pressure_kpa] = air;
        let mut options = self.world.emulator(self.scene.as_ref())?;
        options.extend([
            format!("--pose={}", at.pose_numbers()),
            format!("--sensor={sensor}"),
            format!("--blanking-us={}", at.blanking_us()),
            format!("--temperature-c={temperature_c}"),
            format!("--humidity-percent={humidity_percent}"),
            format!("--pressure-kpa={pressure_kpa}"),
        ]);
        *running = Some(Emulator::start(&options)?);
        Ok(())
    }

    fn port(&self) -> String {
        match &self.kind {
            Kind::Port(port) => port.clone(),
            Kind::Mock(mock) => mock.as_ref().map(Mock::port).unwrap_or_default(),
            Kind::Emulator { running, .. } => {
                running.as_ref().map(Emulator::port).unwrap_or_default()
            }
        }
    }
}

impl Device for LocalDevice {
    fn is_local(&self) -> bool {
        true
    }

    fn go_on(&mut self, patience: Duration, _borrowed: Option<Borrowed>) {
        self.patience = patience;
    }

    fn prepare(&mut self, _plan: &Plan, first: &PreparedScan) -> Result<(), Halt> {
        if let Kind::Mock(mock) = &mut self.kind {
            let link = std::env::temp_dir().join(format!("sonard-mock-{}", std::process::id()));
            *mock = Some(Mock::start(self.world.board(&assumed(first))?, Some(&link))?);
        }
        self.start_emulator(first)
    }

    async fn meet(&mut self) -> Result<Connected, Halt> {
        let identity = self.ranger().await?.identity();
        Ok(Connected { device: device_record(identity), provenance: provenance(identity) })
    }

    /// A real ranger stands where somebody put it.
    fn carry_to(&mut self, to: &PreparedScan) -> Result<(), Halt> {
        if let Kind::Mock(Some(mock)) = &self.kind {
            mock.carry_to(self.world.soundings(&assumed(to))?);
        }
        self.start_emulator(to)
    }

    async fn to_borrow(&self, _air: Option<&AirOrder>) -> Result<Option<Borrowed>, Halt> {
        Ok(None)
    }

    async fn borrow(&mut self, _: Option<Borrowed>, _: Option<&AirOrder>) -> Result<(), Halt> {
        Ok(())
    }

    async fn give_back(&mut self) -> Result<bool, Halt> {
        Ok(false)
    }

    async fn temperature_c(&self) -> Option<f64> {
        None
    }

    async fn take(&mut self, scan: ScanOrder<'_>, beam: &(dyn Fn() + Sync)) -> Result<Taken, Halt> {
        let ScanOrder { prepared, air, of, path, .. } = scan;
        let Some(prepared) = prepared else {
            return Err(Halt::wrong(
                "the scan has no predictions",
                "this is a fault of the program",
            ));
        };
        let interrupts = self.interrupts.clone();
        let ranger = self.find().await?;
        let identity = *ranger.identity();
        let mut job = prepared.job(&identity).map_err(ScanError::from)?;
        job.air = air;
        let session = Session { collection: Some(Box::new(of)), ..prepared.session(&identity) };
        let taken = take(ranger, (&job, session), path, beam, &interrupts).await?;
        if taken.gone {
            self.ranger = None;
        }
        Ok(taken)
    }

    async fn close(self) {
        drop(self.ranger);
        if let Kind::Mock(Some(mock)) = self.kind {
            mock.stop().await;
        }
    }
}
