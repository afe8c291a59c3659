//! The playground, opened from its folder in a real browser. `web/build.sh` builds it.

mod accessible;
mod animated;
mod driven;
mod equal;
mod fast;
mod pictures;
mod served;

use std::path::Path;

use serde_json::Value;

use crate::live_page::browser::{Browser, Screen};

/// Opens the page from the disk, and waits for its first sweep.
fn open(screen: Screen) -> Browser {
    open_with(screen, "")
}

/// The same with a fragment in its address.
fn open_with(screen: Screen, fragment: &str) -> Browser {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("playground");
    let page = folder.join("index.html");
    assert!(
        page.exists(),
        "{}: build it with web/build.sh, or leave it out with `PLAYGROUND=0 ./test.sh` or \
         `cargo test -p sonard-browser-tests -- --skip playground::`",
        page.display()
    );
    let browser = Browser::open_at(&format!("file://{}{fragment}", page.display()), screen);
    settled(&browser);
    browser
}

/// Waits until all that was asked for is shown.
fn settled(browser: &Browser) {
    browser.until("globalThis.playground?.idle() === true");
}

/// The value of an expression of the page, which may be a promise; by way of its text, which keeps every digit.
fn told(browser: &Browser, expression: &str) -> Value {
    let text = browser.eval(&format!(
        "(async () => JSON.stringify(await ({expression})))().catch((error) => 'thrown: ' + (error.message ?? error))"
    ));
    let text = text.as_str().unwrap_or("null");
    serde_json::from_str(text).unwrap_or_else(|_| panic!("{expression}: {text}"))
}

/// Sets a control as a person would, and waits for what comes of it.
fn set(browser: &Browser, id: &str, value: &str) {
    browser.eval(&format!(
        "(() => {{ const e = document.getElementById('{id}'); \
         if (e.type === 'checkbox') e.checked = {value:?} === 'true'; else e.value = {value:?}; \
         for (const kind of ['input', 'change']) e.dispatchEvent(new Event(kind, {{bubbles: true}})); }})()"
    ));
    settled(browser);
}

/// Counts of the legend, by their words.
fn legend(browser: &Browser) -> String {
    browser.text("#legend")
}

fn assert_clean(browser: &Browser) {
    assert_eq!(browser.complaints(), Vec::<String>::new());
    let elsewhere: Vec<String> =
        browser.strangers().into_iter().filter(|url| !url.starts_with("file://")).collect();
    // The worker's own script is a blob that the page makes.
    assert!(elsewhere.iter().all(|url| url.starts_with("blob:")), "{elsewhere:?}");
}
