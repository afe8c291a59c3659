//! Collection through a daemon: each scan is requested with its pose and plan, and the daemon's
//! settings are restored afterwards.

use std::time::Duration;

use serde::Serialize;
use sonard_api::{
    AirOrder, AirStatus, InForce, LinkReport, ScanRequest, Scanning, ScanningReport, Setup, Status,
    client::{Client, RequestedScans, ScansError},
    config::{Mode, ScanningKeys},
};
use sonard_device::ranger::PreparedScan;
use sonard_records::{AirSource, EventKind, Record, STOPPED_ON_REQUEST, Sink as _};
use sonard_runtime::interrupts::Interrupts;
use tokio::time::{Instant, sleep};

use super::{
    CollectError, CollectionPlan, ConnectedDevice, SavedAir, SavedSettings, ScanDevice, ScanTask,
    record_scan::{RecordedScan, ScanSink},
};

/// Retry interval while the daemon or its ranger is unavailable.
const RETRY_INTERVAL: Duration = Duration::from_secs(1);
/// Poll interval of the daemon's state between a request and the first record of its scan.
const POLL_INTERVAL: Duration = Duration::from_secs(5);

/// Daemon that takes the scans of a collection.
pub struct RemoteDevice {
    client: Client,
    /// Daemon's scan setup at the start of the collection.
    setup: Setup,
    patience: Duration,
    interrupts: Interrupts,
    /// Settings to restore, as far as the collection changed them.
    borrowed: Option<SavedSettings>,
    /// Reports messages to the operator.
    report: Report,
}

/// Callback for messages to the operator.
type Report = Box<dyn Fn(&str) + Send + Sync>;

/// Air settings that apply to the daemon's next scan.
fn next_air(status: &Status) -> &AirStatus {
    status.pending.air.as_ref().unwrap_or(&status.air)
}

/// Returns the motor steps per revolution of the daemon's ranger, once it is identified.
#[must_use]
pub fn steps_per_revolution(status: &Status) -> Option<u16> {
    status.device.as_ref().and_then(|device| device.steps_per_revolution.try_into().ok())
}

fn link_failure(link: &LinkReport) -> CollectError {
    let trouble = link.error.as_deref().unwrap_or("no details");
    CollectError::failed(
        format!("the daemon's ranger is not available ({}): {trouble}", link.state.name()),
        "see `sonard status`; start the collection again to resume it",
    )
}

impl ScanDevice for RemoteDevice {
    fn is_local(&self) -> bool {
        false
    }

    fn prepare(
        &mut self,
        _plan: &CollectionPlan,
        _first: &PreparedScan,
    ) -> Result<(), CollectError> {
        Ok(())
    }

    fn move_to(&mut self, _to: &PreparedScan) -> Result<(), CollectError> {
        Ok(())
    }

    fn resume(&mut self, patience: Duration, borrowed: Option<SavedSettings>) {
        (self.patience, self.borrowed) = (patience, borrowed);
    }

    /// Waits until the daemon has a usable ranger.
    async fn connect(&mut self) -> Result<ConnectedDevice, CollectError> {
        let status = self.ready().await?;
        match (status.device, status.provenance) {
            (Some(device), Some(provenance)) => Ok(ConnectedDevice { device, provenance }),
            _ => Err(CollectError::failed(
                "the daemon has not identified its ranger",
                "see `sonard status`",
            )),
        }
    }

    /// Returns the settings about to be changed. The daemon's own scans are suspended, because the
    /// pose is known only to the collection; the air is set if the plan specifies it.
    async fn settings_to_save(
        &self,
        air: Option<&AirOrder>,
    ) -> Result<Option<SavedSettings>, CollectError> {
        let status = self.ready().await?;
        let ScanningReport { mode, every_s, .. } = status.scanning;
        let mut before = self.borrowed.clone();
        if mode != Mode::OnRequest {
            before.get_or_insert_default().scanning = Some(ScanningKeys { mode, every_s });
        }
        if air.is_some_and(|air| !is_ordered(next_air(&status), air)) {
            // The API's air is an earlier setting by a client and must be restored as such.
            let own = || match next_air(&status).source {
                AirSource::Api => SavedAir::Client(as_order(next_air(&status))),
                _ => SavedAir::Daemon,
            };
            before.get_or_insert_default().air.get_or_insert_with(own);
        }
        Ok(before.filter(|before| Some(before) != self.borrowed.as_ref()))
    }

    /// Switches the daemon to scans on request and sets the plan's air.
    async fn apply_settings(
        &mut self,
        before: Option<SavedSettings>,
        air: Option<&AirOrder>,
    ) -> Result<(), CollectError> {
        if before.is_some() {
            self.borrowed = before;
        }
        let on_request = Scanning { mode: Mode::OnRequest, every_s: None };
        self.put("/v1/scanning", &on_request).await?;
        let status: Status = self.client.get_json("/v1/status").await?;
        match air.filter(|air| !is_ordered(next_air(&status), air)) {
            Some(air) => self.put("/v1/air", air).await,
            None => Ok(()),
        }
    }

    /// Restores scan mode and air; returns `true` if anything was saved.
    async fn restore_settings(&mut self) -> Result<bool, CollectError> {
        let Some(before) = self.borrowed.take() else { return Ok(false) };
        if let Some(ScanningKeys { mode, every_s }) = before.scanning {
            let scanning = Scanning { mode, every_s: Some(every_s) };
            self.put("/v1/scanning", &scanning).await?;
        }
        match before.air {
            Some(SavedAir::Client(air)) => self.put("/v1/air", &air).await?,
            Some(SavedAir::Daemon) => {
                self.client.delete("/v1/air").await?;
            }
            None => {}
        }
        Ok(true)
    }

    /// Returns the daemon's air temperature, degrees Celsius, unless it is the configured default.
    async fn temperature_c(&self) -> Option<f64> {
        let InForce::<AirStatus> { now, pending } = self.client.get_json("/v1/air").await.ok()?;
        let air = pending.unwrap_or(now);
        (air.source != AirSource::Configuration).then_some(air.temperature_c)
    }

    async fn record_scan(
        &mut self,
        scan: ScanTask<'_>,
        beam: &(dyn Fn() + Sync),
    ) -> Result<RecordedScan, CollectError> {
        let ScanTask { plan, pose, collection: of, path, .. } = scan;
        let request = ScanRequest { scans: Some(1), plan: Some(plan), pose: Some(pose) };
        let (mut scans, first) = self.begin(&request).await?;
        let began = Instant::now();
        let mut sink = ScanSink::open(path, beam)?;
        let (mut lost, mut stopped) = (None, false);
        let mut next = Some(first);
        while let Some(mut record) = next.take() {
            if let Record::Session(session) = &mut record {
                session.collection = Some(Box::new(of.clone()));
            }
            stopped |= is_stop_event(&record);
            sink.record(&record)?;
            if matches!(record, Record::ScanEnd(_)) {
                break;
            }
            tokio::select! {
                record = scans.next() => match record {
                    Ok(record) => next = Some(record),
                    Err(error) => lost = Some(error.into()),
                },
                () = self.interrupts.clone().wait() => {
                    // Records that can no longer be fetched remain in the daemon's log.
                    for record in scans.cancel().await.unwrap_or_default() {
                        sink.record(&record)?;
                    }
                }
            }
        }
        let wall_s = began.elapsed().as_secs_f64();
        let stopped = stopped && !self.interrupts.happened();
        Ok(RecordedScan {
            view: sink.close()?,
            needs_reconnect: lost.is_some(),
            failure: lost,
            stopped,
            wall_s,
        })
    }

    async fn close(self) {}
}

impl RemoteDevice {
    /// Connects to a daemon and reads its setup without changing it. Messages to the operator go to
    /// `report`.
    ///
    /// # Errors
    /// Returns an error if the daemon does not respond, or only simulates.
    pub async fn open(
        client: Client,
        interrupts: Interrupts,
        report: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<(Self, Status), CollectError> {
        let status: Status = client.get_json("/v1/status").await?;
        if status.simulation.is_some() {
            return Err(CollectError::invalid(
                "the daemon simulates an array and measures nothing",
                "use a daemon that drives a ranger, or see `sonard simulate --array`",
            ));
        }
        let setup = client.get_json("/v1/setup").await?;
        let patience = Duration::ZERO;
        let report = Box::new(report);
        Ok((Self { client, setup, patience, interrupts, borrowed: None, report }, status))
    }

    /// Scan setup of the daemon.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Requests a scan and waits for its first record; the request is repeated if the daemon
    /// restarts meanwhile.
    async fn begin(&self, request: &ScanRequest) -> Result<(RequestedScans, Record), CollectError> {
        loop {
            self.ready().await?;
            let mut scans = match RequestedScans::request(self.client.clone(), request).await {
                Ok(scans) => scans,
                Err(error) if error.is_final() => return Err(error.into()),
                Err(_) => continue,
            };
            match self.first_record(&mut scans).await? {
                Ok(record) => return Ok((scans, record)),
                Err(error @ ScansError::Cancelled(_)) => {
                    return Err(CollectError::Stopped(format!(
                        "{error}\nrun the same command to resume"
                    )));
                }
                Err(_) => {}
            }
        }
    }

    async fn first_record(
        &self,
        scans: &mut RequestedScans,
    ) -> Result<Result<Record, ScansError>, CollectError> {
        loop {
            tokio::select! {
                record = scans.next() => return Ok(record),
                () = sleep(POLL_INTERVAL) => drop(self.ready().await?),
                () = self.interrupts.clone().wait() => {
                    drop(scans.cancel().await);
                    return Err(CollectError::interrupted());
                }
            }
        }
    }

    /// Waits until the daemon responds and has its ranger, at most `collection.retry_limit_s`.
    async fn ready(&self) -> Result<Status, CollectError> {
        let (deadline, mut reported) = (Instant::now() + self.patience, false);
        loop {
            let failure = match self.status().await {
                Ok(status) if status.link.state.is_up() => return Ok(status),
                Ok(status) => link_failure(&status.link),
                Err(failure @ CollectError::Failed { .. }) => failure,
                Err(failure) => return Err(failure),
            };
            if Instant::now() + RETRY_INTERVAL > deadline {
                return Err(failure);
            }
            if !std::mem::replace(&mut reported, true) {
                (self.report)(&format!("waiting: {failure}"));
            }
            tokio::select! {
                () = sleep(RETRY_INTERVAL) => {}
                () = self.interrupts.clone().wait() => return Err(CollectError::interrupted()),
            }
        }
    }

    /// Status of the daemon, provided that its setup is unchanged.
    async fn status(&self) -> Result<Status, CollectError> {
        let setup: Setup = self.client.get_json("/v1/setup").await?;
        if setup != self.setup {
            return Err(CollectError::invalid(
                "the daemon's sensor, model or motion changed since the collection started",
                "restore its configuration (a sensor set by a client: DELETE /v1/sensor), or start the \
                 collection again to list the changes",
            ));
        }
        Ok(self.client.get_json("/v1/status").await?)
    }

    async fn put(&self, path: &str, body: &impl Serialize) -> Result<(), CollectError> {
        Ok(self.client.put(path, body).await?)
    }
}

/// Returns `true` if a client set exactly the ordered air.
fn is_ordered(air: &AirStatus, order: &AirOrder) -> bool {
    let same = |ordered: Option<f64>, now: f64| ordered.is_none_or(|ordered| ordered == now);
    air.source == AirSource::Api
        && air.temperature_c == order.temperature_c
        && same(order.humidity_percent, air.humidity_percent)
        && same(order.pressure_kpa, air.pressure_kpa)
}

const fn as_order(air: &AirStatus) -> AirOrder {
    AirOrder {
        temperature_c: air.temperature_c,
        humidity_percent: Some(air.humidity_percent),
        pressure_kpa: Some(air.pressure_kpa),
    }
}

/// Returns `true` for the event of a scan stopped by a client's request.
fn is_stop_event(record: &Record) -> bool {
    let Record::Event(event) = record else { return false };
    event.kind == EventKind::Stopped && event.detail.contains(STOPPED_ON_REQUEST)
}
