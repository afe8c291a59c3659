//! Performance with large scans and many scans; measurements of drawing time, memory and CPU time.

use serde_json::{Value, json};

use super::{
    assert_clean,
    browser::{Browser, DESK},
    daemon,
};
use sonard_test_support::daemon::write_scans;

/// Number of timed redraws.
const TIMES: usize = 200;

/// Times from a gesture to its frame, milliseconds, sorted.
fn gestures(browser: &Browser, count: usize) -> Vec<f64> {
    let script = format!(
        "import('/page/main.js').then(async ({{plan}}) => {{ \
           const frame = () => new Promise((done) => requestAnimationFrame(done)); const times = []; \
           for (let i = 0; i < {count}; i++) {{ \
             plan.view.pan(3 * Math.sin(i), 0); plan.view.zoom(1 + 0.02 * Math.cos(i), [300, 200]); \
             await frame(); const began = performance.now(); plan.moveView(); \
             await frame(); times.push(performance.now() - began); }} \
           return times; }})"
    );
    let times = browser.eval(&script);
    let mut times: Vec<f64> =
        times.as_array().expect("times").iter().filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// Times of full redraws, milliseconds, sorted.
fn redraws(browser: &Browser, count: usize) -> Vec<f64> {
    let times = browser.eval(&format!(
        "import('/page/main.js').then(({{plan}}) => Array.from({{length: {count}}}, () => {{ \
           const began = performance.now(); plan.redraw(); return performance.now() - began; }}))"
    ));
    let mut times: Vec<f64> =
        times.as_array().expect("times").iter().filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    times
}

fn p95(sorted: &[f64]) -> f64 {
    sorted[sorted.len() * 95 / 100]
}

#[test]
#[ignore = "prints measurements"]
fn measure_drawing_and_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 400);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('scan-label').textContent.includes('400 of 400')");
    let (drawing, frames) = (redraws(&browser, TIMES), gestures(&browser, TIMES));
    println!(
        "400 beams: drawn in {:.1} ms (95th percentile; median {:.1} ms), from a gesture to its frame {:.1} ms",
        p95(&drawing),
        drawing[TIMES / 2],
        p95(&frames)
    );
    // The section of scans over time stores the most data.
    browser.eval("document.getElementById('over-time').open = true");
    // Until then functions are compiled, whose code is on the heap, too.
    (0..8).for_each(|_| sweep(&browser, 100));
    let before = heap(&browser);
    sweep(&browser, 200);
    let after = heap(&browser);
    println!("heap before and after 200 sweeps of 400 beams: {before} and {after} bytes");
    assert_clean(&browser);
}

/// Feeds scans to the page as records of its stream.
fn sweep(browser: &Browser, count: usize) {
    browser.eval(&format!(
        "import('/page/main.js').then(async ({{plan, handleRecord: take}}) => {{ \
           const {{start, beams}} = plan.scan; const pings = [...beams.values()]; \
           for (let i = 0; i < {count}; i++) {{ \
             const scan = crypto.randomUUID(); const time = new Date().toISOString(); \
             take({{...start, type: 'scan_start', scan, time}}); \
             for (const ping of pings) take({{...ping, type: 'ping', scan}}); \
             take({{type: 'scan_end', scan, time, beams: pings.length, missing: 0, duration_s: 1}}); \
             await new Promise((done) => requestAnimationFrame(done)); }} }})"
    ));
}

fn heap(browser: &Browser) -> f64 {
    browser.devtools("HeapProfiler.collectGarbage", &json!({}));
    let heap = browser.devtools("Runtime.getHeapUsage", &json!({}));
    heap["usedSize"].as_f64().expect("a number")
}

#[test]
fn large_scans_and_many_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 65_535);
    let (many, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('scan-label').textContent.includes('65535 of 65535')");
    let (drawing, frames) = (redraws(&browser, 10), gestures(&browser, 50));
    println!(
        "65,535 beams: drawn in {:.0} ms, from a gesture to its frame {:.1} ms (95th percentile)",
        p95(&drawing),
        p95(&frames)
    );
    // Ranges spread over the plan, so that few marks have the same pixel.
    let svg = browser.eval(
        "Promise.all(['main', 'picture'].map((name) => import(`/page/${name}.js`))).then(([{plan}, {renderSvg}]) => { \
         for (const ping of plan.scan.beams.values()) ping.range_m = 0.3 + 1.5 * ((0.618034 * ping.index) % 1); \
         plan.redraw(); return renderSvg(plan, {title: 'large', about: '', badge: undefined, counts: plan.scan.counts}).size; })",
    );
    println!("65,535 beams: SVG of {svg} bytes");
    assert!(svg.as_u64().is_some_and(|bytes| bytes < 3_000_000), "{svg} bytes");
    browser.click_at("#over", 0.5, 0.3);
    assert!(browser.text("#beam-label").starts_with("beam "), "{}", browser.text("#beam-label"));
    drop((browser, many));
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 10_000, 4);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('scrub').max === '49'");
    let took_ms = browser.eval(
        "(async () => { const began = performance.now(); const older = document.getElementById('older'); \
         const line = document.getElementById('scrub'); \
         while (!older.disabled) { const before = line.max; older.click(); \
           while (line.max === before) await new Promise((done) => setTimeout(done, 5)); } \
         return performance.now() - began; })()",
    );
    println!("10,000 scans: whole time line in {took_ms} ms");
    assert_eq!(browser.eval("document.getElementById('scrub').max"), "9999");
    assert_clean(&browser);
}

/// Duration of a CPU time measurement.
const MEASURED_S: f64 = 5.0;

#[test]
#[ignore = "prints measurements"]
fn measure_cpu_time() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 400);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('scan-label').textContent.includes('400 of 400')");
    browser.devtools("Performance.enable", &json!({}));
    let idle = share_of_a_core(&browser, "setTimeout(done, wait_ms)");
    // Rates of a typical ranger, and of a fast one limited to a metre.
    let [typical, fast] = [25, 200].map(|rate| {
        let feed = format!(
            "import('/page/main.js').then(({{plan, handleRecord: take}}) => {{ \
               const {{start, beams}} = plan.scan; const pings = [...beams.values()]; \
               const scan = crypto.randomUUID(); let sent = 0; const began = performance.now(); \
               take({{...start, type: 'scan_start', scan, time: new Date().toISOString()}}); \
               const send = () => {{ \
                 const passed_ms = performance.now() - began; \
                 while (sent < {rate} * passed_ms / 1000) \
                   take({{...pings[sent++ % pings.length], type: 'ping', scan}}); \
                 if (passed_ms < wait_ms) setTimeout(send, 5); else done(sent); }}; \
               send(); }})"
        );
        share_of_a_core(&browser, &feed)
    });
    println!(
        "CPU time of the page: {:.1} % of a core idle, {:.0} % at 25 readings/s, {:.0} % at 200",
        100.0 * idle,
        100.0 * typical,
        100.0 * fast
    );
    assert_clean(&browser);
}

/// Share of time that the main thread is busy while a script runs, which calls `done` after
/// `wait_ms`.
fn share_of_a_core(browser: &Browser, script: &str) -> f64 {
    let before = metrics(browser);
    let wait_ms = 1e3 * MEASURED_S;
    browser.eval(&format!("new Promise((done) => {{ const wait_ms = {wait_ms}; {script}; }})"));
    let after = metrics(browser);
    (after[0] - before[0]) / (after[1] - before[1])
}

/// Busy time and clock, seconds.
fn metrics(browser: &Browser) -> [f64; 2] {
    let reply = browser.devtools("Performance.getMetrics", &json!({}));
    let value_of = |name: &str| {
        let metrics = reply["metrics"].as_array().expect("metrics");
        let found = metrics.iter().find(|metric| metric["name"] == name);
        found.and_then(|metric| metric["value"].as_f64()).expect("a number")
    };
    ["TaskDuration", "Timestamp"].map(value_of)
}
