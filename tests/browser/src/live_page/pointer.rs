//! Mouse and touch input.

use serde_json::json;

use super::browser::Browser;

/// Point on the page, pixels.
pub(crate) type Place = [f64; 2];

/// Point at a fraction of an element's width and height, after scrolling it into view.
pub(crate) fn place(browser: &Browser, selector: &str, across: f64, down: f64) -> Place {
    let at = browser.eval(&format!(
        "(() => {{ const e = document.querySelector('{selector}'); \
         e.scrollIntoView({{block: 'center'}}); const r = e.getBoundingClientRect(); \
         return [r.left + {across} * r.width, r.top + {down} * r.height]; }})()"
    ));
    [0, 1].map(|axis| at[axis].as_f64().expect("a number"))
}

/// Turns the wheel; negative values scroll up.
pub(crate) fn wheel(browser: &Browser, [x, y]: Place, by: f64) {
    let event = json!({"type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": by});
    browser.devtools("Input.dispatchMouseEvent", &event);
}

pub(crate) fn click(browser: &Browser, at: Place) {
    drag(browser, at, at);
}

/// Drags with the left mouse button.
pub(crate) fn drag(browser: &Browser, from: Place, to: Place) {
    let middle = [0, 1].map(|axis| (from[axis] + to[axis]) / 2.0);
    for (kind, [x, y]) in [
        ("mouseMoved", from),
        ("mousePressed", from),
        ("mouseMoved", middle),
        ("mouseMoved", to),
        ("mouseReleased", to),
    ] {
        let buttons = i32::from(kind != "mouseReleased");
        let event = json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": buttons,
                           "clickCount": 1});
        browser.devtools("Input.dispatchMouseEvent", &event);
    }
}

/// Moves several fingers at once, each from one point to another.
pub(crate) fn touch(browser: &Browser, fingers: &[[Place; 2]]) {
    for (kind, share) in [("touchStart", 0.0), ("touchMove", 0.5), ("touchMove", 1.0)] {
        let along = |[from, to]: &[Place; 2]| {
            let [x, y] = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            json!({"x": x, "y": y})
        };
        let points: Vec<_> = fingers.iter().map(along).collect();
        browser.devtools("Input.dispatchTouchEvent", &json!({"type": kind, "touchPoints": points}));
    }
    browser.devtools("Input.dispatchTouchEvent", &json!({"type": "touchEnd", "touchPoints": []}));
}
