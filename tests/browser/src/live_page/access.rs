//! Scanning from the page: start, stop and resume, with and without an access token.

use std::path::Path;

use serde_json::json;

use super::{assert_clean, browser::Browser, browser::DESK, daemon, scanning};
use sonard_test_support::{
    daemon::{Daemon, write_token},
    wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
const IS_OPEN: &str = "document.getElementById('token').open";

/// Starts a daemon with a token, and opens its page.
fn open(folder: &Path, further: &[&str]) -> (Daemon, Browser) {
    let setting = format!("server.token_file={}", write_token(folder, TOKEN).display());
    let options = [&["--set", &setting], further].concat();
    let (daemon, address) = daemon(folder, "127.0.0.1:0", &options);
    let browser = Browser::open(&address, DESK);
    browser.until("document.body.dataset.write === 'token'");
    (daemon, browser)
}

fn is_visible(browser: &Browser, selector: &str) -> bool {
    browser.eval(&format!("document.querySelector('{selector}').checkVisibility()")) == true
}

#[test]
fn page_without_token_is_read_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.body.dataset.write === 'no'");
    assert!(is_visible(&browser, "#read-only"));
    for control in ["#control", "#change", "#unlock"] {
        assert!(!is_visible(&browser, control), "{control}");
    }
    assert_eq!(scanning(&daemon)["requested"], 0);
    assert_clean(&browser);
}

#[test]
fn token_allows_start_and_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = open(folder.path(), &[]);

    // Cancelling the dialog rejects the request.
    browser.click("#control [type=submit]");
    browser.until(IS_OPEN);
    browser.click("#token [formnovalidate]");
    browser.until("document.getElementById('summary').textContent.startsWith('Rejected')");
    // A wrong token opens the dialog again; the correct one starts the scan.
    browser.click("#control [type=submit]");
    browser.until(IS_OPEN);
    browser.type_into("#token-text", "wrong\n");
    browser.until("document.getElementById('token-text').value === '' && document.getElementById('token').open");
    browser.type_into("#token-text", &format!("{TOKEN}\n"));
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(IS_OPEN), false);
    browser.click("#stop");
    wait_until("the stop", || daemon.health()["scans"]["stopped"] == 1);
    browser.until("document.getElementById('progress').hidden");
    assert_eq!(scanning(&daemon)["requested"], 0);

    // The token survives a reload, because it is stored for the tab.
    browser.go();
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.until("document.body.dataset.write === 'yes'");
    browser.click("#control [type=submit]");
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(IS_OPEN), false);
    assert_eq!(browser.eval("localStorage.length + document.cookie.length"), 0);
    // The console contains only the browser's messages about the two 401 responses.
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("401")).collect();
    assert_eq!(other, Vec::<String>::new());
}

#[test]
fn token_is_entered_in_advance() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_daemon, browser) = open(folder.path(), &[]);
    browser.click("#unlock");
    browser.until(IS_OPEN);
    browser.type_into("#token-text", "wrong\n");
    browser.until("document.getElementById('token-why').textContent === 'The token is wrong.'");
    browser.until(IS_OPEN);
    browser.type_into("#token-text", &format!("{TOKEN}\n"));
    browser.until("document.body.dataset.write === 'yes'");
    assert_eq!(browser.eval(IS_OPEN), false);
    assert!(!is_visible(&browser, "#unlock") && is_visible(&browser, "#control"));
    assert_clean(&browser);
}

#[test]
fn stopped_scanning_is_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, browser) = open(folder.path(), &["--set", "scanning.mode=continuous"]);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    let paused = || scanning(&daemon)["paused"].clone();
    browser.until("document.getElementById('resume').disabled");
    browser.click("#stop");
    browser.until("!document.getElementById('resume').disabled");
    assert_eq!(paused(), json!(true));
    browser.click("#resume");
    wait_until("the mode", || paused() == json!(false));
    browser.until("document.getElementById('progress').value > 2");
    // An empty number resumes as well.
    browser.click("#stop");
    browser.until("!document.getElementById('resume').disabled");
    browser.eval("(document.getElementById('scans').value = '', true)");
    browser.click("#control [type=submit]");
    wait_until("the mode", || paused() == json!(false));
    // The result of the last scan stays while the next one is running.
    browser.until(
        "/^Scanning 100 beams. Last scan: .*100 beams, 100 agree/.test(document.getElementById('summary').textContent)",
    );
    assert_clean(&browser);
}
