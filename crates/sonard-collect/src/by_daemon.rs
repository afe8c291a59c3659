//! A daemon that takes the scans of a collection: asked for each with its pose and plan, and left as
//! it was found.

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
    AirBefore, Borrowed, Connected, Device, Halt, Plan, ScanOrder,
    taking::{Taken, Taking},
};

const WAIT: Duration = Duration::from_secs(1);
/// How often it is looked whether a daemon that has not begun yet can scan at all.
const LOOK: Duration = Duration::from_secs(5);

/// A daemon, and what a collection wants of it.
pub struct ByDaemon {
    client: Client,
    /// What it decided about every scan when the collection began.
    setup: Setup,
    patience: Duration,
    interrupts: Interrupts,
    /// What it did by itself before, as far as that was changed.
    borrowed: Option<Borrowed>,
    /// Tells whoever looks on.
    tell: Tell,
}

/// Tells whoever looks on.
type Tell = Box<dyn Fn(&str) + Send + Sync>;

/// The air that the next scan of a daemon will be taken in.
fn next_air(status: &Status) -> &AirStatus {
    status.pending.air.as_ref().unwrap_or(&status.air)
}

/// Motor steps a turn of its ranger, once that told them.
#[must_use]
pub fn steps_per_revolution(status: &Status) -> Option<u16> {
    status.device.as_ref().and_then(|device| device.steps_per_revolution.try_into().ok())
}

fn trouble(link: &LinkReport) -> Halt {
    let trouble = link.trouble.as_deref().unwrap_or("no more is known");
    Halt::failed(
        format!("the daemon has no ranger, it is {}: {trouble}", link.state.name()),
        "see `sonard status`; the collection goes on where it stopped when it is started again",
    )
}

impl Device for ByDaemon {
    fn is_local(&self) -> bool {
        false
    }

    fn prepare(&mut self, _plan: &Plan, _first: &PreparedScan) -> Result<(), Halt> {
        Ok(())
    }

    fn carry_to(&mut self, _to: &PreparedScan) -> Result<(), Halt> {
        Ok(())
    }

    /// Goes on where an earlier run left it.
    fn go_on(&mut self, patience: Duration, borrowed: Option<Borrowed>) {
        (self.patience, self.borrowed) = (patience, borrowed);
    }

    /// Waits until it has a ranger that can be used.
    async fn meet(&mut self) -> Result<Connected, Halt> {
        let status = self.ready().await?;
        match (status.device, status.provenance) {
            (Some(device), Some(provenance)) => Ok(Connected { device, provenance }),
            _ => Err(Halt::failed("the daemon does not know its ranger", "see `sonard status`")),
        }
    }

    /// What is about to be changed of what it does by itself, beyond what is known already: its own
    /// scans are held, because only the collection knows where the ranger stands, and the air is
    /// what the plan says, if it says anything.
    async fn to_borrow(&self, air: Option<&AirOrder>) -> Result<Option<Borrowed>, Halt> {
        let status = self.ready().await?;
        let ScanningReport { mode, every_s, .. } = status.scanning;
        let mut before = self.borrowed.clone();
        if mode != Mode::OnRequest {
            before.get_or_insert_default().scanning = Some(ScanningKeys { mode, every_s });
        }
        if air.is_some_and(|air| !is(next_air(&status), air)) {
            // Air that this collection gave earlier is not the daemon's own.
            let own = || match next_air(&status).source {
                AirSource::Api => AirBefore::Given(as_order(next_air(&status))),
                _ => AirBefore::Own,
            };
            before.get_or_insert_default().air.get_or_insert_with(own);
        }
        Ok(before.filter(|before| Some(before) != self.borrowed.as_ref()))
    }

    /// Lets the collection decide when scans are taken, and in which air.
    async fn borrow(
        &mut self,
        before: Option<Borrowed>,
        air: Option<&AirOrder>,
    ) -> Result<(), Halt> {
        if before.is_some() {
            self.borrowed = before;
        }
        let on_request = Scanning { mode: Mode::OnRequest, every_s: None };
        self.put("/v1/scanning", &on_request).await?;
        let status: Status = self.client.get_json("/v1/status").await?;
        match air.filter(|air| !is(next_air(&status), air)) {
            Some(air) => self.put("/v1/air", air).await,
            None => Ok(()),
        }
    }

    /// Leaves it as it was found; whether there was anything to give back.
    async fn give_back(&mut self) -> Result<bool, Halt> {
        let Some(before) = self.borrowed.take() else { return Ok(false) };
        if let Some(ScanningKeys { mode, every_s }) = before.scanning {
            let scanning = Scanning { mode, every_s: Some(every_s) };
            self.put("/v1/scanning", &scanning).await?;
        }
        match before.air {
            Some(AirBefore::Given(air)) => self.put("/v1/air", &air).await?,
            Some(AirBefore::Own) => {
                self.client.delete("/v1/air").await?;
            }
            None => {}
        }
        Ok(true)
    }

    /// The temperature that somebody measured for it, degrees Celsius.
    async fn temperature_c(&self) -> Option<f64> {
        let InForce::<AirStatus> { now, pending } = self.client.get_json("/v1/air").await.ok()?;
        let air = pending.unwrap_or(now);
        (air.source != AirSource::Configuration).then_some(air.temperature_c)
    }

    async fn take(&mut self, scan: ScanOrder<'_>, beam: &(dyn Fn() + Sync)) -> Result<Taken, Halt> {
        let ScanOrder { plan, pose, of, path, .. } = scan;
        let request = ScanRequest { scans: Some(1), plan: Some(plan), pose: Some(pose) };
        let (mut scans, first) = self.begin(&request).await?;
        let began = Instant::now();
        let mut sink = Taking::open(path, beam)?;
        let (mut lost, mut stopped) = (None, false);
        let mut next = Some(first);
        while let Some(mut record) = next.take() {
            if let Record::Session(session) = &mut record {
                session.collection = Some(Box::new(of.clone()));
            }
            stopped |= is_stop(&record);
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
                    // What can't be had any more is in the daemon's log.
                    for record in scans.cancel().await.unwrap_or_default() {
                        sink.record(&record)?;
                    }
                }
            }
        }
        let wall_s = began.elapsed().as_secs_f64();
        let stopped = stopped && !self.interrupts.happened();
        Ok(Taken { view: sink.close()?, gone: lost.is_some(), lost, stopped, wall_s })
    }

    async fn close(self) {}
}

impl ByDaemon {
    /// Looks at a daemon, and changes nothing of it yet. What a person should know meanwhile goes to
    /// `tell`.
    ///
    /// # Errors
    /// When it does not answer, or measures nothing.
    pub async fn find(
        client: Client,
        interrupts: Interrupts,
        tell: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<(Self, Status), Halt> {
        let status: Status = client.get_json("/v1/status").await?;
        if status.simulation.is_some() {
            return Err(Halt::wrong(
                "the daemon plays an array and measures nothing",
                "collect by a daemon that drives a ranger, or see `sonard simulate --array`",
            ));
        }
        let setup = client.get_json("/v1/setup").await?;
        let patience = Duration::ZERO;
        let tell = Box::new(tell);
        Ok((Self { client, setup, patience, interrupts, borrowed: None, tell }, status))
    }

    /// What it decides about every scan.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Asks for the scan and waits for its first record; a daemon that restarts meanwhile is asked
    /// again.
    async fn begin(&self, request: &ScanRequest) -> Result<(RequestedScans, Record), Halt> {
        loop {
            self.ready().await?;
            let mut scans = match RequestedScans::ask(self.client.clone(), request).await {
                Ok(scans) => scans,
                Err(error) if error.is_final() => return Err(error.into()),
                Err(_) => continue,
            };
            match self.first(&mut scans).await? {
                Ok(record) => return Ok((scans, record)),
                Err(error @ ScansError::Forgotten(_)) => {
                    return Err(Halt::Stopped(format!(
                        "{error}\nstart it again with the same plan: it goes on where it stopped"
                    )));
                }
                Err(_) => {}
            }
        }
    }

    async fn first(&self, scans: &mut RequestedScans) -> Result<Result<Record, ScansError>, Halt> {
        loop {
            tokio::select! {
                record = scans.next() => return Ok(record),
                () = sleep(LOOK) => drop(self.ready().await?),
                () = self.interrupts.clone().wait() => {
                    drop(scans.cancel().await);
                    return Err(Halt::on_request());
                }
            }
        }
    }

    /// Waits, for as long as the plan's patience, until the daemon answers and has its ranger.
    async fn ready(&self) -> Result<Status, Halt> {
        let (until, mut told) = (Instant::now() + self.patience, false);
        loop {
            let failure = match self.look().await {
                Ok(status) if status.link.state.is_up() => return Ok(status),
                Ok(status) => trouble(&status.link),
                Err(failure @ Halt::Failed { .. }) => failure,
                Err(failure) => return Err(failure),
            };
            if Instant::now() + WAIT > until {
                return Err(failure);
            }
            if !std::mem::replace(&mut told, true) {
                (self.tell)(&format!("waiting: {failure}"));
            }
            tokio::select! {
                () = sleep(WAIT) => {}
                () = self.interrupts.clone().wait() => return Err(Halt::on_request()),
            }
        }
    }

    async fn look(&self) -> Result<Status, Halt> {
        let setup: Setup = self.client.get_json("/v1/setup").await?;
        if setup != self.setup {
            return Err(Halt::wrong(
                "the daemon's sensor, model or motion is not what it was when this began",
                "put its configuration back (a sensor that a program changed: DELETE /v1/sensor), or start the collection again: it says what changed",
            ));
        }
        Ok(self.client.get_json("/v1/status").await?)
    }

    async fn put(&self, path: &str, body: &impl Serialize) -> Result<(), Halt> {
        Ok(self.client.put(path, body).await?)
    }
}

/// Whether that is the air in force, by a program's word.
fn is(air: &AirStatus, order: &AirOrder) -> bool {
    let same = |wanted: Option<f64>, now: f64| wanted.is_none_or(|wanted| wanted == now);
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

/// Whether somebody told the daemon to end the scan.
fn is_stop(record: &Record) -> bool {
    let Record::Event(event) = record else { return false };
    event.kind == EventKind::Stopped && event.detail.contains(STOPPED_ON_REQUEST)
}
