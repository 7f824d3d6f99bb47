//! How a hierarchy divides its boxes: in two, and these again, by the surface area heuristic over bins of centroids along each axis.
//!
//! The tree does not depend on the number of threads.

use glam::{DVec3, Vec3A};

/// Most items of a leaf. Four boxes are tested at the price of one, a triangle in f64 costs more than that: leaves are small.
const LEAF: usize = 2;
/// Most bins of an axis; few items have fewer.
const BINS: usize = 12;
/// From this number of items on, the two halves are built in parallel.
const PARALLEL: usize = 4096;
/// From this depth on, halves have equal numbers of items, which bounds the depth of any tree of 2^27 items.
const DEEP: usize = 24;
/// Most levels of a tree.
pub(super) const LEVELS: usize = DEEP + 27;

/// A box in f32 that contains one in f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub(super) low: Vec3A,
    pub(super) high: Vec3A,
}

impl Bounds {
    const NONE: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    pub(crate) fn of(points: &[DVec3]) -> Self {
        let [low, high] = crate::mesh::bounds(points);
        let down = |v: f64| (v as f32).next_down();
        let up = |v: f64| (v as f32).next_up();
        Self {
            low: Vec3A::new(down(low.x), down(low.y), down(low.z)),
            high: Vec3A::new(up(high.x), up(high.y), up(high.z)),
        }
    }

    fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub(super) fn area(self) -> f32 {
        let size = (self.high - self.low).max(Vec3A::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// A part of the tree.
pub(super) enum Tree {
    /// The place of its first item, and how many they are.
    Leaf(Bounds, u32, u32),
    Inner(Bounds, Box<[Tree; 2]>),
}

impl Tree {
    pub(super) fn bounds(&self) -> Bounds {
        match self {
            Self::Leaf(bounds, ..) | Self::Inner(bounds, _) => *bounds,
        }
    }
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    centre: Vec3A,
    index: u32,
}

/// The tree over boxes, of which there is at least one, and their indices in the order of its leaves.
pub(super) fn tree(boxes: &[Bounds]) -> (Tree, Vec<u32>) {
    let items = boxes.iter().enumerate();
    let mut items: Vec<Item> = items
        .map(|(index, &bounds)| Item { bounds, centre: (bounds.low + bounds.high) * 0.5, index: index as u32 })
        .collect();
    let tree = split(&mut items, 0, 0);
    (tree, items.iter().map(|item| item.index).collect())
}

/// The tree of items, which it sorts; `first` is the place of the first one.
fn split(items: &mut [Item], first: u32, depth: usize) -> Tree {
    let bounds = items.iter().fold(Bounds::NONE, |all, item| all.join(item.bounds));
    if items.len() <= LEAF {
        return Tree::Leaf(bounds, first, items.len() as u32);
    }
    let middle = if depth < DEEP { best_split(items) } else { None }.unwrap_or(items.len() / 2);
    let (left, right) = items.split_at_mut(middle);
    let after = first + middle as u32;
    let halves = if left.len() + right.len() >= PARALLEL {
        let (left, right) = rayon::join(|| split(left, first, depth + 1), || split(right, after, depth + 1));
        [left, right]
    } else {
        [split(left, first, depth + 1), split(right, after, depth + 1)]
    };
    Tree::Inner(bounds, Box::new(halves))
}

/// Sorts items into the two sides of the best plane between bins; the number of the first side.
fn best_split(items: &mut [Item]) -> Option<usize> {
    let none = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (low, high) = items.iter().fold(none, |(low, high), item| (low.min(item.centre), high.max(item.centre)));
    let count = items.len().min(BINS);
    let scale = Vec3A::splat(count as f32) / (high - low);
    let bin = |item: &Item, axis: usize| (((item.centre[axis] - low[axis]) * scale[axis]) as usize).min(count - 1);
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        // All in one place, or not numbers.
        if high[axis] <= low[axis] || !scale[axis].is_finite() {
            continue;
        }
        let mut bins = [(Bounds::NONE, 0_usize); BINS];
        for item in &*items {
            let entry = &mut bins[bin(item, axis)];
            *entry = (entry.0.join(item.bounds), entry.1 + 1);
        }
        let mut right = [0.0_f32; BINS];
        let (mut all, mut number) = (Bounds::NONE, 0);
        for k in (1..count).rev() {
            (all, number) = (all.join(bins[k].0), number + bins[k].1);
            right[k] = all.area() * number as f32;
        }
        let (mut all, mut number) = (Bounds::NONE, 0);
        for k in 1..count {
            (all, number) = (all.join(bins[k - 1].0), number + bins[k - 1].1);
            let cost = all.area() * number as f32 + right[k];
            if number > 0 && number < items.len() && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, k));
            }
        }
    }
    let (_, axis, plane) = best?;
    let mut middle = 0;
    for k in 0..items.len() {
        if bin(&items[k], axis) < plane {
            items.swap(k, middle);
            middle += 1;
        }
    }
    Some(middle)
}
