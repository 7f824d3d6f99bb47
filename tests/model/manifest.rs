//! What networks expect of their checkpoints: counts of the published ones, and real files.

use std::collections::BTreeMap;

use omnix_model::{NetworkConfig, Parts, manifest};
use omnix_weights::{Checkpoint, Manifest, Requirement, check};

use crate::fixture;

fn count(manifest: &Manifest, start: &str) -> (usize, usize) {
    let parts = manifest.expected().iter().filter(|e| e.name.starts_with(start));
    parts.fold((0, 0), |(tensors, numbers), e| (tensors + 1, numbers + e.shape.iter().product::<usize>()))
}

/// `spec/da3.md` section 1: parameters counted by instantiation, tensors in the file.
#[test]
fn published_networks_have_their_number_of_parameters() {
    let rows = [
        (NetworkConfig::small(), [22_059_008, 3_873_854, 7_178_496, 1_188_105], 34_299_463, 437),
        (NetworkConfig::base(), [86_583_296, 15_387_582, 28_660_224, 4_735_497], 135_366_599, 437),
        (NetworkConfig::large(), [304_373_760, 47_229_246, 50_927_616, 8_411_145], 410_941_767, 637),
        (NetworkConfig::giant(), [1_136_489_216, 50_114_878, 114_533_376, 18_908_169], 1_355_674_125, 971),
    ];
    for (config, parts, total, tensors) in rows {
        let manifest = manifest(&config, &Parts { rays: true, given_cameras: true, motion: true, gaussians: true });
        for (start, expected) in ["backbone.", "head.", "cam_enc.", "cam_dec."].into_iter().zip(parts) {
            assert_eq!(count(&manifest, start).1, expected, "{} {start}", config.name);
        }
        let (found, numbers) = count(&manifest, "");
        assert_eq!(numbers, total, "{}", config.name);
        assert_eq!(found, tensors, "{}", config.name);
        assert_eq!(count(&manifest, "gs_head.").1, if config.gaussians.is_some() { 35_628_486 } else { 0 });
    }
    let all = Parts { rays: true, given_cameras: true, motion: true, gaussians: true };
    let metric = manifest(&NetworkConfig::metric(), &all);
    assert_eq!(count(&metric, "backbone."), (342, 304_367_616));
    assert_eq!((count(&metric, "head.").1, count(&metric, "")), (29_803_778, (406, 334_171_394)));
    let nested = manifest(&NetworkConfig::nested(), &all);
    assert_eq!(count(&nested, "da3_metric."), (406, 334_171_394));
    assert_eq!(count(&nested, ""), (1377, 1_689_845_519));
}

#[test]
fn parts_decide_what_is_required() {
    let config = NetworkConfig::small();
    let required = |parts: &Parts, start: &str, part: &str| {
        let manifest = manifest(&config, parts);
        let needed = manifest.expected().iter().filter(|e| e.requirement == Requirement::Required);
        needed.filter(|e| e.name.starts_with(start) && e.name.contains(part)).count()
    };
    let least = Parts::default();
    assert_eq!((required(&least, "", "_aux"), required(&least, "cam_enc.", "")), (0, 0));
    assert!(required(&least, "cam_dec.", "") == 10 && required(&least, "head.", "") > 40);
    let rays = Parts { rays: true, ..least };
    assert!(required(&rays, "", "refinenet1_aux") > 0 && required(&rays, "", "output_conv1_aux.3") == 10);
    assert_eq!(required(&rays, "", "output_conv1_aux.2"), 0, "no level but the finest is read");
    assert_eq!(required(&rays, "", "output_conv2_aux.0.2"), 2, "the shared norm is level 0's");
    assert_eq!(required(&Parts { given_cameras: true, ..least }, "cam_enc.", ""), 56 + 8);
}

#[test]
fn lists_of_real_files_agree() {
    for name in ["tiny-a", "tiny-b", "mixed"] {
        let list = fixture::json(&format!("{name}.tensors"));
        let mut found: BTreeMap<String, Vec<usize>> = serde_json::from_value(list).unwrap();
        let config = fixture::config(name);
        let manifest = manifest(&config, &Parts { rays: true, given_cameras: true, motion: true, gaussians: true });
        for expected in manifest.expected() {
            assert_eq!(found.remove(&expected.name).as_ref(), Some(&expected.shape), "{name} {}", expected.name);
        }
        let known: Vec<String> = (1..4).map(|level| format!("head.scratch.output_conv2_aux.{level}.2.")).collect();
        found.retain(|name, _| !known.iter().any(|start| name.starts_with(start.as_str())));
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

#[test]
fn real_checkpoints_pass() {
    let mut folders = vec![fixture::root().join("assets/weights/nano")];
    for folder in [
        "golden/da3/tiny-a",
        "golden/da3/tiny-b",
        "golden/da3/tiny-mono",
        "golden/da3/tiny-nested",
        "golden/omnix/mixed",
        "golden/omnix/single-video",
    ] {
        folders.extend(fixture::shared(folder));
    }
    for folder in folders {
        let checkpoint = Checkpoint::open(&folder).unwrap();
        let config = NetworkConfig::from_json(checkpoint.config_json()).unwrap();
        let given_cameras = config.camera_encoder.is_some();
        let report =
            check(&checkpoint, &manifest(&config, &Parts { rays: true, given_cameras, motion: true, gaussians: true }));
        assert!(report.is_usable(), "{report}");
        assert!(report.surplus.is_empty(), "{report}");
    }
}

#[test]
fn another_network_is_told_apart() {
    let checkpoint = Checkpoint::open(&fixture::root().join("assets/weights/nano")).unwrap();
    let report = check(&checkpoint, &manifest(&NetworkConfig::small(), &Parts::default()));
    assert!(!report.is_usable() && !report.missing.is_empty() && !report.wrong_shape.is_empty());
}
