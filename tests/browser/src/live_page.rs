//! The live page in a real browser.

mod access;
pub(crate) mod accessible;
pub(crate) mod browser;
mod explained;
mod fast;
mod fleet;
mod pictures;
pub(crate) mod pointer;
mod readable;
pub(crate) mod view;
mod viewpoints;
mod workbench;

use std::path::Path;

use fantoccini::key::Key;
use serde_json::{Value, json};

use browser::{Browser, DESK};
use sonard_test_support::{daemon::Daemon, wait_until};

/// A full turn of a hundred beams, which takes some four seconds.
const PLAN: [&str; 4] = ["--set", "plan.step_deg=3.6", "--set", "model.max_range_m=3"];

const OVER: &str = "document.getElementById('summary').textContent.startsWith('Scan over')";

/// A mock in the simple room that is asked by TCP, and its address.
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

/// A scan that is over, of a log with `log` in its name, shown on the page and as the API tells it.
fn show_log(daemon: &Daemon, browser: &Browser, log: &str) -> Value {
    let scans = daemon.get("/v1/scans").json();
    let wanted = |scan: &&Value| {
        !scan["end"].is_null() && scan["log"].as_str().is_some_and(|name| name.contains(log))
    };
    let found = scans.as_array().expect("scans").iter().find(wanted);
    let scan = found.expect("a scan that is over")["scan"].as_str().expect("an id").to_owned();
    let button = format!("[data-scan=\"{scan}\"]");
    browser.until(&format!("document.querySelector('{button}') !== null"));
    browser.eval(&format!("document.querySelector('{button}').click()"));
    browser.until(&format!("document.querySelector('{button}').ariaPressed === 'true'"));
    daemon.get(&format!("/v1/scans/{scan}")).json()
}

/// Beams that the page says it shows.
fn beams_shown(browser: &Browser) -> u64 {
    let text = browser.text("#which");
    let beams = text.split("· ").nth(1).and_then(|rest| rest.split(' ').next());
    beams.and_then(|beams| beams.parse().ok()).unwrap_or(0)
}

/// How many points of a layer of the plan are drawn on.
fn drawn_points(browser: &Browser, layer: &str) -> u64 {
    count_points(browser, layer, "d[i + 3] > 128")
}

/// How many points of a layer fulfil a condition on its bytes `d` at `i`. A copy is looked into:
/// a layer that is read becomes slow to draw on, and the browser says so.
fn count_points(browser: &Browser, layer: &str, condition: &str) -> u64 {
    browser.until_drawn();
    let count = browser.eval(&format!(
        "(() => {{ const c = document.getElementById('{layer}'); \
         const copy = new OffscreenCanvas(c.width, c.height); \
         const look = copy.getContext('2d', {{willReadFrequently: true}}); \
         look.drawImage(c, 0, 0); \
         const d = look.getImageData(0, 0, c.width, c.height).data; \
         const hex = getComputedStyle(document.documentElement).getPropertyValue('--path').trim(); \
         const path = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)); \
         let n = 0; for (let i = 0; i < d.length; i += 4) n += {condition}; return n; }})()"
    ));
    count.as_u64().expect("a number")
}

fn assert_clean(browser: &Browser) {
    assert_eq!(browser.complaints(), Vec::<String>::new());
    assert_eq!(browser.strangers(), Vec::<String>::new());
}

#[test]
fn readings_appear_while_the_sweep_goes_on_and_add_up_at_its_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    assert_eq!(browser.text("#which"), "no scan yet");
    assert!(browser.text("#provenance").contains("MOCK"));
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 10");
    let (early, painted) = (beams_shown(&browser), drawn_points(&browser, "marks"));
    assert!((10..100).contains(&early) && painted > 100, "{early} beams, {painted} points");
    browser.until(OVER);
    assert!(drawn_points(&browser, "marks") > painted);
    assert_eq!(beams_shown(&browser), 100);
    // The legend counts what the daemon's own comparison says.
    let latest = daemon.get("/v1/scans?limit=1").json()[0]["scan"].clone();
    let whole = daemon.get(&format!("/v1/scans/{}", latest.as_str().expect("an id"))).json();
    let pings = whole["pings"].as_array().expect("readings");
    let legend = browser.text("#legend");
    for (verdict, words) in [("direct", "direct echo"), ("multiple", "multiple reflection")] {
        let count = pings.iter().filter(|ping| ping["verdict"] == verdict).count();
        assert!(count > 0 && legend.contains(&format!("{words} ({count})")), "{legend}");
    }
    // The residual strip and the table show the same scan.
    assert!(drawn_points(&browser, "strip") > 500);
    browser.click("#table summary");
    browser.until("document.querySelectorAll('#table tbody tr').length === 100");
    let row = browser.text("#table tbody tr:nth-child(76)");
    assert!(row.starts_with("75270.0"), "{row}");
    assert_clean(&browser);
}

#[test]
fn a_beam_is_chosen_by_click_or_key_and_its_path_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(OVER);
    let now = || browser.text("#beam-now");
    assert_eq!(now(), "none selected");
    // By a click on the residuals, by one on the plan, by arrow keys.
    browser.click_at("#strip", 0.5, 0.5);
    let beam = browser.eval("Number(document.getElementById('beam').value)").as_u64();
    assert!(beam.is_some_and(|beam| (35..65).contains(&beam)), "{beam:?}: {}", now());
    let before = now();
    browser.click_at("#over", 0.9, 0.5);
    assert_ne!(now(), before);
    browser.type_into("#beam", &Key::Home.to_string());
    assert!(now().starts_with("beam 0, azimuth 0.0"), "{}", now());
    for _ in 0..3 {
        browser.press(Key::Right.into());
    }
    assert!(now().starts_with("beam 3, azimuth 10.8"), "{}", now());
    let spoken = browser.eval("document.getElementById('beam').getAttribute('aria-valuetext')");
    assert_eq!(spoken, json!(now()));
    // The daemon tells the beam's echoes and paths; the predicted one is drawn.
    browser.until("document.querySelectorAll('.peaks button').length > 0");
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    assert!(browser.eval("document.querySelectorAll('.echoes li').length").as_u64() >= Some(1));
    let with_path = path_points(&browser);
    assert!(with_path > 50, "{with_path} points of the path's colour");
    // Another sound by key: tab to it, press it, and its own path is drawn.
    browser.eval("document.querySelector('.peaks [aria-pressed=false]:not(:disabled)').focus()");
    browser.press(Key::Enter.into());
    browser.until("document.activeElement.ariaPressed === 'true'");
    assert_ne!(path_points(&browser), with_path);
    assert_clean(&browser);
}

/// How many points above the plan have the colour of a sound's path.
fn path_points(browser: &Browser) -> u64 {
    let like = "d[i + 3] > 200 && path.every((v, k) => Math.abs(d[i + k] - v) < 12)";
    count_points(browser, "over", like)
}

#[test]
fn a_past_scan_is_shown_and_played_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    let browser = Browser::open(&address, DESK);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    let newest = browser.text("#which");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("document.querySelectorAll('#scans-list [aria-pressed=true]').length === 1");
    assert_ne!(browser.text("#which"), newest);
    assert_eq!(beams_shown(&browser), 100);
    browser.click("#replay");
    browser.until("document.getElementById('progress').hidden === false");
    let early = beams_shown(&browser);
    assert!(early < 100, "{early}");
    // A scan that begins meanwhile does not take its place.
    scan_once(&daemon);
    browser.until(
        "document.getElementById('progress').hidden && \
         document.getElementById('which').textContent.includes('100 of 100')",
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
fn the_page_finds_back_by_itself_when_the_daemon_was_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let port = free_port();
    let listen = format!("127.0.0.1:{port}");
    let (first, address) = daemon(folder.path(), &listen, &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&first);
    browser.until("document.getElementById('progress').value > 5");
    assert_clean(&browser);
    first.kill();
    browser.until("document.getElementById('link').textContent === 'daemon not answering'");
    browser.until("!document.getElementById('trouble').hidden");
    // What was known last is shown still, and nothing is claimed of what is not known.
    assert!(beams_shown(&browser) > 5);
    let summary = browser.text("#summary");
    assert!(summary.contains("is not known") && !summary.contains("under way"), "{summary}");
    assert!(!browser.text("#which").starts_with("live"), "{}", browser.text("#which"));
    let (second, _) = daemon(folder.path(), &listen, &[]);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.until("document.getElementById('trouble').hidden");
    // Only now is something new to be seen, live, without the page being loaded again.
    wait_until("the stream", || second.status()["subscribers"]["now"] == 1);
    scan_once(&second);
    browser.until("document.getElementById('which').textContent.startsWith('live')");
    browser.until(OVER);
    assert_eq!(beams_shown(&browser), 100);
    assert_eq!(browser.eval("performance.getEntriesByType('navigation').length"), json!(1));
    let other: Vec<String> =
        browser.complaints().into_iter().filter(|text| !is_of_the_line(text)).collect();
    assert_eq!(other, Vec::<String>::new(), "besides the refused connections");
}

/// Whether the browser only says that nobody answered.
fn is_of_the_line(complaint: &str) -> bool {
    complaint.contains("net::ERR_")
}

fn free_port() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("its address").port()
}

/// The state of the daemon's agenda.
fn scanning(daemon: &Daemon) -> Value {
    daemon.status()["scanning"].clone()
}
