//! Pictures for the documentation.

use std::{fs, path::Path};

use super::{animated, assert_clean, open, set, settled, told};
use crate::live_page::browser::{DESK, PHONE_DARK, Screen};

/// Wide enough for two columns, of which the left one is shown.
const NARROW: Screen = Screen { name: "narrow", size: (940, 900), phone: false, dark: false };
/// Frames of the animated picture, and how far apart they are.
const FRAMES: u32 = 36;
const FRAME_MS: u16 = 130;
/// What README.md may load for it, bytes.
const MOST_BYTES: u64 = 600_000;

const DESK_WIDE: Screen = Screen { name: "desk", size: (1280, 1010), phone: false, dark: false };

#[test]
fn pictures_of_desk_phone_and_engines_are_made() {
    let browser = open(DESK_WIDE);
    browser.click("#tour-next");
    settled(&browser);
    browser.until("document.getElementById('summary').textContent.includes('all 400')");
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

/// The ranger is drawn away from the near wall, until it hears it.
#[test]
fn an_animated_picture_of_the_false_wall_is_made() {
    let browser = open(NARROW);
    browser.click("#tour-next");
    settled(&browser);
    let mut frames = Vec::new();
    for frame in 0..=FRAMES {
        let share = f64::from(frame) / f64::from(FRAMES);
        let pose = format!(
            "{{x_m: {}, y_m: {}, heading_deg: 0}}",
            0.774 - 0.25 * share,
            0.085 + 0.45 * share
        );
        told(&browser, &format!("playground.change({{pose: {pose}}}, true)"));
        settled(&browser);
        if frame == 0 || frame == FRAMES {
            // What is said once it rests.
            browser.until("new Promise((done) => setTimeout(() => done(true), 600))");
        }
        browser.until_drawn();
        let stands_ms = if frame == 0 || frame == FRAMES { 1800 } else { FRAME_MS };
        frames.push((browser.picture_of(".floor"), stands_ms));
    }
    let first = told(&browser, "playground.scan().beams.get(300).range_m").as_f64();
    assert!(
        first.is_some_and(|range_m| (range_m - 0.535).abs() < 0.01),
        "{first:?}: the near wall"
    );
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("page/playground.png");
    animated::write(&file, &frames);
    let bytes = fs::metadata(&file).expect("it was made").len();
    println!("{}: {} frames, {bytes} bytes", file.display(), frames.len());
    assert!(bytes < MOST_BYTES, "{bytes} bytes");
    assert_clean(&browser);
}
