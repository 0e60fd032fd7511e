//! A browser without a screen, for pages: Chromium, by way of chromedriver.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

/// Keys that have no character of their own, as `WebDriver` writes them.
pub mod key {
    /// Tab.
    pub const TAB: char = '\u{e004}';
    /// Arrow left.
    pub const LEFT: char = '\u{e012}';
    /// Arrow up.
    pub const UP: char = '\u{e013}';
    /// Arrow right.
    pub const RIGHT: char = '\u{e014}';
    /// Arrow down.
    pub const DOWN: char = '\u{e015}';
}

/// A browser with one window; it ends with this value.
pub struct Browser {
    driver: Child,
    session: String,
    agent: ureq::Agent,
}

impl Browser {
    /// Starts one, without a GPU.
    ///
    /// # Panics
    /// When Chromium or chromedriver is missing or does not start; so do the rest when a command fails.
    #[must_use]
    pub fn start() -> Self {
        const MISSING: &str =
            "chromium and chromedriver are needed: run tests/run, which installs them";
        let mut driver = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|fault| panic!("{MISSING} ({fault})"));
        let mut lines = BufReader::new(driver.stdout.take().expect("a pipe")).lines();
        let port = lines
            .find_map(|line| {
                let line = line.ok()?;
                let (_, port) = line.split_once("started successfully on port ")?;
                Some(port.trim_end_matches('.').to_owned())
            })
            .expect(MISSING);
        // Nobody reads on; it must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        // Commands that fail have a message in the body.
        let agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let mut browser =
            Self { driver, session: format!("http://127.0.0.1:{port}/session"), agent };
        let options = json!({
            // As root, Chromium has no sandbox; the pages are ours.
            "args": ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1200,900"],
        });
        let capabilities = json!({
            "browserName": "chrome",
            "goog:chromeOptions": options,
            "goog:loggingPrefs": { "browser": "ALL", "performance": "ALL" },
        });
        let answer = browser.post("", &json!({ "capabilities": { "alwaysMatch": capabilities } }));
        let id = answer["sessionId"].as_str().unwrap_or_else(|| panic!("{MISSING} ({answer})"));
        browser.session = format!("{}/{id}", browser.session);
        browser
    }

    fn post(&self, command: &str, body: &Value) -> Value {
        let mut answer = self
            .agent
            .post(format!("{}{command}", self.session))
            .send_json(body)
            .unwrap_or_else(|fault| panic!("{command}: {fault}"));
        let mut document: Value = answer
            .body_mut()
            .with_config()
            .limit(100_000_000)
            .read_json()
            .unwrap_or_else(|fault| panic!("{command}: {fault}"));
        let value = document["value"].take();
        assert!(value["error"].is_null(), "{command}: {value}");
        value
    }

    /// Opens a file.
    pub fn open(&self, page: &Path) {
        self.post("/url", &json!({ "url": format!("file://{}", page.display()) }));
    }

    /// The value of a JavaScript expression.
    #[must_use]
    pub fn value(&self, expression: &str) -> Value {
        self.execute(&format!("return {expression};"))
    }

    /// Runs JavaScript statements.
    pub fn run(&self, script: &str) {
        self.execute(script);
    }

    fn execute(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// The text of an expression.
    ///
    /// # Panics
    /// When it is none.
    #[must_use]
    pub fn text(&self, expression: &str) -> String {
        self.value(expression)
            .as_str()
            .unwrap_or_else(|| panic!("{expression}: no text"))
            .to_owned()
    }

    /// Presses keys one after the other, wherever the focus is.
    pub fn press(&self, keys: &[char]) {
        let actions: Vec<Value> = keys
            .iter()
            .flat_map(|key| ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key })))
            .collect();
        self.post(
            "/actions",
            &json!({ "actions": [{ "type": "key", "id": "keys", "actions": actions }] }),
        );
    }

    /// Moves the mouse to a place of the window, CSS px.
    pub fn point_at(&self, x: i64, y: i64) {
        let moved =
            json!({ "type": "pointerMove", "duration": 0, "x": x, "y": y, "origin": "viewport" });
        self.post(
            "/actions",
            &json!({ "actions": [{ "type": "pointer", "id": "mouse", "actions": [moved] }] }),
        );
    }

    /// A command of the Chrome `DevTools` protocol.
    pub fn devtools(&self, command: &str, parameters: &Value) {
        self.answer_of_devtools(command, parameters);
    }

    fn answer_of_devtools(&self, command: &str, parameters: &Value) -> Value {
        self.post("/goog/cdp/execute", &json!({ "cmd": command, "params": parameters }))
    }

    /// The size of the window, CSS px; as a phone has it or not.
    pub fn resize(&self, width: u32, height: u32, is_phone: bool) {
        let size =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone });
        self.devtools("Emulation.setDeviceMetricsOverride", &size);
        self.settle();
    }

    /// Whether the system asks for dark pages.
    pub fn prefer_dark(&self, is_dark: bool) {
        let value = if is_dark { "dark" } else { "light" };
        let features = json!([{ "name": "prefers-color-scheme", "value": value }]);
        self.devtools("Emulation.setEmulatedMedia", &json!({ "features": features }));
        self.settle();
    }

    /// Waits until the page has been told and drawn.
    fn settle(&self) {
        let script =
            "const done = arguments[0]; requestAnimationFrame(() => setTimeout(done, 20));";
        self.post("/execute/async", &json!({ "script": script, "args": [] }));
    }

    /// What has been logged since the last look: of the `browser` (console) or its `performance` (network).
    #[must_use]
    pub fn log(&self, kind: &str) -> Vec<Value> {
        let entries = self.post("/se/log", &json!({ "type": kind }));
        entries.as_array().cloned().unwrap_or_default()
    }

    /// The window as PNG, in base64.
    ///
    /// # Panics
    /// When the browser gives none.
    #[must_use]
    pub fn screenshot(&self) -> String {
        let answer = self.answer_of_devtools("Page.captureScreenshot", &json!({ "format": "png" }));
        answer["data"].as_str().expect("a picture").to_owned()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Ends Chromium; then chromedriver has nothing to wait for.
        let _ = self.agent.delete(&self.session).call();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
