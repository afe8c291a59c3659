//! Metrics of the shipped dashboard and alerts.

use std::collections::BTreeSet;

use sonard::server::Peer;
use sonard_test_support::in_process::Daemon;

const FILES: [(&str, &str); 3] = [
    ("grafana-sonard.json", include_str!("../../../config/monitoring/grafana-sonard.json")),
    ("sonard-alerts.yml", include_str!("../../../config/monitoring/sonard-alerts.yml")),
    ("sonard-alerts.test.yml", include_str!("../../../config/monitoring/sonard-alerts.test.yml")),
];

/// Metrics of the device's clock, which need a longer observation than this test; they are published
/// together.
const LATER: [&str; 2] = ["sonard_clock_drift_ppm", "sonard_clock_sigma_microseconds"];

/// Returns the words with the prefix of the daemon's metrics.
fn named(text: &str) -> BTreeSet<&str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let words = text.split(|c: char| !is_part(c));
    words.filter(|word| word.starts_with("sonard_")).collect()
}

/// A figure's value in OpenMetrics text.
fn value(figures: &str, name: &str) -> Option<f64> {
    let line = figures.lines().find(|line| line.split(' ').next() == Some(name))?;
    line.split(' ').nth(1)?.parse().ok()
}

#[test]
fn dashboard_and_alert_metrics() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(
        folder.path(),
        // With a clock of its own, for the metrics of the clock.
        &[
            "--realtime",
            "--set",
            "plan.to_deg=90",
            "--set",
            "model.max_range_m=3",
            "--set",
            "plan.step_deg=1.8",
        ],
    );
    daemon.wait_for("ready");
    assert_eq!(daemon.send("PUT", "/v1/air", r#"{"temperature_c":20}"#).status, 202);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    let figures = String::from_utf8(daemon.get("/metrics").body).expect("text");
    let reported = named(&figures);
    for (file, text) in FILES {
        let requested = named(text);
        assert!(requested.len() > 4, "{file}");
        for name in requested.iter().filter(|name| !LATER.contains(name)) {
            assert!(reported.contains(name), "{file} needs {name}:\n{figures}");
        }
    }
    // A mock plays what the model predicts, with noise of millimetres.
    let of = |name: &str| value(&figures, name).unwrap_or_else(|| panic!("{name}:\n{figures}"));
    assert!(of("sonard_last_scan_compared_beams") > 4.0, "{figures}");
    assert!(of("sonard_last_scan_agreement_ratio") > 0.8, "{figures}");
    assert!(of("sonard_last_scan_residual_median_meters") < 0.02, "{figures}");
    assert!(of("sonard_last_scan_bias_meters").abs() < 0.02, "{figures}");
    assert_eq!((of("sonard_last_scan_missing_beams"), of("sonard_log_failing")), (0.0, 0.0));
    assert!(of("sonard_last_scan_age_seconds") < 60.0 && of("sonard_log_free_bytes") > 0.0);
    let lateness_s = of("sonard_reading_lateness_seconds");
    assert!((-1.0..30.0).contains(&lateness_s), "{lateness_s}");
}

#[test]
fn format_from_accept_header() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &[]);
    daemon.wait_for("ready");
    let get = |accept: &str| {
        let reply = daemon.request(Peer::Unix, "GET", "/metrics", &[("accept", accept)], "");
        (reply.head, String::from_utf8(reply.body).expect("text"))
    };
    for accept in ["*/*", "application/openmetrics-text;q=0.5,text/plain;version=0.0.4;q=0.3"] {
        let (head, body) = get(accept);
        assert!(
            head.contains("content-type: application/openmetrics-text; version=1.0.0"),
            "{head}"
        );
        assert!(head.contains("vary: accept"), "{head}");
        assert!(body.ends_with("# EOF\n") && body.contains("# TYPE sonard_robot info"), "{body}");
    }
    for accept in
        ["text/plain;version=0.0.4", "application/openmetrics-text;q=0.3, text/plain;q=0.5"]
    {
        let (head, body) = get(accept);
        assert!(head.contains("content-type: text/plain; version=0.0.4; charset=utf-8"), "{head}");
        assert!(!body.contains("# EOF") && !body.contains(" info\n"), "{body}");
        let mut types = BTreeSet::new();
        for line in body.lines() {
            match line.strip_prefix("# TYPE ").and_then(|rest| rest.split(' ').next()) {
                Some(name) => assert!(types.insert(name), "{name} twice"),
                None if line.starts_with('#') => {}
                None => {
                    let name = line.split(['{', ' ']).next().expect("a name");
                    assert!(types.contains(name), "{name} has no type:\n{body}");
                }
            }
        }
        assert!(
            types.contains("sonard_robot_info") && types.contains("sonard_beams_measured_total")
        );
    }
}
