//! Page "Hidden room": a course by clicks and keys, the survey, its cancellation, links and errors.

use std::{fs, process::Command};

use fantoccini::key::Key;
use serde_json::{Value, json};
use sonard::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    inverse::{FiringOutcome, FitSweep, SweepFiring},
    model::Options,
    survey::{NoObserver, Survey, SurveyOptions, survey, unknown_room},
};

use super::{accessible::check_screens, assert_clean, eval_json, folder, open, wait_until_idle};
use crate::live_page::{
    browser::{Browser, DESK, Screen},
    pointer,
};

/// Rectangular room in whose middle the robot begins.
const RECTANGLE: u32 = 7;

/// Opens the page from disk with a fragment in its address, and waits for its first sweep.
fn open_room(screen: Screen, fragment: &str) -> Browser {
    let page = folder().join("hidden-room.html");
    let browser = Browser::open_at(&format!("file://{}{fragment}", page.display()), screen);
    until_idle(&browser);
    browser
}

/// Opens the page with a random room of a kind.
fn open_random(screen: Screen, kind: &str, seed: u32) -> Browser {
    let browser = open_room(screen, "");
    open_course(&browser, &json!({"kind": kind, "seed": seed}));
    browser
}

fn open_course(browser: &Browser, course: &Value) {
    browser.eval(&format!("hiddenRoom.open({course})"));
    until_idle(browser);
}

/// Waits until the robot is at rest and the survey is complete.
fn until_idle(browser: &Browser) {
    browser.until("globalThis.hiddenRoom?.idle() === true");
}

/// Clicks at a point of the plan, in metres from the robot.
fn click_near_robot(browser: &Browser, by: [f64; 2]) {
    let at = eval_json(
        browser,
        &format!(
            "(() => {{ const {{plan}} = hiddenRoom, {{x_m, y_m}} = plan.scan.start.pose; \
             const [x, y] = plan.view.px([x_m + {}, y_m + {}]); plan.stage.scrollIntoView({{block: 'center'}}); \
             const r = plan.stage.getBoundingClientRect(); return [r.left + x, r.top + y]; }})()",
            by[0], by[1]
        ),
    );
    pointer::click(browser, [0, 1].map(|axis| at[axis].as_f64().expect("a number")));
}

/// Number of sweeps of the course.
fn sweeps(browser: &Browser) -> u64 {
    eval_json(browser, "hiddenRoom.course().stops.length").as_u64().expect("a number")
}

/// Figure of the comparison with the true room.
fn figure(browser: &Browser, label: &str) -> f64 {
    let text = browser.eval(&format!(
        "[...document.querySelectorAll('#comparison div')].find((row) => row.textContent.startsWith({label:?})).lastChild.textContent"
    ));
    let text = text.as_str().expect("a text");
    let number = text.split(' ').next().and_then(|number| number.parse().ok());
    number.unwrap_or_else(|| panic!("{label}: {text}"))
}

#[test]
fn three_sweeps_by_clicks_complete_the_plan() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    assert_eq!(sweeps(&browser), 1);
    assert!(browser.text("#survey-status").contains("Two sweeps"));
    // The true room is neither drawn nor listed in the legend.
    assert_eq!(eval_json(&browser, "hiddenRoom.plan.truth"), Value::Null);
    assert!(!browser.text("#legend").contains("wall"));
    for (by, count) in [([0.5, 0.2], 2), ([-0.2, 0.45], 3)] {
        click_near_robot(&browser, by);
        browser.until(&format!("hiddenRoom.course().stops.length === {count}"));
        until_idle(&browser);
    }
    let status = browser.text("#survey-status");
    assert!(status.starts_with("4 walls from 3 sweeps, "), "{status}");
    for label in
        ["surveyed wall or post: observed", "surveyed pose", "pose by odometry", "direct echo"]
    {
        assert!(browser.text("#legend").contains(label), "{label}: {}", browser.text("#legend"));
    }
    // Odometry is off by centimetres, the survey by millimetres at most.
    let off_m = eval_json(
        &browser,
        "(() => { const at = (a, b) => Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m); \
         return hiddenRoom.course().stops.map(({truth, odometry}, i) => \
         [at(truth, odometry), at(truth, hiddenRoom.survey().poses[i].pose)]); })()",
    );
    for stop in 1..3 {
        let [odometry_m, surveyed_m] = [0, 1].map(|at| off_m[stop][at].as_f64().expect("metres"));
        assert!(odometry_m > 0.004 && surveyed_m < 0.003, "{odometry_m} m, {surveyed_m} m");
    }
    browser.click("#reveal");
    until_idle(&browser);
    assert!(figure(&browser, "Recall") > 99.5);
    assert!(figure(&browser, "Precision") > 99.5);
    assert!(figure(&browser, "Corners") < 5.0);
    assert!(browser.text("#legend").contains("true wall"));
    assert_eq!(browser.eval("document.querySelectorAll('#stops tbody tr').length"), 3);
    browser.picture("hidden-room");
    browser.click("#reveal");
    until_idle(&browser);
    assert_eq!(browser.eval("document.querySelectorAll('#comparison div').length"), 0);
    assert_clean(&browser);
}

#[test]
fn robot_is_driven_by_keys_and_buttons() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    let heading = |browser: &Browser| {
        eval_json(browser, "hiddenRoom.course().robot.odometry.heading_deg")
            .as_f64()
            .expect("degrees")
    };
    let before = heading(&browser);
    browser.click("#left");
    until_idle(&browser);
    assert!(((heading(&browser) - before).rem_euclid(360.0) - 30.0).abs() < 1e-6);
    // Turning on the spot gives no new place.
    browser.click("#sweep");
    browser.until("!document.getElementById('trouble').hidden");
    assert!(browser.text("#trouble").contains("Drive on"), "{}", browser.text("#trouble"));
    assert_eq!(sweeps(&browser), 1);
    browser.eval("document.getElementById('stage').focus()");
    browser.press(Key::Right.into());
    browser.press(Key::Up.into());
    browser.press(' ');
    browser.until("hiddenRoom.course().stops.length === 2");
    until_idle(&browser);
    let turned_deg = heading(&browser) - before;
    assert!((turned_deg - 360.0 * (turned_deg / 360.0).round()).abs() < 1e-6, "{turned_deg}");
    // Many steps ahead end before a wall, and the robot stays inside.
    for _ in 0..12 {
        browser.press(Key::Up.into());
    }
    until_idle(&browser);
    assert!(
        browser.text("#summary").contains("stopped before an obstacle"),
        "{}",
        browser.text("#summary")
    );
    browser.press(' ');
    browser.until("hiddenRoom.course().stops.length === 3");
    until_idle(&browser);
    assert_eq!(browser.eval("document.getElementById('trouble').hidden"), true);
    assert_clean(&browser);
}

#[test]
fn survey_is_cancelled_and_started_again() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    browser.click("#forward");
    until_idle(&browser);
    // Cancelled at its first progress.
    let progress = browser.eval(
        "new Promise((done) => { const [status, survey, progress] = \
         ['survey-status', 'survey', 'progress'].map((id) => document.getElementById(id)); \
         new MutationObserver((_, observer) => { const text = status.textContent; \
         if (!text.endsWith('tried')) return; \
         observer.disconnect(); \
         done([text, survey.textContent, progress.hidden]); survey.click(); }) \
         .observe(status, {childList: true}); \
         document.getElementById('sweep').click(); })",
    );
    let text = "Surveying: poses; 0 walls, 0 floor plans tried";
    assert_eq!(progress, json!([text, "Cancel", false]));
    browser.until("document.getElementById('survey-status').textContent === 'Survey cancelled.'");
    until_idle(&browser);
    assert_eq!(eval_json(&browser, "hiddenRoom.survey()"), Value::Null);
    assert_eq!(browser.eval("document.getElementById('progress').hidden"), true);
    // A further sweep replaces a running survey, whose result would have two poses.
    browser.eval(
        "['survey', 'forward', 'sweep'].forEach((id) => document.getElementById(id).click())",
    );
    browser.until("hiddenRoom.course().stops.length === 3");
    until_idle(&browser);
    assert_eq!(eval_json(&browser, "hiddenRoom.survey().poses.length"), 3);
    assert_clean(&browser);
}

#[test]
fn invalid_input_is_reported() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    browser.click("#survey");
    browser.until("!document.getElementById('trouble').hidden");
    let trouble = browser.text("#trouble");
    assert!(
        trouble.contains("Too few sweeps (1)") && trouble.contains("another sweep"),
        "{trouble}"
    );
    assert_eq!(browser.text("#survey-status"), "Not surveyed.");
    // A stop of a link that is not in the room ends the course before it.
    let place = |x_m: f64| {
        let pose = json!({"x_m": x_m, "y_m": 0.7, "heading_deg": 0});
        json!({"truth": pose, "odometry": pose})
    };
    let scene = json!({"name": "square", "materials": {"wall": {"reflectance": 0.97}}, "walls": [
        {"id": "w", "polyline": [[0, 0], [2, 0], [2, 2], [0, 2]], "closed": true, "material": "wall"}]});
    let course = json!({"scene": scene, "start": place(0.7)["truth"],
        "stops": [place(0.7), place(1.2), place(2.0)], "robot": place(2.0)});
    open_course(&browser, &course);
    let trouble = browser.text("#trouble");
    assert!(trouble.starts_with("Stop 3: the pose (2, 0.7) m is"), "{trouble}");
    assert_eq!(sweeps(&browser), 2);
    assert_eq!(eval_json(&browser, "hiddenRoom.survey().poses.length"), 2);
    let error = |request: &str| {
        let expression =
            format!("hiddenRoom.request({request}).catch(({{problem}}) => problem.message)");
        eval_json(&browser, &expression).as_str().expect("an error").to_owned()
    };
    assert!(error("{type: 'open_room', room: {random: {kind: 'maze', seed: 1}}}").contains("maze"));
    assert!(error("{type: 'open_room', room: {random: {seed: -1}}}").contains("invalid request"));
    assert!(error("{type: 'survey', sweeps: Array(50).fill({pose: {x_m: 0, y_m: 0, heading_deg: 0}, readings: []})}").contains("50 sweeps"));
    assert_clean(&browser);
}

#[test]
fn missing_module_is_reported() {
    let copy = tempfile::tempdir().expect("a folder");
    for name in ["hidden-room.html", "hidden-room.js", "playground.css", "style.css", "icon.svg"] {
        fs::copy(folder().join(name), copy.path().join(name)).expect("there is room");
    }
    let page = copy.path().join("hidden-room.html");
    let browser = Browser::open_at(&format!("file://{}", page.display()), DESK);
    browser.until("!document.getElementById('trouble').hidden");
    assert_eq!(browser.text("#link"), "survey not loaded");
    let trouble = browser.text("#trouble");
    assert!(trouble.contains("survey-data.js cannot be loaded"), "{trouble}");
}

#[test]
fn link_restores_the_course() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    click_near_robot(&browser, [0.5, 0.2]);
    browser.until("hiddenRoom.course().stops.length === 2");
    until_idle(&browser);
    browser.click("#share");
    browser.until("document.getElementById('shared').open");
    let address = browser.eval("document.getElementById('address').value");
    let (_, fragment) = address.as_str().and_then(|text| text.split_once('#')).expect("a link");
    let [course, survey] =
        ["hiddenRoom.course()", "hiddenRoom.survey()"].map(|of| eval_json(&browser, of));
    assert_clean(&browser);
    drop(browser);
    let browser = open_room(DESK, &format!("#{fragment}"));
    assert_eq!(eval_json(&browser, "hiddenRoom.course()"), course);
    assert_eq!(eval_json(&browser, "hiddenRoom.survey()"), survey);
    assert_clean(&browser);
    drop(browser);
    let browser = open_room(DESK, &format!("#{}", &fragment[..fragment.len() / 2]));
    assert_eq!(sweeps(&browser), 1);
    assert!(browser.text("#about").contains("incomplete"), "{}", browser.text("#about"));
}

#[test]
fn drawn_room_is_hidden() {
    let browser = open(DESK);
    browser.click("#edit");
    browser.click("#new-room");
    wait_until_idle(&browser);
    browser.click("#hide-room");
    until_idle(&browser);
    assert_eq!(browser.text("#room-label"), "drawn room, 1 sweep");
    assert_eq!(
        eval_json(&browser, "hiddenRoom.course().start"),
        json!({"x_m": 1, "y_m": 0.8, "heading_deg": 0})
    );
    browser.click("#reveal");
    until_idle(&browser);
    assert_eq!(eval_json(&browser, "hiddenRoom.plan.truth.name"), "my-room");
    assert_clean(&browser);
}

/// Surveys sweeps of the module with the library.
fn survey_natively(sweeps: &Value) -> Survey {
    let air = Air::default();
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let world = unknown_room(sensor, air, Options::default(), 4.0).expect("a world");
    let us_per_m = 2e6 / air.sound_speed_m_s();
    let firing = |reading: &Value| SweepFiring {
        azimuth_deg: reading["azimuth_deg"].as_f64().expect("degrees"),
        outcome: match (reading["status"].as_str(), reading["range_m"].as_f64()) {
            (Some("echo"), Some(range_m)) => FiringOutcome::Echo { tof_us: range_m * us_per_m },
            (Some("min_range"), _) => FiringOutcome::BelowMinRange,
            _ => FiringOutcome::NoEcho,
        },
    };
    let sweep = |(number, sweep): (u128, &Value)| FitSweep {
        scan: uuid::Uuid::from_u128(number),
        pose: serde_json::from_value::<Pose>(sweep["pose"].clone()).expect("a pose"),
        beams: sweep["readings"].as_array().expect("readings").iter().map(firing).collect(),
    };
    let sweeps: Vec<FitSweep> = (1..).zip(sweeps.as_array().expect("sweeps")).map(sweep).collect();
    let options = SurveyOptions { max_scenes: 6000, ..SurveyOptions::default() };
    survey(&world, &sweeps, &options, &NoObserver).expect("a survey")
}

#[test]
fn survey_equals_the_programs() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    let course = [[0.0, 0.0, 0.0], [0.5, 0.1, 30.0], [0.3, 0.5, 100.0]];
    let sweeps = eval_json(
        &browser,
        &format!(
            "(async () => {{ const room = {{random: {{kind: 'rectangle', seed: {RECTANGLE}}}}}, sweeps = []; \
             const {{start}} = await hiddenRoom.request({{type: 'open_room', room}}); \
             for (const [dx, dy, turn] of {}) {{ \
               const pose = {{x_m: start.x_m + dx, y_m: start.y_m + dy, heading_deg: (start.heading_deg + turn) % 360}}; \
               const {{readings}} = await hiddenRoom.request({{type: 'take_sweep', room, pose, seed: 1, number: sweeps.length}}); \
               sweeps.push({{pose, readings}}); }} \
             return sweeps; }})()",
            json!(course)
        ),
    );
    let found =
        eval_json(&browser, &format!("hiddenRoom.request({{type: 'survey', sweeps: {sweeps}}})"));
    let found: Survey = serde_json::from_value(found).expect("a survey");
    let expected = survey_natively(&sweeps);
    assert_eq!(found.walls.len(), expected.walls.len());
    for (found, expected) in found.walls.iter().zip(&expected.walls) {
        assert_eq!(found.id, expected.id);
        for (a, b) in [(found.from, expected.from), (found.to, expected.to)] {
            let off_m = (a.at_m[0] - b.at_m[0]).hypot(a.at_m[1] - b.at_m[1]);
            assert!(off_m < 1e-6, "{}: {off_m} m", found.id);
        }
        let statuses = |of: &sonard::survey::SurveyedWall| {
            of.pieces.iter().map(|piece| piece.status).collect::<Vec<_>>()
        };
        assert_eq!(statuses(found), statuses(expected), "{}", found.id);
    }
    assert_eq!(found.causes, expected.causes);
    assert_eq!(found.scored_scenes, expected.scored_scenes);
}

#[test]
fn hidden_room_is_accessible() {
    let browser = open_random(DESK, "rectangle", RECTANGLE);
    click_near_robot(&browser, [0.5, 0.2]);
    browser.until("hiddenRoom.course().stops.length === 2");
    until_idle(&browser);
    browser.click("#reveal");
    until_idle(&browser);
    check_screens(&browser, "hidden-room", until_idle);
}

#[test]
fn size_limit_is_enforced() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let data = folder().join("survey-data.js");
    let check = |max_bytes: &str| {
        let script = format!("{root}/web/check-size.sh");
        let output =
            Command::new("bash").arg(script).arg(max_bytes).arg(&data).output().expect("bash");
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert!(check("1000000").0);
    let (is_small, error) = check("10000");
    assert!(!is_small && error.contains("the total exceeds 10000 bytes"), "{error}");
    // The module's script belongs to the page "Hidden room" alone.
    let playground = fs::read_to_string(folder().join("index.html")).expect("the page");
    assert!(!playground.contains("survey-data.js"));
}
