//! Checkpoints put together by hand: what PyTorch writes rarely, and what it never writes.

use std::io::Write as _;

use crate::{Dtype, TensorFile};

/// A tensor as a pickle describes it.
#[derive(Clone)]
struct Described {
    name: &'static str,
    class: &'static str,
    key: &'static str,
    count: i64,
    offset: i64,
    shape: Vec<i64>,
    stride: Vec<i64>,
}

impl Described {
    fn floats(name: &'static str, key: &'static str, count: i64, offset: i64, shape: &[i64], stride: &[i64]) -> Self {
        Self { name, class: "FloatStorage", key, count, offset, shape: shape.to_vec(), stride: stride.to_vec() }
    }

    fn instructions(&self) -> Vec<u8> {
        let tuple =
            |values: &[i64]| [&b"("[..], &values.iter().flat_map(|v| integer(*v)).collect::<Vec<_>>(), b"t"].concat();
        let class = format!("ctorch\n{}\n", self.class);
        [
            b"ctorch._utils\n_rebuild_tensor_v2\n((",
            &text("storage")[..],
            class.as_bytes(),
            &text(self.key),
            &text("cpu"),
            &integer(self.count),
            b"tQ",
            &integer(self.offset),
            &tuple(&self.shape),
            &tuple(&self.stride),
            b"\x89ccollections\nOrderedDict\n)RtR",
        ]
        .concat()
    }
}

fn text(text: &str) -> Vec<u8> {
    [&b"X"[..], &(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn integer(value: i64) -> Vec<u8> {
    [&b"\x8a\x08"[..], &value.to_le_bytes()].concat()
}

/// A pickle of a dictionary of these values.
fn dictionary(items: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let items: Vec<u8> = items.iter().flat_map(|(key, value)| [text(key), value.clone()].concat()).collect();
    [&b"}("[..], &items, b"u"].concat()
}

fn state(tensors: &[Described]) -> Vec<u8> {
    dictionary(&tensors.iter().map(|tensor| (tensor.name, tensor.instructions())).collect::<Vec<_>>())
}

fn pickled(value: &[u8]) -> Vec<u8> {
    [b"\x80\x02", value, b"."].concat()
}

fn bytes_of(numbers: &[f32]) -> Vec<u8> {
    bytemuck::cast_slice(numbers).to_vec()
}

/// An archive of these entries, written by a library of its own.
fn archive(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    packed(entries, zip::CompressionMethod::Stored)
}

fn packed(entries: &[(&str, Vec<u8>)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in entries {
        writer.start_file(*name, options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A file of one storage of the numbers 0 to 11 under the key 0, and of these tensors.
fn of(tensors: &[Described]) -> Result<TensorFile, String> {
    let numbers: Vec<f32> = (0..12).map(|v| v as f32).collect();
    open(archive(&[("a/data.pkl", pickled(&state(tensors))), ("a/data/0", bytes_of(&numbers))]))
}

fn open(bytes: Vec<u8>) -> Result<TensorFile, String> {
    TensorFile::from_bytes(bytes.into(), "file.pt").map_err(|error| error.to_string())
}

fn numbers(file: &TensorFile, name: &str) -> Vec<f32> {
    file.tensor(name).unwrap().to_f32()
}

#[test]
fn views_of_one_storage_are_read_in_order() {
    let f = Described::floats;
    let file = of(&[
        f("whole", "0", 12, 0, &[3, 4], &[4, 1]),
        f("part", "0", 12, 2, &[3], &[1]),
        f("turned", "0", 12, 0, &[4, 3], &[1, 4]),
        f("last", "0", 12, 11, &[], &[]),
        f("sparse rows", "0", 12, 1, &[2, 2], &[6, 2]),
        f("nothing", "0", 12, 12, &[0, 5], &[5, 1]),
        f("nothing inside", "0", 12, 3, &[0], &[1]),
        f("nothing odd", "0", 12, 3, &[0, 1 << 40], &[0, 0]),
        f("one", "0", 12, 3, &[1, 1], &[77, 99]),
        f("again", "0", 12, 0, &[3, 4], &[4, 1]),
        f("flat", "0", 12, 0, &[12], &[1]),
    ])
    .unwrap();
    let counted = |range: std::ops::Range<i32>| range.map(|v| v as f32).collect::<Vec<_>>();
    assert_eq!(numbers(&file, "again"), counted(0..12));
    // The same bytes under the name that comes later in order: as safetensors files say it, in the metadata.
    assert_eq!(file.metadata().get("whole").map(String::as_str), Some("again"));
    assert_eq!(numbers(&file, "flat"), counted(0..12));
    assert_eq!(numbers(&file, "part"), counted(2..5));
    assert_eq!(numbers(&file, "turned"), [0., 4., 8., 1., 5., 9., 2., 6., 10., 3., 7., 11.]);
    assert_eq!((numbers(&file, "last"), file.info("last").unwrap().shape.len()), (vec![11.0], 0));
    assert_eq!(numbers(&file, "sparse rows"), [1., 3., 7., 9.]);
    assert_eq!((numbers(&file, "nothing"), file.info("nothing").unwrap().shape.clone()), (vec![], vec![0, 5]));
    assert_eq!(numbers(&file, "one"), [3.0]);
    for name in ["nothing inside", "nothing odd"] {
        assert_eq!((file.info(name).unwrap().byte_len(), file.info(name).unwrap().elements()), (0, 0), "{name}");
    }
}

#[test]
fn every_number_is_looked_at_and_every_byte_is_hashed() {
    let mut values: Vec<f32> = (0..12).map(|v| v as f32).collect();
    values[7] = f32::NAN;
    let f = Described::floats;
    // In order and not: both hold the number.
    let tensors = [f("a", "0", 12, 0, &[12], &[1]), f("b", "0", 12, 0, &[4, 3], &[1, 4])];
    let bytes = archive(&[
        ("x/data.pkl", pickled(&state(&tensors))),
        ("x/data/0", bytes_of(&values)),
        ("x/version", b"3\n".to_vec()),
    ]);
    let file = open(bytes.clone()).unwrap();
    let (mut together, mut found) = (Vec::new(), Vec::new());
    let _ = file.in_pieces(&mut |piece| -> std::ops::ControlFlow<()> {
        together.extend_from_slice(piece.bytes);
        found.extend(
            piece.examine().into_iter().map(|(name, found)| (name.to_owned(), found.non_finite.map(|(at, _)| at))),
        );
        std::ops::ControlFlow::Continue(())
    });
    assert_eq!(together, bytes);
    found.sort();
    assert_eq!(found, [("a".to_owned(), Some(7)), ("b".to_owned(), Some(10))]);
}

#[test]
fn networks_are_found_beside_other_things() {
    let tensor = Described::floats("net.a", "0", 12, 0, &[12], &[1]);
    let network = state(std::slice::from_ref(&tensor));
    let optimiser = dictionary(&[("state", b"}".to_vec()), ("lr", b"G\x3f\xf8\0\0\0\0\0\0".to_vec())]);
    let odd = Described { class: "ComplexDoubleStorage", ..tensor.clone() }.instructions();
    let shapes: [(&str, Vec<u8>); 6] = [
        // Single tensors beside it, also of types that are not known.
        (
            "rng_state, best",
            dictionary(&[("rng_state", tensor.instructions()), ("best", odd), ("state_dict", network.clone())]),
        ),
        ("", network.clone()),
        (
            "epoch, optimizer",
            dictionary(&[("epoch", integer(3)), ("state_dict", network.clone()), ("optimizer", optimiser.clone())]),
        ),
        ("optimizer", dictionary(&[("optimizer", optimiser), ("model", network.clone())])),
        ("epoch", dictionary(&[("model", dictionary(&[("state_dict", network.clone())])), ("epoch", integer(1))])),
        ("_extra_state", dictionary(&[("net.a", tensor.instructions()), ("_extra_state", b"cmy\nThing\n)R".to_vec())])),
    ];
    for (beside, value) in shapes {
        let file = open(archive(&[("data.pkl", pickled(&value)), ("data/0", vec![0; 48])])).unwrap();
        assert_eq!(file.tensors().map(|(name, _)| name).collect::<Vec<_>>(), ["net.a"]);
        assert_eq!(file.metadata().get("left out").map_or("", String::as_str), beside);
    }
}

#[test]
fn types_have_their_names() {
    let kinds = [
        ("FloatStorage", Dtype::F32),
        ("DoubleStorage", Dtype::F64),
        ("HalfStorage", Dtype::F16),
        ("BFloat16Storage", Dtype::BF16),
        ("LongStorage", Dtype::I64),
        ("ByteStorage", Dtype::U8),
        ("BoolStorage", Dtype::Bool),
    ];
    for (class, dtype) in kinds {
        let tensor = Described { class, ..Described::floats("a", "0", 2, 0, &[2], &[1]) };
        let bytes = archive(&[("m/data.pkl", pickled(&state(&[tensor]))), ("m/data/0", vec![0; 2 * dtype.size()])]);
        assert_eq!(open(bytes).unwrap().info("a").unwrap().known(), Some(dtype), "{class}");
    }
    // A storage of bytes, whose type the tensor says.
    let untyped = [
        &b"ctorch._utils\n_rebuild_tensor_v3\n(("[..],
        &text("storage"),
        b"ctorch.storage\nUntypedStorage\n",
        &text("0"),
        &text("cpu"),
        b"K\x04tQK\x00K\x02\x85K\x01\x85\x89}ctorch\nbfloat16\ntR",
    ]
    .concat();
    let bytes =
        archive(&[("m/data.pkl", pickled(&dictionary(&[("a", untyped)]))), ("m/data/0", vec![0x80, 0x3f, 0, 0x40])]);
    assert_eq!(numbers(&open(bytes).unwrap(), "a"), [1.0, 2.0]);
}

#[test]
fn tensors_that_contradict_their_storage_are_refused() {
    let f = Described::floats;
    let cases = [
        (f("a", "0", 12, 0, &[13], &[1]), "more elements than its storage"),
        // A view of a trillion elements of one number.
        (f("a", "0", 12, 0, &[1_000_000, 1_000_000], &[0, 0]), "expanded view"),
        (f("a", "0", 12, 1, &[12], &[1]), "beyond its storage"),
        (f("a", "0", 12, 13, &[0], &[1]), "beyond its storage"),
        (f("a", "0", 12, i64::MAX, &[1], &[1]), "beyond its storage"),
        (f("a", "0", 12, 0, &[2, 2], &[i64::MAX, 1]), "beyond its storage"),
        (f("a", "0", 12, 0, &[i64::MAX, i64::MAX, 4], &[1, 1, 1]), "more elements"),
        (f("a", "0", 12, 0, &[1 << 40, 1 << 40, 0], &[1, 1, 1]), "larger than any memory"),
        (f("a", "0", 12, 0, &[-1], &[1]), "shape and strides"),
        (f("a", "0", 12, -1, &[1], &[1]), "shape and strides"),
        (f("a", "0", 12, 0, &[2, 2], &[1]), "shape and strides"),
        (f("a", "0", 12, 0, &vec![1; 65], &vec![1; 65]), "shape and strides"),
        (f("a", "0", 13, 0, &[1], &[1]), "the file is damaged"),
        (f("a", "0", i64::MAX, 0, &[1], &[1]), "the file is damaged"),
        (f("a", "0", -12, 0, &[1], &[1]), "something other than a storage"),
        (f("a", "1", 12, 0, &[1], &[1]), "no entry a/data/1"),
        (f("a", "../../data/0", 12, 0, &[1], &[1]), "no entry"),
        (Described { class: "QInt8Storage", ..f("a", "0", 48, 0, &[1], &[1]) }, "a quantised tensor"),
        (Described { class: "Float4Storage", ..f("a", "0", 12, 0, &[1], &[1]) }, "a type that is not known"),
    ];
    for (tensor, part) in cases {
        let message = of(&[tensor]).unwrap_err();
        assert!(message.contains(part) && message.contains("file.pt"), "{message}");
    }
    let twice = of(&[f("a", "0", 12, 0, &[1], &[1]), f("a", "0", 12, 1, &[1], &[1])]).unwrap_err();
    assert!(twice.contains("twice"), "{twice}");
    // Copies of views take no more memory than the file: a thousand views of everything are refused.
    let names: Vec<&'static str> = (0..1000).map(|k| &*Box::leak(format!("t{k}").into_boxed_str())).collect();
    let many = [vec![0; 1 << 20]];
    let views: Vec<_> = names.iter().map(|name| f(name, "0", 1 << 18, 0, &[1 << 9, 1 << 9], &[1, 1 << 9])).collect();
    let message = open(archive(&[("data.pkl", pickled(&state(&views))), ("data/0", many[0].clone())])).unwrap_err();
    assert!(message.contains("over each other"), "{message}");
}

#[test]
fn kinds_of_tensors_and_of_files_that_cannot_be_read_are_named() {
    let call = |name: &str| format!("ctorch._utils\n{name}\n)R").into_bytes();
    let good = Described::floats("net.a", "0", 12, 0, &[12], &[1]);
    for (name, part) in [
        ("_rebuild_sparse_tensor", "a sparse tensor"),
        ("_rebuild_qtensor", "a quantised tensor"),
        ("_rebuild_nested_tensor", "a nested tensor"),
        ("_rebuild_meta_tensor_no_storage", "without numbers"),
        ("_rebuild_wrapper_subclass", "a class of its own"),
    ] {
        let state = dictionary(&[("net.a", good.instructions()), ("net.b", call(name))]);
        let message = open(archive(&[("data.pkl", pickled(&state)), ("data/0", vec![0; 48])])).unwrap_err();
        assert!(message.contains("net.b") && message.contains(part), "{message}");
    }
    let whole = |value: &[u8]| vec![("m/data.pkl", pickled(value)), ("m/data/0", vec![0; 48])];
    let with = |name: &'static str, bytes: &[u8]| {
        let mut entries = whole(&state(std::slice::from_ref(&good)));
        entries.push((name, bytes.to_vec()));
        archive(&entries)
    };
    let deflated = packed(&whole(&state(std::slice::from_ref(&good))), zip::CompressionMethod::Deflated);
    let files = [
        (archive(&whole(b"cmy.module\nNetwork\n)\x81}b")), "state_dict()"),
        (archive(&whole(&good.instructions())), "a single tensor"),
        (archive(&whole(b"]")), "no dictionary of tensors"),
        (archive(&whole(b"}")), "no tensors are in it"),
        (archive(&whole(&dictionary(&[("a", integer(1))]))), "no tensors are in it"),
        (archive(&whole(b"cposix\nsystem\nX\x02\0\0\0id\x85R")), "posix.system"),
        (with("m/byteorder", b"big"), "big-endian"),
        (with("m/code/__torch__.py", b""), "TorchScript"),
        (with("m/constants.pkl", b""), "TorchScript"),
        (with("n/data.pkl", b""), "more than one data.pkl"),
        (archive(&[("word/document.xml", vec![])]), "without data.pkl"),
        (archive(&[("deep/er/data.pkl", pickled(b"}"))]), "without data.pkl"),
        (deflated, "compressed"),
        (b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.".to_vec(), "before 1.6"),
        ([&[b'x'; 257][..], b"ustar", &[0; 300]].concat(), "tar archive"),
    ];
    for (bytes, part) in files {
        let message = open(bytes).unwrap_err();
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(open(with("m/byteorder", b"little")).is_ok());
}

/// Cut anywhere, and with any byte of its directory and pickle changed: an error or a file, no panic.
#[test]
fn damage_never_panics() {
    let f = Described::floats;
    let tensors = [f("a", "0", 12, 0, &[3, 4], &[4, 1]), f("b", "0", 12, 0, &[4, 3], &[1, 4])];
    let whole = archive(&[
        ("m/data.pkl", pickled(&state(&tensors))),
        ("m/byteorder", b"little".to_vec()),
        ("m/data/0", vec![0; 48]),
    ]);
    for end in 0..whole.len() {
        assert!(open(whole[..end].to_vec()).is_err(), "cut at {end}");
    }
    for at in 0..whole.len() {
        for change in [0x01, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            let _ = open(bytes);
        }
    }
}
