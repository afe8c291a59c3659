//! What the last scan would be better explained by, on the page.

use std::{fs, path::Path};

use sonard::{mock::Pace, scene::shipped};

use super::{
    assert_clean,
    browser::{Browser, DESK},
    count_points,
};
use sonard_test_support::{
    daemon::{Daemon, write_token},
    rig::Rig,
    run, wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// A daemon that believes a scene, beside a ranger in the simple room, and its page with the token.
fn open(folder: &Path, scene: &str) -> (Rig, Daemon, Browser) {
    let mut rig = Rig::new(folder, Pace::Virtual);
    rig.plug("", 1);
    let token = format!("server.token_file={}", write_token(folder, TOKEN).display());
    let mut options = rig.options();
    let place = options.iter().position(|option| option == "simple-room").expect("a scene");
    scene.clone_into(&mut options[place]);
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

/// Takes a scan, and waits until the page says what would explain it better.
fn scan(daemon: &Daemon, browser: &Browser) {
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    browser.until("document.querySelectorAll('#better-list button').length > 0");
}

/// Points above the plan in the colour of what is only explained.
fn ghost_points(browser: &Browser) -> u64 {
    let bad = "getComputedStyle(document.documentElement).getPropertyValue('--bad').trim()";
    let hex = browser.eval(bad);
    let hex = hex.as_str().expect("a colour");
    let part = |at: usize| i64::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal");
    let [r, g, b] = [1, 3, 5].map(part);
    let like = format!(
        "d[i + 3] > 200 && Math.abs(d[i] - {r}) + Math.abs(d[i + 1] - {g}) + Math.abs(d[i + 2] - {b}) < 40"
    );
    count_points(browser, "over", &like)
}

#[test]
fn a_pose_that_is_wrong_is_said_drawn_previewed_and_put_right() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_rig, daemon, browser) = open(folder.path(), "simple-room");
    assert_eq!(browser.eval("document.getElementById('better').hidden"), true);
    let beside = r#"{"x_m":0.794,"y_m":0.105,"heading_deg":0}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", beside).status, 202);
    scan(&daemon, &browser);
    // In the words of the program.
    let socket = folder.path().join("s").display().to_string();
    let told = String::from_utf8(run(&["status", "--socket", &socket]).stdout).expect("text");
    let told = told.split("fit      better with ").nth(1).and_then(|rest| rest.lines().next());
    let said =
        browser.text("#better-list button").replace('−', "-").replace('±', "+-").replace('°', "");
    let (what, more) = said.split_once("explains").expect("how many it explains");
    let wanted = format!("{what}, which explains{}", more.split("gain").next().expect("a part"));
    assert_eq!(told, Some(wanted.as_str()));
    assert!(more.contains("gain "), "{said}");
    // Drawn when it is chosen, by key, and no more when it is not.
    assert_eq!(ghost_points(&browser), 0);
    browser.eval("document.querySelector('#better-list button').focus()");
    browser.press(fantoccini::key::Key::Enter.into());
    browser.until("document.querySelector('#better-list button').ariaPressed === 'true'");
    assert!(ghost_points(&browser) > 20, "{}", ghost_points(&browser));
    browser.until(
        "document.getElementById('legend').textContent.includes('by the chosen explanation')",
    );
    // The model is asked for it, and it is ordered.
    browser.click("#better-preview");
    browser.until("document.getElementById('next-now').textContent.includes('expects')");
    for (key, true_m) in [("x_m", 0.774), ("y_m", 0.085)] {
        let value =
            browser.eval(&format!("Number(document.getElementById('next-{key}').value)")).as_f64();
        assert!(value.is_some_and(|value| (value - true_m).abs() < 0.004), "{key}: {value:?}");
    }
    browser.click("#apply");
    browser.until("document.getElementById('summary').textContent.startsWith('Taken in: pose')");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    // What is left is a millimetre or nothing.
    daemon.wait_for_scans(2);
    let residual_m = daemon.health()["fit"]["median_abs_residual_m"].as_f64().expect("a fit");
    assert!(residual_m < 0.004, "{residual_m}");
    assert_clean(&browser);
}

#[test]
fn a_wall_that_stands_elsewhere_is_drawn_where_it_would_be() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = shipped::text("simple-room").expect("a shipped scene").replace("0.742", "0.722");
    let file = folder.path().join("room.json");
    fs::write(&file, text).expect("there is room");
    let (_rig, daemon, browser) = open(folder.path(), &file.display().to_string());
    scan(&daemon, &browser);
    let north = "[data-change=\"wall north\"]";
    browser.until(&format!("document.querySelector('{north}') !== null"));
    let said = browser.text(&format!("#better-list {north}"));
    assert!(said.starts_with("wall north by +") && said.contains(" mm ± "), "{said}");
    browser.click(north);
    browser.until(&format!("document.querySelector('{north}').ariaPressed === 'true'"));
    assert!(ghost_points(&browser) > 50, "{}", ghost_points(&browser));
    // No order moves a wall.
    assert_eq!(browser.eval("document.getElementById('better-preview').hidden"), true);
    // Nor is it drawn over a scan that it says nothing of.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(2);
    let told = || daemon.health()["fit"]["explanations"].as_array().map_or(0, Vec::len);
    wait_until("what explains this one", || told() > 0);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    assert_eq!(ghost_points(&browser), 0);
    browser.click("#live");
    browser.until("document.querySelector('#live').ariaPressed === 'true'");
    let drawn = || ghost_points(&browser) > 50;
    wait_until("it to be drawn", drawn);
    browser.picture("explained");
    browser.click(north);
    assert_eq!(ghost_points(&browser), 0);
    assert_clean(&browser);
}

#[test]
fn air_and_threshold_are_previewed_as_they_would_be() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_rig, daemon, browser) = open(folder.path(), "simple-room");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    // What the daemon would say of colder air and of a ranger that hears less.
    browser.eval(
        "(() => { const own = fetch; globalThis.fetch = async (path, ...rest) => { \
           const answer = await own(path, ...rest); \
           if (path !== '/v1/health') return answer; \
           const health = await answer.json(); \
           health.fit.explanations = [ \
             {change: 'sound_speed', gain: 90, explains: 40, estimates: [{name: 'percent', value: -1, sigma: 0.02}]}, \
             {change: 'threshold', gain: 50, explains: 20, estimates: [{name: 'threshold_db', value: 20, sigma: 0.4}]}]; \
           return new Response(JSON.stringify(health)); }; })()",
    );
    browser.until("document.querySelectorAll('#better-list button').length === 2");
    let said = browser.text("[data-change=sound_speed]");
    assert!(said.starts_with("sound speed by −1.00 % ± 0.02 (air −5.9 °C)"), "{said}");
    let field = |key: &str| {
        let value = browser.eval(&format!("Number(document.getElementById('next-{key}').value)"));
        value.as_f64().expect("a figure")
    };
    browser.click("[data-change=sound_speed]");
    browser.click("#better-preview");
    browser.until("document.getElementById('next-now').textContent.includes('otherwise than')");
    // 293.15 K times 0.99 squared.
    assert!((field("temperature_c") - 14.17).abs() < 0.01, "{}", field("temperature_c"));
    let threshold = daemon.status()["sensor"]["threshold"].as_f64().expect("a threshold");
    browser.click("[data-change=threshold]");
    browser.click("#better-preview");
    browser.until("Number(document.getElementById('next-threshold').value) > 0.1");
    assert!((field("threshold") / threshold - 10.0).abs() < 0.01);
    assert_eq!(ghost_points(&browser), 0);
    assert_clean(&browser);
}
