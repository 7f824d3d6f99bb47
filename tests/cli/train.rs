//! `omnix train`: one right answer, however often a run was stopped and whatever memory it had; and what a user can do wrong.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::{Ran, finish, folder, of_kind, program, reconstruct, root};

/// `omnix train CONFIG --out OUT` with more arguments.
fn train(config: &Path, out: &Path, more: &[&str]) -> Ran {
    finish(program().arg("train").arg(config).arg("--out").arg(out).args(more))
}

fn smoke() -> PathBuf {
    root().join("recipes/smoke.toml")
}

/// Weights and state of a run.
fn state(out: &Path) -> [Vec<u8>; 2] {
    ["last/model.safetensors", "last/state.safetensors"].map(|file| fs::read(out.join(file)).unwrap())
}

/// The recipe with lines changed.
fn changed(dir: &Path, from: &str, to: &str) -> PathBuf {
    let text = fs::read_to_string(smoke()).unwrap();
    assert!(text.contains(from), "no `{from}` in the recipe");
    let path = dir.join("changed.toml");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    path
}

#[test]
fn the_smoke_recipe_learns_and_its_checkpoint_reconstructs() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let ran = train(&smoke(), &out, &["--json"]).ok();
    let events = ran.events();
    let steps = of_kind(&events, "step");
    let loss = |step: &Value| step["losses"]["total"].as_f64().unwrap();
    assert_eq!(steps.len(), 20);
    assert!(loss(steps[19]) < 0.6 * loss(steps[0]), "{} after {}", loss(steps[19]), loss(steps[0]));
    assert_eq!(of_kind(&events, "validated").len(), 2);
    assert_eq!(
        (events.last().unwrap()["event"].as_str(), events.last().unwrap()["step"].as_u64()),
        (Some("trained"), Some(20))
    );
    for file in ["config.json", "model.safetensors", "train.html", "train.jsonl", "best/model.safetensors"] {
        assert!(out.join(file).is_file(), "no {file}");
    }
    let page = fs::read_to_string(out.join("train.html")).unwrap();
    assert!(page.contains("<svg") && !page.contains("http://") && !page.contains("https://"), "a page by itself");
    // It is a checkpoint like any other.
    let weights = out.to_str().unwrap();
    reconstruct(&folder(dir.path(), 2), &dir.path().join("rec"), &["--weights", weights, "--export", "depth"]).ok();
}

#[test]
fn stops_budgets_and_runs_change_no_bit() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    train(&smoke(), &at("whole"), &["--steps", "4", "-q"]).ok();
    let whole = state(&at("whole"));
    // Stopped, and gone on with.
    train(&smoke(), &at("parts"), &["--steps", "1", "-q"]).ok();
    let ran = train(&smoke(), &at("parts"), &["--steps", "4", "--json"]).ok();
    assert_eq!(of_kind(&ran.events(), "continued")[0]["step"], 1);
    assert!(state(&at("parts")) == whole, "a run that was stopped took other steps");
    // With as little memory as will do: what the refusal says.
    let refused = train(&smoke(), &at("small"), &["--steps", "4", "--memory-budget", "1MiB"]).fails(5, &["at least"]);
    let least = refused.err.split("at least ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    assert!(!at("small").join("last").exists(), "nothing was begun");
    let least: u64 = least.parse().unwrap();
    let free = finish(program().args(["plan", "--train"]).arg(smoke()).arg("--json")).ok().events();
    let free = of_kind(&free, "plan")[0].clone();
    assert_eq!(free["least"]["bytes"].as_u64(), Some(least));
    let most = free["bytes"].as_u64().unwrap();
    let mut recomputed = 0;
    for (name, budget) in [("middle", u64::midpoint(least, most)), ("small", least)] {
        let budget_bytes = format!("{budget}B");
        let ran = train(&smoke(), &at(name), &["--steps", "4", "--json", "--memory-budget", &budget_bytes]).ok();
        let plan = of_kind(&ran.events(), "plan")[0].clone();
        let number = |key: &str| plan[key].as_u64().unwrap();
        assert!(number("bytes") <= budget && number("recomputed_flops") > recomputed, "{plan}");
        assert_eq!((&plan["without"]["bytes"], &plan["without"]["flops"]), (&free["bytes"], &free["flops"]));
        assert_eq!(number("flops"), free["flops"].as_u64().unwrap() + number("recomputed_flops"));
        recomputed = number("recomputed_flops");
        assert!(state(&at(name)) == whole, "a budget of {budget} bytes changed the result");
    }
    // People are told, too.
    let told = train(&smoke(), &at("told"), &["--steps", "1", "--memory-budget", &format!("{least}B")]).ok();
    assert!(told.err.contains("computed again"), "{}", told.err);
    // Another seed is another run.
    train(&smoke(), &at("other"), &["--steps", "4", "-q", "--seed", "2"]).ok();
    assert!(state(&at("other")) != whole);
}

#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_from_its_last_checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    let config = changed(dir.path(), "[schedule]", "[checkpoint]\nevery_steps = 1\n\n[schedule]");
    let (killed, whole) = (dir.path().join("killed"), dir.path().join("whole"));
    let mut command = program();
    command.arg("train").arg(&config).arg("--out").arg(&killed).args(["--json", "--steps", "6"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|l| l.contains("\"saved\"") && l.contains("\"step\":2")), "no second checkpoint");
    Command::new("kill").args(["-KILL", &child.id().to_string()]).status().unwrap();
    child.wait().unwrap();
    train(&config, &killed, &["--steps", "6", "-q"]).ok();
    train(&config, &whole, &["--steps", "6", "-q"]).ok();
    assert!(state(&killed) == state(&whole), "a run that was killed took other steps");
}

#[cfg(unix)]
#[test]
fn a_signal_saves_and_leaves() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let mut command = program();
    command.arg("train").arg(smoke()).arg("--out").arg(&out).args(["--json", "--steps", "100000"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|l| l.contains("\"event\":\"step\"")), "no step");
    // A second trainer in the same folder is refused.
    train(&smoke(), &out, &[]).fails(6, &["run"]);
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let last: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{last:?}");
    assert!(out.join("last/state.safetensors").is_file());
}

#[test]
fn configurations_that_cannot_be_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let cases: [(&str, &str, i32, &[&str]); 5] = [
        ("[sample]", "[smaple]", 3, &["smaple", "sample"]),
        ("rate = 5e-4", "rate = -1.0", 2, &["rate"]),
        ("size = [84, 70]", "size = [84, 71]", 2, &["14"]),
        ("depth = 6", "depth = 5", 3, &["out_layers"]),
        ("[[data]]\nmade = \"shapes\"\n", "", 2, &["data"]),
    ];
    for (from, to, code, words) in cases {
        train(&changed(dir.path(), from, to), &out, &["--steps", "1"]).fails(code, words);
    }
    train(&dir.path().join("absent.toml"), &out, &[]).fails(3, &["absent.toml"]);
    assert!(!out.join("last").exists());
}

#[test]
fn a_rate_that_explodes_is_named_and_the_checkpoint_before_it_is_good() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let config = changed(dir.path(), "rate = 5e-4", "rate = 1e30");
    train(&config, &out, &["--steps", "8"]).fails(1, &["NaN or infinite", "step", "sample"]);
}

#[test]
fn a_plan_says_what_a_run_will_take() {
    let dir = tempfile::tempdir().unwrap();
    let plan = |config: &Path, more: &[&str]| finish(program().args(["plan", "--train"]).arg(config).args(more));
    let planned = plan(&smoke(), &["--json"]).ok().events();
    let ran = train(&smoke(), &dir.path().join("run"), &["--steps", "1", "--json"]).ok().events();
    for key in ["images", "image_size", "flops", "forward_flops", "trained"] {
        assert_eq!(of_kind(&planned, "plan")[0][key], of_kind(&ran, "plan")[0][key], "{key}");
    }
    let text = plan(&smoke(), &[]).ok();
    assert!(["training of network smoke", "memory", "GFLOP a sample"].iter().all(|part| text.out.contains(part)));
    assert!(text.out.contains("least ") && !text.out.contains("if nothing were computed again"), "{}", text.out);
    plan(&smoke(), &["--memory-budget", "1MiB"]).fails(5, &["at least"]);
    let least = of_kind(&planned, "plan")[0]["least"]["bytes"].as_u64().unwrap();
    let tight = plan(&smoke(), &["--memory-budget", &format!("{least}B")]).ok();
    assert!(tight.out.contains("if nothing were computed again") && tight.out.contains("%"), "{}", tight.out);
    plan(&dir.path().join("none.toml"), &[]).fails(3, &["none.toml"]);
    // What is said of pictures has no meaning for a training.
    assert_eq!(plan(&smoke(), &["--frames", "3"]).code, Some(2));
}

/// 1.33 G parameters, of which none is made: what a step takes is known without them.
#[test]
fn a_step_of_the_release_is_planned_without_its_weights() {
    let recipe = root().join("recipes/release.toml");
    let budget = ["--memory-budget", "64GiB"];
    let planned = finish(program().args(["plan", "--json", "--train"]).arg(recipe).args(budget)).ok().events();
    let plan = &of_kind(&planned, "plan")[0];
    let number = |pointer: &str| plan.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"));
    assert!((1.32e9..1.33e9).contains(&number("/trained")), "{plan}");
    // About half of the memory, for less than a tenth of the operations.
    assert!(number("/bytes") <= 64.0 * 1024f64.powi(3) && number("/without/bytes") > 1.6 * number("/bytes"), "{plan}");
    assert!(number("/recomputed_flops") < 0.1 * number("/without/flops"), "{plan}");
}
