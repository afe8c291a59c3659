//! Adapts a plan to a daemon: keys that the plan leaves open take the daemon's values, conflicting
//! keys are errors.

use serde_json::Value;

use super::load::{Origins, sensor};
use crate::{
    acoustics::Sensor,
    api::{Setup, Status},
    cli::{Failure, options::load_sensor},
    collect::{ByDaemon, Plan, steps_per_revolution},
    model::OptionKeys,
};

impl Plan {
    /// Adopts the settings that the daemon determines.
    ///
    /// # Errors
    ///
    /// The plan sets other values; the message lists each key to change.
    pub(super) fn adopt(&mut self, daemon: &ByDaemon, status: &Status) -> Result<(), Failure> {
        let setup = daemon.setup();
        let mut differences = self.adopt_motion(setup);
        differences.extend(self.adopt_sensor(setup)?);
        if setup.thermometer && self.gives_air() {
            differences.push(format!(
                "{} is given, and the daemon reads a thermometer of its own (air.file)",
                self.given_air().map(|key| format!("air.{key}")).collect::<Vec<_>>().join(", ")
            ));
        }
        if !differences.is_empty() {
            return Err(Failure::input(
                format!(
                    "the plan differs from the daemon's settings:\n  {}",
                    differences.join("\n  ")
                ),
                "leave these keys out of the plan, or change them in the daemon's configuration and \
                 reload it (`systemctl reload sonard`)",
            ));
        }
        self.steps_per_revolution =
            steps_per_revolution(status).unwrap_or(self.steps_per_revolution);
        Ok(())
    }

    fn adopt_motion(&mut self, setup: &Setup) -> Vec<String> {
        let [plan, daemon] = [&self.keys.motion, &setup.motion]
            .map(|keys| serde_json::to_value(keys).unwrap_or_default());
        let keys = daemon.as_object().into_iter().flatten();
        let differ = keys
            .filter(|(key, theirs)| self.is_given("motion", key) && plan[key.as_str()] != **theirs)
            .map(|(key, theirs)| {
                self.differs("motion", key, &plan[key], &format!("motion.{key}"), theirs)
            })
            .collect();
        self.keys.motion = setup.motion.clone();
        differ
    }

    fn adopt_sensor(&mut self, setup: &Setup) -> Result<Vec<String>, Failure> {
        let keys = &self.keys.sensor;
        let reach_m = setup.model.options.max_range_m.unwrap_or(setup.sensor.max_range_m);
        let adopted = OptionKeys { max_range_m: Some(reach_m), ..setup.model.options };
        let threshold = adopted.threshold.or(Some(setup.sensor.threshold));
        let (ours, theirs) = (to_json(keys.options), to_json(OptionKeys { threshold, ..adopted }));
        let options = theirs.as_object().into_iter().flatten();
        let mut differ: Vec<String> = options
            .filter(|(key, theirs)| self.is_given("sensor", key) && ours[key.as_str()] != **theirs)
            .map(|(key, theirs)| {
                self.differs("sensor", key, &ours[key.as_str()], &format!("model.{key}"), theirs)
            })
            .collect();
        let base = match self.is_given("sensor", "sensor") {
            true => load_sensor(&keys.sensor)?,
            false => setup.sensor.clone(),
        };
        let at = Origins { layers: &self.layers, file: &self.name };
        let requested = sensor(base, &self.keys, &at)?;
        let fields = differing_fields(&requested, &setup.sensor);
        if !fields.is_empty() {
            differ.push(format!(
                "the plan's sensor {} is not the daemon's {} (model.sensor): {} differ",
                requested.name,
                setup.sensor.name,
                fields.join(", ")
            ));
        }
        let keys = &mut self.keys.sensor;
        keys.options = adopted;
        keys.sensor.clone_from(&setup.sensor.name);
        self.sensor = setup.sensor.clone();
        Ok(differ)
    }

    fn differs(
        &self,
        section: &str,
        key: &str,
        ours: &Value,
        there: &str,
        theirs: &Value,
    ) -> String {
        let place =
            self.layers.origin(section, key).map_or_else(String::new, |at| format!("{at}: "));
        format!("{place}{section}.{key} is {ours}, and {there} of the daemon {theirs}")
    }
}

fn to_json(to_json: impl serde::Serialize) -> Value {
    serde_json::to_value(to_json).unwrap_or_default()
}

/// Returns the names of the fields in which two sensors differ.
fn differing_fields(a: &Sensor, b: &Sensor) -> Vec<String> {
    let (a, b) = (to_json(a), to_json(b));
    let fields = |sensor: &Value| sensor.as_object().cloned().unwrap_or_default();
    let mut names: Vec<String> =
        fields(&a).into_iter().chain(fields(&b)).map(|(name, _)| name).collect();
    names.sort();
    names.dedup();
    names.retain(|name| a[name.as_str()] != b[name.as_str()]);
    names
}
