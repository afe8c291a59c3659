//! Pan, zoom and length measurement on the floor plan, which both pages share.

use fantoccini::key::Key;

use super::{
    COMPLETE, assert_clean,
    browser::{Browser, DESK, PHONE},
    daemon,
    pointer::{click, drag, place, touch, wheel},
    scan_once,
};

const LIVE: &str = "import('/page/main.js').then(({plan}) => plan)";

#[test]
fn pan_zoom_and_measure() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    // The list of scans, which is fetched again at the end of a scan, moves what is beside it.
    browser.until("document.querySelectorAll('#scans-list li').length === 1");
    browser.eval("new Promise((done) => setTimeout(done, 1500))");
    check_view(&browser, LIVE);
    assert_clean(&browser);
}

#[test]
fn previous_scan_is_faded() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    let faded = || super::drawn_pixels(&browser, "under") + faint_pixels(&browser);
    scan_once(&daemon);
    browser.until(COMPLETE);
    assert_eq!(faded(), 0);
    scan_once(&daemon);
    browser.until("document.getElementById('progress').value > 5");
    assert!(faded() > 100, "{}", faded());
    assert!(browser.text("#legend").contains("previous scan"));
    browser.until(COMPLETE);
    assert_eq!(faded(), 0);
    assert_clean(&browser);
}

fn faint_pixels(browser: &Browser) -> u64 {
    super::count_pixels(browser, "under", "d[i + 3] > 20")
}

/// Scale, origin, and whether the view was moved, once no event changes them any more.
fn view(browser: &Browser, plan: &str) -> ([f64; 3], bool) {
    let mut before = current_view(browser, plan);
    for _ in 0..100 {
        let now = current_view(browser, plan);
        if now == before {
            return now;
        }
        before = now;
    }
    panic!("the view keeps changing: {before:?}");
}

fn current_view(browser: &Browser, plan: &str) -> ([f64; 3], bool) {
    browser.until_drawn();
    let view =
        browser.eval(&format!("({plan}).then(({{view: v}}) => [v.scale, v.x0, v.y0, v.moved])"));
    ([0, 1, 2].map(|i| view[i].as_f64().expect("a number")), view[3] == true)
}

/// Checks all operations on the view of a plan, which is given as an expression for a promise.
pub(crate) fn check_view(browser: &Browser, plan: &str) {
    let (fitted, moved) = view(browser, plan);
    assert!(!moved);
    check_mouse(browser, plan, fitted);
    check_keys(browser, plan, fitted);
    check_buttons(browser, plan, fitted);
    check_lengths(browser, plan);
    browser.look_through(PHONE);
    browser.eval("new Promise((done) => setTimeout(done, 300))");
    check_fingers(browser, plan);
    browser.look_through(DESK);
}

/// The wheel zooms about the pointer; a drag pans and selects no beam.
fn check_mouse(browser: &Browser, plan: &str, fitted: [f64; 3]) {
    let selected = browser.text("#beam-label");
    let at = place(browser, "#over", 0.3, 0.4);
    let corner = place(browser, "#over", 0.0, 0.0);
    wheel(browser, at, -400.0);
    let ([scale, x0, y0], moved) = view(browser, plan);
    assert!(moved && scale > 1.4 * fitted[0], "{scale} after {fitted:?}");
    let under = |x0: f64, scale: f64, axis: usize| (at[axis] - corner[axis] - x0) / scale;
    for (axis, now, before) in [(0, x0, fitted[1]), (1, y0, fitted[2])] {
        let off = under(now, scale, axis) - under(before, fitted[0], axis);
        assert!(off.abs() * scale < 1.5, "the point under the mouse moved by {off} m");
    }
    drag(browser, at, [at[0] + 60.0, at[1] - 30.0]);
    let ([still, right, up], _) = view(browser, plan);
    assert!((right - x0 - 60.0).abs() < 1.0 && (up - y0 + 30.0).abs() < 1.0, "{right} {up}");
    assert!((still - scale).abs() < 1e-9);
    assert_eq!(browser.text("#beam-label"), selected, "a drag is no click");
    wheel(browser, at, 3000.0);
    assert!(view(browser, plan).0[0] < scale);
}

fn check_keys(browser: &Browser, plan: &str, fitted: [f64; 3]) {
    browser.eval("document.getElementById('stage').focus()");
    browser.press('0');
    assert_eq!(view(browser, plan), (fitted, false), "0 fits the view again");
    browser.press('+');
    assert!((view(browser, plan).0[0] / fitted[0] - 1.25).abs() < 1e-9);
    browser.press('-');
    browser.press(Key::Left.into());
    let ([scale, x0, _], moved) = view(browser, plan);
    assert!((scale - fitted[0]).abs() < 1e-9 && (x0 - fitted[1] - 60.0).abs() < 1e-6 && moved);
    browser.press('0');
}

fn check_buttons(browser: &Browser, plan: &str, fitted: [f64; 3]) {
    let button = |name: &str| format!(".tools [aria-label=\"{name}\"]");
    assert_eq!(
        browser.eval("document.querySelector('.tools [title=\"Fit the view\"]').disabled"),
        true
    );
    browser.click(&button("Zoom in"));
    assert!((view(browser, plan).0[0] / fitted[0] - 1.5).abs() < 1e-9);
    browser.click(&button("Zoom out"));
    browser.click(&button("Fit the view"));
    assert_eq!(view(browser, plan), (fitted, false));
}

/// Lengths are measured by clicks and by keys; points snap to wall ends.
fn check_lengths(browser: &Browser, plan: &str) {
    let output = || browser.text(".measured");
    browser.click(".tools [aria-label=\"Measure a length\"]");
    let selected = browser.text("#beam-label");
    let corner = place(browser, "#over", 0.0, 0.0);
    // Clicks three pixels from each end of the first wall.
    let wall = browser.eval(&format!(
        "({plan}).then(({{view, scene}}) => [scene.walls[0].from, scene.walls[0].to]\
         .flatMap((end) => view.px(end)))"
    ));
    let at = |i: usize| wall[i].as_f64().expect("pixels");
    for end in [[at(0), at(1)], [at(2), at(3)]] {
        click(browser, [corner[0] + end[0] + 2.0, corner[1] + end[1] - 2.0]);
    }
    let length_m = browser.eval(&format!(
        "({plan}).then(({{scene}}) => Math.hypot(...[0, 1].map((i) => \
         scene.walls[0].to[i] - scene.walls[0].from[i])))"
    ));
    let length_m = length_m.as_f64().expect("metres");
    assert!(output().starts_with(&format!("{length_m:.4} m")), "{} and not {length_m}", output());
    assert!(browser.text("#legend").contains("measured length"));
    assert_eq!(browser.text("#beam-label"), selected, "no beam is selected meanwhile");
    browser.eval("document.getElementById('stage').focus()");
    for key in [Key::Escape.into(), 'm', Key::Enter.into()] {
        browser.press(key);
    }
    for _ in 0..20 {
        browser.press(Key::Right.into());
    }
    browser.press(Key::Enter.into());
    let ([scale, ..], _) = view(browser, plan);
    let by_keys: f64 = output().split(' ').next().and_then(|m| m.parse().ok()).expect("metres");
    // Each end may have snapped.
    assert!((by_keys * scale - 200.0).abs() < 20.0, "{}: {by_keys} m", output());
    browser.press(Key::Escape.into());
    assert_eq!(browser.eval("document.querySelector('.measured').hidden"), true);
    assert!(!browser.text("#legend").contains("measured length"));
}

/// A finger scrolls the page until two fingers have moved the view.
fn check_fingers(browser: &Browser, plan: &str) {
    let [x, y] = place(browser, "#over", 0.72, 0.75);
    let (fitted, _) = view(browser, plan);
    touch(browser, &[[[x, y], [x + 40.0, y]]]);
    assert_eq!(view(browser, plan), (fitted, false));
    touch(browser, &[[[x - 30.0, y], [x - 60.0, y]], [[x + 30.0, y], [x + 60.0, y]]]);
    let ([scale, x0, _], moved) = view(browser, plan);
    assert!(moved && (scale / fitted[0] - 2.0).abs() < 0.1, "{scale} after {fitted:?}");
    touch(browser, &[[[x, y], [x + 40.0, y]]]);
    let ([_, right, _], _) = view(browser, plan);
    assert!((right - x0 - 40.0).abs() < 3.0, "{x0} {right}");
    browser.click(".tools [aria-label=\"Fit the view\"]");
    assert!(!view(browser, plan).1);
}
