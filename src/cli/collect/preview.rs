//! Duration and disk use of a collection, before it begins.

use serde_json::json;

use super::{Args, observer::human_duration};
use crate::{
    cli::Failure,
    collect::{CollectionPlan, Poses, budget, disk_bytes},
    ranger::ScanDuration,
};

/// Formats the estimate as text, or as one JSON object.
pub(super) fn render(plan: &CollectionPlan, args: &Args) -> Result<String, Failure> {
    let estimate = Estimate::from_plan(plan)?;
    Ok(if args.json { format!("{}\n", estimate.object(plan)) } else { estimate.describe(plan) })
}

/// Estimated duration of a plan, as far as it is known.
struct Estimate {
    scan: ScanDuration,
    scans: Option<u32>,
    pauses_s: f64,
    /// `true` if people have to act between scans.
    people: bool,
}

impl Estimate {
    fn from_plan(plan: &CollectionPlan) -> Result<Self, Failure> {
        let collection = &plan.keys.collection;
        let scans = plan.pose_count().map(|poses| poses.saturating_mul(collection.repeats));
        let pauses = f64::from(scans.unwrap_or(0).saturating_sub(1));
        let people = plan.keys.poses.confirm
            || !plan.keys.ask.at_pose.is_empty()
            || matches!(plan.poses, Poses::Prompt);
        let pauses_s = pauses * collection.pause_s;
        Ok(Self { scan: budget(plan)?, scans, pauses_s, people })
    }

    fn object(&self, plan: &CollectionPlan) -> serde_json::Value {
        let split = |budget: &ScanDuration| {
            json!({
                "acoustics_s": budget.acoustics_s,
                "motor_s": budget.motor_s,
                "link_s": budget.link_s,
            })
        };
        let all = self.scans.map(|scans| {
            let budget = self.scan.times(scans.into());
            let mut all = split(&budget);
            all["pauses_s"] = self.pauses_s.into();
            all["total_s"] = (budget.total_s() + self.pauses_s).into();
            all["disk_bytes"] = disk_bytes(plan, scans).round().into();
            all
        });
        let mut one = split(&self.scan);
        one["total_s"] = self.scan.total_s().into();
        one["beams"] = plan.azimuths.beams().into();
        json!({
            "poses": plan.pose_count(), "repeats": plan.keys.collection.repeats, "scans": self.scans,
            "scan": one, "total": all, "waits_for_people": self.people,
        })
    }

    fn describe(&self, plan: &CollectionPlan) -> String {
        let line = |name: &str, budget: &ScanDuration| {
            format!(
                "{name:<12}{:>12} = {} acoustics + {} motor + {} link",
                seconds(budget.total_s()),
                seconds(budget.acoustics_s),
                seconds(budget.motor_s),
                seconds(budget.link_s),
            )
        };
        let mut lines = vec![line("one scan", &self.scan)];
        match self.scans {
            Some(scans) => {
                let all = self.scan.times(scans.into());
                lines.push(line(&format!("{scans} scans"), &all));
                let total_s = all.total_s() + self.pauses_s;
                if plan.keys.collection.pause_s > 0.0 {
                    lines.push(format!("{:<12}{:>12}", "pauses", seconds(self.pauses_s)));
                }
                lines.push(format!(
                    "{:<12}{:>12} ({}), about {:.1} MB",
                    "total",
                    seconds(total_s),
                    human_duration(total_s),
                    disk_bytes(plan, scans) / 1e6
                ));
            }
            None => {
                lines.push("the number of poses is unknown: set poses.count".into());
            }
        }
        if self.people {
            lines.push("not included: time for answers and for moving the ranger".into());
        }
        lines.push("not included: retakes, and the model's computing time at each new pose".into());
        lines.join("\n") + "\n"
    }
}

fn seconds(seconds: f64) -> String {
    if seconds < 100.0 { format!("{seconds:.2} s") } else { format!("{seconds:.0} s") }
}
