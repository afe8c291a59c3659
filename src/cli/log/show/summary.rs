//! Contents of a log, scan by scan.

use std::{collections::HashMap, mem};

use jiff::Timestamp;
use serde::Serialize;
use uuid::Uuid;

use crate::{
    compare::quantile,
    geometry::Pose,
    scan::{Event, Ping, PingStatus, Record, ScanEnd, ScanStart, Session},
    store::LineError,
};

/// A log's contents in order.
#[derive(Debug, Default)]
pub(super) struct Summary {
    pub(super) items: Vec<Item>,
    /// Position of each scan in `items`.
    scans: HashMap<Uuid, usize>,
    damaged: Vec<Item>,
    more_damaged: u64,
}

/// A session, a scan, an event or a damaged line.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Item {
    Session(Box<Session>),
    Scan(Box<Scan>),
    Event(Event),
    Damaged {
        line: u64,
        fault: String,
    },
    /// Number of further damaged lines.
    MoreDamaged {
        lines: u64,
    },
}

/// Counts and figures of a scan.
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
    pub(super) step_uncertain: u32,
    pub(super) module_fault: u32,
    pub(super) median_abs_residual_m: Option<f64>,
    pub(super) end: Option<ScanEnd>,
    #[serde(skip)]
    residuals_m: Vec<f64>,
}

/// Maximum number of listed damaged lines; further ones are counted.
const MAX_DAMAGED: usize = 5;

impl Summary {
    /// Adds the next record.
    pub(super) fn add(&mut self, record: Record) {
        match record {
            Record::Session(session) => self.items.push(Item::Session(session)),
            Record::ScanStart(start) => self.scan(start.scan).begin(&start),
            Record::Ping(ping) => self.scan(ping.scan).count(&ping),
            Record::ScanEnd(end) => {
                let scan = end.scan;
                self.scan(scan).end = Some(end);
            }
            Record::Event(event) => self.items.push(Item::Event(event)),
        }
    }

    /// Adds a line that is not a record.
    pub(super) fn damaged(&mut self, error: &LineError) {
        if self.damaged.len() == MAX_DAMAGED {
            self.more_damaged += 1;
            return;
        }
        let fault = error.fault.to_string();
        self.damaged.push(Item::Damaged { line: error.line, fault });
    }

    /// Computes medians and appends damaged lines, after the last line.
    pub(super) fn finish(mut self) -> Self {
        for item in &mut self.items {
            if let Item::Scan(scan) = item {
                scan.median_abs_residual_m = quantile(mem::take(&mut scan.residuals_m), 0.5);
            }
        }
        self.items.append(&mut self.damaged);
        if self.more_damaged > 0 {
            self.items.push(Item::MoreDamaged { lines: self.more_damaged });
        }
        self
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
            PingStatus::StepUncertain => &mut self.step_uncertain,
            PingStatus::ModuleFault => &mut self.module_fault,
        } += 1;
        self.residuals_m.extend(ping.residual_m.filter(|m| m.is_finite()).map(f64::abs));
    }
}
