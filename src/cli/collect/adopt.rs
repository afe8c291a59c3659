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

/// Takes over what a daemon decides by itplan.
///
/// # Errors
/// When the plan wants something of that otherwise: all of it, with the key to change.
pub(super) fn adopt(plan: &mut Plan, daemon: &ByDaemon, status: &Status) -> Result<(), Failure> {
    let setup = daemon.setup();
    let mut differences = adopt_motion(plan, setup);
    differences.extend(adopt_sensor(plan, setup)?);
    if setup.thermometer && plan.gives_air() {
        differences.push(format!(
            "{} is given, and the daemon reads a thermometer of its own (air.file)",
            plan.given_air().map(|key| format!("air.{key}")).collect::<Vec<_>>().join(", ")
        ));
    }
    if !differences.is_empty() {
        return Err(Failure::input(
            format!("the plan is not what the daemon does:\n  {}", differences.join("\n  ")),
            "leave these keys out of the plan, or change them in the daemon's configuration and \
             have it read again (`systemctl reload sonard`)",
        ));
    }
    plan.steps_per_revolution = steps_per_revolution(status).unwrap_or(plan.steps_per_revolution);
    Ok(())
}

fn adopt_motion(plan: &mut Plan, setup: &Setup) -> Vec<String> {
    let [ours, daemon] = [&plan.keys.motion, &setup.motion]
        .map(|keys| serde_json::to_value(keys).unwrap_or_default());
    let keys = daemon.as_object().into_iter().flatten();
    let differ = keys
        .filter(|(key, theirs)| plan.is_given("motion", key) && ours[key.as_str()] != **theirs)
        .map(|(key, theirs)| {
            describe_difference(plan, "motion", key, &ours[key], &format!("motion.{key}"), theirs)
        })
        .collect();
    plan.keys.motion = setup.motion.clone();
    differ
}

fn adopt_sensor(plan: &mut Plan, setup: &Setup) -> Result<Vec<String>, Failure> {
    let keys = &plan.keys.sensor;
    let reach_m = setup.model.options.max_range_m.unwrap_or(setup.sensor.max_range_m);
    let adopted = OptionKeys { max_range_m: Some(reach_m), ..setup.model.options };
    let threshold = adopted.threshold.or(Some(setup.sensor.threshold));
    let (ours, theirs) = (value(keys.options), value(OptionKeys { threshold, ..adopted }));
    let options = theirs.as_object().into_iter().flatten();
    let mut differ: Vec<String> = options
        .filter(|(key, theirs)| plan.is_given("sensor", key) && ours[key.as_str()] != **theirs)
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
    let base = match plan.is_given("sensor", "sensor") {
        true => load_sensor(&keys.sensor)?,
        false => setup.sensor.clone(),
    };
    let at = Places { layers: &plan.layers, file: &plan.name };
    let wanted = sensor(base, &plan.keys, &at)?;
    let fields = differing(&wanted, &setup.sensor);
    if !fields.is_empty() {
        differ.push(format!(
            "the plan's sensor {} is not the daemon's {} (model.sensor): {} differ",
            wanted.name,
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
    plan: &Plan,
    section: &str,
    key: &str,
    ours: &Value,
    there: &str,
    theirs: &Value,
) -> String {
    let place = plan.layers.origin(section, key).map_or_else(String::new, |at| format!("{at}: "));
    format!("{place}{section}.{key} is {ours}, and {there} of the daemon {theirs}")
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
