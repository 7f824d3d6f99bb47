//! What the machine has between two instructions, and how it is taken and added to. Whatever a pickle asks for, nothing is taken that is not
//! there, and no more is made than the room allows.

use std::collections::HashMap;

use crate::pickle::values::{Pickle, Span, Value};

/// The state between two instructions.
pub(super) struct Machine<'a> {
    pub(super) pickle: Pickle<'a>,
    pub(super) stack: Vec<Value>,
    /// Heights of the stack.
    pub(super) marks: Vec<usize>,
    pub(super) memo: HashMap<u32, Value>,
    /// Where the next instruction is.
    pub(super) at: usize,
    /// Values that may still be made.
    pub(super) room: usize,
}

impl<'a> Machine<'a> {
    pub(super) fn new(bytes: &'a [u8], room: usize) -> Self {
        Self { pickle: Pickle::new(bytes), stack: Vec::new(), marks: Vec::new(), memo: HashMap::new(), at: 0, room }
    }

    pub(super) fn push(&mut self, value: Value) -> Result<(), String> {
        self.pay(1)?;
        self.stack.push(value);
        Ok(())
    }

    /// The top of the stack above the last mark, taken away.
    pub(super) fn pop(&mut self) -> Result<Value, String> {
        self.floor(1)?;
        self.stack.pop().ok_or_else(empty)
    }

    pub(super) fn top(&self) -> Result<Value, String> {
        self.floor(1)?;
        self.stack.last().copied().ok_or_else(empty)
    }

    /// Where the last `count` values begin, which lie above the last mark.
    pub(super) fn floor(&self, count: usize) -> Result<usize, String> {
        let floor = self.marks.last().copied().unwrap_or(0);
        self.stack.len().checked_sub(count).filter(|&start| start >= floor).ok_or_else(empty)
    }

    /// All above the last mark, which is taken away as well.
    pub(super) fn marked(&mut self) -> Result<Vec<Value>, String> {
        let mark = self.marks.pop().ok_or("the end of a group that never began")?;
        Ok(self.stack.split_off(mark))
    }

    pub(super) fn pay(&mut self, values: usize) -> Result<(), String> {
        let left = self.room.checked_sub(values);
        self.room = left.ok_or("more values than a checkpoint of this length can have")?;
        Ok(())
    }

    pub(super) fn byte(&mut self) -> Result<u8, String> {
        self.array().map(|[byte]| byte)
    }

    pub(super) fn u64(&mut self) -> Result<u64, String> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn length4(&mut self) -> Result<usize, String> {
        let length = u32::from_le_bytes(self.array()?);
        usize::try_from(length).map_err(|_| cut())
    }

    pub(super) fn length8(&mut self) -> Result<usize, String> {
        usize::try_from(self.u64()?).map_err(|_| cut())
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let span = self.take(N)?;
        self.pickle.span(span).first_chunk().copied().ok_or_else(cut)
    }

    pub(super) fn take(&mut self, length: usize) -> Result<Span, String> {
        let end = self.at.checked_add(length).filter(|&end| end <= self.pickle.bytes.len()).ok_or_else(cut)?;
        let span = Span::new(self.at, length);
        self.at = end;
        Ok(span)
    }
}

/// Why there is nothing more to read.
fn cut() -> String {
    "the end of the pickle in the middle of an instruction".to_owned()
}

fn empty() -> String {
    "an instruction that takes more values than there are".to_owned()
}
