//! Pickles, read and not run.
//!
//! A pickle is a program for a small machine of Python's, which can call any function that Python finds. Here its instructions only put
//! together plain values. Calls are looked up in a list of what tensors and dictionaries are made of (`calls.rs`); what another function
//! or class would give is [`Value::Opaque`], and names that only an attack has a use for refuse the file.
//!
//! Strings stay in the pickle's bytes, and a [`Value`] is 16 bytes that may point into tables of the [`Pickle`], so nothing is nested in
//! memory. The room for values is given by the caller.
//!
//! Source: `Lib/pickletools.py` of CPython; protocols 2 to 5.

mod calls;
mod machine;
mod names;
mod stack;
mod values;

pub(crate) use values::{Element, Pickle, Rebuilt, Value};

/// Why a pickle is refused, and the place of the instruction.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Flaw {
    pub(crate) at: usize,
    pub(crate) reason: String,
}

/// Reads a pickle. It may make at most `room` values.
pub(crate) fn read(bytes: &[u8], room: usize) -> Result<Pickle<'_>, Flaw> {
    stack::Machine::new(bytes, room).run()
}

#[cfg(test)]
mod tests;
