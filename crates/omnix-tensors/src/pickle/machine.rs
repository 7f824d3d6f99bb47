//! The machine that a pickle is written for: a stack, marks on it, and a memo.

use crate::pickle::stack::Machine;
use crate::pickle::values::{Pickle, Span, Value};
use crate::pickle::{Flaw, names};

/// Bytes of a class's name at most.
const LONGEST_NAME: usize = 1024;
/// Values that a table, or an entry of the memo, counts as.
const TABLE: usize = 4;

impl<'a> Machine<'a> {
    /// Follows the instructions to the end.
    pub(super) fn run(mut self) -> Result<Pickle<'a>, Flaw> {
        if u32::try_from(self.pickle.bytes.len()).is_err() {
            return Err(Flaw { at: 0, reason: "it is larger than 4 GiB".to_owned() });
        }
        loop {
            let at = self.at;
            match self.step() {
                Ok(false) => {}
                Ok(true) => break,
                Err(reason) => return Err(Flaw { at, reason }),
            }
        }
        match *self.stack {
            [root] if self.marks.is_empty() => {
                self.pickle.root = root;
                Ok(self.pickle)
            }
            _ => Err(Flaw { at: self.at - 1, reason: "it ends with other than one value".to_owned() }),
        }
    }

    /// One instruction; whether it was the last.
    fn step(&mut self) -> Result<bool, String> {
        match self.byte()? {
            b'.' => return Ok(true),
            0x80 => {
                let protocol = self.byte()?;
                if !(2..=5).contains(&protocol) {
                    return Err(format!("protocol {protocol}, where 2 to 5 can be read"));
                }
            }
            // A frame says how much is read at once; nothing depends on it.
            0x95 => {
                let length = self.u64()?;
                if length > (self.pickle.bytes.len() - self.at) as u64 {
                    return Err("a frame that is longer than the pickle".to_owned());
                }
            }
            b'N' => self.push(Value::None)?,
            0x88 => self.push(Value::Bool(true))?,
            0x89 => self.push(Value::Bool(false))?,
            b'J' => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()))?;
            }
            b'K' => {
                let value = self.byte()?;
                self.push(Value::Int(value.into()))?;
            }
            b'M' => {
                let value = u16::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()))?;
            }
            0x8a => {
                let length = self.byte()?.into();
                self.long(length)?;
            }
            0x8b => {
                let length = self.length4()?;
                self.long(length)?;
            }
            b'G' => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Value::Float(value))?;
            }
            0x8c | b'U' => {
                let length = self.byte()?.into();
                self.text(length)?;
            }
            b'X' | b'T' => {
                let length = self.length4()?;
                self.text(length)?;
            }
            0x8d => {
                let length = self.length8()?;
                self.text(length)?;
            }
            b'C' => {
                let length = self.byte()?.into();
                self.raw(length)?;
            }
            b'B' => {
                let length = self.length4()?;
                self.raw(length)?;
            }
            0x8e | 0x96 => {
                let length = self.length8()?;
                self.raw(length)?;
            }
            b'(' => {
                self.pay(1)?;
                self.marks.push(self.stack.len());
            }
            b'0' => {
                // Python's own machine takes a mark away where one is on top.
                if self.marks.last() == Some(&self.stack.len()) {
                    self.marks.pop();
                } else {
                    self.pop()?;
                }
            }
            b'1' => drop(self.marked()?),
            b'2' => {
                let top = self.top()?;
                self.push(top)?;
            }
            b')' => self.tuple(Vec::new())?,
            0x85 => self.tuple_of(1)?,
            0x86 => self.tuple_of(2)?,
            0x87 => self.tuple_of(3)?,
            b't' => {
                let items = self.marked()?;
                self.tuple(items)?;
            }
            b']' => self.list(Vec::new())?,
            b'l' => {
                let items = self.marked()?;
                self.list(items)?;
            }
            b'a' => {
                let item = self.pop()?;
                self.append(&[item])?;
            }
            b'e' => {
                let items = self.marked()?;
                self.append(&items)?;
            }
            b'}' => self.dict(&[])?,
            b'd' => {
                let items = self.marked()?;
                self.dict(&items)?;
            }
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.set(&[key, value])?;
            }
            b'u' => {
                let items = self.marked()?;
                self.set(&items)?;
            }
            // Sets are of no use to tensors.
            0x8f => self.push(Value::Opaque)?,
            0x90 => {
                self.marked()?;
                self.top()?;
            }
            0x91 => {
                self.marked()?;
                self.push(Value::Opaque)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.global(module, name)?;
            }
            0x93 => {
                let (Value::Text(name), Value::Text(module)) = (self.pop()?, self.pop()?) else {
                    return Err("a class without a name".to_owned());
                };
                self.global(module, name)?;
            }
            b'R' | 0x81 => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                self.call(function, arguments)?;
            }
            0x92 => {
                let (_named, arguments, function) = (self.pop()?, self.pop()?, self.pop()?);
                self.call(function, arguments)?;
            }
            // What an object is given beside its items: none of tensors and dictionaries is wanted.
            b'b' => {
                self.pop()?;
                self.top()?;
            }
            b'Q' => {
                let number = self.pop()?;
                self.pay(TABLE)?;
                let value = self.pickle.persistent(number)?;
                self.push(value)?;
            }
            b'q' => {
                let key = self.byte()?.into();
                self.remember(key)?;
            }
            b'r' => {
                let key = u32::from_le_bytes(self.array()?);
                self.remember(key)?;
            }
            0x94 => {
                let key = self.memo.len() as u32;
                self.remember(key)?;
            }
            b'h' => {
                let key = self.byte()?.into();
                self.recall(key)?;
            }
            b'j' => {
                let key = u32::from_le_bytes(self.array()?);
                self.recall(key)?;
            }
            b'I' | b'L' | b'F' | b'S' | b'V' | b'p' | b'g' | b'P' | b'i' => {
                return Err(
                    "an instruction of protocol 0: save the checkpoint again with a PyTorch of today".to_owned()
                );
            }
            b'o' | 0x82..=0x84 => return Err("an instruction that no checkpoint has (an extension)".to_owned()),
            0x97 | 0x98 => return Err("a buffer that lies outside of the pickle".to_owned()),
            other => return Err(format!("no instruction: byte {other:#04x}")),
        }
        Ok(false)
    }

    fn call(&mut self, function: Value, arguments: Value) -> Result<(), String> {
        self.pay(TABLE)?;
        let value = self.pickle.call(function, arguments)?;
        // A dictionary may be made of a list of pairs that was put aside.
        self.pay(2 * self.pickle.dict(value).map_or(0, <[_]>::len))?;
        self.push(value)
    }

    fn global(&mut self, module: Span, name: Span) -> Result<(), String> {
        self.pay(1)?;
        if module.len() + name.len() > LONGEST_NAME {
            return Err("a class whose name is longer than any".to_owned());
        }
        self.pickle.globals.push((module, name));
        let at = self.pickle.globals.len() as u32 - 1;
        let (module, name) = self.pickle.global(at);
        if names::is_hostile(module, name) {
            let called = format!("{module}.{name}").escape_debug().to_string();
            return Err(format!(
                "{called}, which Python would run on opening this file and no checkpoint needs. Nothing was run: do not open it with anything else"
            ));
        }
        self.push(Value::Global(at))
    }

    fn tuple_of(&mut self, count: usize) -> Result<(), String> {
        let start = self.floor(count)?;
        let items = self.stack.split_off(start);
        self.tuple(items)
    }

    fn tuple(&mut self, items: Vec<Value>) -> Result<(), String> {
        self.pay(TABLE)?;
        self.pickle.tuples.push(items.into_boxed_slice());
        self.push(Value::Tuple(self.pickle.tuples.len() as u32 - 1))
    }

    fn list(&mut self, items: Vec<Value>) -> Result<(), String> {
        self.pay(TABLE)?;
        self.pickle.lists.push(items);
        self.push(Value::List(self.pickle.lists.len() as u32 - 1))
    }

    fn dict(&mut self, items: &[Value]) -> Result<(), String> {
        self.pay(TABLE)?;
        self.pickle.dicts.push(Vec::new());
        self.push(Value::Dict(self.pickle.dicts.len() as u32 - 1))?;
        self.set(items)
    }

    /// Adds items to the list on top; to anything else that takes some they are lost.
    fn append(&mut self, items: &[Value]) -> Result<(), String> {
        match self.top()? {
            Value::List(at) => {
                self.pay(items.len())?;
                self.pickle.lists[at as usize].extend_from_slice(items);
                Ok(())
            }
            Value::Opaque => Ok(()),
            _ => Err("items for something other than a list".to_owned()),
        }
    }

    /// Adds keys and values to the dictionary on top; to anything else that takes some they are lost.
    fn set(&mut self, items: &[Value]) -> Result<(), String> {
        let (pairs, rest) = items.as_chunks::<2>();
        if !rest.is_empty() {
            return Err("a key without a value".to_owned());
        }
        match self.top()? {
            Value::Dict(at) => {
                self.pay(items.len())?;
                self.pickle.dicts[at as usize].extend(pairs.iter().map(|&[key, value]| (key, value)));
                Ok(())
            }
            Value::Opaque => Ok(()),
            _ => Err("keys for something other than a dictionary".to_owned()),
        }
    }

    fn remember(&mut self, key: u32) -> Result<(), String> {
        let top = self.top()?;
        self.pay(TABLE)?;
        self.memo.insert(key, top);
        Ok(())
    }

    fn recall(&mut self, key: u32) -> Result<(), String> {
        let value = *self.memo.get(&key).ok_or_else(|| format!("value {key}, which was never put aside"))?;
        self.push(value)
    }

    /// An integer of `length` bytes, in two's complement. Tensors need no number of more than 64 bits.
    fn long(&mut self, length: usize) -> Result<(), String> {
        let span = self.take(length)?;
        let bytes = self.pickle.span(span);
        let negative = bytes.last().is_some_and(|b| b & 0x80 != 0);
        let mut wide = [if negative { 0xff } else { 0 }; 8];
        let value = match wide.get_mut(..bytes.len()) {
            Some(part) => {
                part.copy_from_slice(bytes);
                Value::Int(i64::from_le_bytes(wide))
            }
            None => Value::Opaque,
        };
        self.push(value)
    }

    fn text(&mut self, length: usize) -> Result<(), String> {
        let span = self.take(length)?;
        let is_text = std::str::from_utf8(self.pickle.span(span)).is_ok();
        self.push(if is_text { Value::Text(span) } else { Value::Bytes(span) })
    }

    fn raw(&mut self, length: usize) -> Result<(), String> {
        let span = self.take(length)?;
        self.push(Value::Bytes(span))
    }

    /// The text up to the end of the line.
    fn line(&mut self) -> Result<Span, String> {
        let rest = &self.pickle.bytes[self.at..];
        let length = rest.iter().position(|&b| b == b'\n').ok_or("a name without an end")?;
        if std::str::from_utf8(&rest[..length]).is_err() {
            return Err("a name that is no text".to_owned());
        }
        let span = self.take(length)?;
        self.at += 1;
        Ok(span)
    }
}
