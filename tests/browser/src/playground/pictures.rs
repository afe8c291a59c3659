//! Pictures for the documentation.

use std::{fs, path::Path};

use super::{animated, assert_clean, eval_json, open, set, wait_until_idle};
use crate::live_page::browser::{DESK, PHONE_DARK, Screen};

/// Minimum width with two columns, of which the left one is recorded.
const NARROW: Screen = Screen { name: "narrow", size: (940, 900), phone: false, dark: false };
/// Number and interval of the animation's frames.
const FRAMES: u32 = 36;
const FRAME_MS: u16 = 130;
/// Maximum size of the animation in README.md.
const MAX_BYTES: u64 = 600_000;

const DESK_WIDE: Screen = Screen { name: "desk", size: (1280, 1010), phone: false, dark: false };

#[test]
fn desk_phone_and_engines() {
    let browser = open(DESK_WIDE);
    browser.click("#tour-next");
    wait_until_idle(&browser);
    browser.until("document.getElementById('summary').textContent.includes('400 beams with')");
    browser.picture("playground-desk");
    browser.look_through(PHONE_DARK);
    browser.until("new Promise((done) => setTimeout(() => done(true), 400))");
    browser.picture("playground-phone");
    browser.look_through(DESK);
    set(&browser, "compare", "true");
    browser.eval("document.querySelector('.engines').scrollIntoView({block: 'end'})");
    browser.until("new Promise((done) => setTimeout(() => done(true), 400))");
    browser.picture("playground-engines");
    assert_clean(&browser);
}

/// Moves the ranger away from the near wall until it detects the wall directly.
#[test]
fn false_wall_animation() {
    let browser = open(NARROW);
    browser.click("#tour-next");
    wait_until_idle(&browser);
    let mut frames = Vec::new();
    for frame in 0..=FRAMES {
        let share = f64::from(frame) / f64::from(FRAMES);
        let pose = format!(
            "{{x_m: {}, y_m: {}, heading_deg: 0}}",
            0.774 - 0.25 * share,
            0.085 + 0.45 * share
        );
        eval_json(&browser, &format!("playground.change({{pose: {pose}}}, true)"));
        wait_until_idle(&browser);
        if frame == 0 || frame == FRAMES {
            // The summary follows after a delay.
            browser.until("new Promise((done) => setTimeout(() => done(true), 600))");
        }
        browser.until_drawn();
        let duration_ms = if frame == 0 || frame == FRAMES { 1800 } else { FRAME_MS };
        frames.push((browser.picture_of(".floor"), duration_ms));
    }
    let first = eval_json(&browser, "playground.scan().beams.get(300).range_m").as_f64();
    assert!(
        first.is_some_and(|range_m| (range_m - 0.535).abs() < 0.01),
        "{first:?}: the near wall"
    );
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("page/playground.png");
    animated::write(&file, &frames);
    let bytes = fs::metadata(&file).expect("the animation").len();
    println!("{}: {} frames, {bytes} bytes", file.display(), frames.len());
    assert!(bytes < MAX_BYTES, "{bytes} bytes");
    assert_clean(&browser);
}
