//! The performance guard: work of fixed plans, counted and compared with `tests/data/model/work.txt`. Wall time is noise,
//! counts are not: more dispatches, bytes, operations, pipelines or memory show as a diff of that file.
//!
//! A change that is meant: `OMNIX_ACCEPT_WORK=1 cargo test -p omnix-tests --test model work`, and look at `git diff`.

use std::fmt::Write as _;

use omnix_graph::{Graph, Plan, PlanOptions};
use omnix_kernels::Caps;
use omnix_model::{BackboneSpec, HeadSpec, ModelError, MotionSpec, Network, NetworkConfig, SamplingSpec};

use crate::fixture::{nano, root};

/// One plan and what it is called.
type Named = (String, Plan);

fn planned(caps: &Caps, record: impl FnOnce(&mut Graph) -> Result<(), ModelError>) -> Plan {
    let mut graph = Graph::new();
    record(&mut graph).unwrap();
    Plan::new(&graph, caps, &PlanOptions::default()).unwrap()
}

/// Backbone and head of some images.
fn geometry(network: &Network, images: usize, grid: (usize, usize), caps: &Caps) -> [Named; 3] {
    let spec = BackboneSpec {
        images,
        grid,
        reference: network.default_reference(),
        cameras_given: false,
        times: times(images),
        export_layers: Vec::new(),
    };
    let head = |rays| HeadSpec { frames: 1, grid, rays, points: false, gaussians: false };
    let record_head = |rays| planned(caps, |g| network.head(g, &head(rays)).map(|_| ()));
    [
        (format!("backbone, {images} images"), planned(caps, |g| network.backbone(g, &spec).map(|_| ()))),
        ("head, depth".to_owned(), record_head(false)),
        ("head, depth and rays".to_owned(), record_head(true)),
    ]
}

/// The trajectory module and the sampling head of one image.
fn motion(network: &Network, images: usize, grid: (usize, usize), caps: &Caps) -> [Named; 2] {
    let spec = MotionSpec { images, grid, times: times(images), forced: false };
    let sampling = SamplingSpec { frames: 1, times: images, grid };
    [
        (format!("motion, {images} images"), planned(caps, |g| network.motion(g, &spec).map(|_| ()))),
        (format!("sampling, {images} times"), planned(caps, |g| network.sampling(g, &sampling).map(|_| ()))),
    ]
}

fn times(images: usize) -> Vec<(u32, u32)> {
    (0..images as u32).map(|i| (0, i)).collect()
}

/// The file as it should be.
fn counted() -> String {
    let mut out =
        String::from("# Work of fixed plans: tests/model/work.rs says what is counted and how to accept a change.\n");
    let small = Network::new(NetworkConfig::small());
    let nano = Network::new(NetworkConfig::from_json(&nano()).unwrap());
    for (device, caps) in [("lavapipe", Caps::lavapipe()), ("baseline", Caps::baseline())] {
        let [one, depth, rays] = geometry(&small, 1, (20, 36), &caps);
        let [two, ..] = geometry(&small, 2, (20, 36), &caps);
        let [four, ..] = geometry(&small, 4, (20, 36), &caps);
        section(&mut out, &format!("small, 280x504, {device}"), &[one, two, four, depth, rays]);
        let mut plans = Vec::from(geometry(&nano, 4, (8, 10), &caps));
        plans.extend(motion(&nano, 4, (8, 10), &caps));
        section(&mut out, &format!("nano, 112x140, {device}"), &plans);
    }
    out
}

fn section(out: &mut String, title: &str, plans: &[Named]) {
    writeln!(out, "\n[{title}]").unwrap();
    for (name, plan) in plans {
        let work = plan.work().unwrap();
        writeln!(out, "{name}").unwrap();
        let numbers = [
            ("dispatches", work.dispatches as u64),
            ("pipelines", work.pipelines as u64),
            ("bytes", work.bytes),
            ("multiply-adds", work.multiply_adds),
            ("working bytes", work.working_bytes),
            ("weight bytes", work.weight_bytes),
        ];
        for (what, number) in numbers {
            writeln!(out, "    {what:<14} {number:>15}").unwrap();
        }
    }
}

/// The first lines that differ, with the plan they belong to.
fn difference(expected: &str, found: &str) -> String {
    let (mut plan, mut out) = ("", String::new());
    let mut theirs = expected.lines();
    for line in found.lines() {
        if !line.starts_with(' ') {
            plan = line;
        }
        let before = theirs.next().unwrap_or_default();
        if before != line {
            writeln!(out, "{plan}:\n  was {before}\n  now {line}").unwrap();
        }
    }
    out
}

#[test]
fn plans_do_the_work_that_the_file_says() {
    let path = root().join("tests/data/model/work.txt");
    let found = counted();
    if std::env::var_os("OMNIX_ACCEPT_WORK").is_some() {
        std::fs::write(&path, found).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "the work of fixed plans has changed; if that is meant, run again with OMNIX_ACCEPT_WORK=1\n{}",
        difference(&expected, &found)
    );
}
