//! Random numbers as a function of what they are for: the same seed, index and purpose give the same numbers, whatever else was drawn.

/// A stream of numbers (SplitMix64).
#[derive(Debug, Clone)]
pub(crate) struct Random(u64);

impl Random {
    /// The stream of one purpose for one sample.
    pub(crate) fn new(seed: u64, index: u64, purpose: u64) -> Self {
        // Each part goes through the mixer before the next comes in, so that neighbours have nothing in common.
        Self(mix(mix(mix(seed).wrapping_add(index)).wrapping_add(purpose)))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// In [0, 1), 53 bits.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// In 0..count; 0 where count is 0. The bias is below 2^-32 for all counts here.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next()) * count as u128) >> 64) as usize
    }

    /// So many distinct numbers of 0..of, in random order; all of them where there are fewer.
    pub(crate) fn some(&mut self, count: usize, of: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..of).collect();
        let count = count.min(of);
        for k in 0..count {
            let other = k + self.below(of - k);
            all.swap(k, other);
        }
        all.truncate(count);
        all
    }
}

const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_functions_and_even() {
        let mut random = Random::new(1, 2, 3);
        assert_eq!(random.next(), Random::new(1, 2, 3).next());
        assert_ne!(Random::new(1, 2, 3).next(), Random::new(1, 3, 2).next());
        let mean = (0..10_000).map(|_| random.unit()).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let mut counts = [0; 5];
        (0..5000).for_each(|_| counts[random.below(5)] += 1);
        assert!(counts.iter().all(|n| (900..1100).contains(n)), "{counts:?}");
    }

    #[test]
    fn some_are_distinct() {
        let mut some = Random::new(7, 0, 0).some(6, 9);
        assert_eq!(some.len(), 6);
        some.sort_unstable();
        some.dedup();
        assert_eq!((some.len(), some.last().is_some_and(|k| *k < 9)), (6, true));
        assert_eq!(Random::new(7, 0, 0).some(6, 2).len(), 2);
    }
}
