//! Pictures for the documentation.

use super::{assert_clean, open, set, settled};
use crate::live_page::browser::{DESK, PHONE_DARK, Screen};

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
