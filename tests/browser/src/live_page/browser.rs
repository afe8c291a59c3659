//! Headless Chromium, driven through WebDriver.

use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use fantoccini::{
    Client, ClientBuilder, Locator, elements::Element, wd::WebDriverCompatibleCommand,
};
use http::Method;
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};
use tokio::runtime::Runtime;

/// Allows one browser at a time, because each needs a processor.
static EXCLUSIVE: Mutex<()> = Mutex::new(());

/// Size and colour scheme of a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Screen {
    pub(crate) name: &'static str,
    pub(crate) size: (u32, u32),
    pub(crate) phone: bool,
    pub(crate) dark: bool,
}

pub(crate) const DESK: Screen =
    Screen { name: "desk", size: (1280, 900), phone: false, dark: false };
pub(crate) const DESK_DARK: Screen = Screen { name: "desk-dark", dark: true, ..DESK };
pub(crate) const PHONE: Screen =
    Screen { name: "phone", size: (390, 844), phone: true, dark: false };
pub(crate) const PHONE_DARK: Screen = Screen { name: "phone-dark", dark: true, ..PHONE };

/// Browser with one page.
pub(crate) struct Browser {
    runtime: Runtime,
    client: Option<Client>,
    driver: Child,
    base: String,
    _exclusive: MutexGuard<'static, ()>,
}

impl Browser {
    /// Opens the page of a daemon at `address`.
    pub(crate) fn open(address: &str, screen: Screen) -> Self {
        Self::open_at(&format!("http://{address}/"), screen)
    }

    /// Opens a page by its URL, which may be a file's.
    pub(crate) fn open_at(address: &str, screen: Screen) -> Self {
        let exclusive = EXCLUSIVE.lock().unwrap_or_else(PoisonError::into_inner);
        let (driver, port) = start_driver();
        let runtime = Runtime::new().expect("threads");
        let mut builder = ClientBuilder::new(HttpConnector::new());
        builder.capabilities(capabilities().as_object().expect("an object").clone());
        let driver_address = format!("http://127.0.0.1:{port}");
        let connecting = builder.connect(&driver_address);
        let client =
            runtime.block_on(connecting).expect("Chromium starts; is `chromium` installed?");
        let base = address.to_owned();
        let browser = Self { runtime, client: Some(client), driver, base, _exclusive: exclusive };
        browser.look_through(screen);
        browser.go();
        browser
    }

    /// Loads or reloads the page.
    pub(crate) fn go(&self) {
        self.wait_for(self.client().goto(&self.base));
    }

    pub(crate) fn look_through(&self, screen: Screen) {
        let (width, height) = screen.size;
        let scale = if screen.phone { 2 } else { 1 };
        self.devtools(
            "Emulation.setDeviceMetricsOverride",
            &json!({"width": width, "height": height, "deviceScaleFactor": scale,
                   "mobile": screen.phone}),
        );
        let scheme = if screen.dark { "dark" } else { "light" };
        self.devtools(
            "Emulation.setEmulatedMedia",
            &json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]}),
        );
    }

    /// Value of an expression on the page.
    pub(crate) fn eval(&self, expression: &str) -> Value {
        self.wait_for(self.client().execute(&format!("return {expression}"), Vec::new()))
    }

    /// Waits until earlier changes are drawn; texts and canvases are updated in the next frame.
    pub(crate) fn until_drawn(&self) {
        self.eval(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))",
        );
    }

    /// Text of the first element that matches a selector, after the next frame.
    pub(crate) fn text(&self, selector: &str) -> String {
        self.until_drawn();
        let text = self.eval(&format!("document.querySelector('{selector}').textContent"));
        text.as_str().expect("a text").to_owned()
    }

    /// Waits until an expression is true.
    pub(crate) fn until(&self, expression: &str) {
        let since = Instant::now();
        while self.eval(expression) != true {
            if since.elapsed() > Duration::from_secs(30) {
                self.picture("failed");
                let body = self.eval("document.body.innerText");
                panic!("waited in vain for {expression}; target/page/failed.png shows\n{body}");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    pub(crate) fn click(&self, selector: &str) {
        self.wait_for(self.find(selector).click());
    }

    /// Clicks at a fraction of an element's width and height.
    pub(crate) fn click_at(&self, selector: &str, across: f64, down: f64) {
        let script = format!(
            "(() => {{ const e = document.querySelector('{selector}'); \
             e.scrollIntoView({{block: 'center'}}); const r = e.getBoundingClientRect(); \
             return [r.left + {across} * r.width, r.top + {down} * r.height]; }})()"
        );
        let at = self.eval(&script);
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({"type": kind, "x": at[0], "y": at[1], "button": "left",
                               "clickCount": 1});
            self.devtools("Input.dispatchMouseEvent", &event);
        }
    }

    /// Focuses an element and types into it.
    pub(crate) fn type_into(&self, selector: &str, keys: &str) {
        self.wait_for(self.find(selector).send_keys(keys));
    }

    /// Presses a key in the focused element.
    pub(crate) fn press(&self, key: char) {
        let focused = self.wait_for(self.client().active_element());
        self.wait_for(focused.send_keys(&key.to_string()));
    }

    /// Executes a command of the DevTools protocol.
    pub(crate) fn devtools(&self, method: &'static str, params: &Value) -> Value {
        let command = DriverCommand {
            path: "goog/cdp/execute",
            body: json!({"cmd": method, "params": params}),
        };
        self.wait_for(self.client().issue_cmd(command))
    }

    /// Saves a screenshot as `target/page/NAME.png`.
    pub(crate) fn picture(&self, name: &str) -> PathBuf {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("page");
        fs::create_dir_all(&folder).expect("the target folder");
        let file = folder.join(format!("{name}.png"));
        let png = self.wait_for(self.client().screenshot());
        fs::write(&file, png).expect("there is room");
        file
    }

    /// Screenshot of an element, PNG.
    pub(crate) fn picture_of(&self, selector: &str) -> Vec<u8> {
        self.wait_for(self.find(selector).screenshot())
    }

    /// Warnings and errors on the console since the last call.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let entries = self.log("browser");
        let serious = entries
            .iter()
            .filter(|entry| ["WARNING", "SEVERE"].iter().any(|level| entry["level"] == *level));
        serious.map(|entry| entry["message"].as_str().unwrap_or_default().to_owned()).collect()
    }

    /// Addresses requested since the last call that are not below the page's base address.
    pub(crate) fn foreign_requests(&self) -> Vec<String> {
        let mut requests = 0;
        let mut foreign = Vec::new();
        for entry in self.log("performance") {
            let text = entry["message"].as_str().unwrap_or_default();
            let message: Value = serde_json::from_str(text).expect("JSON");
            let url = &message["message"]["params"]["request"]["url"];
            if let Some(url) = url.as_str() {
                requests += 1;
                if !url.starts_with(&self.base) {
                    foreign.push(url.to_owned());
                }
            }
        }
        assert!(requests > 0, "the log contains no requests");
        foreign
    }

    fn log(&self, kind: &'static str) -> Vec<Value> {
        let command = DriverCommand { path: "se/log", body: json!({"type": kind}) };
        let entries = self.wait_for(self.client().issue_cmd(command));
        entries.as_array().expect("a list").clone()
    }

    fn find(&self, selector: &str) -> Element {
        self.wait_for(self.client().find(Locator::Css(selector)))
    }

    fn client(&self) -> &Client {
        self.client.as_ref().expect("it is open")
    }

    fn wait_for<T, E: std::fmt::Debug>(&self, doing: impl Future<Output = Result<T, E>>) -> T {
        self.runtime.block_on(doing).expect("the browser does it")
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if let Some(client) = self.client.take() {
            drop(self.runtime.block_on(client.close()));
        }
        drop(self.driver.kill());
        drop(self.driver.wait());
    }
}

/// ChromeDriver command that is not part of WebDriver.
#[derive(Debug)]
struct DriverCommand {
    path: &'static str,
    body: Value,
}

impl WebDriverCompatibleCommand for DriverCommand {
    fn endpoint(
        &self,
        base: &url::Url,
        session: Option<&str>,
    ) -> Result<url::Url, url::ParseError> {
        base.join(&format!("session/{}/{}", session.unwrap_or_default(), self.path))
    }

    fn method_and_body(&self, _: &url::Url) -> (Method, Option<String>) {
        (Method::POST, Some(self.body.to_string()))
    }
}

/// Starts ChromeDriver on a free port.
fn start_driver() -> (Child, u16) {
    let mut driver = Command::new("chromedriver")
        .arg("--port=0")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect(
            "the page is tested in Chromium: apt-get install chromium chromium-driver, or skip it \
             with `PAGE=0 ./test.sh` or `cargo test -- --skip live_page::`",
        );
    let lines = BufReader::new(driver.stdout.take().expect("piped")).lines();
    let port = lines.map_while(Result::ok).find_map(|line| {
        let (_, port) = line.split_once("successfully on port ")?;
        port.trim_end_matches('.').parse().ok()
    });
    (driver, port.expect("ChromeDriver prints its port"))
}

fn capabilities() -> Value {
    let mut arguments = vec![
        "--headless=new",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--force-color-profile=srgb",
        "--hide-scrollbars",
    ];
    // Chromium's sandbox does not run as root, which containers and CI use.
    if rustix::process::geteuid().is_root() {
        arguments.push("--no-sandbox");
    }
    json!({
        "browserName": "chrome",
        "goog:chromeOptions": {"args": arguments},
        "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
    })
}
