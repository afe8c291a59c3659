//! Tests of the fleet page.

use super::{
    accessible::axe,
    assert_clean,
    browser::{Browser, DESK, DESK_DARK, PHONE, PHONE_DARK},
};
use sonard_test_support::{fleet::Fleet, wait_until};

#[test]
fn cards_show_state_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut fleet = Fleet::start(folder.path());
    let address = fleet.asking.address();
    let browser = Browser::open(&address, DESK);
    browser.until("document.getElementById('link').textContent === 'ready'");
    assert_eq!(browser.eval("document.getElementById('fleet').hidden"), false);
    browser.click("#fleet");
    browser.until("document.getElementById('summary').textContent === '3 of 3 healthy'");
    browser.until("document.querySelectorAll('#robots canvas:not([hidden])').length === 3");
    let names =
        "[...document.querySelectorAll('#robots h2')].map((title) => title.textContent).join()";
    assert_eq!(browser.eval(names), "kiwi,mango,lime");
    let lime = format!("http://{}/", fleet.robots[2].as_ref().expect("it runs").address());
    assert_eq!(browser.eval("document.querySelector('#robots li:last-child a').href"), *lime);
    let label = browser.eval("document.querySelector('#robots canvas').ariaLabel");
    assert!(label.as_str().is_some_and(|label| label.contains("last scan of kiwi")), "{label}");
    assert!(drawn(&browser) > 500, "{} points", drawn(&browser));

    fleet.rig.unplug();
    let state = "document.querySelector('#robots li:nth-child(1) .state').textContent";
    let lamp = "document.querySelector('#robots li:nth-child(1)').dataset.lamp";
    wait_until("the unplugged one on the page", || browser.eval(lamp) == "bad");
    let text = browser.eval(state);
    assert!(text.as_str().is_some_and(|text| text.contains("since")), "{text}");
    fleet.robots[1].take().expect("it runs").kill();
    let summary = "document.getElementById('summary').textContent";
    wait_until("the killed one on the page", || {
        browser.eval(summary).as_str().is_some_and(|text| text.contains("offline: mango"))
    });

    for screen in [DESK, DESK_DARK, PHONE, PHONE_DARK] {
        browser.look_through(screen);
        browser.until("new Promise((done) => setTimeout(() => done(true), 300))");
        browser.picture(&format!("fleet-{}", screen.name));
        let [wide, window] = ["document.documentElement.scrollWidth", "innerWidth"];
        assert_eq!(
            browser.eval(wide),
            browser.eval(window),
            "{}: horizontal scrolling",
            screen.name
        );
        assert_eq!(axe(&browser), Vec::<String>::new(), "{}", screen.name);
    }
    assert_clean(&browser);
}

/// Number of painted pixels of the last robot's floor plan.
fn drawn(browser: &Browser) -> u64 {
    let count = browser.eval(
        "(() => { const c = document.querySelector('#robots li:last-child canvas'); \
         const copy = new OffscreenCanvas(c.width, c.height).getContext('2d'); \
         copy.drawImage(c, 0, 0); \
         const d = copy.getImageData(0, 0, c.width, c.height).data; \
         let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 128; return n; })()",
    );
    count.as_u64().expect("a number")
}
