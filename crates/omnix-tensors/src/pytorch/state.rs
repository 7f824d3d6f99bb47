//! Which of a checkpoint's values are the network's tensors: training programs put optimisers, counters and settings beside them.

use crate::pickle::{Pickle, Rebuilt, Value};
use crate::pytorch::archive::Flaw;

/// The tensors of the network by name, and what else there is.
#[derive(Debug)]
pub(super) struct State<'p> {
    pub(super) tensors: Vec<(&'p str, &'p Rebuilt)>,
    /// Names of the values beside them.
    pub(super) beside: Vec<&'p str>,
}

/// Where training programs put the network, the likeliest first.
const PLACES: [&str; 7] = ["state_dict", "model_state_dict", "model", "module", "net", "network", "weights"];

/// Finds the tensors.
pub(super) fn find<'p>(pickle: &'p Pickle<'p>) -> Result<State<'p>, Flaw> {
    let mut at = pickle.root();
    let mut beside = Vec::new();
    // A state may lie in two such places, one in the other.
    for _ in 0..3 {
        let Some(items) = pickle.dict(at) else { return Err(not_a_state(at)) };
        let named = |name: &str| {
            items.iter().rev().find(|(key, value)| pickle.text(*key) == Some(name) && holds(pickle, *value))
        };
        // Single tensors may lie beside such a place: the best accuracy, the state of a random generator.
        let Some((inner, (_, next))) = PLACES.iter().find_map(|name| Some((*name, named(name)?))) else { break };
        beside.extend(items.iter().filter_map(|(key, _)| pickle.text(*key)).filter(|key| *key != inner));
        at = *next;
    }
    let items = pickle.dict(at).ok_or_else(|| not_a_state(at))?;
    let mut tensors = Vec::with_capacity(items.len());
    for (key, value) in items {
        let Some(name) = pickle.text(*key) else { continue };
        match value {
            Value::Refused(kind) => {
                return Err(format!(
                    "{} is {}; make it a plain one in Python before saving",
                    name.escape_debug(),
                    kind.name()
                ));
            }
            _ => match pickle.tensor(*value) {
                Some(tensor) => tensors.push((name, tensor)),
                None => beside.push(name),
            },
        }
    }
    if tensors.is_empty() {
        return Err("no tensors are in it, neither at its top nor in a state_dict".to_owned());
    }
    Ok(State { tensors, beside })
}

/// Whether a value is a dictionary with tensors, or with a dictionary that may have some.
fn holds(pickle: &Pickle<'_>, value: Value) -> bool {
    pickle
        .dict(value)
        .is_some_and(|items| items.iter().any(|(_, value)| is_tensor(*value) || matches!(value, Value::Dict(_))))
}

const fn is_tensor(value: Value) -> bool {
    matches!(value, Value::Tensor(_) | Value::Refused(_))
}

fn not_a_state(value: Value) -> Flaw {
    match value {
        Value::Opaque => {
            "a whole Python object was saved in it, not its tensors; save the object's state_dict() in Python"
        }
        Value::Tensor(_) => "a single tensor was saved in it, not those of a network",
        _ => "no dictionary of tensors was saved in it",
    }
    .to_owned()
}
