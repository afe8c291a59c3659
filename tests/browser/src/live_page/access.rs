//! Start and stop from the page, with and without a token.

use super::{browser::Browser, browser::DESK, daemon, scanning};
use sonard_test_support::{daemon::write_token, wait_until};

#[test]
fn without_a_token_the_page_says_why_nothing_is_started() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#control [type=submit]");
    browser.until("document.getElementById('summary').textContent.startsWith('Refused')");
    let said = browser.text("#summary");
    assert!(said.contains("no token") && said.contains("server.token_file"), "{said}");
    assert_eq!(scanning(&daemon)["requested"], 0);
}

#[test]
fn with_a_token_scans_are_started_and_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = "0123456789abcdef0123456789abcdef";
    let file = write_token(folder.path(), token);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", &setting]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    let asks = "document.getElementById('token').open";

    // Asked for, and declined: nothing happens.
    browser.click("#control [type=submit]");
    browser.until(asks);
    browser.click("#token [formnovalidate]");
    browser.until("document.getElementById('summary').textContent.startsWith('Refused')");
    // A wrong one is asked for again; the right one starts the scan.
    browser.click("#control [type=submit]");
    browser.until(asks);
    browser.type_into("#token-text", "wrong\n");
    browser.until("document.getElementById('token-text').value === '' && document.getElementById('token').open");
    browser.type_into("#token-text", &format!("{token}\n"));
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(asks), false);
    browser.click("#stop");
    wait_until("the stop", || daemon.health()["scans"]["stopped"] == 1);
    browser.until("document.getElementById('progress').hidden");
    assert_eq!(scanning(&daemon)["requested"], 0);

    // The token lives as long as the tab: a page that is loaded again needs not ask.
    browser.go();
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#control [type=submit]");
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(asks), false);
    assert_eq!(browser.eval("localStorage.length + document.cookie.length"), 0);
    // The browser's own note of the two refusals is all there is on the console.
    let other: Vec<String> =
        browser.complaints().into_iter().filter(|text| !text.contains("401")).collect();
    assert_eq!(other, Vec::<String>::new());
}
