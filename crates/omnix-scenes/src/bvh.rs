//! A hierarchy of axis-aligned boxes with four children a node, over anything that has a box.
//!
//! Boxes are f32, rounded outwards when built; what they contain is tested in f64 by the caller. A ray's tests against boxes can
//! therefore only err towards visiting too much: the origin's rounding widens every box by [`ORIGIN_ERROR`] of the largest
//! coordinate, the rounding of direction, reciprocal and product stretches the interval by [`SLACK`] on either side.
//! Split by the surface area heuristic over 12 bins of centroids; the tree does not depend on the number of threads.

use glam::{DVec3, Vec3, Vec3A, Vec4};

/// Most items of a leaf.
const LEAF: usize = 4;
const BINS: usize = 12;
/// From this number of items on, the two halves are built in parallel.
const PARALLEL: usize = 4096;
/// From this depth on, halves have equal numbers of items, which bounds the depth of any tree of 2^27 items.
const DEEP: usize = 24;
/// Four-wide nodes push at most three entries a level.
const STACK: usize = 3 * (DEEP + 27) + 4;
const ORIGIN_ERROR: f64 = 2.4e-7;
const SLACK: f32 = 1e-6;

const IS_LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 27;
const EMPTY: u32 = IS_LEAF;

/// A box in f32 that contains one in f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    low: Vec3A,
    high: Vec3A,
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

    fn area(self) -> f32 {
        let size = (self.high - self.low).max(Vec3A::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// Four children: their boxes by axis, and what they are.
#[derive(Debug, Clone)]
struct Node {
    /// `[axis][0 = low, 1 = high]`, one lane for each child.
    planes: [[Vec4; 2]; 3],
    /// A node's index, or `IS_LEAF | count << 27 | first` with indices into `order`.
    children: [u32; 4],
}

/// The hierarchy.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    /// Items in the order of the leaves.
    order: Vec<u32>,
}

/// A ray as boxes see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slabs {
    inverse: Vec3,
    /// The origin moved so that the near and the far plane come out early and late.
    near: Vec3,
    far: Vec3,
    /// 1 where the direction is negative: which plane of an axis is near.
    sign: [usize; 3],
}

impl Slabs {
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Self {
        // A direction of 0 would make 0 * infinity; what such a small one moves is far below the slack.
        let inverse = |d: f64| (1.0 / (if d.abs() < 1e-18 { 1e-18_f64.copysign(d) } else { d })) as f32;
        let inverse = Vec3::new(inverse(direction.x), inverse(direction.y), inverse(direction.z));
        let error = (origin.abs().max_element() * ORIGIN_ERROR) as f32;
        let origin = origin.as_vec3();
        let shift = Vec3::splat(error).copysign(inverse);
        let sign = inverse.to_array().map(|v| usize::from(v < 0.0));
        Self { inverse, near: origin + shift, far: origin - shift, sign }
    }
}

/// A part of the tree while it is built.
enum Tree {
    Leaf(Bounds, u32, u32),
    Inner(Bounds, Box<[Tree; 2]>),
}

impl Tree {
    fn bounds(&self) -> Bounds {
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

impl Bvh {
    /// The hierarchy over boxes; its items are their indices.
    pub(crate) fn new(boxes: &[Bounds]) -> Self {
        let items = boxes.iter().enumerate();
        let mut items: Vec<Item> = items
            .map(|(index, &bounds)| Item { bounds, centre: (bounds.low + bounds.high) * 0.5, index: index as u32 })
            .collect();
        if items.is_empty() {
            return Self::default();
        }
        let tree = split(&mut items, 0, 0);
        let mut nodes = Vec::with_capacity(items.len() / 3 + 1);
        flatten(&tree, &mut nodes);
        Self { nodes, order: items.iter().map(|item| item.index).collect() }
    }

    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Calls `test(places in order, most)` for leaves that the ray may meet at a parameter in [0, most], near ones first.
    /// `test` lowers `most` and returns true to end the walk.
    pub(crate) fn visit(
        &self,
        ray: &Slabs,
        most: &mut f64,
        mut test: impl FnMut(std::ops::Range<usize>, &mut f64) -> bool,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = [(0_u32, 0.0_f32); STACK];
        let mut height = 1;
        let [x, y, z] = ray.sign;
        let splat = |v: Vec3| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        let (inverse, near, far) = (splat(ray.inverse), splat(ray.near), splat(ray.far));
        while height > 0 {
            height -= 1;
            let (entry, from) = stack[height];
            if f64::from(from) > *most {
                continue;
            }
            if entry & IS_LEAF != 0 {
                let first = (entry & ((1 << COUNT_SHIFT) - 1)) as usize;
                let count = (entry >> COUNT_SHIFT & 15) as usize;
                if test(first..first + count, most) {
                    return;
                }
                continue;
            }
            let node = &self.nodes[entry as usize];
            let [px, py, pz] = &node.planes;
            let enter = ((px[x] - near[0]) * inverse[0])
                .max((py[y] - near[1]) * inverse[1])
                .max((pz[z] - near[2]) * inverse[2])
                .max(Vec4::ZERO)
                * (1.0 - SLACK);
            let leave = ((px[1 - x] - far[0]) * inverse[0])
                .min((py[1 - y] - far[1]) * inverse[1])
                .min((pz[1 - z] - far[2]) * inverse[2])
                * (1.0 + SLACK);
            let mut hits = enter.cmple(leave).bitmask();
            let enter = enter.to_array();
            let base = height;
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize;
                hits &= hits - 1;
                // Sorted so that the nearest is on top.
                let mut place = height;
                while place > base && stack[place - 1].1 < enter[lane] {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = (node.children[lane], enter[lane]);
                height += 1;
            }
        }
    }
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
    let size = high - low;
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    if size[axis] <= 0.0 || !size[axis].is_finite() {
        return None;
    }
    let scale = BINS as f32 / size[axis];
    let bin = |item: &Item| (((item.centre[axis] - low[axis]) * scale) as usize).min(BINS - 1);
    let mut bins = [(Bounds::NONE, 0_usize); BINS];
    for item in &*items {
        let entry = &mut bins[bin(item)];
        *entry = (entry.0.join(item.bounds), entry.1 + 1);
    }
    let mut right = [0.0_f32; BINS];
    let (mut all, mut count) = (Bounds::NONE, 0);
    for k in (1..BINS).rev() {
        (all, count) = (all.join(bins[k].0), count + bins[k].1);
        right[k] = all.area() * count as f32;
    }
    let (mut all, mut count) = (Bounds::NONE, 0);
    let mut best = None;
    for k in 1..BINS {
        (all, count) = (all.join(bins[k - 1].0), count + bins[k - 1].1);
        let cost = all.area() * count as f32 + right[k];
        if count > 0 && count < items.len() && best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, k));
        }
    }
    let (_, plane) = best?;
    let mut middle = 0;
    for k in 0..items.len() {
        if bin(&items[k]) < plane {
            items.swap(k, middle);
            middle += 1;
        }
    }
    Some(middle)
}

/// Writes a tree as four-wide nodes; the entry of its root.
fn flatten(tree: &Tree, nodes: &mut Vec<Node>) -> u32 {
    // The root is a node even when it is a leaf.
    let index = nodes.len();
    nodes.push(Node { planes: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3], children: [EMPTY; 4] });
    let mut children: Vec<&Tree> = vec![tree];
    while children.len() < 4 {
        let inner = |tree: &Tree| if let Tree::Inner(bounds, _) = tree { bounds.area() } else { -1.0 };
        let widest = (0..children.len()).max_by(|&a, &b| inner(children[a]).total_cmp(&inner(children[b])));
        let Some((place, Tree::Inner(_, halves))) = widest.map(|place| (place, children[place])) else {
            break;
        };
        children[place] = &halves[0];
        children.push(&halves[1]);
    }
    for (lane, child) in children.into_iter().enumerate() {
        let bounds = child.bounds();
        for axis in 0..3 {
            nodes[index].planes[axis][0][lane] = bounds.low[axis];
            nodes[index].planes[axis][1][lane] = bounds.high[axis];
        }
        nodes[index].children[lane] = match child {
            Tree::Leaf(_, first, count) => IS_LEAF | count << COUNT_SHIFT | first,
            Tree::Inner(..) => flatten(child, nodes),
        };
    }
    index as u32
}
