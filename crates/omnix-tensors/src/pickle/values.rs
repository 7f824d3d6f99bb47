//! What a pickle holds.

/// Bytes of the pickle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Span {
    start: u32,
    length: u32,
}

/// A value. Numbers index the tables of the [`Pickle`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Value {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    /// UTF-8 text.
    Text(Span),
    Bytes(Span),
    Tuple(u32),
    List(u32),
    Dict(u32),
    /// A function or class, by its name.
    Global(u32),
    /// Numbers of a tensor, as a file of their own.
    Storage(u32),
    Tensor(u32),
    /// A tensor of a kind that is not supported.
    Refused(Kind),
    /// What a function or class that is not known would give.
    Opaque,
}

/// Tensors that cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Sparse,
    Quantised,
    Nested,
    /// A shape without numbers.
    Meta,
    /// A class of somebody's own.
    Subclass,
    /// Numbers of a type that is not known.
    Type,
}

impl Kind {
    /// As messages say it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Sparse => "a sparse tensor",
            Self::Quantised => "a quantised tensor",
            Self::Nested => "a nested tensor",
            Self::Meta => "a tensor without numbers (of the device meta)",
            Self::Subclass => "a tensor of a class of its own",
            Self::Type => "a tensor of numbers of a type that is not known here",
        }
    }
}

/// The type of numbers, as PyTorch names its storages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Element {
    /// With the name that safetensors gives it, and its bytes.
    Known(crate::Dtype),
    /// Bytes whose type the tensor says.
    Untyped,
}

/// Numbers that lie in an entry of the archive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Storage {
    /// The name of the entry below `data/`.
    pub(crate) key: Span,
    pub(crate) element: Element,
    /// Number of elements that the pickle says.
    pub(crate) count: u64,
}

/// A tensor: a view of a storage.
#[derive(Debug, Clone)]
pub(crate) struct Rebuilt {
    pub(crate) storage: u32,
    /// Elements before its first.
    pub(crate) offset: u64,
    pub(crate) shape: Box<[u64]>,
    /// Elements from one to the next, along each axis.
    pub(crate) stride: Box<[u64]>,
    /// Its type, where the storage does not say it.
    pub(crate) element: Element,
}

/// A pickle that was read.
#[derive(Debug)]
pub(crate) struct Pickle<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) root: Value,
    pub(super) tuples: Vec<Box<[Value]>>,
    pub(super) lists: Vec<Vec<Value>>,
    pub(super) dicts: Vec<Vec<(Value, Value)>>,
    /// Module and name.
    pub(super) globals: Vec<(Span, Span)>,
    pub(super) storages: Vec<Storage>,
    pub(super) tensors: Vec<Rebuilt>,
}

impl<'a> Pickle<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            root: Value::None,
            tuples: Vec::new(),
            lists: Vec::new(),
            dicts: Vec::new(),
            globals: Vec::new(),
            storages: Vec::new(),
            tensors: Vec::new(),
        }
    }

    /// The value that the pickle is of.
    pub(crate) const fn root(&self) -> Value {
        self.root
    }

    /// A text of a length that names have, if the value is one. (Longer ones could be looked at again and again.)
    pub(crate) fn text(&self, value: Value) -> Option<&'a str> {
        const LONGEST: usize = 4096;
        match value {
            Value::Text(span) if span.len() <= LONGEST => std::str::from_utf8(self.span(span)).ok(),
            _ => None,
        }
    }

    /// The items of a dictionary, in the order they were put in, if the value is one.
    pub(crate) fn dict(&self, value: Value) -> Option<&[(Value, Value)]> {
        if let Value::Dict(at) = value { Some(&self.dicts[at as usize]) } else { None }
    }

    /// The items of a tuple, if the value is one.
    pub(super) fn tuple(&self, value: Value) -> Option<&[Value]> {
        if let Value::Tuple(at) = value { Some(&self.tuples[at as usize]) } else { None }
    }

    /// A tensor, if the value is one.
    pub(crate) fn tensor(&self, value: Value) -> Option<&Rebuilt> {
        if let Value::Tensor(at) = value { Some(&self.tensors[at as usize]) } else { None }
    }

    /// The numbers of a tensor.
    pub(crate) fn storage(&self, tensor: &Rebuilt) -> (&'a str, Storage) {
        let storage = self.storages[tensor.storage as usize];
        (std::str::from_utf8(self.span(storage.key)).unwrap_or_default(), storage)
    }

    /// Module and name of a function or class.
    pub(super) fn global(&self, at: u32) -> (&'a str, &'a str) {
        let (module, name) = self.globals[at as usize];
        let text = |span| std::str::from_utf8(self.span(span)).unwrap_or_default();
        (text(module), text(name))
    }

    pub(super) fn span(&self, span: Span) -> &'a [u8] {
        &self.bytes[span.start as usize..][..span.length as usize]
    }
}

impl Span {
    /// `length` bytes from `start` on; a pickle is shorter than 4 GiB.
    pub(super) const fn new(start: usize, length: usize) -> Self {
        Self { start: start as u32, length: length as u32 }
    }

    pub(super) const fn len(self) -> usize {
        self.length as usize
    }
}
