//! Accessibility: names for screen readers, contrast, small screens, light and dark scheme.

use super::{assert_clean, open, set, wait_until_idle};
use crate::live_page::{
    accessible::{axe, nameless},
    browser::{Browser, DESK, DESK_DARK, PHONE, PHONE_DARK},
};

#[test]
fn playground_is_accessible() {
    let browser = open(DESK);
    // The last step of the tour, with the pulse on its way.
    while browser.text("#tour-next") == "Next" {
        browser.click("#tour-next");
        wait_until_idle(&browser);
    }
    browser.until("!document.getElementById('pulse-play').disabled");
    browser.eval("playground.pulse.goTo(3000)");
    set(&browser, "compare", "true");
    browser.click("#edit");
    check_screens(&browser, "playground-all", wait_until_idle);
}

/// Checks a page on large and small screens, light and dark; takes pictures named after `page`.
pub(super) fn check_screens(browser: &Browser, page: &str, wait_until_idle: impl Fn(&Browser)) {
    for screen in [DESK, DESK_DARK, PHONE, PHONE_DARK] {
        browser.look_through(screen);
        browser.eval("scrollTo(0, 0)");
        browser.until("new Promise((done) => setTimeout(() => done(true), 300))");
        wait_until_idle(browser);
        browser.picture(&format!("{page}-{}", screen.name));
        let wide = browser.eval("document.documentElement.scrollWidth");
        assert_eq!(wide, browser.eval("innerWidth"), "{}: horizontal scrolling", screen.name);
        assert_eq!(nameless(browser), Vec::<String>::new(), "{}", screen.name);
        // axe-core requests the style sheets, which the policy blocks.
        assert_clean(browser);
        assert_eq!(axe(browser), Vec::<String>::new(), "{}", screen.name);
        browser.warnings();
    }
}
