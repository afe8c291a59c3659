//! Ranger driven by the collection itself: identified, placed at each pose, and recovered after a
//! loss.

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
        scan::{self, Mock, emulator::Emulator, mock_link, setup::assumed},
    },
    collect::{
        CollectError, CollectionPlan, ConnectedDevice, RecordedScan, RetrySchedule, SavedSettings,
        ScanDevice, ScanTask, record_scan,
    },
    link::PortOpener,
    ranger::{PreparedScan, Ranger, ScanError, device_record, provenance},
    scan::Session,
};

/// Source of the readings.
enum Source {
    Port(String),
    Mock(Option<Mock>),
    Emulator { sensor: String, air: [f64; 3], running: Option<Emulator> },
}

/// Ranger driven by the collection itself.
pub(super) struct LocalDevice {
    source: Source,
    ports: PortOpener,
    world: MockWorldArgs,
    scene: String,
    patience: Duration,
    interrupts: Interrupts,
    ranger: Option<Ranger<SerialStream>>,
    /// Identity of the ranger that was identified first.
    first: Option<Identity>,
}

impl LocalDevice {
    /// Creates the device that the options or the plan name.
    pub(super) fn new(args: &Args, plan: &CollectionPlan, interrupts: Interrupts) -> Self {
        let keys = &plan.keys;
        let source = if args.mock {
            Source::Mock(None)
        } else if args.emulator {
            let air = [keys.air.temperature_c, keys.air.humidity_percent, keys.air.pressure_kpa];
            Source::Emulator { sensor: keys.sensor.sensor.clone(), air, running: None }
        } else {
            let port = args.port.clone().or_else(|| keys.device.port.clone());
            Source::Port(port.unwrap_or_default())
        };
        let (world, scene) = (args.world.clone(), keys.place.scene.clone());
        let patience = Duration::ZERO;
        let ports = PortOpener::default();
        Self { source, ports, world, scene, patience, interrupts, ranger: None, first: None }
    }

    /// Returns the ranger, identifying it first if necessary; failures are not retried.
    async fn ranger(&mut self) -> Result<&mut Ranger<SerialStream>, CollectError> {
        let ranger = match self.ranger.take() {
            Some(ranger) => ranger,
            None => {
                let port = self.port();
                scan::identify(&mut self.ports, &port, &self.interrupts).await?
            }
        };
        let identity = *ranger.identity();
        if let Some(change) = self.first.and_then(|first| BoardChange::between(&first, &identity)) {
            return Err(CollectError::failed(
                format!("a different ranger is connected than at the start: {change}"),
                "connect the first ranger, or restart the collection: it reports what it needs",
            ));
        }
        self.first = Some(identity);
        Ok(self.ranger.insert(ranger))
    }

    /// Returns the ranger, reconnecting until the plan's timeout expires.
    async fn find(&mut self) -> Result<&mut Ranger<SerialStream>, CollectError> {
        let (mut patience, mut notified) = (RetrySchedule::for_absent_device(self.patience), false);
        loop {
            let halt = match self.ranger().await {
                // A direct return would extend the first borrow through the loop.
                Ok(_) => return self.ranger().await,
                Err(halt @ CollectError::Failed { .. }) => halt,
                Err(halt) => return Err(halt),
            };
            let Some(wait) = patience.next_delay() else { return Err(halt) };
            if !std::mem::replace(&mut notified, true) {
                notice!("waiting for the ranger: {halt}");
            }
            tokio::select! {
                () = sleep(wait) => {}
                () = self.interrupts.clone().wait() => return Err(CollectError::interrupted()),
            }
        }
    }

    /// Starts an emulated board at a pose; its pose is fixed at start.
    fn start_emulator(&mut self, at: &PreparedScan) -> Result<(), CollectError> {
        let Source::Emulator { sensor, air, running } = &mut self.source else { return Ok(()) };
        self.ranger = None;
        *running = None;
        let [temperature_c, humidity_percent, pressure_kpa] = air;
        let mut options = self.world.emulator(self.scene.as_ref())?;
        options.extend([
            format!("--pose={}", at.pose_argument()),
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
        match &self.source {
            Source::Port(port) => port.clone(),
            Source::Mock(mock) => mock.as_ref().map(Mock::port).unwrap_or_default(),
            Source::Emulator { running, .. } => {
                running.as_ref().map(Emulator::port).unwrap_or_default()
            }
        }
    }
}

impl ScanDevice for LocalDevice {
    fn is_local(&self) -> bool {
        true
    }

    fn resume(&mut self, patience: Duration, _borrowed: Option<SavedSettings>) {
        self.patience = patience;
    }

    fn prepare(
        &mut self,
        _plan: &CollectionPlan,
        first: &PreparedScan,
    ) -> Result<(), CollectError> {
        if let Source::Mock(mock) = &mut self.source {
            *mock = Some(Mock::start(self.world.board(&assumed(first))?, Some(&mock_link()))?);
        }
        self.start_emulator(first)
    }

    async fn connect(&mut self) -> Result<ConnectedDevice, CollectError> {
        let identity = self.ranger().await?.identity();
        Ok(ConnectedDevice { device: device_record(identity), provenance: provenance(identity) })
    }

    /// Only a mock can be moved; a real ranger is placed by the operator.
    fn move_to(&mut self, to: &PreparedScan) -> Result<(), CollectError> {
        if let Source::Mock(Some(mock)) = &self.source {
            mock.carry_to(self.world.soundings(&assumed(to))?);
        }
        self.start_emulator(to)
    }

    async fn settings_to_save(
        &self,
        _air: Option<&AirOrder>,
    ) -> Result<Option<SavedSettings>, CollectError> {
        Ok(None)
    }

    async fn apply_settings(
        &mut self,
        _: Option<SavedSettings>,
        _: Option<&AirOrder>,
    ) -> Result<(), CollectError> {
        Ok(())
    }

    async fn restore_settings(&mut self) -> Result<bool, CollectError> {
        Ok(false)
    }

    async fn temperature_c(&self) -> Option<f64> {
        None
    }

    async fn record_scan(
        &mut self,
        scan: ScanTask<'_>,
        beam: &(dyn Fn() + Sync),
    ) -> Result<RecordedScan, CollectError> {
        let ScanTask { prepared, air, collection: of, path, .. } = scan;
        let Some(prepared) = prepared else {
            return Err(CollectError::invalid(
                "the scan has no predictions",
                "this is a bug: report it",
            ));
        };
        let interrupts = self.interrupts.clone();
        let ranger = self.find().await?;
        let identity = *ranger.identity();
        let mut job = prepared.job(&identity).map_err(ScanError::from)?;
        job.air = air;
        let session = Session { collection: Some(Box::new(of)), ..prepared.session(&identity) };
        let taken = record_scan(ranger, (&job, session), path, beam, &interrupts).await?;
        if taken.needs_reconnect {
            self.ranger = None;
        }
        Ok(taken)
    }

    async fn close(self) {
        drop(self.ranger);
        if let Source::Mock(Some(mock)) = self.source {
            mock.stop().await;
        }
    }
}
