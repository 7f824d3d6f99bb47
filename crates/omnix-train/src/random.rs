//! Random numbers as a function of a seed, a purpose and a number: nothing is carried from one use to the next, so whatever is drawn
//! does not depend on what was drawn before, on the number of threads or on where a run was resumed.
//!
//! The bytes are the extended output of BLAKE3 over `purpose`, seed and number. A uniform number takes 8 of them, its 53 upper bits
//! over 2⁵³: `[0, 1)`. A normal one takes two uniform ones (Box and Muller), of which the second result is kept for the next call.

use blake3::{Hasher, OutputReader};

/// A stream of random numbers.
pub struct Random {
    reader: OutputReader,
    spare: Option<f64>,
}

impl Random {
    /// The stream of this seed, purpose (a text without a zero byte) and number.
    #[must_use]
    pub fn new(seed: u64, purpose: &str, number: u64) -> Self {
        let mut hasher = Hasher::new();
        hasher.update(purpose.as_bytes()).update(&[0]).update(&seed.to_le_bytes()).update(&number.to_le_bytes());
        Self { reader: hasher.finalize_xof(), spare: None }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let mut bytes = [0; 8];
        self.reader.fill(&mut bytes);
        u64::from_le_bytes(bytes)
    }

    /// Uniform in `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A whole number below `count`, which is above 0. (The bias of the remainder is below 2⁻³² for any count of 32 bits.)
    pub fn below(&mut self, count: u32) -> u32 {
        (self.bits() % u64::from(count.max(1))) as u32
    }

    /// Normal, mean 0 and deviation 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // 1 - u lies in (0, 1], so that the logarithm is finite.
        let (radius, turn) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        self.spare = Some(radius * turn.sin());
        radius * turn.cos()
    }

    /// Normal, drawn again until it lies within `limit` deviations.
    pub fn normal_within(&mut self, limit: f64) -> f64 {
        loop {
            let value = self.normal();
            if value.abs() <= limit {
                return value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_function_of_seed_purpose_and_number() {
        let draw = |seed, purpose: &str, number| Random::new(seed, purpose, number).bits();
        assert_eq!(draw(1, "a", 2), draw(1, "a", 2));
        let all = [draw(1, "a", 2), draw(2, "a", 2), draw(1, "b", 2), draw(1, "a", 3)];
        assert!((0..4).all(|i| (0..i).all(|j| all[i] != all[j])));
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut random = Random::new(7, "moments", 0);
        let n = 40_000;
        let moments = |draw: &mut dyn FnMut() -> f64| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..n {
                let value = draw();
                sum += value;
                squares += value * value;
            }
            (sum / f64::from(n), squares / f64::from(n))
        };
        let (mean, square) = moments(&mut || random.uniform());
        assert!((mean - 0.5).abs() < 0.01 && (square - 1.0 / 3.0).abs() < 0.01);
        let (mean, square) = moments(&mut || random.normal());
        assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03);
        // Of a normal cut at two deviations the variance is 0.774.
        let (mean, square) = moments(&mut || random.normal_within(2.0));
        assert!(mean.abs() < 0.02 && (square - 0.774).abs() < 0.02);
        assert!((0..1000).all(|_| random.below(3) < 3 && (2.0..5.0).contains(&random.between(2.0, 5.0))));
    }
}
