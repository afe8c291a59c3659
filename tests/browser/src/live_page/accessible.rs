//! Accessibility: names for screen readers, contrast, small screens, light and dark scheme.

use std::{fs, path::Path};

use serde_json::{Value, json};

use super::{
    COMPLETE, assert_clean,
    browser::{Browser, DESK, DESK_DARK, PHONE, PHONE_DARK},
    daemon, scan_once,
};
use sonard_test_support::daemon::write_token;

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// Roles of controls and pictures, which need a name.
const NAMED: [&str; 9] = [
    "button",
    "checkbox",
    "combobox",
    "dialog",
    "image",
    "progressbar",
    "slider",
    "spinbutton",
    "textbox",
];

#[test]
fn live_page_is_accessible() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", "plan.step_deg=0.9"]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    browser.eval(
        "(() => { const s = document.getElementById('beam'); s.value = 300; \
         s.dispatchEvent(new Event('input')); })()",
    );
    browser.until("document.querySelectorAll('.peaks button').length > 0");
    assert_clean(&browser);
    check_screens(&browser, "");
}

#[test]
fn open_workbench_is_accessible() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", &setting]);
    let browser = Browser::open(&address, DESK);
    scan_once(&daemon);
    browser.until(COMPLETE);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    for id in ["show-map", "show-lines", "show-features", "pin", "change"] {
        browser.click(&format!("#{id}"));
    }
    for id in ["over-time", "table"] {
        browser.eval(&format!("document.getElementById('{id}').open = true"));
    }
    browser.until("document.getElementById('next-status').textContent.startsWith('Preview (')");
    browser.click(".tools [aria-label=\"Measure a length\"]");
    browser.click_at("#over", 0.3, 0.6);
    browser.click_at("#over", 0.6, 0.7);
    assert_clean(&browser);
    check_screens(&browser, "workbench-");
}

/// Checks each screen size in both colour schemes.
fn check_screens(browser: &Browser, prefix: &str) {
    for screen in [DESK, DESK_DARK, PHONE, PHONE_DARK] {
        browser.look_through(screen);
        browser.eval("scrollTo(0, 0)");
        browser.until("new Promise((done) => setTimeout(() => done(true), 300))");
        browser.picture(&format!("{prefix}{}", screen.name));
        let [wide, window] = ["document.documentElement.scrollWidth", "innerWidth"];
        assert_eq!(
            browser.eval(wide),
            browser.eval(window),
            "{}: horizontal scrolling",
            screen.name
        );
        assert_eq!(nameless(browser), Vec::<String>::new(), "{}", screen.name);
        for (mark, contrast) in contrasts(browser) {
            assert!(contrast >= 3.0, "{}: {mark} has a contrast of {contrast:.2}", screen.name);
        }
        assert_eq!(axe(browser), Vec::<String>::new(), "{}", screen.name);
    }
}

/// Roles of the controls and pictures that have no accessible name.
pub(crate) fn nameless(browser: &Browser) -> Vec<String> {
    let tree = browser.devtools("Accessibility.getFullAXTree", &json!({}));
    let nodes = tree["nodes"].as_array().expect("a tree");
    let named: Vec<&Value> = nodes
        .iter()
        .filter(|node| node["ignored"] != true)
        .filter(|node| NAMED.iter().any(|role| node["role"]["value"] == *role))
        .collect();
    assert!(named.len() > 12, "only {} controls and pictures", named.len());
    let without =
        named.into_iter().filter(|node| node["name"]["value"].as_str().unwrap_or("").is_empty());
    without.map(|node| node["role"]["value"].to_string()).collect()
}

/// Contrast of each mark colour against the background, as defined by WCAG 2.2. Graphics need at
/// least 3 (success criterion 1.4.11).
fn contrasts(browser: &Browser) -> Vec<(String, f64)> {
    let colour = |name: &str| {
        let hex = browser.eval(&format!(
            "getComputedStyle(document.documentElement).getPropertyValue('{name}').trim()"
        ));
        luminance(hex.as_str().expect("a colour"))
    };
    let background = colour("--panel");
    let marks = [
        "--direct",
        "--multiple",
        "--edge-mark",
        "--min-range",
        "--disagrees",
        "--no-echo",
        "--invalid",
        "--model",
        "--path",
        "--ray",
        "--wall",
        "--border",
        "--good",
        "--bad",
        "--wait",
    ];
    let contrast = |mark: f64| (mark.max(background) + 0.05) / (mark.min(background) + 0.05);
    marks.iter().map(|mark| ((*mark).to_owned(), contrast(colour(mark)))).collect()
}

/// Relative luminance of `#rrggbb`.
fn luminance(hex: &str) -> f64 {
    let part = |at: usize| {
        let share =
            f64::from(u8::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal")) / 255.0;
        if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    };
    0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
}

/// Violations found by axe-core, which `tests/axe.sh` downloads.
pub(crate) fn axe(browser: &Browser) -> Vec<String> {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("tools/axe-core/axe.min.js");
    let script = match fs::read_to_string(&file) {
        Ok(script) => script,
        Err(_) if std::env::var_os("AXE").is_some_and(|value| value == "0") => {
            eprintln!("SKIPPED, because AXE=0: no check with axe-core");
            return Vec::new();
        }
        Err(error) => {
            panic!("{}: {error}; get it with tests/axe.sh, or skip it with AXE=0", file.display())
        }
    };
    browser.devtools("Runtime.evaluate", &json!({"expression": script}));
    let found = browser.eval("axe.run({resultTypes: ['violations']})");
    let passes = found["passes"].as_array().map_or(0, Vec::len);
    assert!(passes > 10, "axe checked nothing: {passes} rules passed");
    let violations = found["violations"].as_array().expect("a list");
    violations
        .iter()
        .map(|violation| {
            let nodes = violation["nodes"].as_array().into_iter().flatten();
            let elements: Vec<String> = nodes.map(|node| node["html"].to_string()).collect();
            format!("{}: {} {}", violation["id"], violation["help"], elements.join(" "))
        })
        .collect()
}
