//! A hierarchy of axis-aligned boxes with four children a node, over anything that has a box.
//!
//! Boxes are f32, rounded outwards when built; what they contain is tested in f64 by the caller. A ray's tests against boxes can
//! therefore only err towards visiting too much: the origin's rounding widens every box by [`ORIGIN_ERROR`] of the largest
//! coordinate, the rounding of direction, reciprocal and product stretches the interval by [`SLACK`] on either side.
//! So neither the tree's shape nor the order of a walk changes what a caller finds, but how soon.

use std::ops::Range;

use glam::{DVec3, Vec3, Vec4};

use tree::{LEVELS, Tree};

pub(crate) use tree::Bounds;

mod tree;

/// Most levels of nodes of the trees whose walks have a short stack: a long one takes longer to clear than some rays to walk.
const SHALLOW: usize = 14;
const ORIGIN_ERROR: f64 = 2.4e-7;
const SLACK: f32 = 1e-6;

const IS_LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 27;
const EMPTY: u32 = IS_LEAF;

/// Entries that wait at most: of each level's four children one is visited at once.
const fn waiting(levels: usize) -> usize {
    3 * levels
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
    /// Nodes on the longest way from the root to a leaf.
    levels: usize,
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

/// A ray against four boxes at a time.
struct Lanes {
    inverse: [Vec4; 3],
    near: [Vec4; 3],
    far: [Vec4; 3],
    sign: [usize; 3],
}

impl Lanes {
    #[inline(always)]
    fn new(ray: &Slabs) -> Self {
        let splat = |v: Vec3| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        // The mask tells the compiler that these are indices of a pair.
        let sign = ray.sign.map(|sign| sign & 1);
        Self { inverse: splat(ray.inverse), near: splat(ray.near), far: splat(ray.far), sign }
    }

    /// Where the ray enters each child's box, and a bit for each that it enters at or before `most`.
    #[inline(always)]
    fn meet(&self, node: &Node, most: f32) -> ([f32; 4], u32) {
        let [px, py, pz] = &node.planes;
        let [x, y, z] = self.sign;
        let enter = ((px[x] - self.near[0]) * self.inverse[0])
            .max((py[y] - self.near[1]) * self.inverse[1])
            .max((pz[z] - self.near[2]) * self.inverse[2])
            .max(Vec4::ZERO)
            * (1.0 - SLACK);
        let leave = ((px[x ^ 1] - self.far[0]) * self.inverse[0])
            .min((py[y ^ 1] - self.far[1]) * self.inverse[1])
            .min((pz[z ^ 1] - self.far[2]) * self.inverse[2])
            * (1.0 + SLACK);
        (enter.to_array(), enter.cmple(leave.min(Vec4::splat(most))).bitmask())
    }
}

/// The least f32 that is not below.
fn above(most: f64) -> f32 {
    (most as f32).next_up()
}

/// The places in order of a leaf's items.
fn places(leaf: u32) -> Range<usize> {
    let first = (leaf & ((1 << COUNT_SHIFT) - 1)) as usize;
    first..first + (leaf >> COUNT_SHIFT & 15) as usize
}

impl Bvh {
    /// The hierarchy over boxes; its items are their indices.
    pub(crate) fn new(boxes: &[Bounds]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let (tree, order) = tree::tree(boxes);
        let mut nodes = Vec::with_capacity(boxes.len() / 2 + 1);
        let levels = flatten(&tree, &mut nodes);
        Self { nodes, order, levels }
    }

    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Calls `test(places in order, most)` for leaves that the ray may meet at a parameter in [0, most], near ones first.
    /// `test` lowers `most`.
    #[inline]
    pub(crate) fn visit(&self, ray: &Slabs, most: &mut f64, test: impl FnMut(Range<usize>, &mut f64)) {
        if self.levels <= SHALLOW {
            self.nearest::<{ waiting(SHALLOW) }>(ray, most, test);
        } else {
            self.nearest::<{ waiting(LEVELS) }>(ray, most, test);
        }
    }

    fn nearest<const STACK: usize>(&self, ray: &Slabs, most: &mut f64, mut test: impl FnMut(Range<usize>, &mut f64)) {
        if self.nodes.is_empty() {
            return;
        }
        let ray = Lanes::new(ray);
        let mut stack = [(0_u32, 0.0_f32); STACK];
        let (mut entry, mut height, mut limit) = (0, 0, above(*most));
        loop {
            if entry & IS_LEAF == 0 {
                let node = &self.nodes[entry as usize];
                let (enter, mut hits) = ray.meet(node, limit);
                if hits != 0 {
                    let base = height;
                    let child = |lane: usize| (node.children[lane], enter[lane]);
                    let mut next = child(hits.trailing_zeros() as usize);
                    hits &= hits - 1;
                    while hits != 0 {
                        let mut other = child(hits.trailing_zeros() as usize);
                        hits &= hits - 1;
                        if other.1 < next.1 {
                            std::mem::swap(&mut other, &mut next);
                        }
                        // Sorted so that the nearest is on top.
                        let mut place = height;
                        while place > base && stack[place - 1].1 < other.1 {
                            stack[place] = stack[place - 1];
                            place -= 1;
                        }
                        stack[place] = other;
                        height += 1;
                    }
                    entry = next.0;
                    continue;
                }
            } else {
                test(places(entry), most);
                limit = above(*most);
            }
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                let (waiting, from) = stack[height];
                if from <= limit {
                    entry = waiting;
                    break;
                }
            }
        }
    }

    /// Whether `test(places in order)` holds for any leaf that the ray may meet at a parameter in [0, most]; no more are tested then.
    #[inline]
    pub(crate) fn any(&self, ray: &Slabs, most: f64, test: impl FnMut(Range<usize>) -> bool) -> bool {
        if self.levels <= SHALLOW {
            self.first::<{ waiting(SHALLOW) }>(ray, most, test)
        } else {
            self.first::<{ waiting(LEVELS) }>(ray, most, test)
        }
    }

    fn first<const STACK: usize>(&self, ray: &Slabs, most: f64, mut test: impl FnMut(Range<usize>) -> bool) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let (ray, limit) = (Lanes::new(ray), above(most));
        let mut stack = [0_u32; STACK];
        let (mut entry, mut height) = (0, 0);
        loop {
            if entry & IS_LEAF == 0 {
                let node = &self.nodes[entry as usize];
                let (enter, mut hits) = ray.meet(node, limit);
                if hits != 0 {
                    // The nearest at once: what blocks is often near. The order of the others is worth no sorting.
                    let mut next = hits.trailing_zeros() as usize;
                    hits &= hits - 1;
                    while hits != 0 {
                        let mut other = hits.trailing_zeros() as usize;
                        hits &= hits - 1;
                        if enter[other] < enter[next] {
                            std::mem::swap(&mut other, &mut next);
                        }
                        stack[height] = node.children[other];
                        height += 1;
                    }
                    entry = node.children[next];
                    continue;
                }
            } else if test(places(entry)) {
                return true;
            }
            if height == 0 {
                return false;
            }
            height -= 1;
            entry = stack[height];
        }
    }
}

/// Writes a tree as four-wide nodes, each before its children; the number of levels.
fn flatten(tree: &Tree, nodes: &mut Vec<Node>) -> usize {
    // The root is a node even when it is a leaf.
    let index = nodes.len();
    nodes.push(Node { planes: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3], children: [EMPTY; 4] });
    let mut children: Vec<&Tree> = Vec::with_capacity(4);
    children.push(tree);
    while children.len() < 4 {
        let inner = |tree: &Tree| if let Tree::Inner(bounds, _) = tree { bounds.area() } else { -1.0 };
        let widest = (0..children.len()).max_by(|&a, &b| inner(children[a]).total_cmp(&inner(children[b])));
        let Some((place, Tree::Inner(_, halves))) = widest.map(|place| (place, children[place])) else {
            break;
        };
        children[place] = &halves[0];
        children.push(&halves[1]);
    }
    let mut levels = 0;
    for (lane, child) in children.into_iter().enumerate() {
        let bounds = child.bounds();
        for axis in 0..3 {
            nodes[index].planes[axis][0][lane] = bounds.low[axis];
            nodes[index].planes[axis][1][lane] = bounds.high[axis];
        }
        nodes[index].children[lane] = match child {
            Tree::Leaf(_, first, count) => IS_LEAF | count << COUNT_SHIFT | first,
            Tree::Inner(..) => {
                let next = nodes.len() as u32;
                levels = levels.max(flatten(child, nodes));
                next
            }
        };
    }
    levels + 1
}
