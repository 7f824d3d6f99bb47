//! A configuration beside a file of one tensor.
#![no_main]

use omnix_weights::{Checkpoint, describe};

const HEADER: &str = r#"{"net.a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let weights = [&(HEADER.len() as u64).to_le_bytes(), HEADER.as_bytes(), &[0; 4]].concat();
    let checkpoint = match Checkpoint::from_bytes("fuzz", text, weights.into()) {
        Err(omnix_weights::WeightsError::ConfigInvalid { .. }) => return,
        other => other.expect("the weights are right"),
    };
    let _ = (describe(&checkpoint), checkpoint.resolve("a"), checkpoint.name().len());
});
