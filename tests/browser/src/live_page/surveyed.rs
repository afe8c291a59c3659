//! Unknown room surveyed on the page.

use std::fs;

use serde_json::json;

use super::{
    assert_clean,
    browser::{Browser, Screen},
    drawn_pixels,
    workbench::until_has,
};
use sonard_test_support::{
    daemon::{Daemon, write_token},
    wait_until,
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
const WIDE: Screen = Screen { name: "wide", size: (1280, 1010), phone: false, dark: false };
const ROOM: &str = r#"{"name": "room", "materials": {"plaster": {"reflectance": 0.97}}, "walls": [
    {"id": "w", "polyline": [[0, 0], [2.8, 0], [2.8, 2.3], [0, 2.3]], "closed": true, "material": "plaster"}]}"#;
const STOPS: [[f64; 3]; 3] = [[0.7, 0.6, 20.0], [1.2, 0.9, 65.0], [1.9, 1.3, 100.0]];

#[test]
fn surveyed_plan_takes_the_place_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = write_token(folder.path(), TOKEN);
    let setting = format!("server.token_file={}", file.display());
    let scene = folder.path().join("room.json");
    fs::write(&scene, ROOM).expect("there is room");
    let scene = scene.to_str().expect("a plain path");
    let mock = ["--mock", "--virtual-time", "--scene", scene, "--pose", "1,1,0"];
    let keys = ["plan.step_deg=1.8", "model.max_range_m=4", "server.listen=127.0.0.1:0", &setting];
    let keys = keys.iter().flat_map(|key| ["--set", key]);
    let daemon = Daemon::start(folder.path(), &mock.into_iter().chain(keys).collect::<Vec<_>>());
    daemon.wait_for("ready");
    let browser = Browser::open(&daemon.address(), WIDE);
    browser.eval(&format!("sessionStorage.setItem('sonard-token', '{TOKEN}')"));
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.click("#survey");
    until_has(&browser, "#surveyed", "two or more complete scans");
    for (scans, [x_m, y_m, heading_deg]) in (1..).zip(STOPS) {
        let pose = json!({"x_m": x_m, "y_m": y_m, "heading_deg": heading_deg});
        let request = json!({"scans": 1, "pose": pose}).to_string();
        assert_eq!(daemon.send("POST", "/v1/start", &request).status, 202);
        daemon.wait_for_scans(scans);
    }
    // A page that is opened now lists three scans with their ends.
    wait_until("the ends of the scans", || {
        let scans = daemon.get("/v1/scans?limit=10").json();
        scans
            .as_array()
            .is_some_and(|of| of.iter().filter(|scan| scan["end"].is_object()).count() == 3)
    });
    browser.eval("location.reload()");
    browser.until("document.getElementById('link').textContent === 'ready'");
    browser.until("document.querySelectorAll('#scans-list li').length === 3");
    let scene = browser.text("#floor-title");
    let before = drawn_pixels(&browser, "under");
    browser.click("#survey");
    until_has(&browser, "#survey", "Cancel");
    browser.until("!document.getElementById('use-plan').hidden");
    let text = browser.text("#surveyed");
    assert!(text.contains(" walls from 3 scans, ") && text.contains(" arcs explained"), "{text}");
    // Walls by status and poses are drawn and explained.
    assert!(drawn_pixels(&browser, "under") > before + 500);
    for label in ["surveyed wall or post: observed", "surveyed pose", "95 % region of the pose"] {
        until_has(&browser, "#legend", label);
    }
    browser.picture("page-survey");
    browser.click("#use-plan");
    until_has(&browser, "#floor-title", "Floor plan: survey");
    assert_eq!(browser.text("#use-plan"), "Use the scene");
    browser.click("#use-plan");
    until_has(&browser, "#floor-title", &scene);
    browser.click("#clear-survey");
    browser.until("document.getElementById('use-plan').hidden");
    browser.until_drawn();
    assert_eq!(drawn_pixels(&browser, "under"), before);
    // A cancelled survey frees the daemon for the next one.
    browser.click("#survey");
    until_has(&browser, "#surveyed", "Surveying: ");
    browser.click("#survey");
    until_has(&browser, "#surveyed", "Survey cancelled.");
    browser.click("#survey");
    browser.until("!document.getElementById('use-plan').hidden");
    assert_clean(&browser);
}
