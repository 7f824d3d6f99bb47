//! The points of the page and their order: those that change place first.

use super::super::motion::MovingPoints;

/// The points of the page, in its order.
pub(super) struct Order {
    /// Indices of the points that are kept.
    pub(super) points: Vec<u32>,
    /// How many of them, from the start, change place.
    pub(super) changing: usize,
}

impl Order {
    pub(super) fn of(points: &MovingPoints) -> Self {
        let times = points.views.len();
        let place = |time, point| points.position(time, point).map(f32::to_bits);
        let (mut order, mut still) = (Vec::new(), Vec::new());
        for point in 0..points.len() {
            if (0..times).any(|time| points.position(time, point).iter().any(|v| !v.is_finite())) {
                continue;
            }
            let first = place(0, point);
            let changes = (1..times).any(|time| place(time, point) != first);
            // A point's number is below 2^32: its source index alone takes four bytes of memory.
            if changes { &mut order } else { &mut still }.push(point as u32);
        }
        let changing = order.len();
        order.append(&mut still);
        Self { points: order, changing }
    }

    pub(super) fn all(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.points.iter().map(|&point| point as usize)
    }
}
