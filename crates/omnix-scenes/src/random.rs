//! Random numbers as a pure function of (seed, index, purpose): the same scene whatever was drawn before it, or in which thread.
//!
//! A generator is a 64-bit key and a counter; number k is `mix(key + k * GOLDEN)`, with the finaliser of SplitMix64 (Steele, Lea
//! and Flood, "Fast splittable pseudorandom number generators", 2014). [`Random::fork`] makes an independent generator for a
//! named purpose, so that a new draw in one part of a scene leaves every other part as it was.

use glam::{DQuat, DVec2, DVec3};

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of SplitMix64: every bit of the result depends on every bit of `x`.
pub(crate) const fn mix(x: u64) -> u64 {
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    key: u64,
    drawn: u64,
}

impl Random {
    /// The stream of a seed, an index and a purpose.
    #[must_use]
    pub fn new(seed: u64, index: u64, purpose: &str) -> Self {
        Self { key: mix(mix(seed ^ GOLDEN).wrapping_add(index)), drawn: 0 }.fork(purpose)
    }

    /// An independent stream for a purpose. It depends on this stream's key and not on what was drawn from it.
    #[must_use]
    pub fn fork(&self, purpose: &str) -> Self {
        let word = |key: u64, &byte: &u8| mix(key ^ u64::from(byte)).wrapping_add(GOLDEN);
        Self { key: mix(purpose.as_bytes().iter().fold(self.key, word)), drawn: 0 }
    }

    /// An independent stream for entry `index` of a list.
    #[must_use]
    pub fn at(&self, index: usize) -> Self {
        Self { key: mix(self.key.rotate_left(17) ^ mix(index as u64 ^ GOLDEN)), drawn: 0 }
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.drawn = self.drawn.wrapping_add(1);
        mix(self.key.wrapping_add(self.drawn.wrapping_mul(GOLDEN)))
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in a range given as a pair.
    pub fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        self.range(low, high)
    }

    /// In [low, high) with a uniform logarithm; both are positive.
    pub fn log_range(&mut self, low: f64, high: f64) -> f64 {
        self.range(low.ln(), high.ln()).exp()
    }

    /// A whole number below `n`; 0 where `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// A whole number from `low` to `high`, both included.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        low + self.below(high.saturating_sub(low) + 1)
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// An entry of a list that is not empty.
    pub fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }

    /// The index of an entry drawn by weight; 0 where all weights are 0.
    pub fn weighted(&mut self, weights: &[f64]) -> usize {
        let mut left = self.unit() * weights.iter().sum::<f64>();
        for (index, weight) in weights.iter().enumerate() {
            left -= weight;
            if left < 0.0 {
                return index;
            }
        }
        weights.iter().rposition(|&weight| weight > 0.0).unwrap_or(0)
    }

    /// Standard normal (Box and Muller; the second number is not used).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.range(-1.0, 1.0);
        let (sin, cos) = self.range(0.0, std::f64::consts::TAU).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    }

    /// Uniform over all rotations (Shoemake).
    pub fn rotation(&mut self) -> DQuat {
        let (u, v, w) = (self.unit(), self.unit() * std::f64::consts::TAU, self.unit() * std::f64::consts::TAU);
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos())
    }

    /// Uniform in a rectangle.
    pub fn inside(&mut self, low: DVec2, high: DVec2) -> DVec2 {
        DVec2::new(self.range(low.x, high.x), self.range(low.y, high.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_a_function_of_its_names() {
        let draw = |seed, index, purpose| Random::new(seed, index, purpose).bits();
        assert_eq!(draw(1, 2, "room"), draw(1, 2, "room"));
        let others = [draw(2, 2, "room"), draw(1, 3, "room"), draw(1, 2, "moor"), draw(2, 1, "room")];
        assert!(!others.contains(&draw(1, 2, "room")));
        let mut used = Random::new(1, 2, "room");
        let fresh = used.fork("lamp").bits();
        used.bits();
        assert_eq!(used.fork("lamp").bits(), fresh);
    }

    #[test]
    fn numbers_fill_their_ranges() {
        let mut random = Random::new(7, 0, "test");
        let draws: Vec<f64> = (0..4000).map(|_| random.unit()).collect();
        let mean = draws.iter().sum::<f64>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.02 && draws.iter().all(|v| (0.0..1.0).contains(v)), "{mean}");
        let counts = (0..3000).fold([0; 3], |mut counts, _| {
            counts[random.weighted(&[1.0, 0.0, 2.0])] += 1;
            counts
        });
        assert!(counts[1] == 0 && (900..1100).contains(&counts[0]), "{counts:?}");
        assert!((0..100).all(|_| (2..=4).contains(&random.count(2, 4))));
    }
}
