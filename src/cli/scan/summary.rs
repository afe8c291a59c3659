//! One screen about a scan.

use firmware_protocol::{host::LinkStats, messages::Identity};

use super::{output::Output, setup::Setup};
use crate::{
    compare::{Comparison, compare},
    ranger::{ScanSummary, provenance, serial_text},
    scan::{PingStatus, ScanView},
};

/// Prints it on standard error, where it is in no pipe's way.
pub(super) fn print(
    setup: &Setup,
    summary: &ScanSummary,
    identity: &Identity,
    link: &LinkStats,
    output: &Output,
) {
    let views = output.views();
    for line in [
        Some(headline(setup, identity)),
        Some(beams(summary, views.last())),
        Some(agreement(&compare(&views).0, setup)),
        Some(time(summary)),
        Some(traffic(link)),
        warnings(summary),
        output.folder().map(|folder| {
            format!("  wrote {0}/scan.jsonl, {0}/scan.svg and {0}/scan.png", folder.display())
        }),
    ]
    .into_iter()
    .flatten()
    {
        anstream::eprintln!("{line}");
    }
}

fn headline(setup: &Setup, identity: &Identity) -> String {
    let provenance = serde_json::to_value(provenance(identity)).unwrap_or_default();
    format!(
        "{} at {} by {} {}",
        setup.scene.name,
        setup.pose_text,
        provenance.as_str().unwrap_or("ranger"),
        serial_text(identity),
    )
}

fn beams(summary: &ScanSummary, view: Option<&ScanView>) -> String {
    let count = |status| {
        view.map_or(0, |view| view.pings.iter().filter(|ping| ping.status == status).count())
    };
    let mut text = format!(
        "  {} beams, {} missing, {} repaired: {} echo, {} minimum range, {} silent",
        summary.end.beams,
        summary.end.missing,
        summary.end.repaired,
        count(PingStatus::Echo),
        count(PingStatus::MinRange),
        count(PingStatus::NoEcho),
    );
    for (status, name) in
        [(PingStatus::StepDoubtful, "step doubtful"), (PingStatus::ModuleFault, "module fault")]
    {
        if count(status) > 0 {
            text += &format!(", {} {name}", count(status));
        }
    }
    text
}

fn agreement(comparison: &Comparison, setup: &Setup) -> String {
    let engine = setup.simulator.options().engine.name();
    let mm = |metres: Option<f64>| {
        metres.map_or_else(|| "-".into(), |metres| format!("{:.1} mm", metres * 1e3))
    };
    format!(
        "  model ({engine}): {} of {} echo pairs agree; |residual| median {}, 90 % {}; measured \
         only {}, simulated only {}",
        comparison.agree,
        comparison.both_echo,
        mm(comparison.median_abs_residual_m),
        mm(comparison.p90_abs_residual_m),
        comparison.measured_only,
        comparison.simulated_only,
    )
}

fn time(summary: &ScanSummary) -> String {
    let end = &summary.end;
    let ratio = end.duration_s / end.acoustic_limit_s;
    format!(
        "  {:.3} s of device time; acoustics and motor need {:.3} s (x {ratio:.4})",
        end.duration_s, end.acoustic_limit_s
    )
}

fn traffic(link: &LinkStats) -> String {
    let dropped = &link.dropped;
    format!(
        "  link: {} bytes in, {} bytes out ({:.1} % of the traffic), {} frames damaged, {} requests \
         repeated, {} readings refused",
        link.bytes_received,
        link.bytes_sent,
        100.0 * link.bytes_sent as f64 / (link.bytes_sent + link.bytes_received).max(1) as f64,
        u32::from(dropped.checksum) + u32::from(dropped.stuffing) + u32::from(dropped.too_long),
        link.retries,
        link.refused,
    )
}

fn warnings(summary: &ScanSummary) -> Option<String> {
    let mut parts = Vec::new();
    if summary.restarts > 0 {
        parts.push(format!("the device restarted {} times", summary.restarts));
    }
    if let Some(drift) = summary.end.home_drift_steps.filter(|&drift| drift != 0) {
        parts.push(format!("the index was {drift} steps off afterwards: azimuths are doubtful"));
    }
    if let Some(error) = &summary.not_home {
        parts.push(format!("it could not go home afterwards: {error}"));
    }
    (!parts.is_empty()).then(|| format!("  warning: {}", parts.join("; ")))
}
