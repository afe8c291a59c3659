//! Tests of the playground in Chromium, opened from the folder that `web/build.sh` builds.

mod accessible;
mod animated;
mod driven;
mod equal;
mod fast;
mod hidden_room;
mod pictures;
mod served;

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::live_page::browser::{Browser, Screen};

/// Opens the page from disk, and waits for its first sweep.
fn open(screen: Screen) -> Browser {
    open_with(screen, "")
}

/// Opens the page with a fragment in its address.
fn open_with(screen: Screen, fragment: &str) -> Browser {
    let page = folder().join("index.html");
    let browser = Browser::open_at(&format!("file://{}{fragment}", page.display()), screen);
    wait_until_idle(&browser);
    browser
}

/// Folder of the pages.
fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("playground");
    assert!(
        folder.join("index.html").exists(),
        "{}: build it with web/build.sh, or skip it with `PLAYGROUND=0 ./test.sh` or \
         `cargo test -p sonard-browser-tests -- --skip playground::`",
        folder.display()
    );
    folder
}

/// Waits until the requested view is shown.
fn wait_until_idle(browser: &Browser) {
    browser.until("globalThis.playground?.idle() === true");
}

/// Value of an expression or promise of the page, transferred as JSON text to keep every digit.
fn eval_json(browser: &Browser, expression: &str) -> Value {
    let text = browser.eval(&format!(
        "(async () => JSON.stringify(await ({expression})))().catch((error) => 'thrown: ' + (error.message ?? error))"
    ));
    let text = text.as_str().unwrap_or("null");
    serde_json::from_str(text).unwrap_or_else(|_| panic!("{expression}: {text}"))
}

/// Sets a control with the events of user input, and waits until the page is idle.
fn set(browser: &Browser, id: &str, value: &str) {
    browser.eval(&format!(
        "(() => {{ const e = document.getElementById('{id}'); \
         if (e.type === 'checkbox') e.checked = {value:?} === 'true'; else e.value = {value:?}; \
         for (const kind of ['input', 'change']) e.dispatchEvent(new Event(kind, {{bubbles: true}})); }})()"
    ));
    wait_until_idle(browser);
}

/// Text of the legend, with its counts.
fn legend(browser: &Browser) -> String {
    browser.text("#legend")
}

fn assert_clean(browser: &Browser) {
    assert_eq!(browser.warnings(), Vec::<String>::new());
    let foreign: Vec<String> =
        browser.foreign_requests().into_iter().filter(|url| !url.starts_with("file://")).collect();
    // The worker's script is a blob created by the page.
    assert!(foreign.iter().all(|url| url.starts_with("blob:")), "{foreign:?}");
}
