//! Which part of a set this process makes: as the option says, else as an array job's environment does.

use super::Failure;
use crate::generate::Part;

/// Engines that count from 0 and do not say of how many: as many as there are shards.
const FROM_ZERO: [&str; 2] = ["JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX"];
const SLURM: &str = "SLURM_ARRAY_TASK_ID";

/// The part, and a line about it on standard error wherever it is not the option's alone.
pub(super) fn part(
    given: Option<Part>,
    variable: &dyn Fn(&str) -> Option<String>,
    shards: u32,
) -> Result<Part, Failure> {
    let (part, told) = told(given, variable, shards)?;
    if let Some(told) = told {
        notice!("{told}");
    }
    Ok(part)
}

fn told(
    given: Option<Part>,
    variable: &dyn Fn(&str) -> Option<String>,
    shards: u32,
) -> Result<(Part, Option<String>), Failure> {
    let names = [SLURM].into_iter().chain(FROM_ZERO);
    let Some(name) = names.into_iter().find(|name| variable(name).is_some()) else {
        return Ok((given.unwrap_or(Part::WHOLE), None));
    };
    if let Some(part) = given {
        return Ok((part, Some(format!("part {part}, as --shard says; {name} is not looked at"))));
    }
    let part = match name {
        SLURM => of_slurm(variable)?,
        _ => {
            let index: u32 = number(name, variable)?;
            new(name, index.saturating_add(1), shards)?
        }
    };
    Ok((part, Some(format!("part {part}, as {name} says; --shard 1/1 makes all"))))
}

/// Slurm's arrays begin where the user says, and go in steps.
fn of_slurm(variable: &dyn Fn(&str) -> Option<String>) -> Result<Part, Failure> {
    let id = number(SLURM, variable)?;
    let or = |name, otherwise| match variable(name) {
        Some(_) => number(name, variable),
        None => Ok(otherwise),
    };
    let (least, step) = (or("SLURM_ARRAY_TASK_MIN", id)?, or("SLURM_ARRAY_TASK_STEP", 1)?);
    let count = number("SLURM_ARRAY_TASK_COUNT", variable)?;
    let most = or("SLURM_ARRAY_TASK_MAX", id)?;
    // Some ids out of a list, as when those that failed are given again, do not say which part they were.
    let steps = most.checked_sub(least).map(|span| span / step.max(1));
    if steps != count.checked_sub(1) {
        return Err(Failure::input(
            format!(
                "the {count} ids of this Slurm array, {least} to {most}, are not one after the other"
            ),
            "say which part each one is: --shard \"$SLURM_ARRAY_TASK_ID/N\"",
        ));
    }
    new(SLURM, id.saturating_sub(least) / step.max(1) + 1, count)
}

fn number(name: &str, variable: &dyn Fn(&str) -> Option<String>) -> Result<u32, Failure> {
    let text = variable(name);
    text.as_ref().and_then(|text| text.trim().parse().ok()).ok_or_else(|| {
        let is = text.map_or("is not there".to_owned(), |text| format!("is `{text}`"));
        Failure::input(
            format!("{name} {is}, and no number"),
            "say which part it is with --shard I/N",
        )
    })
}

fn new(name: &str, index: u32, of: u32) -> Result<Part, Failure> {
    Part::new(index, of).map_err(|error| {
        Failure::input(
            format!("{name}: {error}"),
            "let the array have as many indices as the set has shards, or say which part it is with --shard I/N",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(given: Option<&str>, variables: &[(&str, &str)]) -> Result<String, String> {
        let variable = |name: &str| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
        };
        let given = given.map(|text| text.parse().expect("a part"));
        let (part, told) = told(given, &variable, 8).map_err(|failure| match failure {
            Failure::Input(report) => report.to_string(),
            other => panic!("{other:?}"),
        })?;
        Ok(told.map_or_else(|| part.to_string(), |told| format!("{part}: {told}")))
    }

    #[test]
    fn the_option_goes_before_the_environment_and_it_is_said_which_counted() {
        let slurm = |id, least, most, count, step| {
            [
                (SLURM, id),
                ("SLURM_ARRAY_TASK_MIN", least),
                ("SLURM_ARRAY_TASK_MAX", most),
                ("SLURM_ARRAY_TASK_COUNT", count),
                ("SLURM_ARRAY_TASK_STEP", step),
            ]
        };
        let begins = |told: Result<String, String>, beginning: &str| {
            assert!(told.as_ref().is_ok_and(|told| told.starts_with(beginning)), "{told:?}");
        };
        assert_eq!(of(None, &[]), Ok("1/1".to_owned()));
        assert_eq!(of(Some("3/20"), &[]), Ok("3/20".to_owned()));
        begins(of(None, &slurm("4", "1", "5", "5", "1")), "4/5: part 4/5, as SLURM_ARRAY_TASK_ID");
        begins(of(None, &slurm("0", "0", "4", "5", "1")), "1/5");
        begins(of(None, &slurm("7", "1", "9", "5", "2")), "4/5");
        begins(
            of(None, &[("JOB_COMPLETION_INDEX", "0")]),
            "1/8: part 1/8, as JOB_COMPLETION_INDEX",
        );
        begins(of(None, &[("AWS_BATCH_JOB_ARRAY_INDEX", "7")]), "8/8");
        begins(of(Some("2/3"), &[("JOB_COMPLETION_INDEX", "0")]), "2/3: part 2/3, as --shard says");
        for (variables, part) in [
            (&slurm("7", "3", "7", "2", "1")[..], "not one after the other"),
            (&[("JOB_COMPLETION_INDEX", "8")], "no part 9 of 8"),
            (&[("JOB_COMPLETION_INDEX", "first")], "`first`"),
            (&[(SLURM, "1")], "SLURM_ARRAY_TASK_COUNT is not there"),
        ] {
            let error = of(None, variables).expect_err(part);
            assert!(error.contains(part), "{error}");
        }
    }
}
