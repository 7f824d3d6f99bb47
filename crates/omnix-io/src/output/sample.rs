//! Bounded, seeded samples of endless streams, and percentiles.

use super::frame::FrameResult;

/// A uniform sample without replacement of a stream of unknown length: every item's key is a bijective hash of its position, and
/// the lowest keys stay. The result depends on the seed and the stream alone.
pub(super) struct Reservoir<T> {
    capacity: usize,
    seed: u64,
    seen: u64,
    /// Keys at or above this can no longer be among the lowest.
    cutoff: u64,
    /// (position, item), up to twice the capacity before it is cut down.
    kept: Vec<(u64, T)>,
}

impl<T> Reservoir<T> {
    pub(super) fn new(capacity: usize, seed: u64) -> Self {
        Self { capacity: capacity.max(1), seed, seen: 0, cutoff: u64::MAX, kept: Vec::new() }
    }

    /// Offers the next item of the stream; it is made only if it may stay.
    pub(super) fn offer(&mut self, item: impl FnOnce() -> T) {
        let position = self.seen;
        self.seen += 1;
        if key(self.seed, position) < self.cutoff {
            self.kept.push((position, item()));
            if self.kept.len() >= self.capacity.saturating_mul(2) {
                self.cut(self.capacity);
            }
        }
    }

    fn cut(&mut self, to: usize) {
        if self.kept.len() > to {
            let seed = self.seed;
            let (_, lowest_out, _) = self.kept.select_nth_unstable_by_key(to, |(position, _)| key(seed, *position));
            self.cutoff = key(seed, lowest_out.0);
            self.kept.truncate(to);
        }
    }

    /// The sample in the order of the stream, only of items that pass, at most `limit` of them.
    pub(super) fn finish(mut self, limit: usize, pass: impl Fn(&T) -> bool) -> Vec<T> {
        self.cut(self.capacity);
        self.kept.retain(|(_, item)| pass(item));
        self.cut(limit);
        self.kept.sort_unstable_by_key(|(position, _)| *position);
        self.kept.into_iter().map(|(_, item)| item).collect()
    }
}

/// SplitMix64's output function: a bijection, so no two positions share a key.
pub(super) fn key(seed: u64, position: u64) -> u64 {
    let mut z = position.wrapping_add(seed).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Confidences of all pixels but those that have none (0, where a mask leaves them out), for percentiles: exact up to half a million pixels, beyond that from a sample of as many.
pub(super) struct ConfidenceSample(Reservoir<f32>);

impl ConfidenceSample {
    const CAPACITY: usize = 1 << 19;

    pub(super) fn new(seed: u64) -> Self {
        Self(Reservoir::new(Self::CAPACITY, seed))
    }

    pub(super) fn add(&mut self, frame: &FrameResult<'_>) {
        for &value in frame.confidence.unwrap_or_default().iter().filter(|c| c.is_finite() && **c > 0.0) {
            self.0.offer(|| value);
        }
    }

    /// Ascending values; none if no image had confidences.
    pub(super) fn sorted(self) -> Vec<f32> {
        let mut values = self.0.finish(usize::MAX, |_| true);
        values.sort_unstable_by(f32::total_cmp);
        values
    }
}

/// The `percent`-th percentile of ascending values, linear between neighbours as numpy's default; none of no values.
pub(super) fn percentile(sorted: &[f32], percent: f32) -> Option<f32> {
    let last = sorted.len().checked_sub(1)?;
    let at = f64::from(percent.clamp(0.0, 100.0)) / 100.0 * last as f64;
    let (low, part) = (at.floor() as usize, at.fract());
    let (a, b) = (f64::from(sorted[low]), f64::from(sorted[(low + 1).min(last)]));
    Some((a + (b - a) * part) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_is_bounded_ordered_and_even() {
        let mut reservoir = Reservoir::new(1000, 7);
        for i in 0..100_000u32 {
            reservoir.offer(|| i);
        }
        assert!(reservoir.kept.len() < 2000);
        let sample = reservoir.finish(1000, |_| true);
        assert_eq!(sample.len(), 1000);
        assert!(sample.windows(2).all(|w| w[0] < w[1]));
        let low = sample.iter().filter(|&&v| v < 50_000).count();
        assert!((400..600).contains(&low), "{low} of 1000 in the first half");
    }

    #[test]
    fn small_streams_stay_whole() {
        let mut reservoir = Reservoir::new(10, 7);
        (0..10u32).for_each(|i| reservoir.offer(|| i));
        assert_eq!(reservoir.finish(usize::MAX, |v| v % 2 == 0), [0, 2, 4, 6, 8]);
    }

    #[test]
    fn percentiles_as_numpy() {
        let v = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(percentile(&v, 50.0), Some(3.0));
        assert_eq!(percentile(&v, 0.0), Some(1.0));
        assert_eq!(percentile(&v, 100.0), Some(8.0));
        assert_eq!(percentile(&[], 50.0), None);
    }
}
