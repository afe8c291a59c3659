//! What is on the page can be understood: counts agree, everything drawn is in the legend, readings are in
//! view, what was selected stays, and what is pending or wrong is said.

use std::{collections::BTreeMap, fs, path::Path};

use rustix::process::Signal;
use serde_json::Value;

use super::{
    OVER, assert_clean,
    browser::{Browser, DESK, DESK_DARK},
    daemon, scan_once, show_log,
};
use sonard_test_support::daemon::Daemon;

const LOG: &str = include_str!("../../../fixtures/small.jsonl");

/// Numbers of the legend by what they count.
fn legend(browser: &Browser) -> BTreeMap<String, u64> {
    let items =
        browser.eval("[...document.querySelectorAll('#legend li')].map((li) => li.textContent)");
    let counts = items.as_array().expect("entries").iter().filter_map(|text| {
        let (words, rest) = text.as_str()?.rsplit_once(" (")?;
        Some((words.to_owned(), rest.strip_suffix(')')?.parse().ok()?))
    });
    counts.collect()
}

fn legend_has(browser: &Browser, words: &str) -> bool {
    let items = "[...document.querySelectorAll('#legend li')].map((li) => li.textContent)";
    browser.eval(&format!("{items}.includes('{words}')")) == true
}

/// The number before some words of a text, 0 without them.
fn number_before(text: &str, words: &str) -> u64 {
    let before = text.split(words).next().filter(|_| text.contains(words)).unwrap_or("0");
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

/// A scan with readings of every kind, two of them silent where the model hears something.
fn write_every_kind(folder: &Path) {
    let mut lines: Vec<String> = LOG.lines().map(str::to_owned).collect();
    let mut silent: Value = serde_json::from_str(&lines[2]).expect("a reading");
    silent["status"] = "no_echo".into();
    for name in ["range_m", "tof_us", "residual_m"] {
        silent[name] = Value::Null;
    }
    silent["echo_ticks"] = Value::Array(Vec::new());
    for index in [7, 8] {
        silent["index"] = index.into();
        let mut fields = silent.clone();
        fields.as_object_mut().expect("an object").remove("type");
        // A record's type stands first.
        lines.insert(2 + index, fields.to_string().replacen('{', "{\"type\":\"ping\",", 1));
    }
    let text = lines.join("\n").replace("\"to_deg\":6.3", "\"to_deg\":8.1");
    let text = text.replace("\"beams\":7", "\"beams\":9");
    let log = folder.join("log");
    fs::create_dir_all(&log).expect("there is room");
    fs::write(log.join("sonard-20260101T000000Z.jsonl"), text + "\n").expect("there is room");
}

#[test]
fn counts_of_a_scan_agree_wherever_they_stand() {
    let folder = tempfile::tempdir().expect("a folder");
    write_every_kind(folder.path());
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    show_log(&daemon, &browser, "20260101");
    let (which, summary) = (browser.text("#which"), browser.text("#summary"));
    let counts = legend(&browser);
    let of = |words: &str| counts.get(words).copied().unwrap_or(0);
    assert_eq!(counts.values().sum::<u64>(), 9, "{counts:?}");
    assert!(
        which.contains("9 of 9 beams") && summary.starts_with("9 beams,"),
        "{which}: {summary}"
    );
    let explained = ["direct echo", "multiple reflection", "edge", "minimum range", "silent"];
    let explained: u64 = explained.iter().map(|words| of(words)).sum();
    assert_eq!(number_before(&summary, " as the model says"), explained, "{summary}, {counts:?}");
    let odd = of("unexplained") + of("silent, model hears");
    assert_eq!((odd, number_before(&summary, " unexplained")), (3, 3), "{summary}, {counts:?}");
    assert_eq!(number_before(&summary, " of them silent"), 2, "{summary}");
    assert_eq!(number_before(&summary, " without a valid reading"), of("no valid reading"));
    assert_eq!(explained + odd + of("no valid reading"), 9, "{summary}");
}

#[test]
fn while_readings_come_no_count_is_out_of_date() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let check = |browser: &Browser| {
        // Of one moment: both texts, and what the progress bar has.
        let now = browser.eval(
            "['which', 'summary'].map((id) => document.getElementById(id).textContent)\
             .concat(document.getElementById('progress').hidden)",
        );
        let [which, summary] = [&now[0], &now[1]].map(|text| text.as_str().expect("a text"));
        if now[2] == true {
            return;
        }
        assert!(which.contains(" of 100 beams"), "{which}");
        let said = number_before(summary, " beam");
        assert_eq!(said, 100, "{which}, but {summary}");
    };
    scan_once(&daemon);
    // A page that is opened in mid-scan reads from the log what was measured before.
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
    let (which, summary) = (browser.text("#which"), browser.text("#summary"));
    assert!(which.contains("100 of 100 beams") && summary.contains("100 beams,"), "{summary}");
}

/// Colours of the style that the legend's canvases have anyhow, as thin lines do, and those that the stage's have
/// exactly: both of one moment, because in a scan the next reading may bring another one.
fn colours(browser: &Browser) -> [Vec<String>; 2] {
    let found = browser.eval(
        "(() => { const style = getComputedStyle(document.documentElement); \
         const names = ['--wall', '--edge', '--ink', '--min-range', '--ray', '--path', '--direct', '--multiple', \
           '--edge-mark', '--unexplained', '--silent', '--lost', '--model']; \
         const all = names.map((name) => style.getPropertyValue(name).trim()); \
         const parts = all.map((hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16))); \
         const of = (canvases, alpha, off) => { \
           const seen = all.map(() => 0); \
           for (const c of document.querySelectorAll(canvases)) { \
             const copy = new OffscreenCanvas(c.width, c.height); \
             const look = copy.getContext('2d', {willReadFrequently: true}); look.drawImage(c, 0, 0); \
             const d = look.getImageData(0, 0, c.width, c.height).data; \
             for (let i = 0; i < d.length; i += 4) if (d[i + 3] >= alpha) parts.forEach((part, n) => { \
               if (part.every((v, k) => Math.abs(v - d[i + k]) <= off)) seen[n]++; }); } \
           return all.filter((_, n) => seen[n] > 3); }; \
         return [of('#legend canvas', 60, 12), of('#stage canvas', 255, 0)]; })()",
    );
    serde_json::from_value(found).expect("two lists of colours")
}

fn check_legend(browser: &Browser, words: &[&str]) {
    browser.until_drawn();
    for words in words {
        assert!(legend_has(browser, words), "{words:?} is not in: {}", browser.text("#legend"));
    }
    let [known, drawn] = colours(browser);
    for colour in drawn {
        assert!(known.contains(&colour), "{colour} is drawn and not in the legend, {known:?}");
    }
}

#[test]
fn everything_that_is_drawn_is_in_the_legend() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    for absent in ["nearest range that is heard", "selected reading", "rough wall"] {
        assert!(!legend_has(&browser, absent), "{absent} before anything of it is drawn");
    }
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 20");
    check_legend(&browser, &["wall", "pose and heading", "direction of the newest reading"]);
    browser.until(OVER);
    assert!(!legend_has(&browser, "direction of the newest reading"));
    choose(&browser, 75);
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    let drawn = [
        "wall",
        "pose and heading",
        "nearest range that is heard",
        "direction of the selected beam",
        "selected reading",
        "path of its sound",
        "model",
    ];
    check_legend(&browser, &drawn);
    choose_view(&browser, "room");
    check_legend(&browser, &[&drawn[..], &["reading beyond the view"]].concat());
    browser.look_through(DESK_DARK);
    check_legend(&browser, &drawn);
    assert_clean(&browser);
}

#[test]
fn rough_walls_bodies_and_transducers_are_in_the_legend() {
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
        &["wall", "rough wall", "robot", "transducer", "nearest range that is heard"],
    );
}

#[test]
fn a_selected_beam_stays_selected_in_the_next_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(OVER);
    choose(&browser, 75);
    let now = || browser.text("#beam-now");
    assert!(now().starts_with("beam 75, ") && !now().contains("before"), "{}", now());
    let first = browser.eval("import('/page/main.js').then(({plan}) => plan.selected.scan)");
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    // Until its turn has come, the reading of before stays, and says so.
    assert!(now().starts_with("beam 75, ") && now().contains("in the scan before"), "{}", now());
    assert_eq!(browser.eval("document.getElementById('beam').value"), "75");
    assert!(legend_has(&browser, "direction of the selected beam"));
    assert!(browser.text("#beam-panel").contains("75 at 270.0"), "the panel keeps it");
    browser.until("document.getElementById('progress').value > 80");
    let second = browser.eval("import('/page/main.js').then(({plan}) => plan.selected.scan)");
    assert_ne!(first, second, "the new scan's reading took its place");
    assert!(now().starts_with("beam 75, ") && !now().contains("before"), "{}", now());
    browser.until(OVER);
    // So it does in a scan of the log.
    browser.until("document.querySelectorAll('#scans-list button').length === 2");
    browser.click("#scans-list li:nth-child(2) button");
    browser.until("document.querySelector('#live').ariaPressed === 'false'");
    assert!(now().starts_with("beam 75, "), "{}", now());
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    assert_clean(&browser);
}

#[test]
fn the_view_has_room_and_readings_and_can_be_chosen() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", "plan.step_deg=1.8"]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(OVER);
    let beyond = || number_before(&browser.text("#beyond"), " reading");
    let usual = beyond();
    assert!(usual <= 40, "{usual} of 200 readings are arrows at the border");
    let scale = || {
        let scale = browser.eval("import('/page/main.js').then(({plan}) => plan.view.scale)");
        scale.as_f64().expect("pixels a metre")
    };
    let near = scale();
    choose_view(&browser, "room");
    // In this room every second reading is a ghost beyond its walls.
    assert!(beyond() > 100, "{}", browser.text("#beyond"));
    let room = scale();
    assert!(room > 2.0 * near && room < 5.0 * near, "{room} and {near} pixels a metre");
    choose_view(&browser, "all");
    assert_eq!((beyond(), browser.text("#beyond")), (0, String::new()));
    assert!(scale() <= near);
    choose_view(&browser, "near");
    assert_eq!(beyond(), usual);
    assert_clean(&browser);
}

#[test]
fn what_is_pending_and_a_refused_configuration_are_said() {
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
    browser.until(
        "document.getElementById('conditions').textContent.includes('From the next scan on')",
    );
    let said = browser.text("#conditions");
    assert!(said.contains("0.774, 0.085 m") && said.contains("pose 0.500, 0.300 m, 90"), "{said}");
    fs::write(&file, "[plan]\nstep_dge = 3.6\n").expect("there is room");
    daemon.signal(Signal::HUP);
    browser.until(
        "document.getElementById('trouble').textContent.includes('configuration was refused')",
    );
    assert!(browser.text("#trouble").contains("step_dge"), "{}", browser.text("#trouble"));
}
