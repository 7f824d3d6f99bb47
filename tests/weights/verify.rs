//! One pass over a checkpoint: its digest and what is odd about its numbers, by one or several at a time.

use std::ops::ControlFlow;

use omnix_weights::{Checkpoint, Findings};

use crate::fixture;

/// Shards whose tensors fill several pieces, with an infinite number, a large one, and a tensor that is no float.
fn shards(folder: &std::path::Path) -> Checkpoint {
    let mut first = vec![0.5f32; 6 << 20];
    first[5 << 20] = f32::INFINITY;
    first[7] = -70000.0;
    let halves = vec![0.25f32; 1 << 20];
    let a = fixture::file(&[fixture::f32("a", &[6 << 20], &first), fixture::i64("steps", &[i64::MAX])], &[]);
    let b = fixture::file(&[fixture::bf16("b", &[1 << 20], &halves), fixture::f64("c", &[2], &[1.0, 1e300])], &[]);
    std::fs::write(folder.join("a.safetensors"), &a).unwrap();
    std::fs::write(folder.join("b.safetensors"), &b).unwrap();
    std::fs::write(folder.join("config.json"), "{}").unwrap();
    let map = r#"{"a": "a.safetensors", "steps": "a.safetensors", "b": "b.safetensors", "c": "b.safetensors"}"#;
    let index = format!(r#"{{"weight_map": {map}}}"#);
    std::fs::write(folder.join("model.safetensors.index.json"), index).unwrap();
    Checkpoint::open(folder).unwrap()
}

#[test]
fn findings_name_tensors_and_the_digest_is_that_of_the_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let checkpoint = shards(dir.path());
    assert!(checkpoint.verified().is_none());
    let mut reports = Vec::new();
    let verified = checkpoint.verify(&mut |done, total| {
        reports.push((done, total));
        ControlFlow::Continue(())
    });
    let verified = verified.unwrap();
    let size = |name: &str| std::fs::metadata(dir.path().join(name)).unwrap().len();
    let total = size("a.safetensors") + size("b.safetensors");
    assert!(reports.len() >= 3 && reports.is_sorted_by(|a, b| a.0 < b.0), "{reports:?}");
    assert_eq!(reports.last(), Some(&(total, total)));
    let a = Findings { non_finite: Some((5 << 20, f32::INFINITY)), beyond_f16: Some((7, -70000.0)) };
    let c = Findings { non_finite: Some((1, f32::INFINITY)), beyond_f16: None };
    assert_eq!(verified.findings().collect::<Vec<_>>(), [("a", a), ("c", c)]);
    assert_eq!((checkpoint.findings(verified, "a"), checkpoint.findings(verified, "b")), (a, Findings::default()));
    // The digest of both files together, by way of one file that holds the bytes of both.
    assert_eq!(checkpoint.digest(), verified.digest());
    let again = Checkpoint::open(dir.path()).unwrap();
    assert_eq!(again.digest(), verified.digest());
    let single = Checkpoint::from_bytes("empty", "{}", fixture::raw("{}", &[]).into()).unwrap();
    assert_ne!(single.digest(), verified.digest());
}

#[test]
fn who_waits_gets_the_same_and_who_breaks_off_leaves_it_to_the_next() {
    let dir = tempfile::tempdir().unwrap();
    let checkpoint = shards(dir.path());
    let broken = checkpoint.verify(&mut |_, _| ControlFlow::Break(()));
    assert!(broken.is_none() && checkpoint.verified().is_none());
    let digests: Vec<&str> = std::thread::scope(|scope| {
        let ask = || checkpoint.verify(&mut |_, _| ControlFlow::Continue(())).unwrap().digest();
        let asking: Vec<_> = (0..4).map(|_| scope.spawn(ask)).collect();
        asking.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(digests.iter().all(|digest| *digest == checkpoint.digest() && digest.len() == 64), "{digests:?}");
}
