//! Summary of simulated scans on a terminal.

use std::io::{self, Write as _};

use crate::{
    cli::table::{align_right, fit, ruled},
    geometry::Pose,
    scan::{Ping, PingStatus, Record, Session, text::format_count},
    store::{RecordWriter, StoreError},
};

/// Counts the readings of scans, and prints them at the end instead of the records.
#[derive(Debug, Default)]
pub(super) struct Summaries {
    session: Option<Box<Session>>,
    scans: Vec<Summary>,
}

/// Counts and ranges of a scan.
#[derive(Debug)]
struct Summary {
    pose: Pose,
    echoes: u32,
    min_range: u32,
    no_echo: u32,
    nearest_m: f64,
    farthest_m: f64,
}

impl Summary {
    const fn new(pose: Pose) -> Self {
        Self {
            pose,
            echoes: 0,
            min_range: 0,
            no_echo: 0,
            nearest_m: f64::INFINITY,
            farthest_m: 0.0,
        }
    }

    fn add(&mut self, ping: &Ping) {
        match ping.status {
            PingStatus::Echo => self.echoes += 1,
            PingStatus::MinRange => self.min_range += 1,
            _ => self.no_echo += 1,
        }
        if let Some(range_m) = ping.range_m {
            self.nearest_m = self.nearest_m.min(range_m);
            self.farthest_m = self.farthest_m.max(range_m);
        }
    }

    fn row(&self) -> [String; 7] {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        let range = |range_m: f64| match self.echoes + self.min_range {
            0 => "-".to_owned(),
            _ => format!("{range_m:.3} m"),
        };
        [
            format!("{x_m},{y_m},{heading_deg}"),
            (self.echoes + self.min_range + self.no_echo).to_string(),
            self.echoes.to_string(),
            self.min_range.to_string(),
            self.no_echo.to_string(),
            range(self.nearest_m),
            range(self.farthest_m),
        ]
    }
}

impl Summaries {
    fn text(&self) -> String {
        let mut table =
            ruled(["pose", "beams", "echo", "min range", "no echo", "nearest", "farthest"]);
        align_right(&mut table, 1..7);
        for scan in &self.scans {
            table.add_row(scan.row());
        }
        let session = self.session.as_deref();
        let scene = session.and_then(|session| session.scene.as_ref());
        let model = session.and_then(|session| session.model.as_ref());
        format!(
            "{} in {}, {}, model {}\n{}\n-o FILE writes the records, --json prints them",
            format_count(self.scans.len(), "simulated scan"),
            scene.map_or("no scene", |scene| &scene.name),
            session.map_or("", |session| &session.sensor.name),
            model.map_or("none", |model| &model.engine),
            fit(table)
        )
    }
}

impl RecordWriter for Summaries {
    fn write(&mut self, record: &Record) -> Result<(), StoreError> {
        match record {
            Record::Session(session) => self.session = Some(session.clone()),
            Record::ScanStart(start) => self.scans.push(Summary::new(start.pose)),
            Record::Ping(ping) => {
                if let Some(scan) = self.scans.last_mut() {
                    scan.add(ping);
                }
            }
            Record::ScanEnd(_) | Record::Event(_) => {}
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), StoreError> {
        writeln!(io::stdout(), "{}", self.text())
            .map_err(|source| StoreError::Write { path: "standard output".into(), source })
    }
}
