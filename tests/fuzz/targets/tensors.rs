//! A file of tensors, as it is: safetensors, PyTorch or anything else.
#![no_main]

use std::ops::ControlFlow;

use omnix_tensors::TensorFile;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = TensorFile::from_bytes(bytes.to_vec().into(), "fuzz") else { return };
    let names: Vec<String> = file.tensors().map(|(name, _)| name.to_owned()).collect();
    for name in &names {
        let _ = file.tensor(name).map(|tensor| tensor.to_f32());
    }
    let mut read = 0;
    let _ = file.in_pieces(&mut |piece| -> ControlFlow<()> {
        read += piece.bytes.len();
        let _ = piece.examine();
        ControlFlow::Continue(())
    });
    assert_eq!(read, bytes.len());
});
