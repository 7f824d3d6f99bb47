//! Reading a JSON tree so that every complaint names the field, its value and what is allowed.

use serde_json::{Map, Value};

use crate::ModelError;

/// An object of the configuration and the path to it.
#[derive(Debug, Clone)]
pub(crate) struct Fields<'a> {
    path: String,
    map: &'a Map<String, Value>,
}

/// A value as messages show it.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    if text.chars().count() <= LONGEST { text } else { text.chars().take(LONGEST).chain("...".chars()).collect() }
}

impl<'a> Fields<'a> {
    /// The whole configuration.
    pub(crate) fn root(value: &'a Value) -> Result<Self, ModelError> {
        Self::at(String::new(), value)
    }

    fn at(path: String, value: &'a Value) -> Result<Self, ModelError> {
        match value {
            Value::Object(map) => Ok(Self { path, map }),
            other => Err(ModelError::BadField {
                field: if path.is_empty() { "the whole".to_owned() } else { path },
                value: shown(other),
                allowed: "an object is needed".to_owned(),
            }),
        }
    }

    fn full(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    /// The field, unless it is absent or null.
    pub(crate) fn get(&self, name: &str) -> Option<&'a Value> {
        self.map.get(name).filter(|v| !v.is_null())
    }

    /// The error that the field's value is not `allowed`, or that there is none.
    pub(crate) fn bad(&self, name: &str, allowed: impl Into<String>) -> ModelError {
        let (field, allowed) = (self.full(name), allowed.into());
        match self.get(name) {
            Some(value) => ModelError::BadField { field, value: shown(value), allowed },
            None => ModelError::FieldMissing { field, allowed },
        }
    }

    /// The field as converted by `read`.
    fn read<T>(&self, name: &str, allowed: &str, read: impl Fn(&'a Value) -> Option<T>) -> Result<T, ModelError> {
        self.get(name).and_then(read).ok_or_else(|| self.bad(name, allowed))
    }

    /// An object.
    pub(crate) fn object(&self, name: &str) -> Result<Self, ModelError> {
        match self.get(name) {
            Some(value) => Self::at(self.full(name), value),
            None => Err(self.bad(name, "an object is needed")),
        }
    }

    /// A whole number from 0.
    pub(crate) fn whole(&self, name: &str) -> Result<usize, ModelError> {
        self.read(name, "a whole number is needed", |v| usize::try_from(v.as_u64()?).ok())
    }

    /// A block from which on something holds; none for null, absence and -1.
    pub(crate) fn start(&self, name: &str) -> Result<Option<usize>, ModelError> {
        match self.get(name) {
            None => Ok(None),
            Some(v) if v.as_i64() == Some(-1) => Ok(None),
            Some(_) => {
                let allowed = "a block's number, or null or -1 for never, is needed";
                self.read(name, allowed, |v| usize::try_from(v.as_u64()?).ok()).map(Some)
            }
        }
    }

    /// Four whole numbers.
    pub(crate) fn four(&self, name: &str) -> Result<[usize; 4], ModelError> {
        self.read(name, "four whole numbers are needed", |v| {
            let items = v.as_array()?.iter().map(|n| usize::try_from(n.as_u64()?).ok()).collect::<Option<Vec<_>>>()?;
            items.try_into().ok()
        })
    }

    /// Whole numbers.
    pub(crate) fn wholes(&self, name: &str) -> Result<Vec<usize>, ModelError> {
        self.read(name, "a list of whole numbers is needed", |v| {
            v.as_array()?.iter().map(|n| usize::try_from(n.as_u64()?).ok()).collect()
        })
    }

    /// Whole numbers; none where the field is absent.
    pub(crate) fn wholes_or_none(&self, name: &str) -> Result<Vec<usize>, ModelError> {
        if self.get(name).is_some() { self.wholes(name) } else { Ok(Vec::new()) }
    }

    /// A list of this number of numbers.
    pub(crate) fn numbers<const N: usize>(&self, name: &str) -> Result<[f32; N], ModelError> {
        self.read(name, &format!("{N} numbers are needed"), |v| {
            let items = v.as_array()?.iter().map(|n| Some(n.as_f64()? as f32)).collect::<Option<Vec<_>>>()?;
            items.try_into().ok()
        })
    }

    /// True or false.
    pub(crate) fn truth(&self, name: &str) -> Result<bool, ModelError> {
        self.read(name, "true or false is needed", serde_json::Value::as_bool)
    }

    /// True or false; `default` where the field is absent.
    pub(crate) fn flag(&self, name: &str, default: bool) -> Result<bool, ModelError> {
        if self.get(name).is_some() { self.truth(name) } else { Ok(default) }
    }

    /// A number.
    pub(crate) fn number(&self, name: &str) -> Result<f64, ModelError> {
        self.read(name, "a number is needed", Value::as_f64)
    }

    /// A text.
    pub(crate) fn text(&self, name: &str) -> Result<&'a str, ModelError> {
        self.read(name, "a text is needed", Value::as_str)
    }

    /// One of some texts, by its index.
    pub(crate) fn one_of(&self, name: &str, choices: &[&str]) -> Result<usize, ModelError> {
        let allowed = || format!("it can be {}", choices.join(" or "));
        let text = self.get(name).and_then(Value::as_str).ok_or_else(|| self.bad(name, allowed()))?;
        choices.iter().position(|c| *c == text).ok_or_else(|| self.bad(name, allowed()))
    }

    /// Complains of fields other than these, which are probably misspelt.
    pub(crate) fn only(&self, known: &[&str]) -> Result<(), ModelError> {
        match self.map.keys().find(|name| !known.contains(&name.as_str())) {
            Some(name) => Err(self.bad(name, format!("no such field; there are {}", known.join(", ")))),
            None => Ok(()),
        }
    }
}
