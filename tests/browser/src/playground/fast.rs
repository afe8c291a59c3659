//! Measurements of drawing time, memory and idle CPU time.

use std::time::Duration;

use serde_json::{Value, json};

use super::{eval_json, open, set};
use crate::live_page::browser::{Browser, DESK};

/// Number of timed moves of the ranger.
const MOVES: usize = 200;

#[test]
#[ignore = "prints measurements"]
fn measure_drawing_and_memory() {
    let browser = open(DESK);
    set(&browser, "scene", "simple-room");
    let before = memory(&browser);
    let (mut times, after) = (move_about(&browser), memory(&browser));
    times.sort_by(f64::total_cmp);
    let (median, p95) = (times[MOVES / 2], times[MOVES * 95 / 100]);
    println!(
        "400 beams in simple-room, from move to picture: median {median:.1} ms, 95th percentile {p95:.1} ms"
    );
    println!(
        "page heap and model memory before and after {MOVES} sweeps: {before:?}, {after:?} bytes"
    );
    // An idle page uses no CPU time.
    let busy_s = |browser: &Browser| {
        let metrics = browser.devtools("Performance.getMetrics", &json!({}));
        let metrics = metrics["metrics"].as_array().expect("metrics").clone();
        let task = metrics.iter().find(|metric| metric["name"] == "TaskDuration");
        task.and_then(|metric| metric["value"].as_f64()).expect("a duration")
    };
    browser.devtools("Performance.enable", &json!({}));
    let before_s = busy_s(&browser);
    std::thread::sleep(Duration::from_secs(2));
    let idle_s = busy_s(&browser) - before_s;
    println!("busy for {:.1} % while idle", 50.0 * idle_s);
}

/// Time of each picture, milliseconds.
fn move_about(browser: &Browser) -> Vec<f64> {
    let times = eval_json(
        browser,
        &format!(
            "(async () => {{ const {{times_ms, change, idle}} = playground; \
             const frame = () => new Promise((done) => requestAnimationFrame(done)); \
             for (let i = 0; i < {MOVES}; i++) {{ \
               const at = 0.3 + 0.2 * Math.sin(0.05 * i); \
               change({{pose: {{x_m: at, y_m: 0.35 + 0.1 * Math.cos(0.05 * i), heading_deg: i}}}}, true); \
               do {{ await frame(); }} while (!idle()); }} \
             return times_ms.slice(-{MOVES}); }})()"
        ),
    );
    let times: Vec<f64> =
        times.as_array().expect("times").iter().filter_map(Value::as_f64).collect();
    assert_eq!(times.len(), MOVES);
    times
}

/// Heap of the page and memory of the model, bytes.
fn memory(browser: &Browser) -> [f64; 2] {
    browser.devtools("HeapProfiler.collectGarbage", &json!({}));
    let heap = browser.devtools("Runtime.getHeapUsage", &json!({}));
    let model = eval_json(browser, "playground.request({kind: 'memory'})");
    [&heap["usedSize"], &model["bytes"]].map(|bytes| bytes.as_f64().expect("a number"))
}
