//! The playground served by a daemon.

use super::{eval_json, wait_until_idle};
use crate::live_page::browser::{Browser, DESK};
use sonard_test_support::daemon::Daemon;

#[test]
fn served_with_its_policy() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("playground");
    let served = format!("server.playground={}", page.display());
    let listen = ["--set", "server.listen=127.0.0.1:0", "--set", &served];
    let daemon = Daemon::start_mock(folder.path(), &listen);
    let browser = Browser::open(&daemon.address(), DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#playground");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "location.pathname"), "/playground/");
    assert_eq!(eval_json(&browser, "playground.scan().beams.size"), 400);
    browser.click("a[href='hidden-room.html']");
    browser.until("globalThis.hiddenRoom?.idle() === true");
    browser.click("a[href='index.html']");
    wait_until_idle(&browser);
    // The policy blocks requests to the daemon.
    let result = eval_json(&browser, "fetch('/v1/status').then(() => 'sent', () => 'blocked')");
    assert_eq!(result, "blocked");
    let warnings = browser.warnings();
    assert!(warnings.iter().all(|text| text.contains("Content Security Policy")), "{warnings:?}");
    let reply = daemon.get("/playground/");
    assert!(reply.head.contains("frame-ancestors 'none'"), "{}", reply.head);
    assert_eq!(daemon.get("/playground/..%2Findex.html").status, 404);
}

#[test]
fn missing_folder_hides_the_link() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &["--set", "server.listen=127.0.0.1:0"]);
    let reply = daemon.get("/playground/");
    assert_eq!(reply.status, 404);
    assert!(reply.json()["help"].as_str().is_some_and(|help| help.contains("server.playground")));
    let page = String::from_utf8(daemon.get("/").body).expect("text");
    assert!(page.contains("href=\"/playground/\" hidden"), "the link is hidden");
    drop(daemon);
    let folder = tempfile::tempdir().expect("a folder");
    // The folder is checked at the start, but may be deleted later.
    let page = folder.path().join("playground");
    std::fs::create_dir(&page).expect("a folder");
    std::fs::write(page.join("index.html"), "").expect("there is room");
    let setting = format!("server.playground={}", page.display());
    let daemon = Daemon::start_mock(folder.path(), &["--set", &setting]);
    std::fs::remove_dir_all(&page).expect("the folder");
    let reply = daemon.get("/playground/playground.js");
    assert_eq!(reply.status, 500);
    assert!(reply.json()["error"].as_str().is_some_and(|error| error.contains("playground.js")));
}
