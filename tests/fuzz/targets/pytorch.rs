//! A pickle inside an archive that is right: the archive's own numbers would keep most changed pickles from being read.
#![no_main]

use omnix_tensors::TensorFile;

libfuzzer_sys::fuzz_target!(|pickle: &[u8]| {
    let numbers: Vec<u8> = (0..256).map(|v| v as u8).collect();
    let bytes = archive(&[("m/data.pkl", pickle), ("m/data/0", &numbers), ("m/data/1", &numbers[..16])]);
    let Ok(file) = TensorFile::from_bytes(bytes.into(), "fuzz") else { return };
    for (name, info) in file.tensors() {
        assert!(info.byte_len() <= 256);
        let _ = file.tensor(name).map(|tensor| tensor.to_f32());
    }
});

/// A zip archive of entries stored as they are.
fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, contents) in entries {
        let (length, local) = ((contents.len() as u32).to_le_bytes(), (bytes.len() as u32).to_le_bytes());
        let name_length = (name.len() as u16).to_le_bytes();
        bytes.extend([b"PK\x03\x04", &[0; 14][..], &length, &length, &name_length, &[0; 2], name.as_bytes(), contents].concat());
        directory.extend(
            [b"PK\x01\x02", &[0; 16][..], &length, &length, &name_length, &[0; 12], &local, name.as_bytes()].concat(),
        );
    }
    let (count, start) = ((entries.len() as u16).to_le_bytes(), (bytes.len() as u32).to_le_bytes());
    let size = (directory.len() as u32).to_le_bytes();
    bytes.extend([&directory[..], b"PK\x05\x06", &[0; 4], &count, &count, &size, &start, &[0; 2]].concat());
    bytes
}
