//! Interaction with mouse, finger and keys.

use std::fs;

use fantoccini::key::Key;
use serde_json::json;

use super::{assert_clean, eval_json, legend, open, open_with, set, wait_until_idle};
use crate::live_page::{
    browser::{Browser, DESK, PHONE},
    view::check_view,
};
use sonard_test_support::{run, stderr};

/// Count of a label in the legend; 0 if the label is missing.
fn counted(browser: &Browser, label: &str) -> u64 {
    let legend = legend(browser);
    let after = legend.split(&format!("{label} (")).nth(1).and_then(|rest| rest.split(')').next());
    after.and_then(|number| number.parse().ok()).unwrap_or(0)
}

fn to_step(browser: &Browser, title: &str) {
    while browser.text("#tour-title") != title {
        browser.click("#tour-next");
        wait_until_idle(browser);
    }
}

fn beam_now(browser: &Browser) -> String {
    browser.text("#beam-label")
}

fn pose(browser: &Browser) -> [f64; 3] {
    let pose = eval_json(browser, "playground.state().pose");
    ["x_m", "y_m", "heading_deg"].map(|key| pose[key].as_f64().expect("a number"))
}

#[test]
fn tour_claims_are_true() {
    let browser = open(DESK);
    let steps = [
        ("A room as the sensor measures it", "beam 200, azimuth 180.0°, direct echo, 1.20"),
        ("The false wall", "beam 300, azimuth 270.0°, multiple reflection, 0.828"),
        ("Walls and corners are arcs", "beam 244, azimuth 219.6°, multiple reflection, 1.0"),
        ("Walls that vanish", "beam 161, azimuth 144.9°, no echo"),
        ("Edges", "beam 352, azimuth 316.8°, edge, 0.97"),
        ("Minimum range", "beam 0, azimuth 0.0°, minimum range, 0.409"),
        ("What simpler models miss", "beam 300, azimuth 270.0°, multiple reflection, 0.828"),
    ];
    for (title, beam) in steps {
        to_step(&browser, title);
        let now = beam_now(&browser);
        assert!(now.starts_with(beam), "{title}: {now}");
    }
    let misses = "[...document.querySelectorAll('.misses')].map((e) => e.textContent)";
    let misses = eval_json(&browser, misses);
    let cone = misses[0].as_str().expect("a text");
    assert!(cone.contains("misses") && cone.contains("multiple reflections"), "{cone}");
    assert_eq!(misses[2], "400 of 400 beams with an echo.");
    // The suggested changes have the described effects.
    browser.click("#tour-back");
    wait_until_idle(&browser);
    browser.click("#tour-back");
    wait_until_idle(&browser);
    assert_eq!(counted(&browser, "edge"), 1);
    set(&browser, "threshold", "-10");
    assert!(counted(&browser, "edge") > 3, "{}", legend(&browser));
    browser.click("#tour-back");
    wait_until_idle(&browser);
    let without_echo = counted(&browser, "no echo");
    set(&browser, "roughness", "0.3");
    assert!(counted(&browser, "no echo") < without_echo - 50, "{}", legend(&browser));
    to_step(&browser, "Edges");
    browser.click("#tour-back");
    browser.click("#tour-back");
    browser.click("#tour-back");
    wait_until_idle(&browser);
    assert_eq!(browser.text("#tour-title"), "The false wall");
    // Farther up, the near wall is detected at its true distance.
    browser.eval("playground.change({pose: {x_m: 0.774, y_m: 0.5, heading_deg: 0}})");
    wait_until_idle(&browser);
    assert!(beam_now(&browser).contains("direct echo, 0.50"), "{}", beam_now(&browser));
    assert_clean(&browser);
}

#[test]
fn ranger_is_dragged_and_turned() {
    let browser = open(DESK);
    let before = pose(&browser);
    let [x, y] = middle(&browser, ".ranger");
    for (kind, dx) in
        [("mousePressed", 0.0), ("mouseMoved", 30.0), ("mouseMoved", 60.0), ("mouseReleased", 60.0)]
    {
        mouse(&browser, kind, x + dx, y);
    }
    wait_until_idle(&browser);
    let after = pose(&browser);
    assert!(after[0] > before[0] + 0.1 && (after[1] - before[1]).abs() < 0.01, "{after:?}");
    let [x, y] = middle(&browser, ".heading");
    for (kind, dx, dy) in
        [("mousePressed", 0.0, 0.0), ("mouseMoved", -52.0, -52.0), ("mouseReleased", -52.0, -52.0)]
    {
        mouse(&browser, kind, x + dx, y + dy);
    }
    wait_until_idle(&browser);
    assert!((pose(&browser)[2] - 90.0).abs() < 3.0, "{:?}", pose(&browser));
    browser.look_through(PHONE);
    browser.eval("document.querySelector('.ranger').scrollIntoView({block: 'center'})");
    browser.until("new Promise((done) => setTimeout(() => done(true), 300))");
    let before = pose(&browser);
    let [x, y] = middle(&browser, ".ranger");
    let touches = [("touchStart", 0.0), ("touchMove", 15.0), ("touchMove", 40.0)];
    for (kind, dx) in touches {
        let points = json!([{"x": x + dx, "y": y}]);
        browser.devtools("Input.dispatchTouchEvent", &json!({"type": kind, "touchPoints": points}));
    }
    browser.devtools("Input.dispatchTouchEvent", &json!({"type": "touchEnd", "touchPoints": []}));
    wait_until_idle(&browser);
    let after = pose(&browser);
    assert!(after[0] > before[0] + 0.1, "{before:?} {after:?}");
    browser.look_through(DESK);
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Left.into());
    browser.press(Key::Down.into());
    browser.press(Key::PageUp.into());
    wait_until_idle(&browser);
    let moved = pose(&browser);
    let by = [0, 1, 2].map(|i| moved[i] - after[i]);
    assert!((by[0] + 0.01).abs() < 1e-3 && (by[1] + 0.01).abs() < 1e-3, "{by:?}");
    assert!((by[2] - 0.9).abs() < 0.01, "{by:?}");
    // An invalid pose shows an error and no readings.
    browser.eval("playground.change({pose: {x_m: -3, y_m: 0, heading_deg: 0}})");
    browser.until("!document.getElementById('trouble').hidden");
    assert!(browser.text("#trouble").contains("outside"), "{}", browser.text("#trouble"));
    assert_eq!(eval_json(&browser, "playground.scan().beams.size"), 0);
    assert_clean(&browser);
}

fn mouse(browser: &Browser, kind: &str, x: f64, y: f64) {
    let event =
        json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1});
    browser.devtools("Input.dispatchMouseEvent", &event);
}

fn middle(browser: &Browser, selector: &str) -> [f64; 2] {
    let at = eval_json(
        browser,
        &format!(
            "(() => {{ const e = document.querySelector('{selector}'); e.scrollIntoView({{block: 'center'}}); \
             const r = e.getBoundingClientRect(); \
             return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
        ),
    );
    [0, 1].map(|i| at[i].as_f64().expect("a number"))
}

#[test]
fn ranger_stops_at_walls() {
    let browser = open(DESK);
    to_step(&browser, "The false wall");
    let top = "document.getElementById('stage').getBoundingClientRect().top + scrollY";
    let before = browser.eval(top);
    let [x, y] = middle(&browser, ".ranger");
    // Down and to the left: at the southern wall, 85 mm away, the ranger slides along it.
    for (kind, share) in [("mousePressed", 0.0), ("mouseMoved", 0.5), ("mouseReleased", 1.0)] {
        mouse(&browser, kind, x - 120.0 * share, y + 200.0 * share);
    }
    wait_until_idle(&browser);
    let [x_m, y_m, _] = pose(&browser);
    assert!((0.0..0.02).contains(&y_m) && (0.0..0.7).contains(&x_m), "({x_m}, {y_m})");
    assert_eq!(browser.eval("document.getElementById('trouble').hidden"), true);
    // Into a corner, where it stops.
    let [x, y] = middle(&browser, ".ranger");
    for (kind, by) in [("mousePressed", 0.0), ("mouseMoved", 500.0), ("mouseReleased", 900.0)] {
        mouse(&browser, kind, x - by, y + by);
    }
    wait_until_idle(&browser);
    let [x_m, y_m, _] = pose(&browser);
    assert!((0.0..0.02).contains(&x_m) && (0.0..0.02).contains(&y_m), "({x_m}, {y_m})");
    // A message moves nothing on the page.
    browser.eval("playground.change({pose: {x_m: -3, y_m: 0, heading_deg: 0}})");
    browser.until("!document.getElementById('trouble').hidden");
    assert_eq!(browser.eval(top), before);
    assert_clean(&browser);
}

#[test]
fn moves_are_undone() {
    let browser = open(DESK);
    to_step(&browser, "The false wall");
    let first = pose(&browser);
    assert_eq!(browser.eval("document.getElementById('undo').disabled"), true);
    let [x, y] = middle(&browser, ".ranger");
    for (kind, by) in
        [("mousePressed", 0.0), ("mouseMoved", 30.0), ("mouseMoved", 50.0), ("mouseReleased", 60.0)]
    {
        mouse(&browser, kind, x, y - by);
    }
    wait_until_idle(&browser);
    let second = pose(&browser);
    assert!(second[1] > first[1] + 0.05, "{second:?}");
    browser.eval("document.querySelector('.ranger').focus()");
    browser.press(Key::Left.into());
    set(&browser, "temperature", "30");
    // A drag is one step, and so is each key and each setting.
    browser.click("#undo");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().temperature_c"), json!(20));
    assert!((pose(&browser)[0] - second[0] + 0.01).abs() < 1e-3);
    browser.click("#undo");
    wait_until_idle(&browser);
    assert_eq!(pose(&browser), second);
    browser.click("#undo");
    wait_until_idle(&browser);
    assert_eq!(pose(&browser), first);
    assert_eq!(browser.eval("document.getElementById('undo').disabled"), true);
    set(&browser, "roughness", "0.4");
    set(&browser, "temperature", "30");
    browser.click("#reset");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().temperature_c"), json!(20));
    assert_eq!(
        eval_json(&browser, "playground.state().scene.materials.shelving.roughness"),
        json!(0)
    );
    // Reset itself is undone by the key.
    browser.eval("dispatchEvent(new KeyboardEvent('keydown', {key: 'z', ctrlKey: true}))");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().temperature_c"), json!(30));
    assert_clean(&browser);
}

#[test]
fn pulse_travels_along_the_paths() {
    let browser = open(DESK);
    to_step(&browser, "The false wall");
    browser.until("!document.getElementById('pulse-play').disabled");
    let time_us = || eval_json(&browser, "playground.pulse.at_us");
    let painted = || {
        browser.until_drawn();
        eval_json(
            &browser,
            "(() => { const c = document.querySelector('canvas.fronts'); \
             const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true}); \
             copy.drawImage(c, 0, 0); const d = copy.getImageData(0, 0, c.width, c.height).data; \
             let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 128; return n; })()",
        )
    };
    assert_eq!((time_us(), painted()), (json!(null), json!(0)));
    browser.click("#pulse-play");
    browser.until("playground.pulse.at_us > 100");
    browser.until("document.getElementById('pulse-text').textContent.includes('receiver blanked')");
    browser.click("#pulse-play");
    let paused = time_us();
    assert_eq!(browser.text("#pulse-play"), "Play pulse");
    assert!(painted().as_u64() > Some(20), "{}", painted());
    assert!(legend(&browser).contains("wave front that is detected"), "{}", legend(&browser));
    browser.until("new Promise((done) => setTimeout(() => done(true), 200))");
    assert_eq!(time_us(), paused);
    // The slider moves the pulse: after 4.9 ms the third reflection has arrived.
    let scrub = |at_us: f64| {
        browser.eval(&format!(
            "(() => {{ const s = document.getElementById('pulse-time'); \
             s.value = Math.round(1000 * {at_us} / playground.pulse.end_us); \
             s.dispatchEvent(new Event('input')); }})()"
        ));
        browser.text("#pulse-text")
    };
    let text = scrub(4900.0);
    assert!(text.contains("signal above threshold"), "{text}");
    assert!(text.contains("echo by south, north, south: detected as echo 1"), "{text}");
    let text = scrub(600.0);
    assert!(text.contains("receiver blanked") && text.contains("echo by south: blanked"), "{text}");
    assert!(text.starts_with("0.60 ms, path 0.20"), "{text}");
    // Half way between the first and the second reflection, the front is between both walls.
    let drawn = "playground.pulse.trace.cursor_us";
    assert_eq!(eval_json(&browser, drawn), time_us());
    browser.eval("document.getElementById('pulse-time').focus()");
    browser.press(Key::Right.into());
    assert_ne!(time_us(), json!(600.0));
    // Another beam keeps the time; hiding ends it.
    browser.eval("playground.select(0)");
    wait_until_idle(&browser);
    browser.until("document.getElementById('pulse-text').textContent.includes('ms, path')");
    browser.click("#pulse-hide");
    assert_eq!((time_us(), painted()), (json!(null), json!(0)));
    // On a phone the echo trace is next to the plan.
    browser.look_through(PHONE);
    browser.until("document.getElementById('trace').parentElement.id === 'pulse'");
    assert_clean(&browser);
}

#[test]
fn last_step_leads_on() {
    let browser = open(DESK);
    to_step(&browser, "What simpler models miss");
    assert_eq!(browser.text("#tour-next"), "Start again");
    browser.click("#tour-next");
    wait_until_idle(&browser);
    assert_eq!(browser.text("#tour-title"), "A room as the sensor measures it");
    assert_eq!(browser.text("#tour-next"), "Next");
    assert_clean(&browser);
}

#[test]
fn pan_zoom_and_measure() {
    let browser = open(DESK);
    check_view(&browser, "Promise.resolve(playground.plan)");
    // The handles move with the view and still work.
    let before = middle(&browser, ".ranger");
    browser.click(".tools [aria-label=\"Zoom in\"]");
    browser.until_drawn();
    let [x, y] = middle(&browser, ".ranger");
    assert!((x - before[0]).hypot(y - before[1]) > 5.0, "{before:?} {x} {y}");
    let before = pose(&browser);
    for (kind, dx) in [("mousePressed", 0.0), ("mouseMoved", 30.0), ("mouseReleased", 30.0)] {
        mouse(&browser, kind, x + dx, y);
    }
    wait_until_idle(&browser);
    assert!(pose(&browser)[0] > before[0], "{before:?} {:?}", pose(&browser));
    set(&browser, "arcs", "true");
    assert!(legend(&browser).contains("arc: possible positions"), "{}", legend(&browser));
    assert_clean(&browser);
}

#[test]
fn settings_change_readings() {
    let browser = open(DESK);
    let ranges =
        || eval_json(&browser, "[...playground.scan().beams.values()].map((ping) => ping.range_m)");
    for (id, value) in [
        ("temperature", "40"),
        ("humidity", "10"),
        ("reflectance", "0.5"),
        ("roughness", "0.4"),
        ("gain", "air"),
        ("threshold", "20"),
        ("reach", "1.5"),
        ("step", "1.8"),
        ("sensor", "hc-sr04"),
        ("engine", "fan"),
        ("engine", "cone"),
        ("use-3d", "true"),
        ("ceiling", "0.6"),
        ("height", "0.25"),
    ] {
        // Each starts from the initial state, except the heights, which depend on each other.
        if !["ceiling", "height"].contains(&id) {
            browser.eval("playground.change(globalThis.first ??= {...playground.state()})");
            wait_until_idle(&browser);
        }
        let before = ranges();
        set(&browser, id, value);
        assert!(
            browser.eval("document.getElementById('trouble').hidden") == true,
            "{id}: {}",
            browser.text("#trouble")
        );
        assert_ne!(before, ranges(), "{id} = {value} changes nothing");
    }
    assert_clean(&browser);
}

#[test]
fn room_is_edited_and_saved() {
    let browser = open(DESK);
    browser.click("#edit");
    browser.click("#new-room");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "document.querySelectorAll('.corner').length"), 4);
    browser.click("#add-pillar");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "document.querySelectorAll('.pillar').length"), 1);
    // A wall by two clicks.
    browser.click("#add-wall");
    browser.click_at("#over", 0.6, 0.3);
    browser.click_at("#over", 0.7, 0.4);
    wait_until_idle(&browser);
    browser.click("#add-wall");
    assert_eq!(eval_json(&browser, "playground.state().scene.walls.length"), 5);
    assert_eq!(eval_json(&browser, "document.querySelectorAll('.corner').length"), 6);
    // The corner is moved by keys, deleted and restored.
    browser.eval("document.querySelectorAll('.corner')[5].focus()");
    let corner = "playground.state().scene.walls[4].to";
    let before = eval_json(&browser, corner);
    browser.press(Key::Right.into());
    wait_until_idle(&browser);
    let off = eval_json(&browser, corner)[0].as_f64().zip(before[0].as_f64()).map(|(a, b)| a - b);
    assert!(off.is_some_and(|off| (off - 0.01).abs() < 1e-9), "{off:?}");
    browser.press(Key::Delete.into());
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().scene.walls.length"), 4);
    browser.click("#undo");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().scene.walls.length"), 5);
    // The file is a valid scene with the ranger's pose.
    browser.eval(
        "(() => { const make = URL.createObjectURL; \
         URL.createObjectURL = (blob) => { globalThis.saved = blob.text(); return make(blob); }; })()",
    );
    browser.click("#save");
    let saved = eval_json(&browser, "globalThis.saved");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("drawn.json");
    fs::write(&file, saved.as_str().expect("a text")).expect("there is room");
    let name = file.display().to_string();
    let checked = run(&["scene", "check", &name]);
    assert!(checked.status.success(), "{}", stderr(&checked));
    assert!(
        run(&["simulate", "--scene", &name, "--pose", "here", "--max-range", "3"]).status.success()
    );
    // The file can be dropped on the page.
    set(&browser, "scene", "corridor");
    drop_file(&browser, "drawn.json", saved.as_str().expect("a text"));
    browser.until("playground.state().scene.name === 'my-room'");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.state().scene.walls.length"), 5);
    assert_clean(&browser);
}

/// Drops a file on the page.
fn drop_file(browser: &Browser, name: &str, text: &str) {
    let text = json!(text);
    browser.eval(&format!(
        "(() => {{ const data = new DataTransfer(); data.items.add(new File([{text}], {name:?})); \
         dispatchEvent(new DragEvent('drop', {{dataTransfer: data, cancelable: true}})); }})()"
    ));
}

#[test]
fn log_and_table_are_opened() {
    let browser = open(DESK);
    let folder = tempfile::tempdir().expect("a folder");
    let scan = sonard_test_support::mock_scan("fig9", folder.path(), &["--step-deg", "7.2"]);
    assert!(scan.status.success(), "{}", stderr(&scan));
    let log = fs::read_to_string(folder.path().join("scan.jsonl")).expect("a log");
    drop_file(&browser, "scan.jsonl", &log);
    browser.until("!document.getElementById('logged').hidden");
    wait_until_idle(&browser);
    assert_eq!(browser.text("#floor-title"), "Floor plan: simple-room");
    assert_eq!(eval_json(&browser, "playground.scan().beams.size"), 50);
    let residuals = eval_json(
        &browser,
        "playground.scan().residuals().map((ping) => Math.abs(ping.residual_m))",
    );
    let most = residuals
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(serde_json::Value::as_f64)
        .fold(0.0, f64::max);
    assert!(residuals.as_array().is_some_and(|list| list.len() > 30), "{residuals}");
    assert!(most < 0.02, "{most}");
    assert!(browser.eval("document.getElementById('residuals').hidden") == false);
    // At another pose the predictions differ from the log.
    browser.eval("playground.change({pose: {x_m: 0.4, y_m: 0.3, heading_deg: 0}})");
    wait_until_idle(&browser);
    assert!(counted(&browser, "disagrees with model") > 10, "{}", legend(&browser));
    drop_file(&browser, "sweep.csv", "angle_deg,distance_cm\n0,52.8\n90,44.2\n180,40\n270,\n");
    browser.until("playground.scan()?.beams.size === 4");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.scan().beams.get(0).range_m"), json!(0.528));
    browser.click("#close-log");
    wait_until_idle(&browser);
    assert_eq!(eval_json(&browser, "playground.scan().beams.size"), 400);
    drop_file(&browser, "notes.txt", "no readings here\n");
    browser.until("!document.getElementById('trouble').hidden");
    assert_clean(&browser);
}

#[test]
fn link_restores_the_view() {
    let browser = open(DESK);
    set(&browser, "scene", "corridor");
    set(&browser, "temperature", "31");
    browser.eval("playground.change({pose: {x_m: 5, y_m: 0.9, heading_deg: 12.5}})");
    browser.eval("playground.select(33)");
    wait_until_idle(&browser);
    let (now, state) = (beam_now(&browser), eval_json(&browser, "playground.state()"));
    browser.click("#share");
    browser.until("document.getElementById('shared').open");
    let link = browser.eval("document.getElementById('address').value");
    let (_, fragment) = link.as_str().and_then(|link| link.split_once('#')).expect("a fragment");
    let fragment = fragment.to_owned();
    drop(browser);
    let browser = open_with(DESK, &format!("#{fragment}"));
    assert_eq!(eval_json(&browser, "playground.state()"), state);
    assert_eq!(beam_now(&browser), now);
    assert_clean(&browser);
    drop(browser);
    // A truncated link shows a message, and the page works.
    let browser = open_with(DESK, &format!("#{}", &fragment[..fragment.len() / 2]));
    assert_eq!(eval_json(&browser, "playground.scan().beams.size"), 400);
    assert!(browser.text("#tour-text").contains("incomplete"), "{}", browser.text("#tour-text"));
}

#[test]
fn slow_scene_does_not_block() {
    let browser = open(DESK);
    let gap_ms = eval_json(
        &browser,
        "(async () => { const {change, idle} = playground; let [most, last, on] = [0, performance.now(), true]; \
         const frame = (now) => { most = Math.max(most, now - last); last = now; if (on) requestAnimationFrame(frame); }; \
         requestAnimationFrame(frame); \
         const lab = [...document.getElementById('scene').options].find((o) => o.value === 'mcgill-lab'); \
         document.getElementById('scene').value = lab.value; \
         document.getElementById('scene').dispatchEvent(new Event('change')); \
         change({step_deg: 0.45, reach_m: 10.5, engine: 'fan'}); \
         do { await new Promise((done) => setTimeout(done, 20)); } while (!idle()); \
         on = false; return most; })()",
    );
    println!("longest gap between frames during 800 beams of the fan engine: {gap_ms} ms");
    assert!(gap_ms.as_f64().is_some_and(|gap_ms| gap_ms < 250.0), "{gap_ms} ms");
    assert_clean(&browser);
}
