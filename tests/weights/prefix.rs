//! Networks saved under other names than they are published with: the wrappers of training programs in front of every name.

use std::path::Path;

use omnix::Weights;
use safetensors::SafeTensors;

#[test]
fn a_wrapped_checkpoint_is_the_network_inside() {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights/nano");
    let bytes = std::fs::read(from.join("model.safetensors")).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    // Its configuration says `net.`.
    for prefix in ["module.", "model.", "module.net.", ""] {
        let dir = tempfile::tempdir().unwrap();
        let renamed = file.tensors().into_iter().map(|(name, view)| (name.replacen("net.", prefix, 1), view));
        std::fs::write(dir.path().join("model.safetensors"), safetensors::serialize(renamed, None).unwrap()).unwrap();
        std::fs::copy(from.join("config.json"), dir.path().join("config.json")).unwrap();
        let weights = Weights::open(dir.path()).unwrap();
        assert_eq!(weights.checkpoint().key_prefix(), prefix);
        assert!(weights.report().is_usable() && weights.report().surplus.is_empty(), "{prefix}");
    }
}
