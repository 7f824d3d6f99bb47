//! A page in headless Chromium, driven through its debugging protocol (Chrome DevTools Protocol) on a pair of pipes:
//! messages are JSON, each ended by a zero byte, read by the browser on descriptor 3 and written on 4.

use std::{
    collections::BTreeSet,
    fs::File,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    time::{Duration, Instant},
};

use image::RgbImage;
use serde_json::{Value, json};

/// Names of the program, the first that is there is taken. OMNIX_CHROMIUM names another.
const NAMES: [&str; 5] =
    ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chromium-headless-shell"];
const PATIENCE: Duration = Duration::from_secs(240);
/// The software driver: the same pictures on every machine.
const SWIFTSHADER: [&str; 3] = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

/// A browser with one page. It ends when this is dropped.
pub(crate) struct Page {
    child: Child,
    to: Option<ChildStdin>,
    from: Receiver<Value>,
    dir: tempfile::TempDir,
    session: String,
    last: u64,
    /// Warnings, errors and whatever else the page put on its console, and exceptions that nobody caught.
    pub(crate) console: Vec<String>,
}

fn program() -> PathBuf {
    if let Some(given) = std::env::var_os("OMNIX_CHROMIUM") {
        return given.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found =
        NAMES.iter().find_map(|name| std::env::split_paths(&path).map(|dir| dir.join(name)).find(|at| at.is_file()));
    found.expect(
        "the viewer is tested in Chromium, which was not found: install it (apt install chromium; tools/test does), \
         or name the program in OMNIX_CHROMIUM",
    )
}

impl Page {
    /// Opens the file with this fragment in a window of this size and waits until the viewer says that it is ready.
    pub(crate) fn open(file: &Path, fragment: &str, size: (u32, u32)) -> Self {
        let mut page = Self::open_with(file, fragment, size, &SWIFTSHADER);
        page.wait_for("window.omnixViewer && omnixViewer.ready || JSON.parse(document.getElementById('omnix-state').value || '{}').errors?.length > 0");
        page
    }

    /// With these arguments for the choice of a graphics driver; waits for the document only.
    pub(crate) fn open_with(file: &Path, fragment: &str, (width, height): (u32, u32), graphics: &[&str]) -> Self {
        let dir = tempfile::tempdir().expect("a temporary folder can be made");
        // Containers have no sandbox for it, and often a tiny /dev/shm. The shell moves the pipes to where they belong.
        let mut child = Command::new("/bin/sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(program())
            .args(["--headless", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--hide-scrollbars", "--no-first-run"])
            .args(graphics)
            .arg(format!("--user-data-dir={}", dir.path().join("profile").display()))
            .arg(format!("--window-size={width},{height}"))
            .arg("about:blank")
            .current_dir(dir.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::create(dir.path().join("log")).expect("a temporary file can be made"))
            .spawn()
            .expect("a shell starts");
        let mut out = BufReader::new(child.stdout.take().expect("its output is a pipe"));
        let (send, from) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while matches!(out.read_until(0, &mut message), Ok(1..)) {
                message.pop();
                let Ok(value) = serde_json::from_slice(&message) else { break };
                if send.send(value).is_err() {
                    break;
                }
                message.clear();
            }
        });
        let to = child.stdin.take();
        let mut page = Self { child, to, from, dir, session: String::new(), last: 0, console: Vec::new() };
        // Without a size: the full browser takes one for new windows alone. The metrics below set it.
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }));
        let session = page.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        page.session = session["sessionId"].as_str().expect("a session has a name").to_owned();
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            page.call(domain, json!({}));
        }
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        page.call("Emulation.setDeviceMetricsOverride", metrics);
        let path = file.to_str().expect("temporary paths are UTF-8").replace(' ', "%20");
        page.call("Page.navigate", json!({ "url": format!("file://{path}#{fragment}") }));
        page.wait_for("location.protocol === 'file:' && document.readyState === 'complete'");
        page
    }

    /// Sends a command and returns its result; messages of the console among what else arrives are kept.
    fn call(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": params });
        if !self.session.is_empty() {
            message["sessionId"] = self.session.as_str().into();
        }
        let sent = self.to.as_mut().map(|to| to.write_all(format!("{message}\0").as_bytes()).and_then(|()| to.flush()));
        if !matches!(sent, Some(Ok(()))) {
            self.give_up(method, "the browser is gone");
        }
        let start = Instant::now();
        loop {
            match self.from.recv_timeout(PATIENCE.saturating_sub(start.elapsed())) {
                Ok(message) if message["id"] == self.last => {
                    assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                    return message["result"].clone();
                }
                Ok(message) => self.note(&message),
                Err(RecvTimeoutError::Timeout) => self.give_up(method, "no answer"),
                Err(RecvTimeoutError::Disconnected) => self.give_up(method, "the browser is gone"),
            }
        }
    }

    fn give_up(&self, method: &str, what: &str) -> ! {
        let log = std::fs::read_to_string(self.dir.path().join("log")).unwrap_or_default();
        panic!("{method}: {what}; Chromium said:\n{log}");
    }

    fn note(&mut self, message: &Value) {
        let params = &message["params"];
        let text = match message["method"].as_str() {
            Some("Runtime.consoleAPICalled") => params["args"].to_string(),
            Some("Runtime.exceptionThrown") => params["exceptionDetails"].to_string(),
            Some("Log.entryAdded") => params["entry"]["text"].to_string(),
            _ => return,
        };
        // Remarks of the software driver on its own speed (a screenshot reads the canvas back) are none of the page's.
        if !text.contains("GPU stall due to ReadPixels") && !text.contains("software WebGL") {
            self.console.push(text);
        }
    }

    /// Value of an expression in the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", asked);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression holds.
    pub(crate) fn wait_for(&mut self, expression: &str) {
        let start = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            if start.elapsed() > PATIENCE {
                self.give_up(expression, "did not come true");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// What the window shows, once what was asked for is drawn.
    pub(crate) fn picture(&mut self) -> Picture {
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))");
        let shot = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let bytes = base64(shot["data"].as_str().expect("a screenshot has data"));
        let picture = image::load_from_memory(&bytes).expect("the screenshot is a picture").into_rgb8();
        if let Some(folder) = std::env::var_os("OMNIX_VIEWER_SHOTS") {
            let hash = self.value("document.title + location.hash + '-' + innerWidth").to_string();
            let name: String = hash.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
            picture.save(Path::new(&folder).join(format!("{name}.png"))).expect("OMNIX_VIEWER_SHOTS is a folder");
        }
        Picture(picture)
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // Without its pipe the browser ends by itself; the signal is for one that does not.
        self.to.take();
        let start = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) {
            if start.elapsed() > Duration::from_secs(5) {
                let _ = self.child.kill();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

fn base64(text: &str) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for byte in text.bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => break,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    out
}

/// A screenshot of a window of 1280 x 720.
pub(crate) struct Picture(RgbImage);

impl Picture {
    /// The part that holds the canvas and nothing else.
    fn canvas(&self) -> impl Iterator<Item = [u8; 3]> + '_ {
        (90..440).flat_map(move |y| (60..940).map(move |x| self.0.get_pixel(x, y).0))
    }

    /// Share of the stage that differs from its most frequent colour, and the number of colours.
    pub(crate) fn stage(&self) -> (f64, usize) {
        let mut sorted: Vec<_> = self.canvas().collect();
        sorted.sort_unstable();
        let ground = sorted.chunk_by(|a, b| a == b).map(<[_]>::len).max().unwrap_or(0);
        (1.0 - ground as f64 / sorted.len() as f64, sorted.iter().collect::<BTreeSet<_>>().len())
    }

    /// Share of the stage that is clearly of another colour in `other`.
    pub(crate) fn difference(&self, other: &Self) -> f64 {
        let pairs = self.canvas().zip(other.canvas());
        let differing = pairs.filter(|(a, b)| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 24)).count();
        differing as f64 / self.canvas().count() as f64
    }
}
