//! Tests of the live page in Chromium.

mod access;
pub(crate) mod accessible;
pub(crate) mod browser;
mod explained;
mod fast;
mod fleet;
mod pictures;
pub(crate) mod pointer;
mod readable;
mod surveyed;
pub(crate) mod view;
mod viewpoints;
mod workbench;

use std::{fs, path::Path};

use fantoccini::key::Key;
use serde_json::{Value, json};

use browser::{Browser, DESK};
use sonard_test_support::{daemon::Daemon, run, stderr, wait_until};

/// Sweep of a hundred beams, which takes about four seconds.
const PLAN: [&str; 4] = ["--set", "plan.step_deg=3.6", "--set", "model.max_range_m=3"];

const COMPLETE: &str = "document.getElementById('summary').textContent.startsWith('Scan complete')";

/// Starts a daemon with a mock in the simple room that listens on TCP; returns it with its address.
fn daemon(folder: &Path, listen: &str, further: &[&str]) -> (Daemon, String) {
    let listen = format!("server.listen={listen}");
    let daemon = Daemon::start_mock(folder, &[&PLAN[..], &["--set", &listen], further].concat());
    daemon.wait_for("ready");
    let address = daemon.address();
    (daemon, address)
}

fn scan_once(daemon: &Daemon) {
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
}

/// Shows a complete scan of a log whose name contains `log`; returns the scan's JSON of the API.
fn show_log(daemon: &Daemon, browser: &Browser, log: &str) -> Value {
    let scans = daemon.get("/v1/scans").json();
    let matches = |scan: &&Value| {
        !scan["end"].is_null() && scan["log"].as_str().is_some_and(|name| name.contains(log))
    };
    let found = scans.as_array().expect("scans").iter().find(matches);
    let scan = found.expect("a complete scan")["scan"].as_str().expect("an id").to_owned();
    let button = format!("[data-scan=\"{scan}\"]");
    browser.until(&format!("document.querySelector('{button}') !== null"));
    browser.eval(&format!("document.querySelector('{button}').click()"));
    browser.until(&format!("document.querySelector('{button}').ariaPressed === 'true'"));
    daemon.get(&format!("/v1/scans/{scan}")).json()
}

/// Writes a log of a simulated scan, named 20260102, with predictions by other options.
fn write_predicted_log(folder: &Path, simulate: &[&str], predict: &[&str]) {
    let log = folder.join("log");
    fs::create_dir_all(&log).expect("there is room");
    let [raw, log] = [folder.join("raw.jsonl"), log.join("sonard-20260102T000000Z.jsonl")];
    let [raw, log] = [&raw, &log].map(|path| path.to_str().expect("plain"));
    for command in [
        [&["simulate"], simulate, &["--output", raw]].concat(),
        [&["predict", raw], predict, &["--output", log]].concat(),
    ] {
        let output = run(&command);
        assert!(output.status.success(), "{}", stderr(&output));
    }
}

/// Number of beams in the page's caption of the scan.
fn beams_shown(browser: &Browser) -> u64 {
    let text = browser.text("#scan-label");
    let beams = text.split("· ").nth(1).and_then(|rest| rest.split(' ').next());
    beams.and_then(|beams| beams.parse().ok()).unwrap_or(0)
}

/// Number of painted pixels of a layer of the plan.
fn drawn_pixels(browser: &Browser, layer: &str) -> u64 {
    count_pixels(browser, layer, "d[i + 3] > 128")
}

/// Number of pixels of a layer that satisfy a condition on its bytes `d` at `i`. Reads a copy,
/// because reading a canvas slows it down and makes the browser log a warning.
fn count_pixels(browser: &Browser, layer: &str, condition: &str) -> u64 {
    browser.until_drawn();
    let count = browser.eval(&format!(
        "(() => {{ const c = document.getElementById('{layer}'); \
         const copy = new OffscreenCanvas(c.width, c.height); \
         const c2d = copy.getContext('2d', {{willReadFrequently: true}}); \
         c2d.drawImage(c, 0, 0); \
         const d = c2d.getImageData(0, 0, c.width, c.height).data; \
         const hex = getComputedStyle(document.documentElement).getPropertyValue('--path').trim(); \
         const path = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)); \
         let n = 0; for (let i = 0; i < d.length; i += 4) n += {condition}; return n; }})()"
    ));
    count.as_u64().expect("a number")
}

/// Checks that the console has no warnings and that no other server was contacted.
fn assert_clean(browser: &Browser) {
    assert_eq!(browser.warnings(), Vec::<String>::new());
    assert_eq!(browser.foreign_requests(), Vec::<String>::new());
}

#[test]
fn live_readings_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    assert_eq!(browser.text("#scan-label"), "no scan yet");
    assert!(browser.text("#provenance").contains("MOCK"));
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 10");
    let (early, painted) = (beams_shown(&browser), drawn_pixels(&browser, "marks"));
    assert!((10..100).contains(&early) && painted > 100, "{early} beams, {painted} points");
    browser.until(COMPLETE);
    assert!(drawn_pixels(&browser, "marks") > painted);
    assert_eq!(beams_shown(&browser), 100);
    // The legend counts the daemon's verdicts.
    let latest = daemon.get("/v1/scans?limit=1").json()[0]["scan"].clone();
    let scan = daemon.get(&format!("/v1/scans/{}", latest.as_str().expect("an id"))).json();
    let pings = scan["pings"].as_array().expect("readings");
    let legend = browser.text("#legend");
    for (verdict, label) in [("direct", "direct echo"), ("multiple", "multiple reflection")] {
        let count = pings.iter().filter(|ping| ping["verdict"] == verdict).count();
        assert!(count > 0 && legend.contains(&format!("{label} ({count})")), "{legend}");
    }
    // Residuals and table show the same scan.
    assert!(drawn_pixels(&browser, "strip") > 500);
    browser.click("#table summary");
    browser.until("document.querySelectorAll('#table tbody tr').length === 100");
    let row = browser.text("#table tbody tr:nth-child(76)");
    assert!(row.starts_with("75270.0"), "{row}");
    assert_clean(&browser);
}

#[test]
fn beam_selection_draws_its_path() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    let now = || browser.text("#beam-label");
    assert_eq!(now(), "none selected");
    // By a click on the residuals, by a click on the plan, by arrow keys.
    browser.click_at("#strip", 0.5, 0.5);
    let beam = browser.eval("Number(document.getElementById('beam').value)").as_u64();
    assert!(beam.is_some_and(|beam| (35..65).contains(&beam)), "{beam:?}: {}", now());
    let previous = now();
    browser.click_at("#over", 0.9, 0.5);
    assert_ne!(now(), previous);
    browser.type_into("#beam", &Key::Home.to_string());
    assert!(now().starts_with("beam 0, azimuth 0.0"), "{}", now());
    for _ in 0..3 {
        browser.press(Key::Right.into());
    }
    assert!(now().starts_with("beam 3, azimuth 10.8"), "{}", now());
    let value = browser.eval("document.getElementById('beam').getAttribute('aria-valuetext')");
    assert_eq!(value, json!(now()));
    // Echoes and arrivals are loaded; the path of the predicted reading is drawn.
    browser.until("document.querySelectorAll('.peaks button').length > 0");
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    assert!(browser.eval("document.querySelectorAll('.echoes li').length").as_u64() >= Some(1));
    let path = path_pixels(&browser);
    assert!(path > 50, "{path} pixels in the path's colour");
    // Another arrival, selected by key, draws its own path.
    browser.eval("document.querySelector('.peaks [aria-pressed=false]:not(:disabled)').focus()");
    browser.press(Key::Enter.into());
    browser.until("document.activeElement.ariaPressed === 'true'");
    assert_ne!(path_pixels(&browser), path);
    assert_clean(&browser);
}

/// Number of pixels in the colour of a propagation path.
fn path_pixels(browser: &Browser) -> u64 {
    let condition = "d[i + 3] > 200 && path.every((v, k) => Math.abs(d[i + k] - v) < 12)";
    count_pixels(browser, "over", condition)
}

#[test]
fn past_scan_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    let browser = Browser::open(&address, DESK);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    let newest = browser.text("#scan-label");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("document.querySelectorAll('#scans-list [aria-pressed=true]').length === 1");
    assert_ne!(browser.text("#scan-label"), newest);
    assert_eq!(beams_shown(&browser), 100);
    browser.click("#replay");
    browser.until("document.getElementById('progress').hidden === false");
    let early = beams_shown(&browser);
    assert!(early < 100, "{early}");
    // A scan that starts meanwhile does not replace it.
    scan_once(&daemon);
    browser.until(
        "document.getElementById('progress').hidden && \
         document.getElementById('scan-label').textContent.includes('100 of 100')",
    );
    daemon.wait_for_scans(3);
    browser.until("document.querySelectorAll('#scans-list button').length === 3");
    assert_eq!(browser.eval("document.querySelector('#live').ariaPressed"), json!("false"));
    browser.click("#live");
    browser.until("document.querySelector('#live').ariaPressed === 'true'");
    assert_eq!(beams_shown(&browser), 100);
    assert_clean(&browser);
}

#[test]
fn page_reconnects_after_a_kill() {
    let folder = tempfile::tempdir().expect("a folder");
    let port = free_port();
    let listen = format!("127.0.0.1:{port}");
    let (first, address) = daemon(folder.path(), &listen, &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&first);
    browser.until("document.getElementById('progress').value > 5");
    assert_clean(&browser);
    first.kill();
    browser.until("document.getElementById('link').textContent === 'daemon not responding'");
    browser.until("!document.getElementById('trouble').hidden");
    // The last known state stays, and the scan is no longer shown as running.
    assert!(beams_shown(&browser) > 5);
    let summary = browser.text("#summary");
    assert!(summary.starts_with("Connection lost during this scan ("), "{summary}");
    assert!(!browser.text("#scan-label").starts_with("live"), "{}", browser.text("#scan-label"));
    let (second, _) = daemon(folder.path(), &listen, &[]);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.until("document.getElementById('trouble').hidden");
    // The next scan is shown live, without a reload of the page.
    wait_until("the stream", || second.status()["subscribers"]["now"] == 1);
    scan_once(&second);
    browser.until("document.getElementById('scan-label').textContent.startsWith('live')");
    browser.until(COMPLETE);
    assert_eq!(beams_shown(&browser), 100);
    assert_eq!(browser.eval("performance.getEntriesByType('navigation').length"), json!(1));
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("net::ERR_")).collect();
    assert_eq!(other, Vec::<String>::new(), "apart from the failed connections");
}

fn free_port() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("its address").port()
}

/// State of the daemon's schedule.
fn scanning(daemon: &Daemon) -> Value {
    daemon.status()["scanning"].clone()
}
