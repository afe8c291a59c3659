//! Comparison as text.

use std::io::{self, Write};

use comfy_table::Table;

use crate::{
    cli::table::{align_right, fit, ruled},
    compare::{
        ChangeEstimate, ClassifiedPing, Comparison, Explanation, Verdict, keep_every_second,
    },
    scan::{
        PathKind, PathRecord, Ping, PingStatus,
        text::{format_count, format_length},
    },
};

/// Prints the figures and the worst-fitting beams.
pub(super) fn print(
    out: &mut impl Write,
    comparison: &Comparison,
    worst: &WorstBeams,
) -> io::Result<()> {
    print_numbers(out, comparison)?;
    if comparison.beams > 0 {
        writeln!(out, "{}", fit(verdict_table(comparison)))?;
    }
    if !comparison.explanations.is_empty() {
        let table = fit(explanations(&comparison.explanations));
        writeln!(out, "Better-fitting changes:\n{table}")?;
    } else if comparison.agree_fraction.is_some_and(|share| share < FEW_AGREE) {
        writeln!(
            out,
            "No change of some centimetres, degrees or percent explains the readings: check the scene, \
             a pose farther off, and the sense of the angles (--clockwise)."
        )?;
    }
    let apart = worst.apart();
    if !apart.is_empty() {
        writeln!(out, "Largest residuals:\n{}", fit(beam_table(&apart)))?;
    }
    let one_sided = worst.one_sided();
    if !one_sided.is_empty() {
        writeln!(
            out,
            "Detected by one only, or at minimum range in one only:\n{}",
            fit(beam_table(&one_sided))
        )?;
    }
    Ok(())
}

fn print_numbers(out: &mut impl Write, comparison: &Comparison) -> io::Result<()> {
    let Comparison { beams, both_echo, agree, scans, poses, duplicates, .. } = *comparison;
    let at = match poses {
        0 | 1 => String::new(),
        poses => format!(" at {}, combined", format_count(poses, "pose")),
    };
    let (beams, scans) = (format_count(beams, "beam"), format_count(scans, "scan"));
    writeln!(out, "{beams} compared, in {scans}{at}")?;
    let skipped = comparison.not_compared;
    for (count, why) in [
        (skipped.link_lost, "not compared: the reading was lost"),
        (skipped.step_uncertain, "not compared: motor steps may be lost"),
        (skipped.module_fault, "not compared: the module did not fire"),
        (skipped.no_prediction, "not compared: no prediction"),
        (skipped.no_range, "not compared: echo without a range"),
        (duplicates, "readings skipped: their beam was measured again"),
    ] {
        if count > 0 {
            writeln!(out, "{count} {why}")?;
        }
    }
    let Some(share) = comparison.agree_fraction else {
        return writeln!(out, "no beam has an echo in both");
    };
    let percent = 100.0 * share;
    writeln!(out, "{both_echo} have an echo in both; {agree} of them agree ({percent:.1} %)")?;
    writeln!(
        out,
        "residual: median of |r| {}, 90 % within {}, bias {} (measured minus predicted)",
        length(comparison.median_abs_residual_m),
        length(comparison.p90_abs_residual_m),
        length(comparison.median_residual_m),
    )
}

fn verdict_table(comparison: &Comparison) -> Table {
    let (counts, medians) = (comparison.verdicts, comparison.median_abs_residual_by_verdict_m);
    let mut table = ruled(["verdict", "beams", "%", "median |r|"]);
    for (name, count, median_m) in [
        ("direct", counts.direct, medians.direct),
        ("multiple", counts.multiple, medians.multiple),
        ("edge", counts.edge, medians.edge),
        ("min range", counts.min_range, None),
        ("no echo", counts.silent, None),
        ("unexplained", counts.unexplained, medians.unexplained),
    ] {
        let percent = 100.0 * f64::from(count) / f64::from(comparison.beams);
        let row = [name.into(), count.to_string(), format!("{percent:.1}"), length(median_m)];
        table.add_row(row);
    }
    align_right(&mut table, 1..4);
    table
}

fn explanations(found: &[Explanation]) -> Table {
    let mut table = ruled(["change", "by", "explains", "gain"]);
    for Explanation { change, estimates, gain, explains } in found.iter().take(MAX_EXPLANATIONS) {
        let by: Vec<String> = estimates.iter().map(ChangeEstimate::to_string).collect();
        let explains = format_count(*explains, "reading");
        table.add_row([change.replace('_', " "), by.join(", "), explains, format!("{gain:.0}")]);
    }
    align_right(&mut table, 2..4);
    table
}

/// Share of agreeing echoes below which a general error is likely.
const FEW_AGREE: f64 = 0.25;

/// Maximum number of changes shown.
const MAX_EXPLANATIONS: usize = 6;

fn beam_table(beams: &[&Beam]) -> Table {
    let mut table =
        ruled(["beam", "azimuth", "measured", "predicted", "residual", "margin", "predicted path"]);
    for Beam { ping, residual_m } in beams {
        let sim = ping.sim.as_ref();
        let margin_db = sim.and_then(|sim| sim.margin_db);
        table.add_row([
            ping.index.to_string(),
            format!("{:.1}", ping.azimuth_deg),
            format_reading(ping.status, ping.range_m),
            sim.map_or("-".into(), |sim| format_reading(sim.status, sim.range_m)),
            length(*residual_m),
            margin_db.map_or("-".into(), |db| format!("{db:+.1} dB")),
            sim.and_then(|sim| sim.path.as_ref()).map_or(String::new(), describe_path),
        ]);
    }
    align_right(&mut table, 0..6);
    table
}

/// Beam that disagrees with the model.
#[derive(Debug, Clone)]
struct Beam {
    ping: Ping,
    residual_m: Option<f64>,
}

/// Worst-fitting beams of scans that are added one by one.
#[derive(Debug)]
pub(super) struct WorstBeams {
    count: usize,
    apart: Vec<Beam>,
    /// Every `stride`-th of the unexplained beams without a residual.
    one_sided: Vec<Beam>,
    stride: usize,
    seen: usize,
}

/// Maximum number of retained beams without a residual.
const MAX_RETAINED: usize = 1024;

impl WorstBeams {
    /// Collects up to `count` beams of each kind.
    pub(super) const fn new(count: usize) -> Self {
        Self { count, apart: Vec::new(), one_sided: Vec::new(), stride: 1, seen: 0 }
    }

    /// Adds the beams of a scan.
    pub(super) fn add(&mut self, classified: &[ClassifiedPing<'_>]) {
        for beam in classified.iter().filter(|beam| beam.verdict == Ok(Verdict::Unexplained)) {
            let keep = || Beam { ping: beam.ping.clone(), residual_m: beam.residual_m };
            match beam.residual_m {
                Some(m)
                    if self.min_listed_m().is_none_or(|min_listed_m| m.abs() > min_listed_m) =>
                {
                    self.apart.push(keep());
                }
                Some(_) => {}
                None => {
                    if self.seen.is_multiple_of(self.stride) {
                        self.one_sided.push(keep());
                    }
                    self.seen += 1;
                }
            }
        }
        self.apart.sort_by(|a, b| size(b).total_cmp(&size(a)));
        self.apart.truncate(self.count);
        while self.one_sided.len() > MAX_RETAINED.max(2 * self.count) {
            keep_every_second(&mut self.one_sided);
            self.stride *= 2;
        }
    }

    /// Returns the residual that a beam must exceed to be listed, metres.
    fn min_listed_m(&self) -> Option<f64> {
        (self.apart.len() >= self.count).then(|| self.apart.last().map_or(f64::INFINITY, size))
    }

    /// Returns the beams with the largest residuals.
    fn apart(&self) -> Vec<&Beam> {
        self.apart.iter().collect()
    }

    /// Returns unexplained beams without a residual, spread over the scans.
    fn one_sided(&self) -> Vec<&Beam> {
        let stride = self.one_sided.len().div_ceil(self.count.max(1)).max(1);
        self.one_sided.iter().step_by(stride).take(self.count).collect()
    }
}

fn size(beam: &Beam) -> f64 {
    beam.residual_m.map_or(0.0, f64::abs)
}

fn format_reading(status: PingStatus, range_m: Option<f64>) -> String {
    match (status, range_m) {
        (PingStatus::Echo, Some(range_m)) => format!("{range_m:.3} m"),
        (PingStatus::MinRange, Some(range_m)) => format!("min ({range_m:.3} m)"),
        (PingStatus::MinRange, None) => "min".into(),
        (PingStatus::NoEcho, _) => "no echo".into(),
        _ => "-".into(),
    }
}

fn length(value_m: Option<f64>) -> String {
    value_m.map_or("-".into(), format_length)
}

/// Describes a path, for example `3 reflections: south, north, south`.
pub(in crate::cli) fn describe_path(path: &PathRecord) -> String {
    let surfaces = path.describe();
    match (path.kind, path.order) {
        (PathKind::Diffracted, _) => surfaces,
        (PathKind::Scattered, _) => format!("scattered by {surfaces}"),
        (PathKind::Specular, 1) => format!("1 reflection: {surfaces}"),
        (PathKind::Specular, order) => format!("{order} reflections: {surfaces}"),
    }
}
