//! Workbench: past scans, downloads, echo traces, overlays, and the settings of the next scan.

use std::path::Path;

use fantoccini::key::Key;
use serde_json::{Value, json};

use super::{
    COMPLETE, assert_clean,
    browser::{Browser, DESK},
    daemon, drawn_pixels,
    pointer::{drag, place},
    scan_once,
};
use sonard_test_support::{
    daemon::{Daemon, start_array, write_scans, write_token},
    wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// Starts a daemon, records two scans, and opens its page.
fn with_two_scans(folder: &Path, further: &[&str]) -> (Daemon, Browser) {
    let (daemon, address) = daemon(folder, "127.0.0.1:0", further);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    let browser = Browser::open(&address, DESK);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.until("document.getElementById('scan-label').textContent.includes('100 of 100')");
    (daemon, browser)
}

/// Starts a daemon and opens its page with the token and the settings in edit mode.
fn editing_settings(folder: &Path) -> (Daemon, Browser) {
    let file = write_token(folder, TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) = daemon(folder, "127.0.0.1:0", &["--set", &setting]);
    let browser = Browser::open(&address, DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    until_has(&browser, "#next-table", "senscomp-6500");
    browser.click("#change");
    until_has(&browser, "#next-status", "Preview (100 beams)");
    (daemon, browser)
}

fn select_beam(browser: &Browser, index: u32) {
    browser.eval(&format!(
        "(() => {{ const s = document.getElementById('beam'); s.value = {index}; \
         s.dispatchEvent(new Event('input')); }})()"
    ));
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
}

/// Waits until an element contains a text.
pub(super) fn until_has(browser: &Browser, selector: &str, text: &str) {
    browser.until(&format!("document.querySelector({selector:?}).textContent.includes({text:?})"));
}

#[test]
fn time_line_reaches_old_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 620, 10);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    let known = |count: u32| format!("document.getElementById('scrub').max === '{}'", count - 1);
    browser.until(&known(50));
    assert!(drawn_pixels(&browser, "time-line") > 500);
    browser.eval("document.getElementById('scrub').focus()");
    browser.press(Key::Left.into());
    until_has(&browser, "#scrub-label", "scan 49 of 50");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("document.getElementById('scan-label').textContent.includes('10 of 10')");
    browser.click("#older");
    browser.until(&known(550));
    browser.click("#older");
    browser.until(&known(620));
    assert_eq!(browser.eval("document.getElementById('older').disabled"), true);
    // Home selects the first scan; the list follows.
    browser.eval("document.getElementById('scrub').focus()");
    browser.press(Key::Home.into());
    until_has(&browser, "#scrub-label", "scan 1 of 620");
    let first = "[data-scan=\"00000000-0000-0000-0000-000000000001\"]";
    browser.until(&format!("document.querySelector('{first}')?.ariaPressed === 'true'"));
    assert_eq!(browser.eval("document.querySelectorAll('#scans-list button').length"), 50);
    let value = browser.eval("document.getElementById('scrub').getAttribute('aria-valuetext')");
    assert_eq!(value, json!(browser.text("#scrub-label")));
    browser.click("#live");
    until_has(&browser, "#scrub-label", "scan 620 of 620");
    assert_clean(&browser);
}

#[test]
fn downloads() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    select_beam(&browser, 75);
    browser.eval(
        "(() => { globalThis.saved = []; const make = URL.createObjectURL; \
         URL.createObjectURL = (blob) => { saved.push(blob); return make(blob); }; \
         HTMLAnchorElement.prototype.click = function () { saved.push(this.download); }; })()",
    );
    let save = |kind: &str| {
        browser.eval("globalThis.saved.length = 0");
        browser.click(&format!("[data-kind={kind}]"));
        browser.until("globalThis.saved.length === 2");
        browser.eval("saved[1]").as_str().expect("a name").to_owned()
    };
    let text = || browser.eval("saved[0].text()").as_str().expect("a text").to_owned();
    assert!(save("scan").ends_with(".json"));
    let scan: Value = serde_json::from_str(&text()).expect("JSON");
    let newest = daemon.get("/v1/scans?limit=1").json()[0].clone();
    assert_eq!(scan["start"]["scan"], newest["scan"]);
    assert_eq!(json!(save("log")), newest["log"]);
    assert!(text().starts_with("{\"type\":\"session\""));
    assert!(save("svg").ends_with(".svg"));
    let svg = text();
    for drawn in
        ["simple-room", "MOCK, not hardware", "multiple reflection (", "propagation path", "north"]
    {
        assert!(svg.contains(drawn), "{drawn} is not in the picture");
    }
    // Marks of one kind are one path.
    let (paths, marks) = (svg.matches("<path").count(), svg.matches('M').count());
    assert!(marks > 200 && paths < marks / 2, "{marks} marks in {paths} paths");
    let parsed = browser.eval(
        "saved[0].text().then((text) => \
         new DOMParser().parseFromString(text, 'image/svg+xml').querySelector('parsererror') === null)",
    );
    assert_eq!(parsed, true);
    assert!(save("png").ends_with(".png"));
    let size =
        browser.eval("createImageBitmap(saved[0]).then(({width, height}) => [width, height])");
    let wide = browser.eval("document.getElementById('stage').clientWidth").as_u64();
    assert!(size[0].as_u64() > wide.map(|wide| 2 * wide), "{size} of {wide:?}");
    assert_clean(&browser);
}

#[test]
fn echo_trace_and_ranges_over_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    assert_eq!(browser.eval("document.getElementById('trace').hidden"), true);
    select_beam(&browser, 75);
    browser.until("document.getElementById('trace').width > 0");
    let drawn = drawn_pixels(&browser, "trace");
    assert!(drawn > 600, "{drawn} pixels");
    // A click in the trace selects the nearest arrival.
    let selected = || browser.text(".peaks [aria-pressed=true]");
    let previous = selected();
    browser.click_at("#trace", 0.22, 0.85);
    browser.until(&format!(
        "document.querySelector('.peaks [aria-pressed=true]').textContent !== {previous:?}"
    ));
    browser.click("#over-time summary");
    until_has(&browser, "#series-label", "Beam 75 in 2 scans: mean 0.82");
    assert!(drawn_pixels(&browser, "waterfall") > 1000);
    assert!(drawn_pixels(&browser, "series") > 20);
    // A click in the waterfall selects beam and scan.
    browser.click_at("#waterfall", 0.5, 0.1);
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("Number(document.getElementById('beam').value) !== 75");
    let beam = browser.eval("Number(document.getElementById('beam').value)").as_u64();
    assert!(beam.is_some_and(|beam| (40..56).contains(&beam)), "{beam:?}");
    assert_clean(&browser);
}

#[test]
fn overlays() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    let legend = |label: &str| browser.text("#legend").contains(label);
    for (kind, label, layer) in [
        ("map", "map: free", "under"),
        ("map", "map: occupied", "above"),
        ("lines", "fitted line", "above"),
        ("features", "plane (P)", "above"),
    ] {
        assert!(!legend(label));
        let drawn = || super::count_pixels(&browser, layer, "d[i + 3] > 20");
        let bare = drawn();
        browser.click(&format!("#show-{kind}"));
        until_has(&browser, "#legend", label);
        assert!(drawn() > bare, "{kind}");
        browser.click(&format!("#show-{kind}"));
        browser
            .until(&format!("!document.getElementById('legend').textContent.includes({label:?})"));
    }
    browser.click("#pin");
    until_has(&browser, "#pinned-status", "Choose another");
    browser.click("#scans-list li:nth-child(2) button");
    until_has(&browser, "#pinned-status", "100 beams in common, median difference");
    until_has(&browser, "#legend", "pinned scan");
    let set_mode = |mode: &str| {
        browser.eval(&format!(
            "(() => {{ const s = document.getElementById('pinned-mode'); s.value = {mode:?}; \
             s.dispatchEvent(new Event('change')); }})()"
        ));
    };
    set_mode("average");
    until_has(&browser, "#legend", "average of both scans");
    assert_eq!(browser.text("#residuals h2"), "Residual");
    set_mode("difference");
    until_has(&browser, "#legend", "shift since the pinned scan");
    assert_eq!(browser.text("#residuals h2"), "Difference");
    browser.click("#pin");
    browser.until("document.getElementById('pinned-status').hidden");
    assert_eq!(browser.text("#residuals h2"), "Residual");
    assert_clean(&browser);
}

#[test]
fn robot_is_moved() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) =
        daemon(folder.path(), "127.0.0.1:0", &["--set", &setting, "--set", "plan.step_deg=1.8"]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    until_has(&browser, "#next-table", "0.774");
    browser.click("#change");
    until_has(&browser, "#next-status", "Preview (200 beams)");
    until_has(&browser, "#legend", "preview of the next scan");
    let initial = daemon.status()["pose"].clone();
    let x_m = || {
        browser.eval("Number(document.getElementById('next-x_m').value)").as_f64().expect("metres")
    };
    // By mouse, then by key.
    let at = place(&browser, ".ranger", 0.5, 0.5);
    drag(&browser, at, [at[0] - 30.0, at[1]]);
    let dragged = x_m();
    assert!(dragged < 0.774 - 0.05, "{dragged}");
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Up.into());
    browser.until("Math.abs(Number(document.getElementById('next-y_m').value) - 0.095) < 0.002");
    // By its field; an invalid pose has no preview and is not applied.
    let type_x = |text: &str| {
        browser.eval(&format!(
            "(() => {{ const f = document.getElementById('next-x_m'); f.value = {text:?}; \
             f.dispatchEvent(new Event('input')); }})()"
        ));
    };
    type_x("99");
    until_has(&browser, "#next-status", "Preview unavailable");
    assert_eq!(daemon.status()["pose"], initial, "nothing is changed yet");
    type_x("0.5");
    until_has(&browser, "#next-status", "Preview (200 beams)");
    browser.click("#apply");
    until_has(&browser, "#summary", "Applied: pose");
    wait_until("the pose", || daemon.status()["pose"]["x_m"] == 0.5);
    browser.until("document.querySelector('.ranger').hidden");
    // During a scan the change is pending.
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    browser.click("#change");
    until_has(&browser, "#next-status", "Preview (200 beams)");
    type_x("0.6");
    until_has(&browser, "#next-status", "Preview (200 beams)");
    browser.click("#apply");
    browser.until("document.querySelector('#next-table .pending')?.textContent === '0.6'");
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("409")).collect();
    assert_eq!(other, Vec::<String>::new(), "apart from the browser's message about status 409");
}

#[test]
fn sensor_change_is_previewed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = editing_settings(folder.path());
    let enter = |id: &str, value: &str| {
        browser.eval(&format!(
            "(() => {{ const f = document.getElementById('next-{id}'); f.value = {value:?}; \
             f.dispatchEvent(new Event('input')); }})()"
        ));
    };
    let shown = |id: &str| browser.eval(&format!("document.getElementById('next-{id}').value"));
    enter("threshold", "0.9");
    until_has(&browser, "#next-status", "beams would change");
    until_has(&browser, "#next-status", "no echo");
    // A preset has its own parameters; its blanking is too short for this device.
    enter("name", "hc-sr04");
    browser.until("document.getElementById('next-blanking_us').value === '117'");
    assert_eq!(shown("threshold"), daemon.get("/v1/sensors").json()[5]["threshold"].to_string());
    until_has(&browser, "#next-status", "Preview unavailable: the device's minimum blanking");
    until_has(&browser, "#next-fault", "Keep Blanking (µs) unchanged");
    let marked = "document.querySelector('#next-table [aria-invalid]').id";
    assert_eq!(browser.eval(marked), "next-blanking_us");
    browser.click("#apply");
    until_has(&browser, "#next-status", "Nothing changed: ");
    let rejection = browser.text("#next-status");
    assert!(rejection.contains("blanking") && rejection.contains("500 us"), "{rejection}");
    enter("name", "senscomp-6500");
    enter("gain", "compensating");
    enter("threshold", "0.05");
    until_has(&browser, "#next-status", "Preview (100 beams)");
    browser.click("#apply");
    until_has(&browser, "#summary", "Applied: sensor");
    let sensor = daemon.status()["sensor"].clone();
    assert_eq!(
        (&sensor["threshold"], &sensor["gain"]["kind"]),
        (&json!(0.05), &json!("compensating"))
    );
    until_has(&browser, "#next-table", "compensates spreading loss");
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("409")).collect();
    assert_eq!(other, Vec::<String>::new(), "apart from the browser's message about status 409");
}

#[test]
fn late_preview_keeps_the_rejection() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = editing_settings(folder.path());
    // Delays the responses to preview requests until `release` is called.
    browser.eval(
        "(() => { const original = window.fetch; window.responses = 0; \
         const released = new Promise((done) => (window.release = done)); \
         window.fetch = async (url, ...rest) => { const response = await original(url, ...rest); \
         if (String(url).includes('preview')) { await released; window.responses += 1; } \
         return response; }; })()",
    );
    browser.eval(
        "(() => { const f = document.getElementById('next-name'); f.value = 'hc-sr04'; \
         f.dispatchEvent(new Event('input')); })()",
    );
    browser.click("#apply");
    until_has(&browser, "#next-status", "Nothing changed");
    browser.eval("window.release()");
    browser.until("window.responses > 0");
    browser.until_drawn();
    until_has(&browser, "#next-status", "Nothing changed");
    until_has(&browser, "#next-table", "senscomp-6500");
}

#[test]
fn array_is_moved() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let further = ["--set", "server.listen=127.0.0.1:0", "--set", &setting];
    let daemon = start_array(folder.path(), &further);
    let browser = Browser::open(&daemon.address(), DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    until_has(&browser, "#legend", "transducer");
    // Readings have their causes, and the lobes of their rangers; there is nothing to compare.
    until_has(&browser, "#legend", "main lobe up to the reading");
    until_has(&browser, "#legend", "direct echo (");
    browser.until("document.getElementById('residuals').hidden");
    assert!(!browser.text("#health").contains("Serial link"), "{}", browser.text("#health"));
    assert!(browser.text("#conditions").contains("8 rangers"), "{}", browser.text("#conditions"));
    browser.click("#change");
    until_has(&browser, "#next-status", "Preview (8 beams)");
    until_has(&browser, "#legend", "preview of the next scan");
    assert_eq!(browser.eval("document.getElementById('next-from_deg').closest('tr').hidden"), true);
    let before_m = daemon.status()["pose"]["x_m"].as_f64().expect("metres");
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Left.into());
    until_has(&browser, "#next-status", "Preview (8 beams)");
    browser.click("#apply");
    until_has(&browser, "#summary", "Applied: pose");
    let after_m = daemon.status()["pose"]["x_m"].as_f64().expect("metres");
    assert!((before_m - after_m - 0.01).abs() < 1e-6, "{before_m} and {after_m}");
    assert_clean(&browser);
}

#[test]
fn settings_change_together() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = editing_settings(folder.path());
    let before = daemon.status();
    let enter = |id: &str, value: &str| {
        browser.eval(&format!(
            "(() => {{ const f = document.getElementById('next-{id}'); f.value = {value:?}; \
             f.dispatchEvent(new Event('input')); }})()"
        ));
    };
    // A field without a number can't be applied.
    enter("y_m", "");
    until_has(&browser, "#next-fault", "Enter a number.");
    assert_eq!(browser.eval("document.getElementById('apply').disabled"), true);
    enter("y_m", "0.3");
    browser.until("document.querySelector('#next-table .fault').hidden");
    until_has(&browser, "#next-status", "Preview (100 beams)");
    // One setting that the device does not support rejects the others, too.
    enter("step_deg", "1");
    until_has(&browser, "#next-status", "Preview unavailable");
    browser.click("#apply");
    until_has(&browser, "#next-status", "Nothing changed: ");
    until_has(&browser, "#next-fault", "Step (°) 1 is not a whole number of the motor's steps");
    assert_eq!(daemon.status()["pose"], before["pose"]);
    enter("step_deg", "7.2");
    enter("temperature_c", "25");
    until_has(&browser, "#next-status", "Preview (50 beams)");
    browser.click("#apply");
    until_has(&browser, "#summary", "Applied: pose, sweep, air");
    let status = daemon.status();
    let now = (&status["pose"]["y_m"], &status["plan"]["step_deg"]);
    assert_eq!(now, (&json!(0.3), &json!(7.2)));
    assert_eq!(status["air"]["temperature_c"], 25.0);
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("409")).collect();
    assert_eq!(other, Vec::<String>::new(), "apart from the browser's message about status 409");
}

#[test]
fn findings_during_a_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    browser.click("#show-features");
    until_has(&browser, "#legend", "plane (P)");
    assert_eq!(browser.eval("document.getElementById('findings-status').hidden"), true);
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    until_has(&browser, "#findings-status", "Features of the last complete scan, ");
    until_has(&browser, "#legend", "plane (P)");
    browser.until(COMPLETE);
    browser.until("document.getElementById('findings-status').hidden");
    // The pointer shows the probability of a feature, and the value of a reading.
    let scan = daemon.get("/v1/scans?limit=1").json()[0]["scan"].clone();
    let id = scan.as_str().expect("an id");
    let found = daemon.get(&format!("/v1/scans/{id}/findings")).json();
    let at = browser.eval(&format!(
        "import('/page/main.js').then(({{plan}}) => {{ const at = plan.view.px({}); \
         const r = document.getElementById('over').getBoundingClientRect(); \
         return [r.left + at[0], r.top + at[1]]; }})",
        found["features"][0]["at"]
    ));
    let event = json!({"type": "mouseMoved", "x": at[0], "y": at[1]});
    browser.devtools("Input.dispatchMouseEvent", &event);
    until_has(&browser, ".tip", "probability");
    select_beam(&browser, 75);
    browser.devtools("Input.dispatchMouseEvent", &json!({"type": "mouseMoved", "x": 5, "y": 5}));
    until_has(&browser, ".tip", "beam 75, azimuth 270.0°");
    assert_clean(&browser);
}

#[test]
fn arrivals_have_outcomes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    select_beam(&browser, 75);
    let outcomes = browser.eval(
        "[...document.querySelectorAll('.peaks button')].map((b) => b.children[2].textContent)",
    );
    let outcomes: Vec<&str> = outcomes
        .as_array()
        .expect("a list")
        .iter()
        .map(|text| text.as_str().expect("a text"))
        .collect();
    // The south wall is 85 mm away, and its first echoes arrive while the receiver is blanked.
    assert_eq!(outcomes[0], "blanked", "{outcomes:?}");
    for outcome in ["detected as echo 1", "detected as echo 2", "below threshold"] {
        assert!(outcomes.contains(&outcome), "{outcome} is not in {outcomes:?}");
    }
    // The trace reaches beyond the last measured echo.
    let scan = daemon.get("/v1/scans?limit=1").json()[0]["scan"].clone();
    let path = format!("/v1/scans/{}/beams/75", scan.as_str().expect("an id"));
    let beam = daemon.get(&path).json();
    let last = beam["echoes"].as_array().and_then(|echoes| echoes.last()).expect("echoes");
    let last_m = last["range_m"].as_f64().expect("a range");
    let [step_us, m_per_us] =
        ["step_us", "m_per_us"].map(|key| beam["trace"][key].as_f64().expect("a number"));
    let samples = beam["trace"]["envelope"].as_array().expect("samples").len();
    assert!(samples as f64 * step_us * m_per_us > last_m, "{samples} samples, {last_m} m");
    let facts = browser.text("#beam-panel .facts");
    assert!(facts.contains("Half the path length0.827"), "{facts}");
    assert_clean(&browser);
}

#[test]
fn links_csv_units_and_location() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    let scans = daemon.get("/v1/scans").json();
    let oldest = scans[1]["scan"].as_str().expect("an id");
    // A link shows its scan and its beam; both follow the selection.
    browser.eval(&format!("(location.hash = '#scan={oldest}&beam=30')"));
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    until_has(&browser, "#beam-label", "beam 30, azimuth 108.0°");
    browser.until("location.hash.endsWith('beam=30')");
    browser.eval("(location.reload(), true)");
    browser.until("document.getElementById('beam-label').textContent === 'none selected'");
    until_has(&browser, "#beam-label", "beam 30, azimuth 108.0°");
    browser.click("#live");
    browser.until("location.hash === '#beam=30'");
    let unit = |name: &str| {
        browser.eval(&format!(
            "(() => {{ const u = document.getElementById('unit'); u.value = {name:?}; \
             u.dispatchEvent(new Event('change')); }})()"
        ));
    };
    unit("cm");
    until_has(&browser, "#beam-label", " cm, predicted 227.8");
    unit("m");
    until_has(&browser, "#beam-label", " m, predicted 2.278");
    browser.eval(
        "(() => { globalThis.saved = []; const make = URL.createObjectURL; \
         URL.createObjectURL = (blob) => { saved.push(blob); return make(blob); }; \
         HTMLAnchorElement.prototype.click = function () { saved.push(this.download); }; })()",
    );
    let save = |kind: &str| {
        browser.eval("globalThis.saved.length = 0");
        browser.click(&format!("[data-kind={kind}]"));
        browser.until("globalThis.saved.length === 2");
        browser.eval("saved[0].text()").as_str().expect("a text").to_owned()
    };
    let csv = save("csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert!(lines[0].starts_with("beam,ranger,azimuth_deg,status,range_m,"), "{csv}");
    assert_eq!(lines.len(), 101);
    assert!(lines[31].starts_with("30,,108,echo,2.2"), "{}", lines[31]);
    let csv = save("beam");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines[0], lines.len()), ("scan,time,azimuth_deg,range_m", 3), "{csv}");
    assert!(lines[1].starts_with(oldest) && lines[1].contains(",108,2.2"), "{csv}");
    // The estimated pose is drawn and can be proposed; writing takes the token.
    browser.click("#locate");
    browser.until("document.getElementById('located').textContent.startsWith('(0.774, 0.085) m')");
    until_has(&browser, "#legend", "located pose");
    assert_eq!(browser.eval("document.getElementById('use-pose').checkVisibility()"), false);
    assert_clean(&browser);
}

#[test]
fn newest_scan_is_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    browser.click("#over-time summary");
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    // Time line, list and waterfall count the running scan.
    until_has(&browser, "#scrub-label", "scan 3 of 3");
    until_has(&browser, "#scans-list li", "running");
    until_has(&browser, "#over-time .hint", "3 of 3 scans");
    browser.until(COMPLETE);
    until_has(&browser, "#scans-list li", "100 beams");
    // A scan with another plan has its own azimuths.
    let plan =
        r#"{"scans":1,"plan":{"from_deg":180,"to_deg":360,"step_deg":7.2,"pings_per_stop":1}}"#;
    assert_eq!(daemon.send("POST", "/v1/start", plan).status, 202);
    daemon.wait_for_scans(4);
    until_has(&browser, "#scan-label", "25 of 25");
    browser.eval("document.getElementById('beam').focus()");
    select_beam(&browser, 12);
    until_has(&browser, "#beam-label", "beam 12, azimuth 266.4°");
    until_has(&browser, "#series-label", "Beam 12 in 4 scans");
    assert_clean(&browser);
}

#[test]
fn selection_moves_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    select_beam(&browser, 75);
    let places = || {
        browser.eval(
            "['.history', '.next', '#residuals', '#scan-line'].map((name) => \
             Math.round(document.querySelector(name).getBoundingClientRect().top + scrollY))",
        )
    };
    let before = places();
    // Until the details of the other beam are loaded, those of the last one keep their room.
    browser.eval(
        "(() => { const s = document.getElementById('beam'); s.value = 20; \
         s.dispatchEvent(new Event('input')); })()",
    );
    assert_eq!(places(), before);
    assert_clean(&browser);
}

#[test]
fn contradictions_are_marked() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    // Beams 74 to 76 are predicted to be a multiple reflection; the northern wall is at y = 0.742.
    let marked = browser.eval(
        "Promise.all(['main', 'findings'].map((name) => import(`/page/${name}.js`))).then(([{plan}, {markContradictions}]) => { \
         const found = {features: [{kind: 'edge', beams: [74, 76]}, {kind: 'unresolved', beams: [74, 76]}, \
             {kind: 'plane', beams: [24, 26]}], \
           lines: [{from: [0.2, 0.75], to: [0.6, 0.75]}, {from: [0.2, 1.5], to: [0.6, 1.5]}]}; \
         markContradictions(found, plan.scan, plan.scene); \
         return [...found.features, ...found.lines].map(({contradiction}) => contradiction ?? null); })",
    );
    let expected = json!([
        "the model predicts a multiple reflection here",
        null,
        null,
        null,
        "no wall of the scene here"
    ]);
    assert_eq!(marked, expected);
}

#[test]
fn located_pose_is_used() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    // The ranger stays at its true pose, 3 cm from the assumed one.
    let options = ["--set", &setting, "--truth-pose", "fig9"];
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &options);
    let wrong = r#"{"x_m":0.744,"y_m":0.085,"heading_deg":0}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", wrong).status, 202);
    let browser = Browser::open(&address, DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    scan_once(&daemon);
    // The result of the scan stays next to its explanation.
    until_has(&browser, "#summary", "Last scan: 100 beams, ");
    until_has(&browser, "#summary", "Better explained: ");
    browser.click("#locate");
    browser.until("!document.getElementById('use-pose').hidden");
    browser.click("#use-pose");
    until_has(&browser, "#next-status", "Preview (100 beams)");
    browser.click("#apply");
    until_has(&browser, "#summary", "Applied: pose");
    let x_m = daemon.status()["pose"]["x_m"].as_f64();
    assert!(x_m.is_some_and(|x_m| (x_m - 0.774).abs() < 0.002), "{x_m:?}");
    assert_clean(&browser);
}
