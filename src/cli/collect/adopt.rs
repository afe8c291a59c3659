//! Adapts a plan to a daemon: keys that the plan leaves open take the daemon's values, conflicting
//! keys are errors.

use serde_json::Value;

use super::load::{Origins, sensor};
use crate::{
    acoustics::Sensor,
    api::{Setup, Status},
    cli::{Failure, options::load_sensor},
    collect::{CollectionPlan, RemoteDevice, steps_per_revolution},
    model::OptionKeys,
};

/// Adopts the settings that the daemon determines.
///
/// # Errors
///
/// The plan sets other values; the message lists each key to change.
pub(super) fn adopt(
    plan: &mut CollectionPlan,
    daemon: &RemoteDevice,
    status: &Status,
) -> Result<(), Failure> {
    let setup = daemon.setup();
    let mut differences = adopt_motion(plan, setup);
    differences.extend(adopt_sensor(plan, setup)?);
    if setup.thermometer && plan.sets_air() {
        differences.push(format!(
            "{} is given, and the daemon reads a thermometer of its own (air.file)",
            plan.air_keys().map(|key| format!("air.{key}")).collect::<Vec<_>>().join(", ")
        ));
    }
    if !differences.is_empty() {
        return Err(Failure::input(
            format!("the plan differs from the daemon's settings:\n  {}", differences.join("\n  ")),
            "leave these keys out of the plan, or change them in the daemon's configuration and \
             reload it (`systemctl reload sonard`)",
        ));
    }
    plan.steps_per_revolution = steps_per_revolution(status).unwrap_or(plan.steps_per_revolution);
    Ok(())
}

fn adopt_motion(plan: &mut CollectionPlan, setup: &Setup) -> Vec<String> {
    let [ours, daemon] = [&plan.keys.motion, &setup.motion]
        .map(|keys| serde_json::to_value(keys).unwrap_or_default());
    let keys = daemon.as_object().into_iter().flatten();
    let differ = keys
        .filter(|(key, theirs)| plan.is_set("motion", key) && ours[key.as_str()] != **theirs)
        .map(|(key, theirs)| {
            describe_difference(plan, "motion", key, &ours[key], &format!("motion.{key}"), theirs)
        })
        .collect();
    plan.keys.motion = setup.motion.clone();
    differ
}

fn adopt_sensor(plan: &mut CollectionPlan, setup: &Setup) -> Result<Vec<String>, Failure> {
    let keys = &plan.keys.sensor;
    let reach_m = setup.model.options.max_range_m.unwrap_or(setup.sensor.max_range_m);
    let adopted = OptionKeys { max_range_m: Some(reach_m), ..setup.model.options };
    let threshold = adopted.threshold.or(Some(setup.sensor.threshold));
    let (ours, theirs) = (to_json(keys.options), to_json(OptionKeys { threshold, ..adopted }));
    let options = theirs.as_object().into_iter().flatten();
    let mut differ: Vec<String> = options
        .filter(|(key, theirs)| plan.is_set("sensor", key) && ours[key.as_str()] != **theirs)
        .map(|(key, theirs)| {
            describe_difference(
                plan,
                "sensor",
                key,
                &ours[key.as_str()],
                &format!("model.{key}"),
                theirs,
            )
        })
        .collect();
    let base = match plan.is_set("sensor", "sensor") {
        true => load_sensor(&keys.sensor)?,
        false => setup.sensor.clone(),
    };
    let at = Origins { layers: &plan.layers, file: &plan.name };
    let requested = sensor(base, &plan.keys, &at)?;
    let fields = differing_fields(&requested, &setup.sensor);
    if !fields.is_empty() {
        differ.push(format!(
            "the plan's sensor {} is not the daemon's {} (model.sensor): {} differ",
            requested.name,
            setup.sensor.name,
            fields.join(", ")
        ));
    }
    let keys = &mut plan.keys.sensor;
    keys.options = adopted;
    keys.sensor.clone_from(&setup.sensor.name);
    plan.sensor = setup.sensor.clone();
    Ok(differ)
}

fn describe_difference(
    plan: &CollectionPlan,
    section: &str,
    key: &str,
    ours: &Value,
    there: &str,
    theirs: &Value,
) -> String {
    let place = plan.layers.origin(section, key).map_or_else(String::new, |at| format!("{at}: "));
    format!("{place}{section}.{key} is {ours}, and {there} of the daemon {theirs}")
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
