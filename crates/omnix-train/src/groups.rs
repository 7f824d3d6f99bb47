//! Which tensors train at which rate, and where they lie.
//!
//! A group takes the tensors whose name contains its `name`; of several the first wins. All trained tensors together are one flat
//! list of f32, for the optimiser, for sums over processes and for the device:
//!
//! ```text
//! | group 0                                 | group 1         |  each group one contiguous range, in the order of the groups
//! | tensor a | 0 0 | tensor b | tensor c | 0 | tensor d | 0 0  |  each tensor at a multiple of 64 numbers (256 bytes); gaps are zeros
//! | arena 0              | arena 1           | arena 2         |  at most 256 MiB each; no tensor is cut, no arena has two groups
//! ```
//!
//! An arena is what fits one binding on a device. A tensor that is frozen, or that the objective does not reach, has no place in the
//! list: it costs neither gradient nor moments.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::TrainError;

/// Every tensor begins at a multiple of this number of numbers, which is 256 bytes: what devices ask of a binding.
pub const ALIGN: usize = 64;
/// Numbers of an arena at most: 256 MiB.
pub const ARENA: usize = 64 << 20;

/// How the tensors of some names are trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// Part of the names of its tensors; empty for all.
    pub name: String,
    /// The rate, before the schedule.
    #[serde(default)]
    pub rate: Option<f64>,
    /// Weight decay of AdamW, per unit of rate; the optimiser's where it is not given.
    #[serde(default)]
    pub decay: Option<f64>,
    /// Whether its tensors stay as they are.
    #[serde(default)]
    pub frozen: bool,
}

impl Group {
    /// A group that trains at this rate.
    #[must_use]
    pub fn new(name: &str, rate: f64) -> Self {
        Self { name: name.to_owned(), rate: Some(rate), decay: None, frozen: false }
    }

    /// The groups of the release (`spec/omnix.md` 11.3).
    #[must_use]
    pub fn release() -> Vec<Self> {
        let fast = ["st_mod", "offset_head", "_idx_embed"].map(|name| Self::new(name, 2e-4));
        [Self::new("backbone", 2e-5)].into_iter().chain(fast).chain([Self::new("", 1e-4)]).collect()
    }
}

/// A tensor of the network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tensor {
    /// Its logical name, without a checkpoint's prefix.
    pub name: String,
    /// Its shape, slowest first.
    pub shape: Vec<usize>,
    /// Whether the objective depends on it.
    pub reached: bool,
}

/// A trained tensor and its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slot {
    /// Its logical name.
    pub name: String,
    /// Its shape, slowest first.
    pub shape: Vec<usize>,
    /// Its group.
    pub group: usize,
    /// Its arena.
    pub arena: usize,
    /// Its numbers in the flat list.
    pub range: Range<usize>,
}

/// Neighbouring numbers of the flat list that lie in one buffer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arena {
    /// The group that all its tensors belong to.
    pub group: usize,
    /// Its numbers in the flat list.
    pub range: Range<usize>,
}

/// Where all trained tensors lie, and which tensors stay as they are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Layout {
    /// The trained tensors in the order of the flat list.
    pub slots: Vec<Slot>,
    /// The arenas in the order of the flat list.
    pub arenas: Vec<Arena>,
    /// Each group's numbers in the flat list; frozen groups have none.
    pub groups: Vec<Range<usize>>,
    /// Names and shapes of the tensors that stay as they are, in the order given.
    pub fixed: Vec<(String, Vec<usize>)>,
    /// Groups that took no tensor, by index: perhaps their name is misspelt.
    pub idle: Vec<usize>,
}

impl Layout {
    /// Puts `tensors` in order, in arenas of at most `arena` numbers ([`ARENA`] but in tests).
    ///
    /// # Errors
    /// A tensor that no group takes, one that no arena holds, or none that is trained.
    pub fn new(tensors: &[Tensor], groups: &[Group], arena: usize) -> Result<Self, TrainError> {
        let mut layout = Self::default();
        let mut members = vec![Vec::new(); groups.len()];
        for tensor in tensors {
            let group = groups.iter().position(|group| tensor.name.contains(&group.name));
            let group = group.ok_or_else(|| TrainError::NoGroup { tensor: tensor.name.clone() })?;
            members[group].push(tensor);
        }
        let mut at = 0usize;
        for (group, tensors) in members.iter().enumerate() {
            if tensors.is_empty() {
                layout.idle.push(group);
            }
            let start = at;
            for tensor in tensors.iter().filter(|tensor| tensor.reached && !groups[group].frozen) {
                let too_large = || TrainError::TensorTooLarge { tensor: tensor.name.clone(), most: arena };
                let len = tensor.shape.iter().try_fold(1usize, |n, side| n.checked_mul(*side));
                let len = len.filter(|len| *len <= arena).ok_or_else(too_large)?;
                let room = len.checked_next_multiple_of(ALIGN).ok_or_else(too_large)?;
                let end = at.checked_add(room).ok_or_else(too_large)?;
                let index = match layout.arenas.last_mut() {
                    Some(last) if last.group == group && end - last.range.start <= arena.next_multiple_of(ALIGN) => {
                        last.range.end = end;
                        layout.arenas.len() - 1
                    }
                    _ => {
                        layout.arenas.push(Arena { group, range: at..end });
                        layout.arenas.len() - 1
                    }
                };
                let (name, shape) = (tensor.name.clone(), tensor.shape.clone());
                layout.slots.push(Slot { name, shape, group, arena: index, range: at..at + len });
                at = end;
            }
            layout.groups.push(start..at);
        }
        let trained: std::collections::BTreeSet<&str> = layout.slots.iter().map(|slot| slot.name.as_str()).collect();
        let fixed = tensors.iter().filter(|tensor| !trained.contains(tensor.name.as_str()));
        layout.fixed = fixed.map(|tensor| (tensor.name.clone(), tensor.shape.clone())).collect();
        if layout.slots.is_empty() { Err(TrainError::NothingTrains) } else { Ok(layout) }
    }

    /// Numbers of the flat list, gaps included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.arenas.last().map_or(0, |arena| arena.range.end)
    }

    /// Whether nothing is trained. A layout that was made has something.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Numbers that are trained: those of the tensors, without gaps.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.slots.iter().map(|slot| slot.range.len()).sum()
    }

    /// Where the slot's numbers lie in its arena.
    #[must_use]
    pub fn in_arena(&self, slot: &Slot) -> Range<usize> {
        let start = self.arenas[slot.arena].range.start;
        slot.range.start - start..slot.range.end - start
    }

    /// The slots of an arena.
    pub fn of_arena(&self, arena: usize) -> impl Iterator<Item = &Slot> {
        self.slots.iter().filter(move |slot| slot.arena == arena)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(name: &str, shape: &[usize]) -> Tensor {
        Tensor { name: name.to_owned(), shape: shape.to_vec(), reached: true }
    }

    #[test]
    fn the_first_group_that_fits_takes_a_tensor() {
        let names = ["cam_dec.backbone.0.weight", "backbone.pretrained.video_idx_embed.proj.weight"];
        let names =
            names.iter().chain(&["st_mod.blocks.0.mlp.fc1.weight", "head.norm.weight", "offset_head.norm.weight"]);
        let tensors: Vec<Tensor> = names.map(|name| tensor(name, &[3])).collect();
        let layout = Layout::new(&tensors, &Group::release(), ARENA).unwrap();
        let group = |name: &str| layout.slots.iter().find(|slot| slot.name.starts_with(name)).unwrap().group;
        assert_eq!(["cam_dec", "backbone", "st_mod", "head", "offset_head"].map(group), [0, 0, 1, 4, 2]);
        // No name has `_idx_embed` that `backbone` did not take.
        assert_eq!(layout.idle, [3]);
    }

    #[test]
    fn tensors_lie_aligned_in_arenas_of_one_group() {
        let tensors = [tensor("a.0", &[60]), tensor("b.0", &[2, 65]), tensor("a.1", &[64]), tensor("a.2", &[1])];
        let layout = Layout::new(&tensors, &[Group::new("a", 1.0), Group::new("b", 2.0)], 192).unwrap();
        let places: Vec<_> =
            layout.slots.iter().map(|slot| (slot.name.as_str(), slot.arena, slot.range.clone())).collect();
        assert_eq!(places, [("a.0", 0, 0..60), ("a.1", 0, 64..128), ("a.2", 0, 128..129), ("b.0", 1, 192..322)]);
        assert_eq!(layout.groups, [0..192, 192..384]);
        assert_eq!((layout.len(), layout.parameters()), (384, 60 + 64 + 1 + 130));
        assert_eq!(layout.in_arena(&layout.slots[3]), 0..130);
        let cut = Layout::new(&tensors, &[Group::new("", 1.0)], 130).unwrap();
        assert!(cut.arenas.windows(2).all(|pair| pair[0].range.end == pair[1].range.start));
        assert!(cut.arenas.len() > 2 && cut.arenas.iter().all(|arena| arena.range.len() <= 192));
        assert!(cut.slots.iter().all(|slot| cut.of_arena(slot.arena).any(|other| other == slot)));
    }

    #[test]
    fn what_is_frozen_or_not_reached_has_no_place() {
        let mut tensors = vec![tensor("a", &[8]), tensor("b", &[8]), tensor("c", &[8])];
        tensors[2].reached = false;
        let frozen = Group { frozen: true, ..Group::new("a", 1.0) };
        let layout = Layout::new(&tensors, &[frozen.clone(), Group::new("", 1.0)], ARENA).unwrap();
        assert_eq!(layout.slots.iter().map(|slot| slot.name.as_str()).collect::<Vec<_>>(), ["b"]);
        assert_eq!(layout.fixed.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["a", "c"]);
        assert_eq!(layout.groups, [0..0, 0..64]);
        let all = Group { name: String::new(), ..frozen };
        assert!(matches!(Layout::new(&tensors, &[all], ARENA), Err(TrainError::NothingTrains)));
    }

    #[test]
    fn what_cannot_be_placed_is_named() {
        let tensors = [tensor("a", &[8]), tensor("b", &[usize::MAX, 2])];
        let error = Layout::new(&tensors, &[Group::new("a", 1.0)], ARENA).unwrap_err();
        assert!(matches!(error, TrainError::NoGroup { tensor } if tensor == "b"));
        let error = Layout::new(&tensors, &[Group::new("", 1.0)], ARENA).unwrap_err();
        assert!(matches!(error, TrainError::TensorTooLarge { tensor, .. } if tensor == "b"));
    }
}
