//! A saved field, opened from a file.
#![no_main]

use omnix_io::output::field::FieldReader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(dir) = tempfile::tempdir() else { return };
    let path = dir.path().join("field.safetensors");
    if std::fs::write(&path, bytes).is_err() {
        return;
    }
    let Ok(field) = FieldReader::open(&path) else { return };
    for spec in field.specs() {
        let _ = field.read(&spec.name, 0..spec.len());
    }
});
