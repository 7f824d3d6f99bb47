//! Permute, slice, concatenate, broadcast, assemble: what moves numbers without changing them.

use omnix_kernels::KernelError;
use omnix_kernels::copy::{Copy as StridedCopy, Strided};
use omnix_kernels::fill::Fill;

use crate::error::{GraphError, u32_of};
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// An output put together from strided pieces that cover it, or lie in zeros.
#[derive(Clone, Debug)]
pub struct Copies {
    /// Source and geometry of each piece.
    pub pieces: Vec<(Value, StridedCopy)>,
    /// Whether what no piece addresses is zero; otherwise the pieces cover the output.
    pub zeros: bool,
}

/// A block of a value and where it goes in the result of [`Graph::assemble`].
#[derive(Clone, Debug)]
pub struct Piece {
    /// Source.
    pub value: Value,
    /// Extents, as many axes as the result has.
    pub dims: Vec<usize>,
    /// First element read, counted in row-major order.
    pub start: usize,
    /// Elements from one index to the next in the source, axis by axis; 0 repeats.
    pub strides: Vec<usize>,
    /// Index in the result where the block begins.
    pub at: Vec<usize>,
}

/// Row-major strides of `dims`.
fn strides(dims: &[usize]) -> Vec<usize> {
    let mut out = vec![1; dims.len()];
    for i in (0..dims.len().saturating_sub(1)).rev() {
        out[i] = out[i + 1] * dims[i + 1];
    }
    out
}

/// A copy of `dims` elements with an offset and strides for each side; up to six axes.
fn strided(dims: &[usize], src: (usize, &[usize]), dst: (usize, &[usize])) -> Result<StridedCopy, GraphError> {
    let six = |values: &[usize], fill: u32| {
        let mut out = [fill; 6];
        let Some(first) = out.len().checked_sub(values.len()) else {
            let reason = format!("a copy of {} axes; at most 6", values.len());
            return Err(KernelError::Unsupported { kernel: "copy", reason });
        };
        for (o, v) in out[first..].iter_mut().zip(values) {
            *o = u32_of("copy", *v)?;
        }
        Ok(out)
    };
    let side = |(offset, strides): (usize, &[usize])| {
        Ok::<_, KernelError>(Strided { offset: offset as u64, strides: six(strides, 0)? })
    };
    Ok(StridedCopy { shape: six(dims, 1)?, src: side(src)?, dst: side(dst)? })
}

impl<O: Operation + From<Copies>> Graph<O> {
    /// Axis `i` of the result is axis `order[i]` of `x`.
    ///
    /// # Errors
    /// When `order` is not a permutation of the axes.
    pub fn permute(&mut self, x: Value, order: &[usize]) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        if !sorted.into_iter().eq(0..shape.len()) {
            return Err(self.misfit("permute", x, format!("{} axes", order.len())));
        }
        let from = strides(&shape);
        let dims: Vec<usize> = order.iter().map(|a| shape[*a]).collect();
        let src: Vec<usize> = order.iter().map(|a| from[*a]).collect();
        let piece = strided(&dims, (0, &src), (0, &strides(&dims)))?;
        Ok(self.copies(vec![(x, piece)], dims.as_slice()))
    }

    /// Elements `start..start + len` of axis `axis`.
    ///
    /// # Errors
    /// When they do not exist.
    pub fn slice(&mut self, x: Value, axis: usize, start: usize, len: usize) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        if axis >= shape.len() || start.saturating_add(len) > shape[axis] {
            return Err(self.misfit("slice", x, format!("{} elements along axis {axis}", start.saturating_add(len))));
        }
        let mut dims = shape.to_vec();
        dims[axis] = len;
        let from = strides(&shape);
        let piece = strided(&dims, (start * from[axis], &from), (0, &strides(&dims)))?;
        Ok(self.copies(vec![(x, piece)], dims.as_slice()))
    }

    /// Joins values along `axis`; all other dimensions agree.
    ///
    /// # Errors
    /// When they do not, there is no such axis, or there is nothing to join.
    pub fn concat(&mut self, parts: &[Value], axis: usize) -> Result<Value, GraphError> {
        let Some(first) = parts.first() else {
            return Err(GraphError::Arguments { op: "concat", reason: "there are no values to join".to_owned() });
        };
        let mut dims = self.shape(*first).to_vec();
        if axis >= dims.len() {
            return Err(self.misfit("concat", *first, format!("more than {axis} axes")));
        }
        dims[axis] = 0;
        for part in parts {
            let shape = self.shape(*part);
            let fits =
                shape.len() == dims.len() && shape.iter().zip(&dims).enumerate().all(|(i, (a, b))| i == axis || a == b);
            if !fits {
                return Err(self.misfit("concat", *part, format!("{dims:?} but for axis {axis}")));
            }
            dims[axis] += shape[axis];
        }
        let to = strides(&dims);
        let mut start = 0;
        let mut pieces = Vec::with_capacity(parts.len());
        for part in parts {
            let shape = self.shape(*part);
            pieces.push((*part, strided(shape, (0, &strides(shape)), (start * to[axis], &to))?));
            start += shape[axis];
        }
        Ok(self.copies(pieces, dims.as_slice()))
    }

    /// A value put together from blocks, each a strided part of some value: slices, broadcasts and concatenation in one
    /// pass. The blocks must cover the result and not overlap.
    ///
    /// # Errors
    /// When a block reads outside its source or leaves the result, or the blocks do not cover it.
    pub fn assemble(&mut self, shape: impl Into<Shape>, pieces: &[Piece]) -> Result<Value, GraphError> {
        let shape = shape.into();
        let to = strides(&shape);
        let covered: usize = pieces.iter().map(|piece| piece.dims.iter().product::<usize>()).sum();
        if covered != shape.elements() {
            let reason = format!("the blocks have {covered} elements, the result {shape} has {}", shape.elements());
            return Err(GraphError::Arguments { op: "assemble", reason });
        }
        let mut copies = Vec::with_capacity(pieces.len());
        for Piece { value, dims, start, strides: from, at } in pieces {
            let axes = [dims.len(), from.len(), at.len()];
            let inside =
                axes == [shape.len(); 3] && dims.iter().zip(at).zip(&*shape).all(|((n, a), all)| a + n <= *all);
            if !inside {
                return Err(self.misfit("assemble", *value, format!("a block {dims:?} at {at:?} of {shape}")));
            }
            if dims.contains(&0) {
                continue;
            }
            let end = start + dims.iter().zip(from).map(|(n, s)| (n - 1) * s).sum::<usize>();
            if end >= self.shape(*value).elements() {
                return Err(self.misfit("assemble", *value, format!("more than {end} elements")));
            }
            let first = at.iter().zip(&to).map(|(a, s)| a * s).sum();
            copies.push((*value, strided(dims, (*start, from), (first, &to))?));
        }
        Ok(self.copies(copies, shape))
    }

    /// `[outer, n, inner]` from a value of `outer · inner` elements: each repeated along a new axis in the middle.
    ///
    /// # Errors
    /// When it has not this number of elements.
    pub(crate) fn broadcast_middle(&mut self, x: Value, [outer, n, inner]: [usize; 3]) -> Result<Value, GraphError> {
        if self.shape(x).elements() != outer * inner {
            return Err(self.misfit("broadcast", x, format!("[{outer}, {inner}]")));
        }
        let dims = [outer, n, inner];
        let piece = strided(&dims, (0, &[inner, 0, 1]), (0, &strides(&dims)))?;
        Ok(self.copies(vec![(x, piece)], dims))
    }

    /// `count` copies of `x` along a new first axis.
    ///
    /// # Errors
    /// When the result has more than six axes.
    pub fn repeat(&mut self, x: Value, count: usize) -> Result<Value, GraphError> {
        let shape = self.shape(x).clone();
        let mut dims = vec![count];
        dims.extend_from_slice(&shape);
        let mut src = vec![0];
        src.extend(strides(&shape));
        let piece = strided(&dims, (0, &src), (0, &strides(&dims)))?;
        Ok(self.copies(vec![(x, piece)], dims.as_slice()))
    }

    /// A value of `shape` that is zero but where the `pieces` are: each reads its value at `src` and writes the result at `dst`,
    /// in elements. A slice's gradient, a map with zeros between its pixels. No two indices may write the same element.
    ///
    /// # Errors
    /// When a piece reads outside its value, writes outside the result, or writes an element twice by a stride of 0.
    pub fn in_zeros(
        &mut self,
        shape: impl Into<Shape>,
        pieces: Vec<(Value, StridedCopy)>,
    ) -> Result<Value, GraphError> {
        let shape = shape.into();
        let end = |piece: &StridedCopy, side: &Strided| {
            let last = piece.shape.iter().zip(&side.strides).map(|(n, s)| u64::from(n - 1) * u64::from(*s));
            side.offset + last.sum::<u64>()
        };
        let mut kept = Vec::with_capacity(pieces.len());
        for (value, piece) in pieces {
            if piece.shape.contains(&0) {
                continue;
            }
            let (from, to) = (end(&piece, &piece.src), end(&piece, &piece.dst));
            if from >= self.shape(value).elements() as u64 {
                return Err(self.misfit("in_zeros", value, format!("more than {from} elements")));
            }
            let twice = piece.shape.iter().zip(&piece.dst.strides).any(|(n, s)| *n > 1 && *s == 0);
            if twice || to >= shape.elements() as u64 {
                let reason = format!("{piece:?} writes an element twice, or outside of {shape}");
                return Err(GraphError::Arguments { op: "in_zeros", reason });
            }
            kept.push((value, piece));
        }
        // No element is written twice: this number of them is all.
        let written: u64 = kept.iter().map(|(_, p)| p.shape.iter().map(|n| u64::from(*n)).product::<u64>()).sum();
        let zeros = written < shape.elements() as u64;
        Ok(self.push_one(Copies { pieces: kept, zeros }, shape))
    }

    fn copies(&mut self, pieces: Vec<(Value, StridedCopy)>, shape: impl Into<Shape>) -> Value {
        self.push_one(Copies { pieces, zeros: false }, shape)
    }
}

impl Operation for Copies {
    fn name(&self) -> &'static str {
        "copy"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.pieces.iter_mut().for_each(|(v, _)| *v = map(*v));
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let call = |(x, piece): &(Value, StridedCopy)| {
            let args = [Some(*x), Some(site.outputs[0])].into_iter().collect();
            Ok(Call { args, dispatches: piece.record(site.caps)? })
        };
        let mut calls = Vec::with_capacity(self.pieces.len() + 1);
        if self.zeros {
            let y = site.outputs[0];
            let spec = Fill::whole(site.values.shape(y).elements() as u64, 0.0);
            calls.extend(site.call([Some(y)], spec.record(site.caps)?)?);
        }
        for piece in &self.pieces {
            calls.push(call(piece)?);
        }
        Ok(calls)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }
}
