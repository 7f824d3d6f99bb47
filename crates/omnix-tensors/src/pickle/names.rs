//! Functions and classes by what is made of them.

use crate::Dtype;
use crate::pickle::values::{Element, Kind};

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// A dictionary.
    Dict,
    /// A tensor out of (storage, offset, shape, stride, ..), with its type at the end where it is the newest of the functions.
    Tensor {
        typed: bool,
    },
    /// A tensor out of itself and what training adds to it.
    Parameter,
    Refused(Kind),
    /// Anything else, of which nothing is made.
    Unknown,
}

/// What a function or class makes.
pub(super) fn meaning(module: &str, name: &str) -> Meaning {
    match (module, name) {
        ("collections", "OrderedDict" | "defaultdict") | ("builtins" | "__builtin__", "dict") => Meaning::Dict,
        ("torch._utils", name) => match name {
            "_rebuild_tensor" | "_rebuild_tensor_v2" => Meaning::Tensor { typed: false },
            "_rebuild_tensor_v3" => Meaning::Tensor { typed: true },
            "_rebuild_parameter" | "_rebuild_parameter_with_state" => Meaning::Parameter,
            "_rebuild_sparse_tensor" | "_rebuild_sparse_csr_tensor" => Meaning::Refused(Kind::Sparse),
            "_rebuild_qtensor" => Meaning::Refused(Kind::Quantised),
            "_rebuild_nested_tensor" => Meaning::Refused(Kind::Nested),
            "_rebuild_meta_tensor_no_storage" => Meaning::Refused(Kind::Meta),
            "_rebuild_wrapper_subclass"
            | "_rebuild_device_tensor_from_numpy"
            | "_rebuild_device_tensor_from_cpu_tensor" => Meaning::Refused(Kind::Subclass),
            _ => Meaning::Unknown,
        },
        ("torch._tensor", "_rebuild_from_type_v2") => Meaning::Refused(Kind::Subclass),
        _ => Meaning::Unknown,
    }
}

/// The type of the elements of a class of storages, or of a type such as `torch.float32`.
pub(super) fn element(module: &str, name: &str) -> Option<Element> {
    let dtype = match (module, name) {
        ("torch.storage", "UntypedStorage") | ("torch", "UntypedStorage") => return Some(Element::Untyped),
        ("torch", "FloatStorage" | "float32") => Dtype::F32,
        ("torch", "DoubleStorage" | "float64") => Dtype::F64,
        ("torch", "HalfStorage" | "float16") => Dtype::F16,
        ("torch", "BFloat16Storage" | "bfloat16") => Dtype::BF16,
        ("torch", "LongStorage" | "int64") => Dtype::I64,
        ("torch", "IntStorage" | "int32") => Dtype::I32,
        ("torch", "ShortStorage" | "int16") => Dtype::I16,
        ("torch", "CharStorage" | "int8") => Dtype::I8,
        ("torch", "ByteStorage" | "uint8") => Dtype::U8,
        ("torch", "BoolStorage" | "bool") => Dtype::Bool,
        ("torch", "ComplexFloatStorage" | "complex64") => Dtype::C64,
        ("torch", "Float8_e4m3fnStorage" | "float8_e4m3fn") => Dtype::F8E4M3,
        ("torch", "Float8_e5m2Storage" | "float8_e5m2") => Dtype::F8E5M2,
        ("torch", "uint16") => Dtype::U16,
        ("torch", "uint32") => Dtype::U32,
        ("torch", "uint64") => Dtype::U64,
        _ => return None,
    };
    Some(Element::Known(dtype))
}

/// The kind of a storage that holds quantised numbers.
pub(super) fn is_quantised(module: &str, name: &str) -> bool {
    module == "torch"
        && matches!(name, "QInt8Storage" | "QUInt8Storage" | "QInt32Storage" | "QUInt4x2Storage" | "QUInt2x4Storage")
}

/// Whether no checkpoint has a use for a name, and an attack has.
pub(super) fn is_hostile(module: &str, name: &str) -> bool {
    const MODULES: [&str; 29] = [
        "os",
        "posix",
        "nt",
        "sys",
        "subprocess",
        "commands",
        "popen2",
        "pty",
        "shutil",
        "socket",
        "asyncio",
        "runpy",
        "importlib",
        "imp",
        "code",
        "codeop",
        "ctypes",
        "webbrowser",
        "pickle",
        "_pickle",
        "marshal",
        "timeit",
        "cProfile",
        "profile",
        "pdb",
        "bdb",
        "doctest",
        "pip",
        "multiprocessing",
    ];
    const HARMLESS: [&str; 19] = [
        "set",
        "frozenset",
        "dict",
        "list",
        "tuple",
        "object",
        "int",
        "float",
        "bool",
        "complex",
        "str",
        "bytes",
        "bytearray",
        "slice",
        "range",
        "type",
        "NoneType",
        "Ellipsis",
        // How protocol 2 names a class inside of another; nothing is called here.
        "getattr",
    ];
    let top = module.split('.').next().unwrap_or_default();
    match top {
        "builtins" | "__builtin__" => !HARMLESS.contains(&name),
        _ => MODULES.contains(&top),
    }
}
