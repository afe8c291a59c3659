//! The page as a place to work: past scans, downloads, echo traces, overlays, and what is to be changed.

use std::path::Path;

use fantoccini::key::Key;
use serde_json::{Value, json};

use super::{
    OVER, assert_clean,
    browser::{Browser, DESK},
    daemon, drawn_points,
    pointer::{drag, place},
    scan_once,
};
use sonard_test_support::{
    daemon::{Daemon, start_array, write_scans, write_token},
    wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// A page of a daemon that has taken two scans, and its daemon.
fn with_two_scans(folder: &Path, further: &[&str]) -> (Daemon, Browser) {
    let (daemon, address) = daemon(folder, "127.0.0.1:0", further);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    let browser = Browser::open(&address, DESK);
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.until("document.getElementById('which').textContent.includes('100 of 100')");
    (daemon, browser)
}

/// A page whose sensor somebody who has the token is about to change, and its daemon.
fn about_to_change(folder: &Path) -> (Daemon, Browser) {
    let file = write_token(folder, TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) = daemon(folder, "127.0.0.1:0", &["--set", &setting]);
    let browser = Browser::open(&address, DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    has(&browser, "#next-table", "senscomp-6500");
    browser.click("#change");
    has(&browser, "#next-now", "The model expects 100 beams");
    (daemon, browser)
}

fn choose(browser: &Browser, index: u32) {
    browser.eval(&format!(
        "(() => {{ const s = document.getElementById('beam'); s.value = {index}; \
         s.dispatchEvent(new Event('input')); }})()"
    ));
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
}

fn has(browser: &Browser, selector: &str, words: &str) {
    browser.until(&format!("document.querySelector({selector:?}).textContent.includes({words:?})"));
}

#[test]
fn scans_are_scrubbed_through_by_time_also_those_of_long_ago() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 620, 10);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    let most = |count: u32| format!("document.getElementById('scrub').max === '{}'", count - 1);
    browser.until(&most(50));
    assert!(drawn_points(&browser, "time-line") > 500);
    browser.eval("document.getElementById('scrub').focus()");
    browser.press(Key::Left.into());
    has(&browser, "#scrub-now", "scan 49 of 50");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("document.getElementById('which').textContent.includes('10 of 10')");
    browser.click("#older");
    browser.until(&most(550));
    browser.click("#older");
    browser.until(&most(620));
    assert_eq!(browser.eval("document.getElementById('older').disabled"), true);
    // The first of all, by one key; the list follows.
    browser.eval("document.getElementById('scrub').focus()");
    browser.press(Key::Home.into());
    has(&browser, "#scrub-now", "scan 1 of 620");
    let first = "[data-scan=\"00000000-0000-0000-0000-000000000001\"]";
    browser.until(&format!("document.querySelector('{first}')?.ariaPressed === 'true'"));
    assert_eq!(browser.eval("document.querySelectorAll('#scans-list button').length"), 50);
    let spoken = browser.eval("document.getElementById('scrub').getAttribute('aria-valuetext')");
    assert_eq!(spoken, json!(browser.text("#scrub-now")));
    browser.click("#live");
    has(&browser, "#scrub-now", "scan 620 of 620");
    assert_clean(&browser);
}

#[test]
fn scan_log_and_pictures_are_downloaded() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = with_two_scans(folder.path(), &[]);
    choose(&browser, 75);
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
        ["simple-room", "MOCK, not hardware", "multiple reflection (", "path of its sound", "north"]
    {
        assert!(svg.contains(drawn), "{drawn} is not in the picture");
    }
    assert!(svg.matches("<path").count() > 100, "{} paths", svg.matches("<path").count());
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
fn the_selected_beam_has_its_echo_trace_and_its_ranges_over_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    assert_eq!(browser.eval("document.getElementById('trace').hidden"), true);
    choose(&browser, 75);
    browser.until("document.getElementById('trace').width > 0");
    let drawn = drawn_points(&browser, "trace");
    assert!(drawn > 600, "{drawn} points");
    // A sound is chosen by its place in the trace, too.
    let chosen = || browser.text(".peaks [aria-pressed=true]");
    let before = chosen();
    browser.click_at("#trace", 0.22, 0.85);
    browser.until(&format!(
        "document.querySelector('.peaks [aria-pressed=true]').textContent !== {before:?}"
    ));
    browser.click("#over-time summary");
    has(&browser, "#series-now", "Beam 75 in 2 scans: mean 0.82");
    assert!(drawn_points(&browser, "waterfall") > 1000);
    assert!(drawn_points(&browser, "series") > 20);
    // A click in it selects beam and scan.
    browser.click_at("#waterfall", 0.5, 0.1);
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    browser.until("Number(document.getElementById('beam').value) !== 75");
    let beam = browser.eval("Number(document.getElementById('beam').value)").as_u64();
    assert!(beam.is_some_and(|beam| (40..56).contains(&beam)), "{beam:?}");
    assert_clean(&browser);
}

#[test]
fn a_second_scan_map_lines_and_features_lie_under_the_readings() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = with_two_scans(folder.path(), &[]);
    let legend = |words: &str| browser.text("#legend").contains(words);
    for (kind, words, layer) in [
        ("map", "map: free", "under"),
        ("lines", "fitted line", "under"),
        ("features", "plane (P)", "over"),
    ] {
        assert!(!legend(words));
        let drawn = || super::count_points(&browser, layer, "d[i + 3] > 20");
        let bare = drawn();
        browser.click(&format!("#show-{kind}"));
        has(&browser, "#legend", words);
        assert!(drawn() > bare, "{kind}");
        browser.click(&format!("#show-{kind}"));
        browser
            .until(&format!("!document.getElementById('legend').textContent.includes({words:?})"));
    }
    browser.click("#pin");
    has(&browser, "#second-now", "Choose another");
    browser.click("#scans-list li:nth-child(2) button");
    has(&browser, "#second-now", "100 beams with a range in both, median difference");
    has(&browser, "#legend", "reading of the pinned scan");
    let as_way = |way: &str| {
        browser.eval(&format!(
            "(() => {{ const s = document.getElementById('second-as'); s.value = {way:?}; \
             s.dispatchEvent(new Event('change')); }})()"
        ));
    };
    as_way("average");
    has(&browser, "#legend", "average of both scans");
    assert_eq!(browser.text("#residuals h2"), "Residual");
    as_way("difference");
    has(&browser, "#legend", "from the pinned scan to this one");
    assert_eq!(browser.text("#residuals h2"), "Difference");
    browser.click("#pin");
    browser.until("document.getElementById('second-now').hidden");
    assert_eq!(browser.text("#residuals h2"), "Residual");
    assert_clean(&browser);
}

#[test]
fn the_robot_is_dragged_previewed_and_moved_with_the_token() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) =
        daemon(folder.path(), "127.0.0.1:0", &["--set", &setting, "--set", "plan.step_deg=1.8"]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(OVER);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    has(&browser, "#next-table", "0.774");
    browser.click("#change");
    has(&browser, "#next-now", "The model expects 200 beams");
    has(&browser, "#legend", "what the model expects of the next scan");
    let stood = daemon.status()["pose"].clone();
    let x_m = || {
        browser.eval("Number(document.getElementById('next-x_m').value)").as_f64().expect("metres")
    };
    // With the mouse, to the left; then a key.
    let at = place(&browser, ".ranger", 0.5, 0.5);
    drag(&browser, at, [at[0] - 30.0, at[1]]);
    let dragged = x_m();
    assert!(dragged < 0.774 - 0.05, "{dragged}");
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Up.into());
    browser.until("Math.abs(Number(document.getElementById('next-y_m').value) - 0.095) < 0.002");
    // By its field, too; where it can't stand that is said, and it is not applied.
    let type_x = |text: &str| {
        browser.eval(&format!(
            "(() => {{ const f = document.getElementById('next-x_m'); f.value = {text:?}; \
             f.dispatchEvent(new Event('input')); }})()"
        ));
    };
    type_x("99");
    has(&browser, "#next-now", "No preview");
    assert_eq!(daemon.status()["pose"], stood, "nothing is changed yet");
    type_x("0.5");
    has(&browser, "#next-now", "The model expects 200 beams");
    browser.click("#apply");
    has(&browser, "#summary", "Taken in: pose");
    wait_until("the pose", || daemon.status()["pose"]["x_m"] == 0.5);
    browser.until("document.querySelector('.ranger').hidden");
    // While a scan is under way the change is pending.
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    browser.click("#change");
    has(&browser, "#next-now", "The model expects 200 beams");
    type_x("0.6");
    has(&browser, "#next-now", "The model expects 200 beams");
    browser.click("#apply");
    browser.until("document.querySelector('#next-table .pending')?.textContent === '0.6'");
    let refused = |text: &String| text.contains("409");
    let other: Vec<String> =
        browser.complaints().into_iter().filter(|text| !refused(text)).collect();
    assert_eq!(other, Vec::<String>::new(), "besides the browser's note of the refusal");
}

#[test]
fn the_sensor_is_changed_and_its_effect_is_seen_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = about_to_change(folder.path());
    let enter = |id: &str, value: &str| {
        browser.eval(&format!(
            "(() => {{ const f = document.getElementById('next-{id}'); f.value = {value:?}; \
             f.dispatchEvent(new Event('input')); }})()"
        ));
    };
    let shown = |id: &str| browser.eval(&format!("document.getElementById('next-{id}').value"));
    enter("threshold", "0.9");
    has(&browser, "#next-now", "of them otherwise than if nothing is changed");
    has(&browser, "#next-now", "silent");
    // A preset brings its own figures; this device can't be so near.
    enter("name", "hc-sr04");
    browser.until("document.getElementById('next-blanking_us').value === '117'");
    assert_eq!(shown("threshold"), daemon.get("/v1/sensors").json()[5]["threshold"].to_string());
    has(&browser, "#next-now", "otherwise than");
    browser.click("#apply");
    has(&browser, "#next-now", "Refused, the sensor: the device's shortest blanking is 500 us");
    enter("name", "senscomp-6500");
    enter("gain", "compensating");
    enter("threshold", "0.05");
    has(&browser, "#next-now", "The model expects 100 beams");
    browser.click("#apply");
    has(&browser, "#summary", "Taken in: sensor");
    let sensor = daemon.status()["sensor"].clone();
    assert_eq!(
        (&sensor["threshold"], &sensor["gain"]["kind"]),
        (&json!(0.05), &json!("compensating"))
    );
    has(&browser, "#next-table", "as it spreads");
    let refused = |text: &String| text.contains("409");
    let other: Vec<String> =
        browser.complaints().into_iter().filter(|text| !refused(text)).collect();
    assert_eq!(other, Vec::<String>::new(), "besides the browser's note of the refusal");
}

#[test]
fn a_refusal_stays_to_be_read_when_a_preview_comes_after_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = about_to_change(folder.path());
    // Previews are answered once somebody lets them.
    browser.eval(
        "(() => { const asked = window.fetch; window.answered = 0; \
         const held = new Promise((done) => (window.letGo = done)); \
         window.fetch = async (url, ...rest) => { const answer = await asked(url, ...rest); \
         if (String(url).includes('preview')) { await held; window.answered += 1; } \
         return answer; }; })()",
    );
    browser.eval(
        "(() => { const f = document.getElementById('next-name'); f.value = 'hc-sr04'; \
         f.dispatchEvent(new Event('input')); })()",
    );
    browser.click("#apply");
    has(&browser, "#next-now", "Refused, the sensor");
    browser.eval("window.letGo()");
    browser.until("window.answered > 0");
    browser.until_drawn();
    has(&browser, "#next-now", "Refused, the sensor");
    has(&browser, "#next-table", "senscomp-6500");
}

#[test]
fn an_array_is_drawn_from_its_sonars_moved_and_previewed() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let further = ["--set", "server.listen=127.0.0.1:0", "--set", &setting];
    let daemon = start_array(folder.path(), &further);
    let browser = Browser::open(&daemon.address(), DESK);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    has(&browser, "#legend", "transducer");
    assert!(browser.text("#conditions").contains("8 rangers"), "{}", browser.text("#conditions"));
    browser.click("#change");
    has(&browser, "#next-now", "The model expects 8 beams");
    has(&browser, "#legend", "what the model expects of the next scan");
    assert_eq!(browser.eval("document.getElementById('next-from_deg').closest('tr').hidden"), true);
    let stood = daemon.status()["pose"]["x_m"].as_f64().expect("metres");
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Left.into());
    has(&browser, "#next-now", "The model expects 8 beams");
    browser.click("#apply");
    has(&browser, "#summary", "Taken in: pose");
    let stands = daemon.status()["pose"]["x_m"].as_f64().expect("metres");
    assert!((stood - stands - 0.01).abs() < 1e-6, "{stood} and {stands}");
    assert_clean(&browser);
}
