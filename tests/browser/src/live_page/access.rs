//! Start and stop from the page, with and without an access token.

use super::{browser::Browser, browser::DESK, daemon, scanning};
use sonard_test_support::{daemon::write_token, wait_until};

#[test]
fn start_is_rejected_without_token() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#control [type=submit]");
    browser.until("document.getElementById('summary').textContent.startsWith('Rejected')");
    let summary = browser.text("#summary");
    assert!(summary.contains("token") && summary.contains("server.token_file"), "{summary}");
    assert_eq!(scanning(&daemon)["requested"], 0);
}

#[test]
fn token_allows_start_and_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = "0123456789abcdef0123456789abcdef";
    let file = write_token(folder.path(), token);
    let setting = format!("server.token_file={}", file.display());
    let (daemon, address) = daemon(folder.path(), "127.0.0.1:0", &["--set", &setting]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    let prompting = "document.getElementById('token').open";

    // Cancelling the dialog rejects the request.
    browser.click("#control [type=submit]");
    browser.until(prompting);
    browser.click("#token [formnovalidate]");
    browser.until("document.getElementById('summary').textContent.startsWith('Rejected')");
    // A wrong token opens the dialog again; the correct one starts the scan.
    browser.click("#control [type=submit]");
    browser.until(prompting);
    browser.type_into("#token-text", "wrong\n");
    browser.until("document.getElementById('token-text').value === '' && document.getElementById('token').open");
    browser.type_into("#token-text", &format!("{token}\n"));
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(prompting), false);
    browser.click("#stop");
    wait_until("the stop", || daemon.health()["scans"]["stopped"] == 1);
    browser.until("document.getElementById('progress').hidden");
    assert_eq!(scanning(&daemon)["requested"], 0);

    // The token survives a reload, because it is stored for the tab.
    browser.go();
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#control [type=submit]");
    browser.until("document.getElementById('progress').value > 5");
    assert_eq!(browser.eval(prompting), false);
    assert_eq!(browser.eval("localStorage.length + document.cookie.length"), 0);
    // The console contains only the browser's messages about the two 401 responses.
    let other: Vec<String> =
        browser.warnings().into_iter().filter(|text| !text.contains("401")).collect();
    assert_eq!(other, Vec::<String>::new());
}
