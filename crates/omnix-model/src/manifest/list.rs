//! A manifest in the making, and what the dense head and the sampling head have in common.

use omnix_weights::{Manifest, Requirement, Scope};

/// Required only where it is wanted.
pub(super) fn when(wanted: bool) -> Requirement {
    if wanted { Requirement::Required } else { Requirement::Optional }
}

/// A manifest in the making.
pub(super) struct List {
    pub(super) manifest: Manifest,
    /// What is added next is this.
    pub(super) requirement: Requirement,
}

impl List {
    pub(super) fn add(&mut self, name: String, shape: &[usize]) {
        match self.requirement {
            Requirement::Required => self.manifest.require(name, shape),
            Requirement::Optional => self.manifest.optional(name, shape),
        };
    }

    /// A weight of this shape and a bias of its first dimension.
    pub(super) fn layer(&mut self, at: &Scope, shape: &[usize]) {
        self.add(at.name("weight"), shape);
        self.add(at.name("bias"), &shape[..1]);
    }
}

/// What both heads have between the features and the last layer, which makes `out` numbers of `hidden`.
pub(super) fn main_branch(
    list: &mut List,
    head: &Scope,
    wide: usize,
    f: usize,
    channels: [usize; 4],
    last: [usize; 2],
) {
    let ([hidden, out], at) = (last, head.pp("scratch"));
    for (k, c) in channels.into_iter().enumerate() {
        list.layer(&head.pp("projects").pp(k), &[c, wide, 1, 1]);
        if let Some(side) = [Some(4), Some(2), None, Some(3)][k] {
            list.layer(&head.pp("resize_layers").pp(k), &[c, c, side, side]);
        }
        list.add(at.name(format_args!("layer{}_rn.weight", k + 1)), &[f, c, 3, 3]);
    }
    fusion(list, &at, "", f);
    list.layer(&at.pp("output_conv1"), &[f / 2, f, 3, 3]);
    list.layer(&at.pp("output_conv2.0"), &[hidden, f / 2, 3, 3]);
    list.layer(&at.pp("output_conv2.2"), &[out, hidden, 1, 1]);
}

/// A fusion chain of `f` channels.
pub(super) fn fusion(list: &mut List, at: &Scope, suffix: &str, f: usize) {
    for k in 1..=4 {
        let step = at.pp(format_args!("refinenet{k}{suffix}"));
        // The deepest step has nothing to add to.
        for unit in if k == 4 { 2..=2 } else { 1..=2 } {
            for conv in 1..=2 {
                list.layer(&step.pp(format_args!("resConfUnit{unit}.conv{conv}")), &[f, f, 3, 3]);
            }
        }
        list.layer(&step.pp("out_conv"), &[f, f, 1, 1]);
    }
}
