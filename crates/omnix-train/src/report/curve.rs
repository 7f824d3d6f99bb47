//! A curve of bounded memory: means over stretches of steps, which grow longer as the run does.

/// Stretches of a curve at most: more than a page has columns of pixels.
const MOST: usize = 2048;

/// The mean of a number over a stretch of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    /// Number of the stretch: step / length.
    index: u64,
    sum: f64,
    count: u64,
}

/// A number as it changes with the steps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    /// Steps of a stretch: a power of two.
    length: u64,
    stretches: Vec<Stretch>,
}

impl Default for Curve {
    fn default() -> Self {
        Self { length: 1, stretches: Vec::new() }
    }
}

impl Curve {
    /// Adds the number of a step; steps ascend. What is not finite is left out.
    pub(super) fn push(&mut self, step: u64, value: f64) {
        if !value.is_finite() {
            return;
        }
        self.add(Stretch { index: step / self.length, sum: value, count: 1 });
        while self.stretches.len() > MOST {
            self.length *= 2;
            for stretch in std::mem::take(&mut self.stretches) {
                self.add(Stretch { index: stretch.index / 2, ..stretch });
            }
        }
    }

    fn add(&mut self, new: Stretch) {
        match self.stretches.last_mut() {
            Some(last) if last.index == new.index => {
                last.sum += new.sum;
                last.count += new.count;
            }
            _ => self.stretches.push(new),
        }
    }

    /// Step in the middle of each stretch, and the mean there.
    pub(super) fn points(&self) -> impl ExactSizeIterator<Item = (f64, f64)> {
        let half = (self.length - 1) as f64 / 2.0;
        self.stretches.iter().map(move |s| ((s.index * self.length) as f64 + half, s.sum / s.count as f64))
    }

    /// The newest point.
    #[must_use]
    pub(super) fn last(&self) -> Option<(f64, f64)> {
        self.points().last()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_stretches_that_grow() {
        let mut curve = Curve::default();
        (0..3 * MOST as u64).for_each(|step| curve.push(step, step as f64));
        let points: Vec<_> = curve.points().collect();
        assert!(points.len() <= MOST && points.len() > MOST / 2);
        // The mean of a line over a stretch is its value in the middle.
        assert!(points.iter().all(|(step, value)| step == value), "{:?}", &points[..3]);
        curve.push(1 << 20, f64::NAN);
        assert_eq!(curve.last(), points.last().copied());
    }

    #[test]
    fn sparse_steps_keep_their_places() {
        let mut curve = Curve::default();
        [10, 20, 30].into_iter().for_each(|step| curve.push(step, 1.0));
        assert_eq!(curve.points().collect::<Vec<_>>(), [(10.0, 1.0), (20.0, 1.0), (30.0, 1.0)]);
    }
}
