//! Running the program, and small inputs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;

/// What a run of the program left.
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
    pub(crate) seconds: f64,
}

/// The program with nothing on its input.
pub(crate) fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnix"));
    command.stdin(Stdio::null());
    command
}

pub(crate) fn finish(command: &mut Command) -> Ran {
    let since = Instant::now();
    let output = command.output().unwrap();
    Ran {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
        seconds: since.elapsed().as_secs_f64(),
    }
}

/// Runs `omnix` with these arguments.
pub(crate) fn omnix(args: &[&str]) -> Ran {
    finish(program().args(args))
}

/// Runs `omnix reconstruct INPUT --out OUT` with more arguments.
pub(crate) fn reconstruct(input: &Path, out: &Path, more: &[&str]) -> Ran {
    finish(program().arg("reconstruct").arg(input).arg("--out").arg(out).args(more))
}

impl Ran {
    /// Success, or what the program said.
    #[track_caller]
    pub(crate) fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{}{}", self.out, self.err);
        self
    }

    /// This exit code, and one message with all these words, without a panic.
    #[track_caller]
    pub(crate) fn fails(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{}{}", self.out, self.err);
        let message =
            self.err.lines().find(|l| l.starts_with("error: ")).unwrap_or_else(|| panic!("no error: {}", self.err));
        for word in words {
            assert!(self.err.contains(word), "no `{word}` in: {message}\n{}", self.err);
        }
        assert!(!self.err.contains("panicked"), "{}", self.err);
        self
    }

    /// The lines of `--json`.
    #[track_caller]
    pub(crate) fn events(&self) -> Vec<Value> {
        self.out.lines().map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{e}: {l}"))).collect()
    }
}

/// The events of one kind.
pub(crate) fn of_kind<'a>(events: &'a [Value], kind: &str) -> Vec<&'a Value> {
    events.iter().filter(|e| e["event"] == kind).collect()
}

/// A picture with structure in every channel; the extension decides the format.
pub(crate) fn picture(path: &Path, width: u32, height: u32, shift: u32) {
    let at = |x: u32, y: u32| [((x + shift) * 7 + y) as u8, (y * 11) as u8, ((x ^ y) * 5) as u8];
    let data: Vec<u8> = (0..height).flat_map(|y| (0..width).flat_map(move |x| at(x, y))).collect();
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::save_buffer(path, &data, width, height, image::ColorType::Rgb8).unwrap();
}

/// A folder of `count` different pictures.
pub(crate) fn folder(dir: &Path, count: u32) -> PathBuf {
    let folder = dir.join("frames");
    for i in 0..count {
        picture(&folder.join(format!("{i:03}.png")), 150, 90, 3 * i);
    }
    folder
}

/// A folder of `count` hard links to one small picture.
pub(crate) fn many(dir: &Path, count: u32) -> PathBuf {
    let folder = dir.join("many");
    let first = folder.join("00000.jpg");
    picture(&first, 150, 90, 0);
    for i in 1..count {
        fs::hard_link(&first, folder.join(format!("{i:05}.jpg"))).unwrap();
    }
    folder
}

/// A second of video at 10 frames a second, 150 x 90.
pub(crate) fn video(path: &Path) {
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "lavfi", "-i", "testsrc=size=150x90:rate=10:duration=1"])
        .args(["-pix_fmt", "yuv420p"])
        .arg(path)
        .stdin(Stdio::null())
        .status();
    assert!(made.is_ok_and(|s| s.success()), "the tests need ffmpeg: run tools/setup");
}

/// A JSON file.
#[track_caller]
pub(crate) fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap_or_else(|e| panic!("{e}: {}", path.display()))).unwrap()
}

/// An array of a results.npz as f32, with its shape.
#[track_caller]
pub(crate) fn array(npz: &Path, name: &str) -> (Vec<u64>, Vec<f32>) {
    let mut file = npyz::npz::NpzArchive::open(npz).unwrap();
    let array = file.by_name(name).unwrap().unwrap_or_else(|| panic!("no {name} in {}", npz.display()));
    (array.shape().to_vec(), array.into_vec().unwrap())
}

/// All numbers of an array, which must be finite.
#[track_caller]
pub(crate) fn finite(npz: &Path, name: &str, shape: &[u64]) -> Vec<f32> {
    let (found, numbers) = array(npz, name);
    assert_eq!(found, shape, "{name}");
    assert!(numbers.iter().all(|v| v.is_finite()), "{name} is not finite");
    numbers
}

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
