//! Readings on the floor plan are drawn from their viewpoints.

use std::{fs, path::Path};

use serde_json::{Value, json};

use super::{
    browser::{Browser, DESK},
    show_log, write_predicted_log,
};
use sonard_test_support::{
    daemon::{start_ahead, start_array},
    run, stderr,
};

/// Engines without envelopes: a range is half its path's length, without time walk.
const FAN: [&str; 4] = ["--set", "model.engine=fan", "--set", "server.listen=127.0.0.1:0"];
const CONE: [&str; 4] = ["--set", "model.engine=cone", "--set", "server.listen=127.0.0.1:0"];

type Point = [f64; 2];

fn point(of: &Value) -> Point {
    [0, 1].map(|axis| of[axis].as_f64().expect("a coordinate"))
}

fn distance([x, y]: Point, [u, v]: Point) -> f64 {
    (x - u).hypot(y - v)
}

/// Position of a reading's viewpoint.
fn place(reading: &Value) -> Point {
    ["x_m", "y_m"].map(|axis| reading["viewpoint"][axis].as_f64().expect("a figure"))
}

/// End of a reading's range, from the API's viewpoint.
fn end(reading: &Value) -> Option<Point> {
    let range_m = reading["range_m"].as_f64()?;
    let direction_deg = reading["viewpoint"]["direction_deg"].as_f64().expect("a direction");
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    let [x_m, y_m] = place(reading);
    Some([x_m + range_m * cos, y_m + range_m * sin])
}

/// Value of an expression with the page's `plan`.
fn eval_plan(browser: &Browser, expression: &str) -> Value {
    browser.eval(&format!("import('/page/main.js').then(({{plan}}) => {expression})"))
}

/// Converts points of the floor to pixels of the stage.
fn pixels(browser: &Browser, points: &[Point]) -> Vec<Point> {
    let points = eval_plan(browser, &format!("{}.map((at) => plan.view.px(at))", json!(points)));
    points.as_array().expect("points").iter().map(point).collect()
}

/// Returns for each point of the floor whether a layer is painted within two pixels of it. Points
/// outside the view count as painted.
fn painted(browser: &Browser, layer: &str, points: &[Point]) -> Vec<bool> {
    let reply = eval_plan(
        browser,
        &format!(
            "(() => {{ const c = document.getElementById('{layer}'); \
             const copy = new OffscreenCanvas(c.width, c.height); \
             const c2d = copy.getContext('2d', {{willReadFrequently: true}}); \
             c2d.drawImage(c, 0, 0); \
             return {}.map((at) => {{ const px = plan.view.px(at); \
               if (plan.view.isOutside(px)) return true; \
               const [x, y] = px.map((v) => Math.round(v * devicePixelRatio) - 2); \
               return c2d.getImageData(x, y, 5, 5).data.some((v, i) => i % 4 === 3 && v > 128); \
             }}); }})()",
            json!(points)
        ),
    );
    reply.as_array().expect("a list").iter().map(|painted| painted == true).collect()
}

/// Checks that every reading has a mark at its range, and that a click on the mark selects it.
fn check_marks(browser: &Browser, scan: &Value) {
    let readings = scan["pings"].as_array().expect("readings");
    let echoes: Vec<(&Value, Point)> =
        readings.iter().filter_map(|reading| Some((reading, end(reading)?))).collect();
    assert!(echoes.len() > 5, "{} readings", echoes.len());
    let ends: Vec<Point> = echoes.iter().map(|(_, at)| *at).collect();
    for ((reading, _), drawn) in echoes.iter().zip(painted(browser, "marks", &ends)) {
        assert!(drawn, "nothing is drawn at the end of {reading}");
    }
    let size = browser.eval("[document.getElementById('stage').clientWidth, document.getElementById('stage').clientHeight]");
    let [width, height] = point(&size);
    // Picks a mark without others nearby.
    let at = pixels(browser, &ends);
    let isolated = |i: &usize| {
        let inside = at[*i][0] > 30.0 && at[*i][1] > 30.0 && at[*i][0] < width - 30.0;
        inside && (0..at.len()).all(|j| j == *i || distance(at[*i], at[j]) > 30.0)
    };
    let chosen = (0..at.len()).rev().find(isolated).expect("an isolated mark");
    browser.click_at("#over", at[chosen][0] / width, at[chosen][1] / height);
    let now = browser.text("#beam-label");
    let beam = format!("beam {}", echoes[chosen].0["index"]);
    assert!(now.starts_with(&format!("{beam},")), "{now} and not {beam}");
}

/// Checks that a beam's propagation path is drawn, starts and ends at the transducer, and is twice
/// the range long.
fn check_path(browser: &Browser, reading: &Value) {
    browser.eval(&format!(
        "(() => {{ const s = document.getElementById('beam'); s.value = {}; \
         s.dispatchEvent(new Event('input')); }})()",
        reading["index"]
    ));
    browser.until("document.querySelectorAll('.peaks [aria-pressed=true]').length === 1");
    let path: Vec<Point> =
        eval_plan(browser, "plan.path").as_array().expect("a path").iter().map(point).collect();
    for terminal in [path[0], path[path.len() - 1]] {
        let off_m = distance(terminal, place(reading));
        assert!(off_m < 1e-9, "{terminal:?} is not the viewpoint of {reading}");
    }
    let length_m: f64 = path.windows(2).map(|leg| distance(leg[0], leg[1])).sum();
    let late_m = reading["range_m"].as_f64().expect("a range") - length_m / 2.0;
    assert!(late_m.abs() < 1e-3, "{reading}: {late_m} m beyond its path");
    let along: Vec<Point> = path
        .windows(2)
        .map(|leg| [0, 1].map(|axis| 0.7 * leg[0][axis] + 0.3 * leg[1][axis]))
        .collect();
    assert!(painted(browser, "over", &along).into_iter().all(|drawn| drawn), "{path:?}");
    // The ray starts at the transducer.
    let [x_m, y_m] = place(reading);
    let direction_deg = reading["viewpoint"]["direction_deg"].as_f64().expect("a direction");
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    let scale = eval_plan(browser, "plan.view.scale").as_f64().expect("pixels per metre");
    let on_ray = |pixels: f64| [x_m + pixels / scale * cos, y_m + pixels / scale * sin];
    // At least one of several points of a dashed line is painted.
    let drawn = painted(browser, "over", &[on_ray(40.0), on_ray(44.0), on_ray(48.0)]);
    assert!(drawn.contains(&true), "no ray from {x_m}, {y_m}");
}

fn with_range(scan: &Value) -> impl Iterator<Item = &Value> {
    scan["pings"].as_array().expect("readings").iter().filter(|ping| ping["range_m"].is_f64())
}

#[test]
fn array_readings_start_at_sonars() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start_array(folder.path(), &FAN);
    daemon.wait_for_scans(1);
    let browser = Browser::open(&daemon.address(), DESK);
    let scan = show_log(&daemon, &browser, "");
    check_marks(&browser, &scan);
    let places: Vec<Point> =
        scan["pings"].as_array().expect("readings").iter().map(place).collect();
    assert!(painted(&browser, "marks", &places).into_iter().all(|drawn| drawn), "eight faces");
    for reading in with_range(&scan).take(4) {
        check_path(&browser, reading);
    }
    assert!(browser.text("#beam-label").contains(", s"), "the sonar is named");
}

#[test]
fn offset_transducer() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = ["--set", "plan.step_deg=18", "--set", "model.max_range_m=4"];
    let daemon = start_ahead(folder.path(), &[&plan[..], &CONE].concat());
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    let browser = Browser::open(&daemon.address(), DESK);
    let scan = show_log(&daemon, &browser, "");
    check_marks(&browser, &scan);
    for reading in with_range(&scan).take(4) {
        check_path(&browser, reading);
    }
}

#[test]
fn readings_of_a_moving_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    write_turned_ring(folder.path());
    let daemon = start_array(folder.path(), &FAN);
    daemon.wait_for_scans(1);
    let browser = Browser::open(&daemon.address(), DESK);
    let scan = show_log(&daemon, &browser, "20260101");
    let moved = scan["pings"].as_array().expect("readings").iter();
    assert_eq!(moved.filter(|ping| ping["pose"].is_object()).count(), 24, "two rounds of three");
    check_marks(&browser, &scan);
}

/// Residuals of an array have a column per ranger, in their order; a ranger without a prediction
/// has no mark.
#[test]
fn residuals_are_shown_per_ranger() {
    let folder = tempfile::tempdir().expect("a folder");
    write_displaced_array(folder.path());
    let daemon = start_array(folder.path(), &FAN);
    daemon.wait_for_scans(1);
    let browser = Browser::open(&daemon.address(), DESK);
    let scan = show_log(&daemon, &browser, "20260102");
    let readings = scan["pings"].as_array().expect("readings");
    assert_eq!(readings.len(), 8);
    assert!(browser.text("#residuals .head p").contains("vs ranger"));
    let heights = residual_heights(&browser, readings.len());
    let mut shown: Vec<(f64, f64)> = Vec::new();
    for (reading, height) in readings.iter().zip(&heights) {
        let residual_m = reading["residual_m"].as_f64();
        assert_eq!(residual_m.is_some(), height.is_some(), "{reading}: {heights:?}");
        shown.extend(residual_m.zip(*height));
    }
    assert!(shown.len() > 5 && shown.len() < 8, "{} rangers have a residual", shown.len());
    // A larger residual is drawn higher, unless both are clipped.
    shown.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(shown.windows(2).all(|pair| pair[0].1 >= pair[1].1), "{shown:?}");
    assert!(shown[0].1 - shown[shown.len() - 1].1 > 30.0, "{shown:?}");
    // A click on a column selects its ranger's reading.
    for (index, reading) in readings.iter().enumerate() {
        browser.click_at("#strip", column(&browser, index, readings.len()), 0.5);
        let ranger = reading["ranger"].as_str().expect("a name");
        let label = browser.text("#beam-label");
        assert!(label.starts_with(&format!("beam {index}, {ranger}")), "{label}");
    }
}

/// Middle of a ranger's column of the residuals, as a fraction of the canvas; the margins are 46
/// and 10 pixels.
fn column(browser: &Browser, index: usize, rangers: usize) -> f64 {
    let width = browser.eval("document.getElementById('strip').clientWidth");
    let width = width.as_f64().expect("a number");
    (46.0 + (index as f64 + 0.5) / rangers as f64 * (width - 56.0)) / width
}

/// Mean height of the dark or coloured pixels, as of marks, in each ranger's column of the
/// residuals, pixels from the top; `None` without such pixels.
fn residual_heights(browser: &Browser, rangers: usize) -> Vec<Option<f64>> {
    browser.until_drawn();
    let middles: Vec<f64> = (0..rangers).map(|index| column(browser, index, rangers)).collect();
    let heights = browser.eval(&format!(
        "(() => {{ const c = document.getElementById('strip'); \
         const copy = new OffscreenCanvas(c.width, c.height); \
         const c2d = copy.getContext('2d', {{willReadFrequently: true}}); c2d.drawImage(c, 0, 0); \
         return {}.map((middle) => {{ \
           const {{data}} = c2d.getImageData(Math.round(middle * c.width) - 6, 0, 12, c.height - 20); \
           let [sum, count] = [0, 0]; \
           for (let i = 0; i < data.length; i += 4) {{ \
             const [most, least] = [Math.max, Math.min].map((of) => of(...data.slice(i, i + 3))); \
             if (data[i + 3] < 120 || (most > 110 && most - least < 60)) continue; \
             sum += Math.floor(i / 48); count++; }} \
           return count ? sum / count : null; }}); }})()",
        json!(middles)
    ));
    heights.as_array().expect("heights").iter().map(Value::as_f64).collect()
}

/// Writes a log of an array whose predictions are from a pose 4 cm away.
fn write_displaced_array(folder: &Path) {
    let scene = ["--scene", "mcgill-lab", "--pose"];
    write_predicted_log(
        folder,
        &[&scene[..], &["fig4", "--array", "pioneer-8"]].concat(),
        &[&scene[..], &["3.44,1.46,2"]].concat(),
    );
}

/// Writes a log of a ring of twelve sonars that is turned in place and fired three times.
fn write_turned_ring(folder: &Path) {
    let log = folder.join("log");
    fs::create_dir_all(&log).expect("there is room");
    let log = log.join("sonard-20260101T000000Z.jsonl");
    let ring = ["simulate", "--array", "ring-12", "--rounds", "3", "--scene", "two-surface-room"];
    let further =
        ["--pose", "1.2,1,30", "--max-range", "4", "--output", log.to_str().expect("plain")];
    let output = run(&[&ring[..], &further].concat());
    assert!(output.status.success(), "{}", stderr(&output));
}
