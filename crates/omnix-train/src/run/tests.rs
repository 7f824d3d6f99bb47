//! The loop with a step that needs no device: same bits however often it is interrupted, and nothing lost when something fails.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use omnix_data::sets::shared;
use omnix_io::IoError;
use omnix_weights::Checkpoint;
use serde_json::Value;

use super::fake::Fake;
use super::*;
use crate::checkpoint::{BEST, LAST, Saved};
use crate::config::Recipe;
use crate::peers::threads::together;
use crate::read_config;
use crate::shapes::Shapes;

const NETWORK: &str = include_str!("../../../../assets/weights/nano/config.json");
const CONFIG: &str = r#"
steps = 20
seed = 4
network = "nano.json"
sample = { images = 1, size = [14, 14] }
data = [{ made = "shapes" }]
group = [{ name = "backbone", rate = 0.02 }, { name = "", rate = 0.1 }]
optimiser = { accumulate = 2, average = 0.9 }
schedule = { warm_up = 3 }
checkpoint = { every_steps = 5, every_minutes = 0.0 }
validation = { every = 4, samples = 2 }
"#;

fn recipe(text: &str) -> Recipe {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("nano.json"), NETWORK).unwrap();
    let path = dir.path().join("config.toml");
    fs::write(&path, text).unwrap();
    let mut recipe = read_config(&path).unwrap();
    // The folder is another one each time.
    recipe.config.network = crate::config::NetworkSource::Path("nano.json".into());
    recipe
}

struct Go<'a> {
    text: &'a str,
    until: u64,
    threads: usize,
    change: &'a dyn Fn(&mut Fake),
    /// Asked to stop when this number of steps is done.
    stop_at: u64,
}

const GO: Go<'_> = Go { text: CONFIG, until: 20, threads: 2, change: &|_| {}, stop_at: u64::MAX };

impl Go<'_> {
    /// What came of it, and the events in words.
    fn run(self, out: &Path) -> (Result<Outcome, TrainError>, Vec<String>) {
        let recipe = recipe(self.text);
        let mut fake = Fake::new(&recipe.config.group);
        (self.change)(&mut fake);
        let mut session = Session::open(recipe, out).unwrap();
        let (stop, mut told) = (AtomicBool::new(false), Vec::new());
        let options = RunOptions::new(self.until, &stop).threads(self.threads);
        let ended = run(&mut session, &mut fake, options, &mut |event| {
            told.push(match event {
                Event::Step { figures, .. } => {
                    stop.fetch_or(figures.step >= self.stop_at, Ordering::SeqCst);
                    return;
                }
                Event::Continued { step } => format!("continued {step}"),
                Event::Note(note) => note.clone(),
                Event::Validated { step, best, .. } => format!("validated {step} {best}"),
                Event::Saved { step } => format!("saved {step}"),
                Event::SaveFailed { error } => format!("failed {error}"),
            });
        });
        (ended, told)
    }
}

/// All that must be equal to the bit.
fn bits(out: &Path) -> Vec<Vec<u8>> {
    let files = ["last/model.safetensors", "last/state.safetensors", "best/model.safetensors", "model.safetensors"];
    files.iter().map(|name| fs::read(out.join(name)).unwrap()).collect()
}

/// The reported lines without times.
fn lines(out: &Path) -> Vec<Value> {
    let text = fs::read_to_string(out.join("train.jsonl")).unwrap();
    let untimed = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        ["seconds", "time"].iter().for_each(|name| _ = line.as_object_mut().unwrap().remove(*name));
        line
    };
    text.lines().map(untimed).collect()
}

fn whole() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let (ended, _) = GO.run(dir.path());
    let ended = ended.unwrap();
    assert!(ended.step == 20 && !ended.stopped && ended.best.is_some());
    dir
}

#[test]
fn killed_and_continued_has_the_same_bits() {
    let (whole, dir) = (whole(), tempfile::tempdir().unwrap());
    let (ended, _) = Go { change: &|fake| fake.dies_in = Some(13), threads: 1, ..GO }.run(dir.path());
    assert!(matches!(ended, Err(TrainError::Step(_))), "{ended:?}");
    let (ended, told) = Go { threads: 4, ..GO }.run(dir.path());
    // Saved at 12, the best so far, and not at 10 for the last time.
    assert!(told[0] == "continued 12" || told[0] == "continued 10", "{told:?}");
    assert_eq!(ended.unwrap().step, 20);
    assert!(bits(whole.path()) == bits(dir.path()));
    assert_eq!(lines(whole.path()), lines(dir.path()));
}

#[test]
fn stopped_and_continued_has_the_same_bits() {
    let (whole, dir) = (whole(), tempfile::tempdir().unwrap());
    let (ended, told) = Go { stop_at: 7, ..GO }.run(dir.path());
    let ended = ended.unwrap();
    assert!(ended.stopped && ended.step == 7 && told.last().unwrap() == "saved 7", "{told:?}");
    // To a number of steps in all, and on from there; the schedule is that of the configuration.
    assert_eq!(Go { until: 11, ..GO }.run(dir.path()).0.unwrap().step, 11);
    assert_eq!(GO.run(dir.path()).0.unwrap().step, 20);
    assert!(bits(whole.path()) == bits(dir.path()));
    assert_eq!(lines(whole.path()).len(), lines(dir.path()).len() - 1, "validated at 11, where it ended");
    // Nothing is left to do.
    let before = bits(dir.path());
    let (ended, told) = GO.run(dir.path());
    assert!(ended.unwrap().step == 20 && told == ["continued 20"] && before == bits(dir.path()));
}

#[test]
fn the_folders_open_as_checkpoints() {
    let dir = whole();
    for path in [dir.path().to_owned(), dir.path().join(LAST), dir.path().join(BEST)] {
        let checkpoint = Checkpoint::open(&path).unwrap();
        assert_eq!(checkpoint.key_prefix(), "net.");
        assert_eq!(checkpoint.tensor("head.norm.weight").unwrap().shape, [10, 7]);
        assert_eq!(checkpoint.tensor("backbone.pretrained.norm.weight").unwrap().to_f32(), [1.0, 2.0]);
    }
    let left: Vec<_> =
        fs::read_dir(dir.path()).unwrap().flatten().map(|e| e.file_name().into_string().unwrap()).collect();
    assert!(left.iter().all(|name| !name.starts_with(".omnix") && !name.ends_with(".part")), "{left:?}");
}

#[test]
fn one_trainer_for_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let first = Session::open(recipe(CONFIG), dir.path()).unwrap();
    let second = Session::open(recipe(CONFIG), dir.path()).unwrap_err();
    assert!(matches!(second, TrainError::Folder(IoError::FolderInUse { .. })), "{second:?}");
    drop(first);
    Session::open(recipe(CONFIG), dir.path()).unwrap();
}

#[test]
fn what_is_not_finite_ends_the_run_and_spares_the_checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    // Samples 24 and 25 are those of step 13.
    let (ended, _) = Go { change: &|fake| fake.nan_at = Some(25), ..GO }.run(dir.path());
    let text = ended.unwrap_err().to_string();
    for part in ["head.norm.weight", "step 13", "sample 25", "made shapes"] {
        assert!(text.contains(part), "{text}");
    }
    let before = bits(dir.path());
    let (ended, _) = Go { change: &|fake| fake.explodes_in = Some(15), ..GO }.run(dir.path());
    let text = ended.unwrap_err().to_string();
    assert!(text.contains("backbone.pretrained.cls_token[1]") && text.contains("inf"), "{text}");
    assert!(before == bits(dir.path()));
    // Between two checkpoints the next loss tells, and names the tensor.
    let (ended, _) = Go { change: &|fake| fake.explodes_in = Some(13), ..GO }.run(dir.path());
    let text = ended.unwrap_err().to_string();
    assert!(text.contains("first in backbone.pretrained.cls_token") && text.contains("step 14"), "{text}");
}

#[test]
fn a_checkpoint_that_cannot_be_written_leaves_the_former_one() {
    let dir = tempfile::tempdir().unwrap();
    GO.run(dir.path()).0.unwrap();
    let before = bits(dir.path());
    // In the way of the new folder.
    let text = CONFIG.replace("steps = 20", "steps = 30").replace("warm_up = 3", "warm_up = 3, length = 20");
    let mut session = Session::open(recipe(&text), dir.path()).unwrap();
    fs::write(dir.path().join(".omnix-last.new"), "a file").unwrap();
    let mut fake = Fake::new(&session.recipe().config.group);
    let (stop, mut failures) = (AtomicBool::new(false), 0);
    let options = RunOptions::new(30, &stop);
    let ended = run(&mut session, &mut fake, options, &mut |event| {
        failures += usize::from(matches!(event, Event::SaveFailed { .. }));
    });
    assert!(matches!(ended, Err(TrainError::Write { .. })) && failures >= 2, "{ended:?} {failures}");
    assert!(before == bits(dir.path()));
}

#[test]
fn data_that_vanishes_ends_the_run_and_loses_nothing() {
    let (dir, data) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let sample = Shapes::new(2, [14, 14]).unwrap().sample(1, 1).unwrap();
    shared::write(&sample, &data.path().join("scene"), &[(0, 3)]).unwrap();
    let source = format!("data = [{{ path = {:?} }}]", data.path());
    let text = CONFIG.replace("data = [{ made = \"shapes\" }]", &source).replace("validation", "#");
    let mut session = Session::open(recipe(&text), dir.path()).unwrap();
    let mut fake = Fake::new(&session.recipe().config.group);
    let (stop, mut saved) = (AtomicBool::new(false), 0);
    let options = RunOptions::new(20, &stop);
    let ended = run(&mut session, &mut fake, options, &mut |event| match event {
        Event::Step { figures, .. } if figures.step == 7 => fs::remove_dir_all(data.path().join("scene")).unwrap(),
        Event::Saved { step } => saved = *step,
        _ => {}
    });
    let error = ended.unwrap_err();
    assert!(matches!(&error, TrainError::Sample { source, .. } if source.to_string().contains("scene")), "{error:?}");
    // Some samples were made ahead.
    assert!((7..=9).contains(&saved), "{saved}");
}

#[test]
fn other_networks_newer_ones_and_damaged_ones_are_refused() {
    let dir = whole();
    let open = || Session::open(recipe(CONFIG), dir.path()).map(|_| ()).unwrap_err().to_string();
    let mut other = recipe(CONFIG);
    other.network_json["backbone"]["depth"] = 12.into();
    let text = Session::open(other, dir.path()).unwrap_err().to_string();
    assert!(text.contains("backbone.depth is 6 there and 12 here"), "{text}");
    let trainer = dir.path().join("last/trainer.json");
    let original = fs::read_to_string(&trainer).unwrap();
    fs::write(&trainer, original.replace("\"format\": 1", "\"format\": 2, \"unheard\": 3")).unwrap();
    assert!(open().contains("newer than this program"));
    fs::write(&trainer, &original[..40]).unwrap();
    assert!(open().contains("trainer.json"));
    fs::write(&trainer, original.replace("\"step\": 20,\n  \"seed\"", "\"step\": 19,\n  \"seed\"")).unwrap();
    assert!(open().contains("of step 20 and trainer.json of step 19"));
    fs::write(&trainer, &original).unwrap();
    let state = dir.path().join("last/state.safetensors");
    let bytes = fs::read(&state).unwrap();
    fs::write(&state, &bytes[..bytes.len() - 4]).unwrap();
    assert!(open().contains("state.safetensors"));
    fs::write(&state, &bytes).unwrap();
    Session::open(recipe(CONFIG), dir.path()).unwrap();
}

#[test]
fn changed_settings_are_told_and_new_groups_taken() {
    let dir = tempfile::tempdir().unwrap();
    let frozen = CONFIG.replace("rate = 0.02 }", "frozen = true }");
    Go { text: &frozen, until: 6, ..GO }.run(dir.path()).0.unwrap();
    let (ended, told) = Go { until: 8, ..GO }.run(dir.path());
    assert_eq!(ended.unwrap().step, 8);
    assert!(told.iter().any(|note| note.contains("group[0].frozen is true there and false here")), "{told:?}");
}

/// Two threads as processes, each with one sample of a step, in one folder; what came of each.
fn both(out: &Path, until: u64, change: &(dyn Fn(u32, &mut Fake) + Sync)) -> Vec<Result<Outcome, TrainError>> {
    let text = CONFIG.replace("accumulate = 2", "accumulate = 1");
    together(2, |peers| {
        let mut session = Session::join(recipe(&text), out, peers).unwrap();
        let mut fake = Fake::new(&session.recipe().config.group);
        change(peers.rank(), &mut fake);
        let stop = AtomicBool::new(false);
        let options = RunOptions::new(until, &stop).threads(2).peers(Some(peers));
        run(&mut session, &mut fake, options, &mut |_| {})
    })
}

#[test]
fn two_processes_have_the_bits_of_one_that_accumulates() {
    let (whole, dir) = (whole(), tempfile::tempdir().unwrap());
    for until in [9, 20] {
        assert!(both(dir.path(), until, &|_, _| {}).iter().all(|ended| ended.as_ref().unwrap().step == until));
    }
    assert!(bits(whole.path()) == bits(dir.path()));
    // Validated at 9 too, where the first of the two ended.
    let (one, two) = (lines(whole.path()), lines(dir.path()));
    assert!(one.iter().all(|line| two.contains(line)) && one.len() + 1 == two.len());
}

#[test]
fn processes_compute_on_devices_of_one_kind() {
    let dir = tempfile::tempdir().unwrap();
    let ended = both(dir.path(), 20, &|rank, fake| fake.device = ["one card", "another card"][rank as usize]);
    for error in ended.into_iter().map(|ended| ended.unwrap_err().to_string()) {
        assert!(error.contains("process 1") && error.contains("on another card, the first one on one card"), "{error}");
    }
    assert!(!dir.path().join(LAST).exists());
}

#[test]
fn a_process_that_fails_stops_all_with_its_name() {
    let dir = tempfile::tempdir().unwrap();
    // Samples 24 and 25 are those of step 13; the second process has the odd ones.
    let ended = both(dir.path(), 20, &|_, fake| fake.nan_at = Some(25));
    let told: Vec<String> = ended.into_iter().map(|ended| ended.unwrap_err().to_string()).collect();
    assert!(told[0].contains("process 1") && told[0].contains("sample 25"), "{}", told[0]);
    assert!(told[1].starts_with("the loss"), "{}", told[1]);
    let saved = Saved::look(dir.path(), &recipe(CONFIG).network_json).unwrap().unwrap();
    assert_eq!(saved.progress().step, 12);
}

#[test]
fn a_process_that_fails_alone_does_not_leave_the_others_waiting() {
    let dir = tempfile::tempdir().unwrap();
    // Within the update, of which the others know nothing.
    let ended = both(dir.path(), 20, &|rank, fake| fake.dies_in = (rank == 1).then_some(7));
    assert!(
        matches!(&ended[0], Err(TrainError::Peer { rank: 1, reason, .. }) if reason.contains("killed")),
        "{ended:?}"
    );
    assert!(matches!(ended[1], Err(TrainError::Step(_))), "{ended:?}");
    // What the first had learned is kept.
    let saved = |dir: &Path| Saved::look(dir, &recipe(CONFIG).network_json).unwrap().unwrap().progress().step;
    assert_eq!(saved(dir.path()), 7);
    // In the last step the others are done, and ask no more.
    let dir = tempfile::tempdir().unwrap();
    let ended = both(dir.path(), 9, &|rank, fake| fake.dies_in = (rank == 1).then_some(9));
    assert!(ended[0].as_ref().is_ok_and(|ended| ended.step == 9) && ended[1].is_err(), "{ended:?}");
    assert_eq!(saved(dir.path()), 9);
}

#[test]
fn a_process_that_is_stopped_stops_all_in_the_same_step() {
    let dir = tempfile::tempdir().unwrap();
    let ended = together(2, |peers| {
        let text = CONFIG.replace("accumulate = 2", "accumulate = 1");
        let mut session = Session::join(recipe(&text), dir.path(), peers).unwrap();
        let mut fake = Fake::new(&session.recipe().config.group);
        let stop = AtomicBool::new(false);
        let options = RunOptions::new(20, &stop).peers(Some(peers));
        run(&mut session, &mut fake, options, &mut |event| {
            if let (1, Event::Step { figures, .. }) = (peers.rank(), event) {
                stop.fetch_or(figures.step >= 6, Ordering::SeqCst);
            }
        })
    });
    let ended: Vec<Outcome> = ended.into_iter().map(Result::unwrap).collect();
    assert!(ended.iter().all(|ended| ended.stopped && ended.step == 6), "{ended:?}");
    assert!(both(dir.path(), 20, &|_, _| {}).iter().all(Result::is_ok));
    assert!(bits(whole().path()) == bits(dir.path()));
}

#[test]
fn processes_train_the_same_configuration() {
    let dir = tempfile::tempdir().unwrap();
    let joined = together(2, |peers| {
        let text = if peers.rank() == 1 { CONFIG.replace("rate = 0.1", "rate = 0.2") } else { CONFIG.to_owned() };
        Session::join(recipe(&text), dir.path(), peers).map(|_| ()).unwrap_err().to_string()
    });
    assert!(
        joined.iter().all(|text| text.contains("process 1") && text.contains("another configuration")),
        "{joined:?}"
    );
}

#[test]
fn processes_begin_with_the_same_checkpoint() {
    let (dir, other) = (whole(), tempfile::tempdir().unwrap());
    let joined = together(2, |peers| {
        let out = if peers.rank() == 0 { dir.path() } else { other.path() };
        Session::join(recipe(CONFIG), out, peers).map(|_| ()).unwrap_err().to_string()
    });
    assert!(joined.iter().all(|text| text.contains("process 1") && text.contains("from step 0")), "{joined:?}");
    // A folder that another run holds.
    let held = Session::open(recipe(CONFIG), other.path()).unwrap();
    let joined = together(2, |peers| Session::join(recipe(CONFIG), other.path(), peers).map(|_| ()).unwrap_err());
    assert!(matches!(joined[0], TrainError::Folder(IoError::FolderInUse { .. })), "{joined:?}");
    assert!(joined[1].to_string().contains("process 0"), "{joined:?}");
    drop(held);
}
