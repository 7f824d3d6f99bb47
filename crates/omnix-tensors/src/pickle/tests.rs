//! Instructions one by one, and pickles that were made to do harm.

use super::*;

fn pickle(instructions: &[&[u8]]) -> Vec<u8> {
    let mut bytes = vec![0x80, 2];
    instructions.iter().for_each(|part| bytes.extend_from_slice(part));
    bytes.push(b'.');
    bytes
}

const ROOM: usize = 1000;

/// Why a pickle is refused.
fn flaw(instructions: &[&[u8]]) -> String {
    read(&pickle(instructions), ROOM).unwrap_err().reason
}

#[test]
fn values_are_what_python_makes_of_them() {
    // Each made by CPython's pickle.dumps(value, 2 to 5), by hand where it never writes an instruction.
    let cases: [(&[u8], Value); 12] = [
        (b"N", Value::None),
        (b"\x88", Value::Bool(true)),
        (b"K\xff", Value::Int(255)),
        (b"M\x00\x01", Value::Int(256)),
        (b"J\xfe\xff\xff\xff", Value::Int(-2)),
        (b"\x8a\x00", Value::Int(0)),
        (b"\x8a\x01\xff", Value::Int(-1)),
        (b"\x8a\x05\x00\x00\x00\x00\x01", Value::Int(1 << 32)),
        (b"\x8b\x02\x00\x00\x00\x00\x80", Value::Int(-32768)),
        (b"\x8a\x09\x00\x00\x00\x00\x00\x00\x00\x00\x01", Value::Opaque),
        (b"G\x3f\xf8\x00\x00\x00\x00\x00\x00", Value::Float(1.5)),
        (b"K\x01K\x020", Value::Int(1)),
    ];
    for (instructions, expected) in cases {
        let bytes = pickle(&[instructions]);
        assert_eq!(read(&bytes, ROOM).unwrap().root(), expected, "{instructions:?}");
    }
    for text in [&b"X\x02\x00\x00\x00ab"[..], b"\x8c\x02ab", b"U\x02ab", b"\x8d\x02\0\0\0\0\0\0\0ab"] {
        let bytes = pickle(&[text]);
        let pickle = read(&bytes, ROOM).unwrap();
        assert_eq!(pickle.text(pickle.root()), Some("ab"));
    }
}

#[test]
fn dictionaries_in_every_form() {
    let (one, two): (&[u8], &[u8]) = (b"\x8c\x01aK\x01", b"\x8c\x01bK\x02");
    let forms: [&[&[u8]]; 6] = [
        &[b"}(", one, two, b"u"],
        &[b"}", one, b"s", two, b"s"],
        &[b"(", one, two, b"d"],
        &[b"ccollections\nOrderedDict\n)R(", one, two, b"u"],
        &[b"\x8c\x0bcollections\x8c\x0bOrderedDict\x93)R}b(", one, two, b"u"],
        &[b"ccollections\nOrderedDict\n](](", one, b"e](", two, b"ee\x85R"],
    ];
    for form in forms {
        let bytes = pickle(form);
        let pickle = read(&bytes, ROOM).unwrap();
        let items = pickle.dict(pickle.root()).unwrap();
        let found: Vec<_> = items.iter().map(|(key, value)| (pickle.text(*key).unwrap(), *value)).collect();
        assert_eq!(found, [("a", Value::Int(1)), ("b", Value::Int(2))], "{form:?}");
    }
}

#[test]
fn what_is_put_aside_comes_back() {
    let forms: [&[&[u8]]; 3] = [
        &[b"]q\x07", b"h\x07a", b"h\x07"],
        &[b"]r\x00\x01\x00\x00", b"j\x00\x01\x00\x00a", b"j\x00\x01\x00\x00"],
        &[b"]\x94", b"h\x00a", b"h\x00"],
    ];
    // A list that holds itself, twice on the stack: tuples of both are one value.
    for form in forms {
        let bytes = pickle(&[&form.concat(), b"\x86"]);
        let pickle = read(&bytes, ROOM).unwrap();
        let items = pickle.tuple(pickle.root()).unwrap();
        assert_eq!(items[0], items[1]);
        assert!(matches!(items[0], Value::List(_)));
    }
}

#[test]
fn calls_give_nothing_that_is_not_known() {
    for unknown in
        [&b"cargparse\nNamespace\n)\x81}b"[..], b"cnumpy\ndtype\n)R", b"cmy.module\nThing\n)}\x92", b"\x8f(K\x01\x90"]
    {
        let bytes = pickle(&[unknown]);
        assert_eq!(read(&bytes, ROOM).unwrap().root(), Value::Opaque, "{unknown:?}");
    }
}

#[test]
fn attacks_are_named() {
    for (module, name) in [
        ("os", "system"),
        ("posix", "system"),
        ("nt", "system"),
        ("subprocess", "Popen"),
        ("builtins", "eval"),
        ("builtins", "exec"),
        ("__builtin__", "compile"),
        ("builtins", "__import__"),
        ("importlib", "import_module"),
        ("runpy", "run_path"),
        ("shutil", "rmtree"),
        ("webbrowser", "open"),
        ("pickle", "loads"),
        ("os.path", "expanduser"),
    ] {
        let short = |text: &str| [&[0x8c, text.len() as u8], text.as_bytes()].concat();
        let old = [b"c", module.as_bytes(), b"\n", name.as_bytes(), b"\n(X\x04\x00\x00\x00true\x85R"].concat();
        let new = [&short(module)[..], &short(name), b"\x93"].concat();
        for instructions in [&old, &new] {
            let reason = flaw(&[instructions]);
            assert!(reason.contains(&format!("{module}.{name}")) && reason.contains("Nothing was run"), "{reason}");
        }
    }
}

#[test]
fn what_contradicts_itself_is_refused() {
    let cases: [(&[u8], &str); 24] = [
        (b"0", "more values than there are"),
        (b"(0", "other than one value"),
        (b"\x85", "more values than there are"),
        // Nothing below a mark may be taken.
        (b"K\x01K\x02(\x86", "more values than there are"),
        (b"K\x01(a", "more values than there are"),
        (b"t", "never began"),
        (b"h\x05", "never put aside"),
        (b"j\xff\xff\xff\xff", "never put aside"),
        (b"q\x00", "more values than there are"),
        (b"N(K\x01e", "other than a list"),
        (b"N(K\x01K\x02u", "other than a dictionary"),
        (b"}(K\x01u", "without a value"),
        (b"K\x01K\x02\x93", "without a name"),
        (b"K\x01Q", "other than a storage"),
        (b"\x95\xff\xff\xff\xff\xff\xff\xff\xff", "a frame"),
        (b"X\xff\xff\xff\xff", "the end of the pickle"),
        (b"\x8d\xff\xff\xff\xff\xff\xff\xff\xff", "the end of the pickle"),
        (b"\x8b\xff\xff\xff\x7f", "the end of the pickle"),
        (b"I1\n", "protocol 0"),
        (b"P1\n", "protocol 0"),
        (b"\x82\x01", "extension"),
        (b"\x97", "outside of the pickle"),
        (b"\xff", "0xff"),
        (b"cnoend", "without an end"),
    ];
    for (instructions, part) in cases {
        let reason = flaw(&[instructions]);
        assert!(reason.contains(part), "{instructions:?}: {reason}");
    }
    assert!(read(b"", ROOM).is_err() && read(b"\x80\x01N.", ROOM).is_err() && read(b"\x80\x06N.", ROOM).is_err());
    assert_eq!(read(b"\x80\x02NN.", ROOM).unwrap_err().at, 4);
}

#[test]
fn depth_and_number_are_bounded_by_room_alone() {
    // A hundred thousand tuples in each other, lists likewise, and their end.
    let nested = [vec![b'N'], vec![0x85; 100_000]].concat();
    assert!(read(&pickle(&[&nested]), 1 << 20).is_ok());
    assert!(flaw(&[&nested]).contains("more values"));
    let open = [vec![b'('; 100_000], vec![b']'; 100_000]].concat();
    assert!(flaw(&[&open]).contains("more values"));
    // Doubling: each list holds the one before twice.
    let double = [&b"]"[..], &[b'2', b'2', b'a'].repeat(500)].concat();
    assert!(read(&pickle(&[&double]), ROOM).is_err());
}

#[test]
fn what_is_put_aside_cannot_be_had_again_and_again() {
    // A list of 200 pairs, made into dictionaries without end; and a long text, wanted as a name.
    let pairs = [&b"]("[..], &b"NN\x86".repeat(200), b"eq\x00"].concat();
    let again = b"ccollections\nOrderedDict\nh\x00\x85R".repeat(40);
    let bytes = pickle(&[&pairs, &again, b"."]);
    assert!(read(&bytes, 10_000).unwrap_err().reason.contains("more values"));
    let long = [&b"X"[..], &5000u32.to_le_bytes(), &[b'a'; 5000]].concat();
    let bytes = pickle(&[&long]);
    let read_once = read(&bytes, ROOM).unwrap();
    assert_eq!(read_once.text(read_once.root()), None);
    assert!(flaw(&[&long, b"\x8c\x01b\x93"]).contains("longer than any"));
}

/// All that cutting, and changing any byte of, a pickle with every kind of value gives: an error or a value, no panic.
#[test]
fn damage_never_panics() {
    let whole = pickle(&[
        b"}(\x8c\x01actorch._utils\n_rebuild_tensor_v2\n((\x8c\x07storage",
        b"ctorch\nFloatStorage\n\x8c\x010\x8c\x03cpuK\x06tQK\x00K\x02K\x03\x86K\x03K\x01\x86\x89ccollections\nOrderedDict\n)RtR",
        b"\x8c\x01b](K\x01G\x3f\xf8\x00\x00\x00\x00\x00\x00\x8a\x01\xffeu",
    ]);
    assert!(read(&whole, ROOM).is_ok());
    for end in 0..whole.len() {
        assert!(read(&whole[..end], ROOM).is_err());
    }
    let mut changed = whole.clone();
    for at in 0..whole.len() {
        for byte in 0..=255 {
            changed[at] = byte;
            let _ = read(&changed, ROOM);
        }
        changed[at] = whole[at];
    }
}
