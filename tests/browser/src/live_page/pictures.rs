//! Pictures of the workbench for the documentation.

use super::{
    COMPLETE, assert_clean,
    browser::{Browser, Screen},
    pointer::{drag, place},
    scan_once,
};
use sonard_test_support::daemon::{Daemon, write_token};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
const WIDE: Screen = Screen { name: "wide", size: (1280, 1010), phone: false, dark: false };

#[test]
fn overlays_and_preview() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let mock = ["--mock", "--scene", "two-surface-room", "--pose", "middle"];
    let keys = ["plan.step_deg=1.8", "model.max_range_m=4", "server.listen=127.0.0.1:0", &setting];
    let keys = keys.iter().flat_map(|key| ["--set", key]);
    let daemon = Daemon::start(folder.path(), &mock.into_iter().chain(keys).collect::<Vec<_>>());
    daemon.wait_for("ready");
    let browser = Browser::open(&daemon.address(), WIDE);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    scan_once(&daemon);
    browser.until(COMPLETE);
    browser.click("#pin");
    let there = r#"{"x_m":1.2,"y_m":1.0,"heading_deg":0}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", there).status, 202);
    scan_once(&daemon);
    browser.until("document.getElementById('scan-label').textContent.startsWith('live')");
    browser.until(COMPLETE);
    browser.eval(
        "(() => { const s = document.getElementById('beam'); s.value = 100; \
         s.dispatchEvent(new Event('input')); })()",
    );
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    for kind in ["map", "lines", "features"] {
        browser.click(&format!("#show-{kind}"));
    }
    browser.until("document.getElementById('legend').textContent.includes('fitted line')");
    let settle = || {
        browser.eval("scrollTo(0, 0)");
        browser.until("new Promise((done) => setTimeout(() => done(true), 400))");
    };
    settle();
    browser.picture("page-overlays");
    for id in ["pin", "show-map", "show-lines", "show-features", "change"] {
        browser.click(&format!("#{id}"));
    }
    browser.until("document.getElementById('next-status').textContent.startsWith('Preview (')");
    let at = place(&browser, ".ranger", 0.5, 0.5);
    drag(&browser, at, [at[0] + 90.0, at[1] - 50.0]);
    settle();
    browser.picture("page-preview");
    assert_clean(&browser);
}
