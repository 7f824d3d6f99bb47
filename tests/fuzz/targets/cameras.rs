//! Known cameras: the first byte says which file it is.
#![no_main]

use omnix_io::cameras;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let Ok(dir) = tempfile::tempdir() else { return };
    let (mut cameras_bin, mut images_bin) = (1u64.to_le_bytes().to_vec(), Vec::new());
    cameras_bin.extend([1u32.to_le_bytes(), 1u32.to_le_bytes()].concat());
    cameras_bin.extend([64u64.to_le_bytes(), 48u64.to_le_bytes()].concat());
    cameras_bin.extend([50.0f64, 50.0, 32.0, 24.0].map(f64::to_le_bytes).concat());
    images_bin.extend(0u64.to_le_bytes());
    let (text, none): (&[u8], &[u8]) = (b"1 PINHOLE 64 48 50 50 32 24\n", b"");
    let files: [(&str, &[u8]); 2] = match kind % 6 {
        0 => [("cameras.bin", bytes), ("images.bin", &images_bin)],
        1 => [("cameras.bin", &cameras_bin), ("images.bin", bytes)],
        2 => [("cameras.txt", bytes), ("images.txt", none)],
        3 => [("cameras.txt", text), ("images.txt", bytes)],
        4 => [("transforms.json", bytes), ("unused", none)],
        _ => [("poses.tum", bytes), ("intrinsics.txt", b"50 50 32 24")],
    };
    for (name, contents) in files {
        if std::fs::write(dir.path().join(name), contents).is_err() {
            return;
        }
    }
    let path = if kind % 6 == 5 { dir.path().join("poses.tum") } else { dir.path().to_owned() };
    let _ = cameras::read(&path);
});
