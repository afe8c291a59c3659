//! The scans that a log holds before another is added.

use std::path::{Path, PathBuf};

use crate::{
    cli::{Failure, Outcome, output},
    geometry::Pose,
    scan::{ModelRecord, Record, ScanPlan, ScanStart, Session},
    store::{StoreError, open_for_reading, read_log},
};

/// Scans that were taken into a log earlier.
pub(super) struct Earlier {
    log: PathBuf,
    scans: u64,
    session: Option<Box<Session>>,
    start: Option<ScanStart>,
}

impl Earlier {
    /// Of the log at `path`; `None` if there is none, or nothing in it.
    ///
    /// # Errors
    /// What is there is no log, the command reads it, or it can't be read.
    pub(super) fn of(path: &Path) -> Result<Option<Self>, Failure> {
        if path.symlink_metadata().map_or(true, |there| there.is_file() && there.len() == 0) {
            return Ok(None);
        }
        output::refuse_input(path)?;
        let mut earlier = Self { log: path.into(), scans: 0, session: None, start: None };
        let mut lines = 0;
        for line in read_log(open_for_reading(path)?) {
            let line = line.map_err(|source| StoreError::Read { path: path.into(), source })?;
            lines += u64::from(line.ended);
            match line.record {
                Ok(Record::Session(session)) => earlier.session = Some(session),
                Ok(Record::ScanStart(start)) => {
                    earlier.scans += 1;
                    earlier.start = Some(start);
                }
                Ok(_) => {}
                Err(error) => drop(error.reject_other_format(path)?),
            }
        }
        if lines > 0 && earlier.session.is_none() && earlier.scans == 0 {
            return Err(Failure::input(
                format!("{} is there already and is no log of scans", path.display()),
                "give --out another folder",
            ));
        }
        Ok(Some(earlier))
    }

    /// Says what is added to; refuses what was taken otherwise.
    pub(super) fn agree(&self, session: &Session, pose: Pose, plan: ScanPlan) -> Outcome {
        let log = self.log.display();
        if let Some(difference) = self.difference(session, pose, plan) {
            return Err(Failure::input(
                format!("{log} holds scans that were taken otherwise: {difference}"),
                "give --out another folder: a log holds scans of one setup",
            ));
        }
        if self.scans > 0 {
            let scans = self.scans;
            notice!(
                "{log} holds {scans} scan(s) taken alike: this is added to it; the pictures show the \
                 last"
            );
        }
        Ok(())
    }

    fn difference(&self, session: &Session, pose: Pose, plan: ScanPlan) -> Option<String> {
        let told = |what: &str, was: &dyn std::fmt::Display, is: &dyn std::fmt::Display| {
            Some(format!("{what} {was} there, {is} now"))
        };
        if let Some(was) = self.session.as_deref() {
            if was.provenance != session.provenance {
                let (was, is) = (was.provenance, session.provenance);
                return told("readings", &name(was), &name(is));
            }
            if was.scene != session.scene {
                let named = |of: &Session| {
                    let scene = of.scene.as_ref();
                    scene.map_or("none".into(), |scene| {
                        format!("{} ({:.8})", scene.name, scene.sha256)
                    })
                };
                return told("scene", &named(was), &named(session));
            }
            if was.sensor != session.sensor {
                let (was, is) = (&was.sensor.name, &session.sensor.name);
                return told("sensor", was, &format!("{is} with other data"));
            }
            if !is_same(was.model.as_ref(), session.model.as_ref()) {
                let engine = |of: &Session| {
                    of.model
                        .as_ref()
                        .map_or_else(|| "none".to_owned(), |model| model.engine.clone())
                };
                return told("model", &engine(was), &format!("{}, set otherwise", engine(session)));
            }
        }
        let start = self.start.as_ref()?;
        let text = |pose: &Pose| format!("{},{},{}", pose.x_m, pose.y_m, pose.heading_deg);
        if start.pose != pose {
            return told("pose", &text(&start.pose), &text(&pose));
        }
        if start.plan != plan {
            let text = |plan: &ScanPlan| {
                let ScanPlan { from_deg, to_deg, step_deg, pings_per_stop, .. } = plan;
                format!("{from_deg} to {to_deg} by {step_deg} degrees, {pings_per_stop} each")
            };
            return told("plan", &text(&start.plan), &text(&plan));
        }
        None
    }
}

/// Whether two models are set alike, whatever their records leave out.
fn is_same(one: Option<&ModelRecord>, other: Option<&ModelRecord>) -> bool {
    let options = |model: Option<&ModelRecord>| model.and_then(ModelRecord::options);
    one == other
        || options(one).is_some_and(|options_of_one| Some(options_of_one) == options(other))
}

fn name(provenance: crate::scan::Provenance) -> String {
    format!("{provenance:?}").to_lowercase()
}
