//! One page in one run of headless Chromium: what it looks like, what it holds afterwards, what it said on the console.
//!
//! Virtual time (`--virtual-time-budget`) makes the run end by itself when the page has had that much time of its own, however
//! slow the machine is.

use std::{
    collections::BTreeSet,
    fs::File,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use image::RgbImage;
use serde_json::Value;

/// Names of the program, the first that is there is taken. OMNIX_CHROMIUM names another.
const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chromium-headless-shell"];
/// Milliseconds that the page has.
const BUDGET: u32 = 4000;
const PATIENCE: Duration = Duration::from_secs(240);

/// What a run left.
pub(crate) struct Shot {
    pub(crate) picture: RgbImage,
    pub(crate) dom: String,
    /// The page's account of itself, `omnix-state`.
    pub(crate) state: Value,
    /// Lines of the console.
    pub(crate) console: Vec<String>,
}

fn program() -> PathBuf {
    if let Some(given) = std::env::var_os("OMNIX_CHROMIUM") {
        return given.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = NAMES.iter().find_map(|name| std::env::split_paths(&path).map(|dir| dir.join(name)).find(|at| at.is_file()));
    found.expect(
        "the viewer is tested in Chromium, which was not found: install it (apt install chromium; tools/test does), \
         or name the program in OMNIX_CHROMIUM",
    )
}

/// Opens the page with this fragment in a window of this size.
pub(crate) fn open(page: &Path, fragment: &str, size: (u32, u32)) -> Shot {
    open_with(page, fragment, size, &["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
}

/// With these arguments for the choice of a graphics driver.
pub(crate) fn open_with(page: &Path, fragment: &str, (width, height): (u32, u32), graphics: &[&str]) -> Shot {
    let dir = tempfile::tempdir().expect("a temporary folder can be made");
    let at = |name: &str| dir.path().join(name);
    let create = |name: &str| File::create(at(name)).expect("a temporary file can be made");
    let address = format!("file://{}#{fragment}", page.to_str().expect("temporary paths are UTF-8").replace(' ', "%20"));
    // Containers have no sandbox for it, and often a tiny /dev/shm.
    let mut child = Command::new(program())
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", "--no-first-run"])
        .args(graphics)
        .arg(format!("--user-data-dir={}", at("profile").display()))
        .arg(format!("--window-size={width},{height}"))
        .arg(format!("--virtual-time-budget={BUDGET}"))
        .arg(format!("--screenshot={}", at("shot.png").display()))
        .args(["--dump-dom", "--enable-logging=stderr"])
        .arg(&address)
        .current_dir(dir.path())
        .stdin(Stdio::null())
        .stdout(create("dom"))
        .stderr(create("log"))
        .spawn()
        .expect("Chromium starts");
    let start = Instant::now();
    let read = |name: &str| String::from_utf8_lossy(&std::fs::read(at(name)).unwrap_or_default()).into_owned();
    let status = loop {
        if let Some(status) = child.try_wait().expect("Chromium can be waited for") {
            break status;
        }
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            panic!("Chromium was still busy with {address} after {PATIENCE:?}:\n{}", read("log"));
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let (dom, log) = (read("dom"), read("log"));
    assert!(status.success() && at("shot.png").is_file(), "Chromium ended with {status} on {address}:\n{log}");
    let picture = image::open(at("shot.png")).expect("the screenshot is a picture").into_rgb8();
    if let Some(keep) = std::env::var_os("OMNIX_VIEWER_SHOTS") {
        let name = format!("{}-{width}.png", fragment.replace(['&', '='], "_"));
        std::fs::copy(at("shot.png"), Path::new(&keep).join(name)).expect("OMNIX_VIEWER_SHOTS is a folder");
    }
    let state = dom.split_once("<output id=\"omnix-state\" hidden=\"\">").and_then(|(_, rest)| rest.split_once("</output>"));
    let state = state.map_or(Value::Null, |(text, _)| serde_json::from_str(text).unwrap_or(Value::Null));
    let console = log.lines().filter(|line| line.contains("CONSOLE") && !of_the_driver(line)).map(str::to_owned).collect();
    Shot { picture, dom, state, console }
}

/// Remarks of the software driver on its own speed (a screenshot reads the canvas back) are none of the page.
fn of_the_driver(line: &str) -> bool {
    line.contains("GPU stall due to ReadPixels") || line.contains("Automatic fallback to software WebGL")
}

impl Shot {
    /// The part of a 1280 x 720 window that holds the canvas and nothing else.
    fn canvas(&self) -> impl Iterator<Item = [u8; 3]> + '_ {
        (90..440).flat_map(move |y| (60..940).map(move |x| self.picture.get_pixel(x, y).0))
    }

    /// Share of the stage that differs from its most frequent colour, and the number of colours.
    pub(crate) fn stage(&self) -> (f64, usize) {
        let mut sorted: Vec<_> = self.canvas().collect();
        sorted.sort_unstable();
        let runs: Vec<usize> = sorted.chunk_by(|a, b| a == b).map(<[_]>::len).collect();
        let ground = runs.iter().max().copied().unwrap_or(0);
        (1.0 - ground as f64 / sorted.len() as f64, sorted.iter().collect::<BTreeSet<_>>().len())
    }

    /// Share of the stage that is clearly of another colour in `other`.
    pub(crate) fn difference(&self, other: &Self) -> f64 {
        let pairs = self.canvas().zip(other.canvas());
        let differing = pairs.filter(|(a, b)| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 24)).count();
        differing as f64 / self.canvas().count() as f64
    }
}
