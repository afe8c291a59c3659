//! Large scans and many scans, and figures of drawing time, memory and CPU time (`figures_`).

use serde_json::{Value, json};

use super::{
    assert_clean,
    browser::{Browser, DESK},
    daemon,
};
use sonard_test_support::daemon::write_scans;

/// Redraws that are timed.
const TIMES: usize = 200;

/// Milliseconds from a gesture to the frame that shows it, sorted.
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

/// Milliseconds that drawing everything takes by itself, sorted.
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
#[ignore = "prints figures"]
fn figures_of_drawing_and_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 400);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('which').textContent.includes('400 of 400')");
    let (drawing, frames) = (redraws(&browser, TIMES), gestures(&browser, TIMES));
    println!(
        "400 beams: drawn in {:.1} ms (95th percentile; median {:.1} ms), from a gesture to its frame {:.1} ms",
        p95(&drawing),
        drawing[TIMES / 2],
        p95(&frames)
    );
    // The time line's row of all beams is open: it keeps most.
    browser.eval("document.getElementById('over-time').open = true");
    sweep(&browser, 220);
    let before = heap(&browser);
    sweep(&browser, 200);
    let after = heap(&browser);
    println!("heap before and after 200 sweeps of 400 beams: {before} and {after} bytes");
    assert_clean(&browser);
}

/// Lets the page take in sweeps, as its stream brings them.
fn sweep(browser: &Browser, count: usize) {
    browser.eval(&format!(
        "import('/page/main.js').then(async ({{plan, take}}) => {{ \
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
fn the_page_stays_usable_with_65535_beams_and_with_10000_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 65_535);
    let (many, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('which').textContent.includes('65535 of 65535')");
    let (drawing, frames) = (redraws(&browser, 10), gestures(&browser, 50));
    println!(
        "65,535 beams: drawn in {:.0} ms, from a gesture to its frame {:.1} ms (95th percentile)",
        p95(&drawing),
        p95(&frames)
    );
    browser.click_at("#over", 0.5, 0.3);
    assert!(browser.text("#beam-now").starts_with("beam "), "{}", browser.text("#beam-now"));
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
    println!("10,000 scans: all of the time line in {took_ms} ms");
    assert_eq!(browser.eval("document.getElementById('scrub').max"), "9999");
    assert_clean(&browser);
}

/// Seconds for which the page's work is added up.
const WATCHED_S: f64 = 5.0;

#[test]
#[ignore = "prints figures"]
fn figures_of_cpu() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 400);
    let (_daemon, address) = daemon(folder.path(), "127.0.0.1:0", &[]);
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('which').textContent.includes('400 of 400')");
    browser.devtools("Performance.enable", &json!({}));
    let idle = share_of_a_core(&browser, "setTimeout(done, wait_ms)");
    // As many as an ordinary ranger brings, and as many as a fast one to a metre.
    let [usual, fast] = [25, 200].map(|rate| {
        let feed = format!(
            "import('/page/main.js').then(({{plan, take}}) => {{ \
               const {{start, beams}} = plan.scan; const pings = [...beams.values()]; \
               const scan = crypto.randomUUID(); let told = 0; const began = performance.now(); \
               take({{...start, type: 'scan_start', scan, time: new Date().toISOString()}}); \
               const tell = () => {{ \
                 const passed_ms = performance.now() - began; \
                 while (told < {rate} * passed_ms / 1000) \
                   take({{...pings[told++ % pings.length], type: 'ping', scan}}); \
                 if (passed_ms < wait_ms) setTimeout(tell, 5); else done(told); }}; \
               tell(); }})"
        );
        share_of_a_core(&browser, &feed)
    });
    println!(
        "the page takes {:.1} % of a core at rest, {:.0} % at 25 readings a second, {:.0} % at 200",
        100.0 * idle,
        100.0 * usual,
        100.0 * fast
    );
    assert_clean(&browser);
}

/// The page's work while a script runs that ends `wait_ms` later by `done`: tasks of its main thread over the time that
/// passed.
fn share_of_a_core(browser: &Browser, script: &str) -> f64 {
    let before = metrics(browser);
    let wait_ms = 1e3 * WATCHED_S;
    browser.eval(&format!("new Promise((done) => {{ const wait_ms = {wait_ms}; {script}; }})"));
    let after = metrics(browser);
    (after[0] - before[0]) / (after[1] - before[1])
}

/// Seconds of work, and of the clock.
fn metrics(browser: &Browser) -> [f64; 2] {
    let told = browser.devtools("Performance.getMetrics", &json!({}));
    let of = |name: &str| {
        let metrics = told["metrics"].as_array().expect("metrics");
        let found = metrics.iter().find(|metric| metric["name"] == name);
        found.and_then(|metric| metric["value"].as_f64()).expect("a number")
    };
    ["TaskDuration", "Timestamp"].map(of)
}
