//! What calls give: dictionaries, tensors, and nothing else.

use crate::pickle::names::{self, Meaning};
use crate::pickle::values::{Kind, Pickle, Rebuilt, Storage, Value};

/// Axes of a tensor at most: PyTorch's own limit.
const AXES: usize = 64;

impl Pickle<'_> {
    /// What a function or class gives for its arguments.
    pub(super) fn call(&mut self, function: Value, arguments: Value) -> Result<Value, String> {
        let Value::Global(at) = function else { return Ok(Value::Opaque) };
        let (module, name) = self.global(at);
        match names::meaning(module, name) {
            Meaning::Dict => Ok(self.dictionary(arguments)),
            Meaning::Tensor { typed } => self.rebuild(arguments, typed),
            Meaning::Parameter => {
                Ok(self.tuple(arguments).and_then(|all| all.first().copied()).unwrap_or(Value::Opaque))
            }
            Meaning::Refused(kind) => Ok(Value::Refused(kind)),
            Meaning::Unknown => Ok(Value::Opaque),
        }
    }

    /// An empty dictionary, or one of pairs.
    fn dictionary(&mut self, arguments: Value) -> Value {
        let first = self.tuple(arguments).and_then(|all| all.first().copied());
        let pairs = match first {
            Some(Value::List(at)) => {
                let pair = |item: &Value| {
                    self.tuple(*item).or_else(|| self.list(*item)).and_then(|p| Some((*p.first()?, *p.get(1)?)))
                };
                self.lists[at as usize].iter().filter_map(pair).collect()
            }
            _ => Vec::new(),
        };
        self.dicts.push(pairs);
        Value::Dict(self.dicts.len() as u32 - 1)
    }

    fn list(&self, value: Value) -> Option<&[Value]> {
        if let Value::List(at) = value { Some(&self.lists[at as usize]) } else { None }
    }

    /// A tensor out of (storage, offset, shape, stride, requires grad, hooks, type).
    fn rebuild(&mut self, arguments: Value, typed: bool) -> Result<Value, String> {
        let bad = || "a tensor without storage, place, shape and strides".to_owned();
        let all = self.tuple(arguments).ok_or_else(bad)?;
        let [storage, Value::Int(offset), shape, stride, ..] = *all else { return Err(bad()) };
        let storage = match storage {
            Value::Storage(at) => at,
            refused @ Value::Refused(_) => return Ok(refused),
            _ => return Err(bad()),
        };
        let element = match all.get(6).filter(|_| typed) {
            Some(Value::Global(at)) => {
                let (module, name) = self.global(*at);
                let Some(element) = names::element(module, name) else { return Ok(Value::Refused(Kind::Type)) };
                element
            }
            Some(_) => return Err(bad()),
            None => self.storages[storage as usize].element,
        };
        let sizes = |value: Value| -> Option<Box<[u64]>> {
            let all = self.tuple(value).or_else(|| self.list(value)).filter(|all| all.len() <= AXES)?;
            all.iter().map(|v| if let Value::Int(v) = v { u64::try_from(*v).ok() } else { None }).collect()
        };
        let (shape, stride) = (sizes(shape).ok_or_else(bad)?, sizes(stride).ok_or_else(bad)?);
        if shape.len() != stride.len() {
            return Err(bad());
        }
        let offset = u64::try_from(offset).map_err(|_| bad())?;
        self.tensors.push(Rebuilt { storage, offset, shape, stride, element });
        Ok(Value::Tensor(self.tensors.len() as u32 - 1))
    }

    /// What a persistent number stands for: ("storage", class, key, device, number of elements).
    pub(super) fn persistent(&mut self, number: Value) -> Result<Value, String> {
        let bad = || "a reference to something other than a storage".to_owned();
        let all = self.tuple(number).ok_or_else(bad)?;
        let [kind, Value::Global(class), Value::Text(key), _, Value::Int(count), ..] = *all else { return Err(bad()) };
        if self.text(kind) != Some("storage") {
            return Err(bad());
        }
        let (module, name) = self.global(class);
        if names::is_quantised(module, name) {
            return Ok(Value::Refused(Kind::Quantised));
        }
        // What is not known is refused where it belongs to the network.
        let Some(element) = names::element(module, name) else { return Ok(Value::Refused(Kind::Type)) };
        let count = u64::try_from(count).map_err(|_| bad())?;
        self.storages.push(Storage { key, element, count });
        Ok(Value::Storage(self.storages.len() as u32 - 1))
    }
}
