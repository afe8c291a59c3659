//! The playground as a daemon serves it.

use super::{settled, told};
use crate::live_page::browser::{Browser, DESK};
use sonard_test_support::daemon::Daemon;

#[test]
fn a_daemon_serves_the_playground_under_its_strict_policy() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("playground");
    let served = format!("server.playground={}", page.display());
    let listen = ["--set", "server.listen=127.0.0.1:0", "--set", &served];
    let daemon = Daemon::start_mock(folder.path(), &listen);
    let browser = Browser::open(&daemon.address(), DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#playground");
    settled(&browser);
    assert_eq!(told(&browser, "location.pathname"), "/playground/");
    assert_eq!(told(&browser, "playground.scan().beams.size"), 400);
    // It asks nothing of the daemon, and may not.
    let asked = told(&browser, "fetch('/v1/status').then(() => 'answered', () => 'refused')");
    assert_eq!(asked, "refused");
    let complaints = browser.complaints();
    assert!(
        complaints.iter().all(|text| text.contains("Content Security Policy")),
        "{complaints:?}"
    );
    let reply = daemon.get("/playground/");
    assert!(reply.head.contains("frame-ancestors 'none'"), "{}", reply.head);
    assert_eq!(daemon.get("/playground/..%2Findex.html").status, 404);
}

#[test]
fn without_its_folder_there_is_no_way_to_the_playground() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &["--set", "server.listen=127.0.0.1:0"]);
    let reply = daemon.get("/playground/");
    assert_eq!(reply.status, 404);
    assert!(reply.json()["help"].as_str().is_some_and(|help| help.contains("server.playground")));
    let page = String::from_utf8(daemon.get("/").body).expect("text");
    assert!(page.contains("href=\"/playground/\" hidden"), "the link is hidden");
    drop(daemon);
    let folder = tempfile::tempdir().expect("a folder");
    // The page is checked at the start, and may disappear later.
    let page = folder.path().join("playground");
    std::fs::create_dir(&page).expect("a folder");
    std::fs::write(page.join("index.html"), "").expect("there is room");
    let setting = format!("server.playground={}", page.display());
    let daemon = Daemon::start_mock(folder.path(), &["--set", &setting]);
    std::fs::remove_dir_all(&page).expect("it is there");
    let reply = daemon.get("/playground/playground.js");
    assert_eq!(reply.status, 500);
    assert!(reply.json()["error"].as_str().is_some_and(|error| error.contains("playground.js")));
}
