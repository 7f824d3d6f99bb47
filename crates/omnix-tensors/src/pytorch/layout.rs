//! Where the numbers of each tensor lie: in place where they are in order, copied in order where they are not.

use std::ops::Range;

use crate::Dtype;
use crate::info::{Header, TensorInfo};
use crate::pickle::{Element, Pickle, Rebuilt};
use crate::pytorch::archive::{Archive, Flaw};
use crate::pytorch::state::State;

/// The tensors of a checkpoint, and the bytes of those that do not lie in order in the file; their ranges begin where the file ends.
#[derive(Debug)]
pub(crate) struct Checkpoint {
    pub(crate) header: Header,
    pub(crate) ordered: Vec<u8>,
}

/// The entry of the metadata that names what was left out.
const BESIDE: &str = "left out";
/// Names in it at most.
const NAMED: usize = 20;

/// A tensor that was checked against its storage.
#[derive(Debug)]
struct View<'p> {
    name: &'p str,
    dtype: Dtype,
    shape: Vec<usize>,
    stride: Vec<usize>,
    /// From the first element that it reads to the last, as bytes of the file.
    range: Range<usize>,
    in_order: bool,
}

/// Checks every tensor against its storage, and finds its bytes.
pub(super) fn place<'p>(
    archive: &Archive<'p>,
    top: &str,
    pickle: &'p Pickle<'p>,
    state: State<'p>,
) -> Result<Checkpoint, Flaw> {
    let mut views = Vec::with_capacity(state.tensors.len());
    for (name, tensor) in state.tensors {
        let view = View::new(archive, top, pickle, name, tensor);
        views.push(view.map_err(|reason| format!("tensor {}: {reason}", name.escape_debug()))?);
    }
    // Names in order among those that are the same bytes, so that the first is kept whatever the order in the file.
    views.sort_by(|a, b| (a.range.start, a.range.end, a.name).cmp(&(b.range.start, b.range.end, b.name)));
    let bytes = archive.bytes();
    let mut checkpoint = Checkpoint { header: Header::default(), ordered: Vec::new() };
    let mut last: Option<&View<'_>> = None;
    for view in &views {
        let header = &mut checkpoint.header;
        if header.tensors.contains_key(view.name) || header.metadata.contains_key(view.name) {
            return Err(format!("tensor {} is there twice", view.name.escape_debug()));
        }
        if let Some(kept) = last.filter(|last| last.is_same_as(view)) {
            header.metadata.insert(view.name.to_owned(), kept.name.to_owned());
            continue;
        }
        // No bytes lie over no others.
        let empty = view.range.is_empty();
        let in_place = view.in_order && (empty || last.is_none_or(|last| last.range.end <= view.range.start));
        let range = if in_place {
            last = if empty { last } else { Some(view) };
            view.range.clone()
        } else {
            let start = checkpoint.ordered.len();
            if bytes.len() - start < view.byte_len() {
                return Err("its tensors lie over each other many times; save them apart (.clone())".to_owned());
            }
            view.copy(bytes, &mut checkpoint.ordered);
            bytes.len() + start..bytes.len() + checkpoint.ordered.len()
        };
        let info = TensorInfo { dtype: view.dtype.name().to_owned(), shape: view.shape.clone(), range };
        checkpoint.header.tensors.insert(view.name.to_owned(), info);
    }
    if !state.beside.is_empty() {
        let mut named = state.beside[..state.beside.len().min(NAMED)].join(", ");
        if state.beside.len() > NAMED {
            named += &format!(" and {} more", state.beside.len() - NAMED);
        }
        checkpoint.header.metadata.insert(BESIDE.to_owned(), named);
    }
    Ok(checkpoint)
}

impl<'p> View<'p> {
    fn new(
        archive: &Archive<'_>,
        top: &str,
        pickle: &Pickle<'p>,
        name: &'p str,
        tensor: &Rebuilt,
    ) -> Result<Self, Flaw> {
        let (key, storage) = pickle.storage(tensor);
        let Element::Known(dtype) = tensor.element else { return Err("its type is not said".to_owned()) };
        let entry = archive.range(&format!("{top}data/{key}"))?;
        // A typed storage counts elements, one without a type bytes.
        let unit = if let Element::Known(stored) = storage.element { stored.size() as u64 } else { 1 };
        if storage.count.checked_mul(unit) != Some(entry.len() as u64) {
            let (has, says) = (entry.len(), storage.count);
            return Err(format!(
                "its storage has {has} bytes where the pickle says {says} elements: the file is damaged"
            ));
        }
        let elements = entry.len() / dtype.size();
        let outside = || "it reaches beyond its storage: the file is damaged".to_owned();
        let size = |v: &u64| usize::try_from(*v).map_err(|_| outside());
        let shape: Vec<usize> = tensor.shape.iter().map(size).collect::<Result<_, _>>()?;
        let stride: Vec<usize> = tensor.stride.iter().map(size).collect::<Result<_, _>>()?;
        let offset = size(&tensor.offset)?;
        if offset > elements {
            return Err(outside());
        }
        let start = entry.start + offset * dtype.size();
        // Of no elements: along one axis none, whatever the others say, as long as they can be counted.
        if shape.contains(&0) {
            let others = shape
                .iter()
                .filter(|&&side| side > 0)
                .try_fold(dtype.size(), |product, &side| product.checked_mul(side));
            if others.is_none() {
                return Err("its shape is larger than any memory".to_owned());
            }
            let range = start..start;
            return Ok(Self { name, dtype, shape, stride, range, in_order: true });
        }
        let product = shape.iter().try_fold(1usize, |product, &side| product.checked_mul(side));
        let count = product.filter(|&count| count <= elements).ok_or_else(|| {
            "it has more elements than its storage (an expanded view); make it .contiguous() in Python before saving".to_owned()
        })?;
        let last = shape
            .iter()
            .zip(&stride)
            .try_fold(offset, |last, (&side, &step)| (side - 1).checked_mul(step)?.checked_add(last));
        let last = last.filter(|&last| last < elements).ok_or_else(outside)?;
        let mut step = 1;
        let mut in_order = true;
        for (&side, &stride) in shape.iter().zip(&stride).rev() {
            in_order &= side == 1 || stride == step;
            step *= side;
        }
        debug_assert!(!in_order || last + 1 - offset == count, "BUG: {shape:?} {stride:?}");
        let range = start..entry.start + (last + 1) * dtype.size();
        Ok(Self { name, dtype, shape, stride, range, in_order })
    }

    fn is_same_as(&self, other: &Self) -> bool {
        !self.range.is_empty()
            && self.in_order
            && other.in_order
            && (&self.range, self.dtype, &self.shape) == (&other.range, other.dtype, &other.shape)
    }

    fn byte_len(&self) -> usize {
        self.shape.iter().product::<usize>() * self.dtype.size()
    }

    /// Copies the elements in order.
    fn copy(&self, bytes: &[u8], out: &mut Vec<u8>) {
        let size = self.dtype.size();
        out.reserve(self.byte_len());
        let mut index = vec![0; self.shape.len()];
        loop {
            let at: usize = index.iter().zip(&self.stride).map(|(i, step)| i * step).sum();
            out.extend_from_slice(&bytes[self.range.start + at * size..][..size]);
            // The last axis runs first.
            let Some(axis) = (0..index.len()).rev().find(|&axis| index[axis] + 1 < self.shape[axis]) else { break };
            index[axis] += 1;
            index[axis + 1..].fill(0);
        }
    }
}
