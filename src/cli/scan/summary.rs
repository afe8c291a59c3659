//! Summary of a scan in a few lines.

use firmware_protocol::{host::LinkStats, messages::Identity};

use super::output::Output;
use crate::{
    compare::{Comparison, compare},
    ranger::{PreparedScan, ScanSummary, provenance, serial_text},
    scan::{
        PingStatus, Provenance, ScanEnd, ScanView,
        text::{format_count, format_length},
    },
};

/// Prints the summary on standard error. Link statistics are the difference between the two given.
pub(super) fn print(
    setup: &PreparedScan,
    summary: &ScanSummary,
    identity: &Identity,
    [earlier, current]: &[LinkStats; 2],
    output: &Output,
) {
    let views = output.views();
    for line in [
        Some(headline(setup, identity)),
        Some(beams(&summary.end, views.last())),
        Some(agreement(&compare(&views).0, setup.simulator.options().engine.kind().name())),
        Some(time(&summary.end)),
        Some(traffic(earlier, current)),
        warnings(summary),
        output.folder().map(|folder| {
            format!("  wrote {0}/scan.jsonl, {0}/scan.svg and {0}/scan.png", folder.display())
        }),
    ]
    .into_iter()
    .flatten()
    {
        notice!("{line}");
    }
}

/// Prints the summary of a scan taken by a daemon.
pub(super) fn print_of_daemon(end: &ScanEnd, output: &Output) {
    let views = output.views();
    let session = views.last().and_then(|view| view.session.as_ref());
    let by = session.map(|session| {
        let device = session.device.as_ref().map_or("", |device| &device.serial);
        format!("{} {device}", provenance_text(session.provenance))
    });
    notice!("by the daemon's {}", by.as_deref().unwrap_or("ranger").trim_end());
    notice!("{}", beams(end, views.last()));
    if let Some(model) = session.and_then(|session| session.model.as_ref()) {
        notice!("{}", agreement(&compare(&views).0, &model.engine));
    }
    notice!("{}", time(end));
}

fn provenance_text(provenance: Provenance) -> String {
    let text = serde_json::to_value(provenance).unwrap_or_default();
    text.as_str().unwrap_or("ranger").to_owned()
}

fn headline(setup: &PreparedScan, identity: &Identity) -> String {
    format!(
        "{} at {} by {} {}",
        setup.scene.name,
        setup.pose_text,
        provenance_text(provenance(identity)),
        serial_text(identity),
    )
}

fn beams(end: &ScanEnd, view: Option<&ScanView>) -> String {
    let count = |status| {
        view.map_or(0, |view| view.pings.iter().filter(|ping| ping.status == status).count())
    };
    let mut text = format!(
        "  {}, {} missing, {} repaired: {} echo, {} minimum range, {} no echo",
        format_count(end.beams, "beam"),
        end.missing,
        end.repaired,
        count(PingStatus::Echo),
        count(PingStatus::MinRange),
        count(PingStatus::NoEcho),
    );
    for (status, name) in
        [(PingStatus::StepUncertain, "step uncertain"), (PingStatus::ModuleFault, "module fault")]
    {
        if count(status) > 0 {
            text += &format!(", {} {name}", count(status));
        }
    }
    text
}

fn agreement(comparison: &Comparison, engine: &str) -> String {
    let length = |length_m: Option<f64>| length_m.map_or_else(|| "-".into(), format_length);
    format!(
        "  model ({engine}): {} of {} agree; |residual| median {}, 90 % {}; missed {}, false {}",
        comparison.agree,
        format_count(comparison.both_echo, "echo"),
        length(comparison.median_abs_residual_m),
        length(comparison.p90_abs_residual_m),
        comparison.simulated_only,
        comparison.measured_only,
    )
}

fn time(end: &ScanEnd) -> String {
    let ratio = end.duration_s / end.acoustic_limit_s;
    format!(
        "  {:.1} s of device time (physical minimum {:.1} s, ratio {ratio:.4})",
        end.duration_s, end.acoustic_limit_s
    )
}

/// Prints the link statistics over several scans.
pub(super) fn print_total(scans: u32, link: &LinkStats) {
    notice!("total {}\n{}", format_count(scans, "scan"), traffic(&LinkStats::default(), link));
}

fn traffic(earlier: &LinkStats, current: &LinkStats) -> String {
    let received = current.bytes_received - earlier.bytes_received;
    let sent = current.bytes_sent - earlier.bytes_sent;
    let damaged = |link: &LinkStats| {
        let dropped = &link.dropped;
        u32::from(dropped.checksum) + u32::from(dropped.stuffing) + u32::from(dropped.too_long)
    };
    format!(
        "  link: {} in, {} out ({:.1} % of the traffic), {} damaged, {} repeated, {} rejected",
        format_count(received, "byte"),
        format_count(sent, "byte"),
        100.0 * sent as f64 / (sent + received).max(1) as f64,
        format_count(damaged(current) - damaged(earlier), "frame"),
        format_count(current.retries - earlier.retries, "request"),
        format_count(current.rejected - earlier.rejected, "reading"),
    )
}

fn warnings(summary: &ScanSummary) -> Option<String> {
    let mut parts = Vec::new();
    if summary.restarts > 0 {
        parts.push(format!("the device reset {}", format_count(summary.restarts, "time")));
    }
    if let Some(drift) = summary.end.home_drift_steps.filter(|&drift| drift != 0) {
        parts.push(format!(
            "index error {drift} {} after the scan: azimuths are uncertain",
            if drift.abs() == 1 { "step" } else { "steps" }
        ));
    }
    if let Some(error) = &summary.not_home {
        parts.push(format!("homing after the scan failed: {error}"));
    }
    (!parts.is_empty()).then(|| format!("  warning: {}", parts.join("; ")))
}
