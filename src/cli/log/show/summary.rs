//! What a log holds, scan by scan.

use std::{collections::HashMap, mem};

use jiff::Timestamp;
use serde::Serialize;
use uuid::Uuid;

use crate::{
    compare::quantile,
    geometry::Pose,
    scan::{Event, Ping, PingStatus, Record, ScanEnd, ScanStart, Session},
    store::Loaded,
};

/// A log's contents in order.
#[derive(Debug, Default)]
pub(super) struct Summary<'a> {
    pub(super) items: Vec<Item<'a>>,
    /// Where in `items` each scan is.
    scans: HashMap<Uuid, usize>,
}

/// A session, a scan, an event or a damaged line.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Item<'a> {
    Session(&'a Session),
    Scan(Box<Scan>),
    Event(&'a Event),
    Damaged { line: u64, fault: String },
}

/// A scan in numbers.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Scan {
    pub(super) scan: Uuid,
    pub(super) time: Option<Timestamp>,
    pub(super) pose: Option<Pose>,
    pub(super) planned: Option<u32>,
    pub(super) pings: u32,
    pub(super) echo: u32,
    pub(super) min_range: u32,
    pub(super) no_echo: u32,
    pub(super) link_lost: u32,
    pub(super) step_doubtful: u32,
    pub(super) module_fault: u32,
    pub(super) median_abs_residual_m: Option<f64>,
    pub(super) end: Option<ScanEnd>,
    #[serde(skip)]
    residuals_m: Vec<f64>,
}

impl<'a> Summary<'a> {
    pub(super) fn of(loaded: &'a Loaded) -> Self {
        let mut summary = Self::default();
        for record in &loaded.records {
            summary.add(record);
        }
        for item in &mut summary.items {
            if let Item::Scan(scan) = item {
                scan.median_abs_residual_m = quantile(mem::take(&mut scan.residuals_m), 0.5);
            }
        }
        for error in &loaded.damaged {
            let fault = error.fault.to_string();
            summary.items.push(Item::Damaged { line: error.line, fault });
        }
        summary
    }

    fn add(&mut self, record: &'a Record) {
        match record {
            Record::Session(session) => self.items.push(Item::Session(session)),
            Record::ScanStart(start) => self.scan(start.scan).begin(start),
            Record::Ping(ping) => self.scan(ping.scan).count(ping),
            Record::ScanEnd(end) => self.scan(end.scan).end = Some(end.clone()),
            Record::Event(event) => self.items.push(Item::Event(event)),
        }
    }

    fn scan(&mut self, id: Uuid) -> &mut Scan {
        let items = &mut self.items;
        let at = *self.scans.entry(id).or_insert_with(|| {
            items.push(Item::Scan(Box::new(Scan { scan: id, ..Scan::default() })));
            items.len() - 1
        });
        match &mut items[at] {
            Item::Scan(scan) => scan,
            _ => unreachable!("only scans are entered"),
        }
    }
}

impl Scan {
    fn begin(&mut self, start: &ScanStart) {
        self.time = Some(start.time);
        self.pose = Some(start.pose);
        self.planned = start.plan.check().is_ok().then(|| start.plan.beams());
    }

    fn count(&mut self, ping: &Ping) {
        self.pings += 1;
        *match ping.status {
            PingStatus::Echo => &mut self.echo,
            PingStatus::MinRange => &mut self.min_range,
            PingStatus::NoEcho => &mut self.no_echo,
            PingStatus::LinkLost => &mut self.link_lost,
            PingStatus::StepDoubtful => &mut self.step_doubtful,
            PingStatus::ModuleFault => &mut self.module_fault,
        } += 1;
        self.residuals_m.extend(ping.residual_m.filter(|m| m.is_finite()).map(f64::abs));
    }
}
