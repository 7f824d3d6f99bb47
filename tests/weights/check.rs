//! The check of a checkpoint against what a network expects.

use omnix_weights::{CheckReport, Checkpoint, Manifest, WeightsError, check};

use crate::fixture;

fn checkpoint() -> Checkpoint {
    let tensors = [
        fixture::f32("model.backbone.pretrained.cls_token", &[1, 1, 4], &[0.0; 4]),
        fixture::f16("model.backbone.pretrained.blocks.0.norm1.weight", &[4], &[1.0; 4]),
        fixture::f16("model.backbone.pretrained.blocks.1.norm1.weight", &[4], &[1.0; 4]),
        fixture::f32("model.head.scratch.output_conv2_aux.0.2.bias", &[2], &[0.0; 2]),
        fixture::f32("model.gs_head.a", &[1], &[0.0]),
        fixture::i64("model.odd", &[1]),
        fixture::i64("steps", &[1]),
    ];
    Checkpoint::from_bytes("test", "{}", fixture::file(&tensors, &[]).into()).unwrap()
}

fn manifest() -> Manifest {
    let mut manifest = Manifest::new();
    manifest
        .require("backbone.pretrained.cls_token", &[1, 1, 4])
        .require("backbone.pretrained.blocks.0.norm1.weight", &[4])
        .require("backbone.pretrained.blocks.1.norm1.weight", &[4])
        .require("head.scratch.output_conv2_aux.3.2.bias", &[2])
        .optional("head.scratch.output_conv2_aux.0.2.bias", &[2])
        .optional("cam_enc.a", &[1])
        .ignore("gs_head.")
        .ignore("odd");
    manifest
}

#[test]
fn a_fitting_file_has_nothing_to_report() {
    let report = check(&checkpoint(), &manifest()).into_result().unwrap();
    assert!(report.is_usable());
    let empty = CheckReport::default();
    assert_eq!(
        (&report.missing, &report.wrong_shape, &report.surplus),
        (&empty.missing, &empty.wrong_shape, &empty.surplus)
    );
    assert_eq!(report.ignored, ["gs_head.a", "odd", "steps"]);
    assert_eq!(report.seems, "Depth Anything 3, width 4, 2 blocks, with a Gaussian head");
}

#[test]
fn every_difference_is_named() {
    let mut manifest = Manifest::new();
    manifest
        .require("backbone.pretrained.cls_token", &[1, 1, 8])
        .require("backbone.pretrained.blocks.0.norm1.weight", &[4])
        .require("backbone.pretrained.blocks.2.norm1.weight", &[4])
        .require("odd", &[1])
        .optional("gs_head.a", &[2]);
    let error = check(&checkpoint(), &manifest).into_result().unwrap_err();
    let message = error.to_string();
    let WeightsError::Mismatch { report } = error else { panic!("{message}") };
    assert_eq!(report.missing, ["backbone.pretrained.blocks.2.norm1.weight"]);
    let shapes: Vec<_> = report.wrong_shape.iter().map(|w| (w.name.as_str(), &w.expected[..], &w.found[..])).collect();
    assert_eq!(shapes, [("backbone.pretrained.cls_token", &[1, 1, 8][..], &[1, 1, 4][..]), ("gs_head.a", &[2], &[1]),]);
    assert_eq!(report.unsupported, [("odd".to_owned(), "I64".to_owned())]);
    assert_eq!(
        report.surplus,
        ["backbone.pretrained.blocks.1.norm1.weight", "head.scratch.output_conv2_aux.0.2.bias",]
    );
    assert_eq!(report.ignored, ["steps"]);
    for part in
        ["1 missing (backbone.pretrained.blocks.2", "[1, 1, 4] instead of [1, 1, 8]", "odd I64", "seems to be Depth"]
    {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn long_lists_are_cut_with_their_number() {
    let mut manifest = Manifest::new();
    for k in 0..25 {
        manifest.require(format!("absent.{k}"), &[1]);
    }
    let message = check(&checkpoint(), &manifest).into_result().unwrap_err().to_string();
    assert!(message.contains("25 missing (absent.0") && message.contains("absent.9, and 15 more"), "{message}");
    assert!(!message.contains("absent.10"), "{message}");
}

#[test]
fn a_file_of_something_else_says_so() {
    let bytes = fixture::file(&[fixture::f32("lm_head.weight", &[1], &[0.0])], &[]);
    let checkpoint = Checkpoint::from_bytes("llm", "{}", bytes.into()).unwrap();
    let message = check(&checkpoint, &manifest()).into_result().unwrap_err().to_string();
    assert!(message.contains("neither Depth Anything 3 nor OmniX") && message.contains("lm_head.weight"), "{message}");
}
