//! For everybody: names for screen readers, contrast, small screens, light and dark.

use super::{assert_clean, open, set, settled};
use crate::live_page::{
    accessible::{axe, nameless},
    browser::{DESK, DESK_DARK, PHONE, PHONE_DARK},
};

#[test]
fn everything_has_a_name_and_fits_on_desk_and_phone_in_light_and_dark() {
    let browser = open(DESK);
    set(&browser, "compare", "true");
    browser.click("#edit");
    for screen in [DESK, DESK_DARK, PHONE, PHONE_DARK] {
        browser.look_through(screen);
        browser.eval("scrollTo(0, 0)");
        browser.until("new Promise((done) => setTimeout(() => done(true), 300))");
        settled(&browser);
        browser.picture(&format!("playground-all-{}", screen.name));
        let wide = browser.eval("document.documentElement.scrollWidth");
        assert_eq!(wide, browser.eval("innerWidth"), "{}: it scrolls sideways", screen.name);
        assert_eq!(nameless(&browser), Vec::<String>::new(), "{}", screen.name);
        // axe-core itself asks for the style sheets, which the policy refuses.
        assert_clean(&browser);
        assert_eq!(axe(&browser), Vec::<String>::new(), "{}", screen.name);
        browser.complaints();
    }
}
