//! Existing log to which scans are appended.

use std::path::{Path, PathBuf};

use crate::{
    cli::{Failure, Outcome, output},
    geometry::Pose,
    scan::{ModelRecord, Record, ScanPlan, ScanStart, Session, text::format_count},
    store::{StoreError, open_for_reading, read_log},
};

/// Scans in an existing log.
pub(super) struct ExistingLog {
    log: PathBuf,
    scans: u64,
    session: Option<Box<Session>>,
    start: Option<ScanStart>,
}

impl ExistingLog {
    /// Reads the log at `path`; `None` if it does not exist or is empty.
    ///
    /// # Errors
    ///
    /// The file is not a log, is an input of the command, or can't be read.
    pub(super) fn read(path: &Path) -> Result<Option<Self>, Failure> {
        if path.symlink_metadata().map_or(true, |there| there.is_file() && there.len() == 0) {
            return Ok(None);
        }
        output::reject_input(path)?;
        let mut existing = Self { log: path.into(), scans: 0, session: None, start: None };
        let mut lines = 0;
        for line in read_log(open_for_reading(path)?) {
            let line = line.map_err(|source| StoreError::Read { path: path.into(), source })?;
            lines += u64::from(line.ended);
            match line.record {
                Ok(Record::Session(session)) => existing.session = Some(session),
                Ok(Record::ScanStart(start)) => {
                    existing.scans += 1;
                    existing.start = Some(start);
                }
                Ok(_) => {}
                Err(error) => drop(error.reject_other_format(path)?),
            }
        }
        if lines > 0 && existing.session.is_none() && existing.scans == 0 {
            return Err(Failure::input(
                format!("{} exists and is not a log of scans", path.display()),
                "give another folder with --out",
            ));
        }
        Ok(Some(existing))
    }

    /// Reports what is appended to; rejects a different setup.
    pub(super) fn check_same_setup(
        &self,
        session: &Session,
        pose: Pose,
        plan: ScanPlan,
    ) -> Outcome {
        let log = self.log.display();
        if let Some(difference) = self.difference(session, pose, plan) {
            return Err(Failure::input(
                format!("{log} contains scans with a different setup: {difference}"),
                "give another folder with --out: a log contains scans of one setup",
            ));
        }
        if self.scans > 0 {
            let scans = format_count(self.scans, "scan");
            notice!(
                "{log} contains {scans} of the same setup: appending; the pictures show \
             the last scan"
            );
        }
        Ok(())
    }

    fn difference(&self, session: &Session, pose: Pose, plan: ScanPlan) -> Option<String> {
        let differs = |what: &str, was: &dyn std::fmt::Display, is: &dyn std::fmt::Display| {
            Some(format!("{what} {was} (file), {is} (this command)"))
        };
        if let Some(was) = self.session.as_deref() {
            if was.provenance != session.provenance {
                let (was, is) = (was.provenance, session.provenance);
                return differs("readings", &provenance_name(was), &provenance_name(is));
            }
            if was.scene != session.scene {
                let scene_name = |of: &Session| {
                    let scene = of.scene.as_ref();
                    scene.map_or("none".into(), |scene| {
                        format!("{} ({:.8})", scene.name, scene.sha256)
                    })
                };
                return differs("scene", &scene_name(was), &scene_name(session));
            }
            if was.sensor != session.sensor {
                let (was, is) = (&was.sensor.name, &session.sensor.name);
                return differs("sensor", was, &format!("{is} with different data"));
            }
            if !is_same(was.model.as_ref(), session.model.as_ref()) {
                let engine = |of: &Session| {
                    of.model
                        .as_ref()
                        .map_or_else(|| "none".to_owned(), |model| model.engine.clone())
                };
                return differs(
                    "model",
                    &engine(was),
                    &format!("{} with different options", engine(session)),
                );
            }
        }
        let start = self.start.as_ref()?;
        let text = |pose: &Pose| format!("{},{},{}", pose.x_m, pose.y_m, pose.heading_deg);
        if start.pose != pose {
            return differs("pose", &text(&start.pose), &text(&pose));
        }
        if start.plan != plan {
            let text = |plan: &ScanPlan| {
                let ScanPlan { from_deg, to_deg, step_deg, pings_per_stop, .. } = plan;
                format!(
                    "{from_deg} to {to_deg} by {step_deg} degrees, {pings_per_stop} pings per step"
                )
            };
            return differs("plan", &text(&start.plan), &text(&plan));
        }
        None
    }
}

/// Returns `true` if two models have the same options, even if one of their records omits some.
fn is_same(a: Option<&ModelRecord>, b: Option<&ModelRecord>) -> bool {
    let options = |model: Option<&ModelRecord>| model.and_then(ModelRecord::options);
    a == b || options(a).is_some_and(|options_of_a| Some(options_of_a) == options(b))
}

fn provenance_name(provenance: crate::scan::Provenance) -> String {
    format!("{provenance:?}").to_lowercase()
}
