//! Checkpoints as `torch.save` writes them, for tests: a zip archive of a pickle and the numbers of each storage.

use std::io::{Cursor, Write as _};

use omnix_tensors::Dtype;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A tensor: name, type, shape, bytes.
pub type Tensor = (String, Dtype, Vec<usize>, Vec<u8>);

/// A training program's checkpoint of these tensors: `{"epoch": 3, "state_dict": {..}, "optimizer_states": []}`.
///
/// # Panics
/// For a type that no test needs.
#[must_use]
#[expect(clippy::unwrap_used, reason = "it writes to memory")]
pub fn checkpoint(tensors: &[Tensor]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut entry = |name: &str, bytes: &[u8]| {
        // As PyTorch aligns them.
        writer.start_file(format!("checkpoint/{name}"), stored.with_alignment(64)).unwrap();
        writer.write_all(bytes).unwrap();
    };
    let state: Vec<u8> = tensors.iter().enumerate().flat_map(|(k, tensor)| item(k, tensor)).collect();
    let pickle = [
        &b"\x80\x02}("[..],
        &text("epoch"),
        b"K\x03",
        &text("state_dict"),
        b"}(",
        &state,
        b"u",
        &text("optimizer_states"),
        b"]u.",
    ];
    entry("data.pkl", &pickle.concat());
    entry("byteorder", b"little");
    for (k, (.., bytes)) in tensors.iter().enumerate() {
        entry(&format!("data/{k}"), bytes);
    }
    entry("version", b"3\n");
    writer.finish().unwrap().into_inner()
}

/// Name and tensor, as the items of a dictionary.
fn item(key: usize, (name, dtype, shape, bytes): &Tensor) -> Vec<u8> {
    let class = match dtype {
        Dtype::F32 => "FloatStorage",
        Dtype::F16 => "HalfStorage",
        Dtype::BF16 => "BFloat16Storage",
        Dtype::I64 => "LongStorage",
        other => panic!("a test needs no {other}"),
    };
    let mut strides = vec![1; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis] * shape[axis];
    }
    let tuple =
        |sizes: &[usize]| [&b"("[..], &sizes.iter().flat_map(|v| integer(*v)).collect::<Vec<_>>(), b"t"].concat();
    [
        text(name),
        b"ctorch._utils\n_rebuild_tensor_v2\n((".to_vec(),
        text("storage"),
        format!("ctorch\n{class}\n").into_bytes(),
        text(&key.to_string()),
        text("cuda:0"),
        integer(bytes.len() / dtype.size()),
        b"tQK\x00".to_vec(),
        tuple(shape),
        tuple(&strides),
        b"\x89ccollections\nOrderedDict\n)RtR".to_vec(),
    ]
    .concat()
}

fn text(text: &str) -> Vec<u8> {
    [&b"X"[..], &(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn integer(value: usize) -> Vec<u8> {
    [&b"\x8a\x08"[..], &(value as u64).to_le_bytes()].concat()
}
