//! A plan for a daemon: what the plan leaves open is as the daemon has it; where it says otherwise it is
//! refused.

use serde_json::Value;

use super::load::{Places, sensor};
use crate::{
    acoustics::Sensor,
    api::{Setup, Status},
    cli::{Failure, options::load_sensor},
    collect::{ByDaemon, Plan, steps_per_revolution},
    model::OptionKeys,
};

impl Plan {
    /// Takes over what a daemon decides by itself.
    ///
    /// # Errors
    /// When the plan wants something of that otherwise: all of it, with the key to change.
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
                format!("the plan is not what the daemon does:\n  {}", differences.join("\n  ")),
                "leave these keys out of the plan, or change them in the daemon's configuration and \
                 have it read again (`systemctl reload sonard`)",
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
        let (ours, theirs) = (value(keys.options), value(OptionKeys { threshold, ..adopted }));
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
        let at = Places { layers: &self.layers, file: &self.name };
        let wanted = sensor(base, &self.keys, &at)?;
        let fields = differing(&wanted, &setup.sensor);
        if !fields.is_empty() {
            differ.push(format!(
                "the plan's sensor {} is not the daemon's {} (model.sensor): {} differ",
                wanted.name,
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

fn value(value: impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// Names of the fields in which two sensors differ.
fn differing(one: &Sensor, other: &Sensor) -> Vec<String> {
    let (one, other) = (value(one), value(other));
    let fields = |sensor: &Value| sensor.as_object().cloned().unwrap_or_default();
    let mut names: Vec<String> =
        fields(&one).into_iter().chain(fields(&other)).map(|(name, _)| name).collect();
    names.sort();
    names.dedup();
    names.retain(|name| one[name.as_str()] != other[name.as_str()]);
    names
}
