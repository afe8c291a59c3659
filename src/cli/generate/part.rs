//! Part of a set that this process makes, from the option or an array job's environment.

use super::Failure;
use crate::generate::SetPart;

/// Variables of systems that count from 0 without stating the size of the array, which must be the
/// number of shards.
const FROM_ZERO: [&str; 2] = ["JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX"];
const SLURM: &str = "SLURM_ARRAY_TASK_ID";

/// Determines the part; logs a line on standard error unless it is determined by the option alone.
pub(super) fn part(
    given: Option<SetPart>,
    variable: &dyn Fn(&str) -> Option<String>,
    shards: u32,
) -> Result<SetPart, Failure> {
    let (part, note) = determine(given, variable, shards)?;
    if let Some(note) = note {
        notice!("{note}");
    }
    Ok(part)
}

fn determine(
    given: Option<SetPart>,
    variable: &dyn Fn(&str) -> Option<String>,
    shards: u32,
) -> Result<(SetPart, Option<String>), Failure> {
    let names = [SLURM].into_iter().chain(FROM_ZERO);
    let Some(name) = names.into_iter().find(|name| variable(name).is_some()) else {
        return Ok((given.unwrap_or(SetPart::WHOLE), None));
    };
    if let Some(part) = given {
        return Ok((part, Some(format!("part {part}, from --shard; {name} is ignored"))));
    }
    let part = match name {
        SLURM => slurm_part(variable)?,
        _ => {
            let index: u32 = number(name, variable)?;
            new(name, index.saturating_add(1), shards)?
        }
    };
    Ok((part, Some(format!("part {part}, from {name}; --shard 1/1 makes all"))))
}

/// Slurm arrays start at any index and may have a stride.
fn slurm_part(variable: &dyn Fn(&str) -> Option<String>) -> Result<SetPart, Failure> {
    let id = number(SLURM, variable)?;
    let or = |name, default| match variable(name) {
        Some(_) => number(name, variable),
        None => Ok(default),
    };
    let (first, step) = (or("SLURM_ARRAY_TASK_MIN", id)?, or("SLURM_ARRAY_TASK_STEP", 1)?);
    let count = number("SLURM_ARRAY_TASK_COUNT", variable)?;
    let last = or("SLURM_ARRAY_TASK_MAX", id)?;
    // A list of ids, as in a rerun of failed tasks, does not determine the part.
    let steps = last.checked_sub(first).map(|span| span / step.max(1));
    if steps != count.checked_sub(1) {
        return Err(Failure::input(
            format!("the {count} ids of this Slurm array, {first} to {last}, are not consecutive"),
            "state the part of each: --shard \"$SLURM_ARRAY_TASK_ID/N\"",
        ));
    }
    new(SLURM, id.saturating_sub(first) / step.max(1) + 1, count)
}

fn number(name: &str, variable: &dyn Fn(&str) -> Option<String>) -> Result<u32, Failure> {
    let text = variable(name);
    text.as_ref().and_then(|text| text.trim().parse().ok()).ok_or_else(|| {
        let is = text.map_or("is not set".to_owned(), |text| format!("is `{text}`"));
        Failure::input(format!("{name} {is}, not a number"), "state the part with --shard I/N")
    })
}

fn new(name: &str, index: u32, of: u32) -> Result<SetPart, Failure> {
    SetPart::new(index, of).map_err(|error| {
        Failure::input(
            format!("{name}: {error}"),
            "use an array with one index per shard, or state the part with --shard I/N",
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
        let (part, note) = determine(given, &variable, 8).map_err(|failure| match failure {
            Failure::Input(diagnostic) => diagnostic.to_string(),
            other => panic!("{other:?}"),
        })?;
        Ok(note.map_or_else(|| part.to_string(), |note| format!("{part}: {note}")))
    }

    #[test]
    fn option_overrides_environment() {
        let slurm = |id, first, last, count, step| {
            [
                (SLURM, id),
                ("SLURM_ARRAY_TASK_MIN", first),
                ("SLURM_ARRAY_TASK_MAX", last),
                ("SLURM_ARRAY_TASK_COUNT", count),
                ("SLURM_ARRAY_TASK_STEP", step),
            ]
        };
        let begins = |found: Result<String, String>, beginning: &str| {
            assert!(found.as_ref().is_ok_and(|note| note.starts_with(beginning)), "{found:?}");
        };
        assert_eq!(of(None, &[]), Ok("1/1".to_owned()));
        assert_eq!(of(Some("3/20"), &[]), Ok("3/20".to_owned()));
        begins(
            of(None, &slurm("4", "1", "5", "5", "1")),
            "4/5: part 4/5, from SLURM_ARRAY_TASK_ID",
        );
        begins(of(None, &slurm("0", "0", "4", "5", "1")), "1/5");
        begins(of(None, &slurm("7", "1", "9", "5", "2")), "4/5");
        begins(
            of(None, &[("JOB_COMPLETION_INDEX", "0")]),
            "1/8: part 1/8, from JOB_COMPLETION_INDEX",
        );
        begins(of(None, &[("AWS_BATCH_JOB_ARRAY_INDEX", "7")]), "8/8");
        begins(of(Some("2/3"), &[("JOB_COMPLETION_INDEX", "0")]), "2/3: part 2/3, from --shard");
        for (variables, part) in [
            (&slurm("7", "3", "7", "2", "1")[..], "not consecutive"),
            (&[("JOB_COMPLETION_INDEX", "8")], "no part 9 of 8"),
            (&[("JOB_COMPLETION_INDEX", "first")], "`first`"),
            (&[(SLURM, "1")], "SLURM_ARRAY_TASK_COUNT is not set"),
        ] {
            let error = of(None, variables).expect_err(part);
            assert!(error.contains(part), "{error}");
        }
    }
}
