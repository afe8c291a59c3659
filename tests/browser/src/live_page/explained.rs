//! Better-fitting hypotheses on the page.

use std::{fs, path::Path};

use sonard::{mock::Pace, scene::shipped};

use super::{
    assert_clean,
    browser::{Browser, DESK},
    count_pixels, show_log, write_predicted_log,
};
use sonard_test_support::{
    daemon::{Daemon, write_token},
    rig::Rig,
    run, wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// Starts a daemon configured with a scene, with a ranger in the simple room; opens its page with
/// the token.
fn open(folder: &Path, scene: &str) -> (Rig, Daemon, Browser) {
    let mut rig = Rig::new(folder, Pace::Virtual);
    rig.plug("", 1);
    let token = format!("server.token_file={}", write_token(folder, TOKEN).display());
    let mut options = rig.options();
    let at = options.iter().position(|option| option == "simple-room").expect("a scene");
    scene.clone_into(&mut options[at]);
    for setting in ["server.listen=127.0.0.1:0", &token] {
        options.extend(["--set".to_owned(), setting.to_owned()]);
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let daemon = Daemon::start(folder, &options);
    daemon.wait_for("ready");
    let browser = Browser::open(&daemon.address(), DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    (rig, daemon, browser)
}

/// Scans, and waits until the page lists hypotheses.
fn scan(daemon: &Daemon, browser: &Browser) {
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    browser.until("document.querySelectorAll('#hypotheses-list button').length > 0");
}

/// Number of pixels in the colour of a hypothesis.
fn hypothesis_pixels(browser: &Browser) -> u64 {
    let bad = "getComputedStyle(document.documentElement).getPropertyValue('--bad').trim()";
    let hex = browser.eval(bad);
    let hex = hex.as_str().expect("a colour");
    let part = |at: usize| i64::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal");
    let [r, g, b] = [1, 3, 5].map(part);
    let condition = format!(
        "d[i + 3] > 200 && Math.abs(d[i] - {r}) + Math.abs(d[i + 1] - {g}) + Math.abs(d[i + 2] - {b}) < 40"
    );
    count_pixels(browser, "over", &condition)
}

#[test]
fn wrong_pose_is_corrected() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_rig, daemon, browser) = open(folder.path(), "simple-room");
    assert_eq!(browser.eval("document.getElementById('hypotheses').hidden"), true);
    let wrong = r#"{"x_m":0.794,"y_m":0.105,"heading_deg":0}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", wrong).status, 202);
    scan(&daemon, &browser);
    // `sonard status` prints the same estimates.
    let spans = "[...document.querySelectorAll('#hypotheses-list li:first-child span')]\
                 .map((span) => span.textContent)";
    let spans = browser.eval(spans);
    let [change, agreement, gain] = [0, 1, 2].map(|i| spans[i].as_str().expect("a text"));
    let (_, estimates) = change.split_once(": ").expect("estimates");
    let estimates = estimates.replace('−', "-").replace('±', "+-").replace('°', "");
    let socket = folder.path().join("s").display().to_string();
    let status = String::from_utf8(run(&["status", "--socket", &socket]).stdout).expect("text");
    assert!(status.contains(&estimates), "{estimates} is not in {status}");
    assert!(agreement.ends_with(" more readings agree") && gain.starts_with("gain "), "{spans}");
    // The selected hypothesis is drawn.
    assert_eq!(hypothesis_pixels(&browser), 0);
    browser.eval("document.querySelector('#hypotheses-list button').focus()");
    browser.press(fantoccini::key::Key::Enter.into());
    browser.until("document.querySelector('#hypotheses-list button').ariaPressed === 'true'");
    assert!(hypothesis_pixels(&browser) > 20, "{}", hypothesis_pixels(&browser));
    browser.until(
        "document.getElementById('legend').textContent.includes('under the selected hypothesis')",
    );
    // The hypothesis is previewed and applied.
    browser.click("#hypotheses-preview");
    browser.until("document.getElementById('next-status').textContent.startsWith('Preview (')");
    for (key, true_m) in [("x_m", 0.774), ("y_m", 0.085)] {
        let value =
            browser.eval(&format!("Number(document.getElementById('next-{key}').value)")).as_f64();
        assert!(value.is_some_and(|value| (value - true_m).abs() < 0.004), "{key}: {value:?}");
    }
    browser.click("#apply");
    browser.until("document.getElementById('summary').textContent.startsWith('Applied: pose')");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    // The remaining residual is a few millimetres at most.
    daemon.wait_for_scans(2);
    let residual_m = daemon.health()["fit"]["median_abs_residual_m"].as_f64().expect("a fit");
    assert!(residual_m < 0.004, "{residual_m}");
    assert_clean(&browser);
}

#[test]
fn displaced_wall_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = shipped::text("simple-room").expect("a shipped scene").replace("0.742", "0.722");
    let file = folder.path().join("room.json");
    fs::write(&file, text).expect("there is room");
    let (_rig, daemon, browser) = open(folder.path(), &file.display().to_string());
    scan(&daemon, &browser);
    let north = "[data-change=\"wall north\"]";
    browser.until(&format!("document.querySelector('{north}') !== null"));
    let text = browser.text(&format!("#hypotheses-list {north}"));
    assert!(text.starts_with("wall north: +") && text.contains(" mm ± "), "{text}");
    browser.click(north);
    browser.until(&format!("document.querySelector('{north}').ariaPressed === 'true'"));
    assert!(hypothesis_pixels(&browser) > 50, "{}", hypothesis_pixels(&browser));
    // No setting moves a wall, so it has no preview.
    assert_eq!(browser.eval("document.getElementById('hypotheses-preview').hidden"), true);
    // It is not drawn over another scan.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(2);
    let explanations = || daemon.health()["fit"]["explanations"].as_array().map_or(0, Vec::len);
    wait_until("explanations of this scan", || explanations() > 0);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    wait_until("the hypotheses of the other scan", || hypothesis_pixels(&browser) == 0);
    browser.click("#live");
    browser.until("document.querySelector('#live').ariaPressed === 'true'");
    let drawn = || hypothesis_pixels(&browser) > 50;
    wait_until("the wall on the plan", drawn);
    browser.picture("explained");
    browser.click(north);
    assert_eq!(hypothesis_pixels(&browser), 0);
    assert_clean(&browser);
}

#[test]
fn air_and_threshold_are_previewed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_rig, daemon, browser) = open(folder.path(), "simple-room");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    // Replaces the daemon's explanations by colder air and a less sensitive ranger.
    browser.eval(
        "(() => { const original = fetch; globalThis.fetch = async (path, ...rest) => { \
           const response = await original(path, ...rest); \
           if (path !== '/v1/health') return response; \
           const health = await response.json(); \
           health.fit.explanations = [ \
             {change: 'sound_speed', gain: 90, explains: 40, estimates: [{name: 'percent', value: -1, sigma: 0.02}]}, \
             {change: 'threshold', gain: 50, explains: 20, estimates: [{name: 'threshold_db', value: 20, sigma: 0.4}]}]; \
           return new Response(JSON.stringify(health)); }; })()",
    );
    browser.until("document.querySelectorAll('#hypotheses-list button').length === 2");
    let text = browser.text("[data-change=sound_speed]");
    assert!(text.starts_with("sound speed: −1.00 % ± 0.02 (air −5.9 °C)"), "{text}");
    let field = |key: &str| {
        let value = browser.eval(&format!("Number(document.getElementById('next-{key}').value)"));
        value.as_f64().expect("a figure")
    };
    browser.click("[data-change=sound_speed]");
    browser.click("#hypotheses-preview");
    browser.until("document.getElementById('next-status').textContent.includes('would change')");
    // 293.15 K times 0.99 squared.
    assert!((field("temperature_c") - 14.17).abs() < 0.01, "{}", field("temperature_c"));
    let threshold = daemon.status()["sensor"]["threshold"].as_f64().expect("a threshold");
    browser.click("[data-change=threshold]");
    browser.click("#hypotheses-preview");
    browser.until("Number(document.getElementById('next-threshold').value) > 0.1");
    assert!((field("threshold") / threshold - 10.0).abs() < 0.01);
    assert_eq!(hypothesis_pixels(&browser), 0);
    assert_clean(&browser);
}

/// A scan of another room is neither drawn nor proposed at the pose that explains a part of it.
#[test]
fn causes_of_an_unlocated_scan_are_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    write_predicted_log(
        folder.path(),
        &["--scene", "mcgill-lab", "--pose", "fig4", "--step-deg", "3.6", "--max-range", "4"],
        &["--scene", "simple-room", "--pose", "fig9"],
    );
    let options = ["--set", "server.listen=127.0.0.1:0", "--set", "scanning.mode=on-request"];
    let daemon = Daemon::start_mock(folder.path(), &options);
    daemon.wait_for("ready");
    let browser = Browser::open(&daemon.address(), DESK);
    show_log(&daemon, &browser, "20260102");
    browser.click("#locate");
    browser.until("document.querySelectorAll('#causes li').length > 1");
    assert_eq!(browser.text("#located"), "No pose fits the readings. Possible causes:");
    let causes = browser.text("#causes");
    for part in [
        "No pose in this scene explains",
        "check the scene (the right room",
        "it may be a larger place",
    ] {
        assert!(causes.contains(part), "{causes}");
    }
    assert!(!browser.text("#legend").contains("located pose"));
    assert_eq!(browser.eval("document.getElementById('use-pose').hidden"), true);
    // The causes belong to that scan.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.click("#live");
    browser.until("document.querySelectorAll('#causes li').length === 0");
    assert_clean(&browser);
}
