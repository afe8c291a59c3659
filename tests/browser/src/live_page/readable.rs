//! Consistency of the page: counts, legend, view, selection, and pending or rejected settings.

use std::{collections::BTreeMap, fs, path::Path};

use rustix::process::Signal;
use serde_json::Value;

use super::{
    COMPLETE, assert_clean,
    browser::{Browser, DESK, DESK_DARK},
    daemon, scan_once, show_log,
};
use sonard_test_support::{daemon::Daemon, wait_until};

const LOG: &str = include_str!("../../../fixtures/small.jsonl");

/// Counts of the legend by label.
fn legend(browser: &Browser) -> BTreeMap<String, u64> {
    let items =
        browser.eval("[...document.querySelectorAll('#legend li')].map((li) => li.textContent)");
    let counts = items.as_array().expect("entries").iter().filter_map(|text| {
        let (label, rest) = text.as_str()?.rsplit_once(" (")?;
        Some((label.to_owned(), rest.strip_suffix(')')?.parse().ok()?))
    });
    counts.collect()
}

fn legend_has(browser: &Browser, label: &str) -> bool {
    let items = "[...document.querySelectorAll('#legend li')].map((li) => li.textContent)";
    browser.eval(&format!("{items}.includes('{label}')")) == true
}

/// Number that precedes a phrase in a text; 0 if the phrase is missing.
fn number_before(text: &str, phrase: &str) -> u64 {
    let before = text.split(phrase).next().filter(|_| text.contains(phrase)).unwrap_or("0");
    before.split_whitespace().next_back().and_then(|word| word.parse().ok()).unwrap_or(0)
}

fn choose(browser: &Browser, beam: u32) {
    browser.eval(&format!(
        "(() => {{ const s = document.getElementById('beam'); s.value = {beam}; \
         s.dispatchEvent(new Event('input')); }})()"
    ));
}

fn choose_view(browser: &Browser, view: &str) {
    browser.eval(&format!(
        "(() => {{ const s = document.getElementById('fit'); s.value = '{view}'; \
         s.dispatchEvent(new Event('change')); }})()"
    ));
    browser.until_drawn();
}

/// Writes a log with a scan with readings of every kind, two of them missed echoes.
fn write_every_kind(folder: &Path) {
    let mut lines: Vec<String> = LOG.lines().map(str::to_owned).collect();
    let mut missed: Value = serde_json::from_str(&lines[2]).expect("a reading");
    missed["status"] = "no_echo".into();
    for name in ["range_m", "tof_us", "residual_m"] {
        missed[name] = Value::Null;
    }
    missed["echo_ticks"] = Value::Array(Vec::new());
    for index in [7, 8] {
        missed["index"] = index.into();
        let mut fields = missed.clone();
        fields.as_object_mut().expect("an object").remove("type");
        // `type` is the first field of a record.
        lines.insert(2 + index, fields.to_string().replacen('{', "{\"type\":\"ping\",", 1));
    }
    let text = lines.join("\n").replace("\"to_deg\":6.3", "\"to_deg\":8.1");
    let text = text.replace("\"beams\":7", "\"beams\":9");
    let log = folder.join("log");
    fs::create_dir_all(&log).expect("there is room");
    fs::write(log.join("sonard-20260101T000000Z.jsonl"), text + "\n").expect("there is room");
}

#[test]
fn counts_of_a_scan_are_consistent() {
    let folder = tempfile::tempdir().expect("a folder");
    write_every_kind(folder.path());
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    show_log(&daemon, &browser, "20260101");
    let (label, summary) = (browser.text("#scan-label"), browser.text("#summary"));
    let counts = legend(&browser);
    let count = |label: &str| counts.get(label).copied().unwrap_or(0);
    assert_eq!(counts.values().sum::<u64>(), 9, "{counts:?}");
    assert!(
        label.contains("9 of 9 beams") && summary.starts_with("9 beams,"),
        "{label}: {summary}"
    );
    let agreeing = ["direct echo", "multiple reflection", "edge", "minimum range", "no echo"];
    let agreeing: u64 = agreeing.iter().map(|label| count(label)).sum();
    let agree = number_before(&summary, " agree with the model");
    assert_eq!(agree, agreeing, "{summary}, {counts:?}");
    let disagreeing = count("disagrees with model") + count("missed echo");
    let disagree = number_before(&summary, " disagree with the model");
    assert_eq!((disagreeing, disagree), (3, 3), "{summary}, {counts:?}");
    assert_eq!(number_before(&summary, " of them without echo"), 2, "{summary}");
    let invalid = count("invalid reading");
    assert_eq!(number_before(&summary, " without a valid reading"), invalid);
    assert_eq!(agreeing + disagreeing + invalid, 9, "{summary}");
}

#[test]
fn counts_of_a_running_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let check = |browser: &Browser| {
        // Both texts and the progress bar at the same moment.
        let now = browser.eval(
            "['scan-label', 'summary'].map((id) => document.getElementById(id).textContent)\
             .concat(document.getElementById('progress').hidden)",
        );
        let [label, summary] = [&now[0], &now[1]].map(|text| text.as_str().expect("a text"));
        if now[2] == true {
            return;
        }
        assert!(label.contains(" of 100 beams"), "{label}");
        assert_eq!(number_before(summary, " beam"), 100, "{label}, but {summary}");
    };
    scan_once(&daemon);
    // A page opened during a scan reads the earlier readings from the log.
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('progress').value > 5");
    check(&browser);
    browser.until("document.getElementById('progress').value > 50");
    check(&browser);
    browser.until("document.getElementById('progress').hidden");
    browser.click("#replay");
    browser.until("document.getElementById('progress').value > 20");
    check(&browser);
    browser.until("document.getElementById('progress').hidden");
    let (label, summary) = (browser.text("#scan-label"), browser.text("#summary"));
    assert!(label.contains("100 of 100 beams") && summary.contains("100 beams,"), "{summary}");
}

/// Colours found in the legend (approximately, because of thin lines) and on the stage (exactly).
/// Both are read at the same moment, because the next reading may add a colour.
fn colours(browser: &Browser) -> [Vec<String>; 2] {
    let found = browser.eval(
        "(() => { const style = getComputedStyle(document.documentElement); \
         const names = ['--wall', '--border', '--ink', '--min-range', '--ray', '--path', '--direct', '--multiple', \
           '--edge-mark', '--disagrees', '--no-echo', '--invalid', '--model']; \
         const all = names.map((name) => style.getPropertyValue(name).trim()); \
         const parts = all.map((hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16))); \
         const find = (canvases, alpha, tolerance) => { \
           const seen = all.map(() => 0); \
           for (const c of document.querySelectorAll(canvases)) { \
             const copy = new OffscreenCanvas(c.width, c.height); \
             const c2d = copy.getContext('2d', {willReadFrequently: true}); c2d.drawImage(c, 0, 0); \
             const d = c2d.getImageData(0, 0, c.width, c.height).data; \
             for (let i = 0; i < d.length; i += 4) if (d[i + 3] >= alpha) parts.forEach((part, n) => { \
               if (part.every((v, k) => Math.abs(v - d[i + k]) <= tolerance)) seen[n]++; }); } \
           return all.filter((_, n) => seen[n] > 3); }; \
         return [find('#legend canvas', 60, 12), find('#stage canvas', 255, 0)]; })()",
    );
    serde_json::from_value(found).expect("two lists of colours")
}

fn check_legend(browser: &Browser, labels: &[&str]) {
    browser.until_drawn();
    for label in labels {
        assert!(legend_has(browser, label), "{label:?} is not in: {}", browser.text("#legend"));
    }
    let [listed, drawn] = colours(browser);
    for colour in drawn {
        assert!(listed.contains(&colour), "{colour} is drawn but not in the legend, {listed:?}");
    }
}

#[test]
fn legend_lists_everything_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    for absent in ["minimum range (blanking)", "selected reading", "rough wall"] {
        assert!(!legend_has(&browser, absent), "{absent} is listed but not drawn");
    }
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 20");
    check_legend(&browser, &["wall", "pose and heading", "current beam"]);
    browser.until(COMPLETE);
    wait_until("a legend without the beam", || !legend_has(&browser, "current beam"));
    choose(&browser, 75);
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    let drawn = [
        "wall",
        "pose and heading",
        "minimum range (blanking)",
        "direction of the selected beam",
        "selected reading",
        "propagation path",
        "prediction",
    ];
    check_legend(&browser, &drawn);
    choose_view(&browser, "room");
    check_legend(&browser, &[&drawn[..], &["outside the view"]].concat());
    browser.look_through(DESK_DARK);
    check_legend(&browser, &drawn);
    assert_clean(&browser);
}

#[test]
fn legend_lists_parts_of_an_array() {
    let folder = tempfile::tempdir().expect("a folder");
    let array = ["--simulate", "--array", "ring-12", "--scene", "mcgill-lab", "--pose", "fig4"];
    let listen = ["--set", "server.listen=127.0.0.1:0"];
    let daemon = Daemon::start(folder.path(), &[&array[..], &listen].concat());
    daemon.wait_for_scans(1);
    let browser = Browser::open(&daemon.address(), DESK);
    show_log(&daemon, &browser, "");
    choose(&browser, 3);
    check_legend(
        &browser,
        &["wall", "rough wall", "robot", "transducer", "minimum range (blanking)"],
    );
}

#[test]
fn selection_is_kept_across_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    choose(&browser, 75);
    let now = || browser.text("#beam-label");
    assert!(now().starts_with("beam 75, ") && !now().contains("previous"), "{}", now());
    let first = browser.eval("import('/page/main.js').then(({plan}) => plan.selected.scan)");
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    // The previous reading stays, labelled as such, until the beam is measured again.
    assert!(now().starts_with("beam 75, ") && now().contains("previous scan"), "{}", now());
    assert_eq!(browser.eval("document.getElementById('beam').value"), "75");
    assert!(legend_has(&browser, "direction of the selected beam"));
    assert!(browser.text("#beam-panel").contains("75 at 270.0"), "the panel keeps the reading");
    browser.until("document.getElementById('progress').value > 80");
    let second = browser.eval("import('/page/main.js').then(({plan}) => plan.selected.scan)");
    assert_ne!(first, second, "the new scan's reading replaces it");
    assert!(now().starts_with("beam 75, ") && !now().contains("previous"), "{}", now());
    browser.until(COMPLETE);
    // The selection is kept in a scan of the log, too.
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    assert!(now().starts_with("beam 75, "), "{}", now());
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    assert_clean(&browser);
}

#[test]
fn view_modes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", "plan.step_deg=1.8"]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    let outside = || number_before(&browser.text("#out-of-view"), " reading");
    let usual = outside();
    assert!(usual <= 40, "{usual} of 200 readings are arrows at the edge");
    let scale = || {
        let scale = browser.eval("import('/page/main.js').then(({plan}) => plan.view.scale)");
        scale.as_f64().expect("pixels per metre")
    };
    let near = scale();
    choose_view(&browser, "room");
    // In this room every other reading is a multiple reflection beyond the walls.
    assert!(outside() > 100, "{}", browser.text("#out-of-view"));
    let room = scale();
    assert!(room > 2.0 * near && room < 5.0 * near, "{room} and {near} pixels per metre");
    choose_view(&browser, "all");
    assert_eq!((outside(), browser.text("#out-of-view")), (0, String::new()));
    assert!(scale() <= near);
    choose_view(&browser, "near");
    assert_eq!(outside(), usual);
    assert_clean(&browser);
}

#[test]
fn pending_and_rejected_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("sonard.toml");
    fs::write(&file, "[plan]\nstep_deg = 3.6\n").expect("there is room");
    let config = ["--config", file.to_str().expect("plain")];
    let mode = ["--set", "scanning.mode=continuous", "--set", "plan.step_deg=0.9"];
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[&config[..], &mode].concat());
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('progress').value > 5");
    let pose = r#"{"x_m":0.5,"y_m":0.3,"heading_deg":90}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", pose).status, 202);
    browser.until("document.getElementById('conditions').textContent.includes('Next scan')");
    let conditions = browser.text("#conditions");
    let [current, pending] = ["(0.774, 0.085) m", "pose (0.500, 0.300) m, heading 90"];
    assert!(conditions.contains(current) && conditions.contains(pending), "{conditions}");
    fs::write(&file, "[plan]\nstep_dge = 3.6\n").expect("there is room");
    daemon.signal(Signal::HUP);
    browser
        .until("document.getElementById('trouble').textContent.includes('Configuration rejected')");
    assert!(browser.text("#trouble").contains("step_dge"), "{}", browser.text("#trouble"));
}
