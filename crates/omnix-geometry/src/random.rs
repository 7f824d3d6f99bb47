//! The generator behind NumPy's `default_rng(seed)`, as far as sampling without replacement needs it.
//!
//! `SeedSequence` (the entropy pool of 4 words), PCG-64 XSL-RR 128/64, Lemire's bounded integers on 32-bit halves, and
//! `Generator.choice(n, size, replace=False)`: Floyd's method, or a tail shuffle for n > 10000 and size > n/50. The same
//! numbers as NumPy, so that a fit which the reference draws with `default_rng(42)` is drawn alike.

const MULTIPLIER: u128 = 0x2360_ED05_1FC6_5DA4_4385_DF64_9FCC_F645;

/// PCG-64 seeded as `numpy.random.default_rng(seed)`.
#[derive(Debug, Clone)]
pub(crate) struct Generator {
    state: u128,
    increment: u128,
    /// The upper half of a 64-bit number whose lower half was used.
    spare: Option<u32>,
}

impl Generator {
    pub(crate) fn new(seed: u32) -> Self {
        let words = seed_words(seed);
        let join = |k: usize| {
            // Words are little-endian halves of u64, the first u64 the upper half of u128.
            let u64_at = |k: usize| u128::from(words[2 * k]) | u128::from(words[2 * k + 1]) << 32;
            u64_at(k) << 64 | u64_at(k + 1)
        };
        let (initial, stream) = (join(0), join(2));
        let mut generator = Self { state: 0, increment: stream << 1 | 1, spare: None };
        generator.step();
        generator.state = generator.state.wrapping_add(initial);
        generator.step();
        generator
    }

    /// `size` distinct numbers below `n`, in random order.
    pub(crate) fn choice(&mut self, n: usize, size: usize) -> Vec<usize> {
        assert!(size <= n, "BUG: {size} distinct numbers below {n}");
        if n > 10_000 && size > n / 50 {
            let mut all: Vec<usize> = (0..n).collect();
            self.shuffle(&mut all, (n - size).max(1));
            return all.split_off(n - size);
        }
        let mut chosen = Vec::with_capacity(size);
        let mut seen = std::collections::BTreeSet::new();
        for j in n - size..n {
            let value = self.below_or_equal(j);
            let value = if seen.insert(value) { value } else { j };
            seen.insert(value);
            chosen.push(value);
        }
        self.shuffle(&mut chosen, 1);
        chosen
    }

    /// Exchanges each place from the last down to `first` with one at or before it.
    fn shuffle(&mut self, values: &mut [usize], first: usize) {
        for i in (first..values.len()).rev() {
            let j = self.below_or_equal(i);
            values.swap(i, j);
        }
    }

    /// A number in 0..=most, which is below 2^32 - 1 here.
    fn below_or_equal(&mut self, most: usize) -> usize {
        if most == 0 {
            return 0;
        }
        let range = u32::try_from(most).ok().and_then(|m| m.checked_add(1)).expect("BUG: a sample of 2^32 items");
        let threshold = range.wrapping_neg() % range;
        loop {
            let product = u64::from(self.next_u32()) * u64::from(range);
            if product as u32 >= threshold {
                return (product >> 32) as usize;
            }
        }
    }

    fn next_u32(&mut self) -> u32 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        self.step();
        let folded = (self.state >> 64) as u64 ^ self.state as u64;
        let number = folded.rotate_right((self.state >> 122) as u32);
        self.spare = Some((number >> 32) as u32);
        number as u32
    }

    fn step(&mut self) {
        self.state = self.state.wrapping_mul(MULTIPLIER).wrapping_add(self.increment);
    }
}

/// `SeedSequence(seed).generate_state(8)`.
fn seed_words(seed: u32) -> [u32; 8] {
    let mut constant = 0x43b0_d7e5_u32;
    let mut hash = |value: u32| {
        let mixed = value ^ constant;
        constant = constant.wrapping_mul(0x931e_8875);
        let mixed = mixed.wrapping_mul(constant);
        mixed ^ mixed >> 16
    };
    let mut pool = [hash(seed), hash(0), hash(0), hash(0)];
    for from in 0..4 {
        for to in (0..4).filter(|&to| to != from) {
            let hashed = hash(pool[from]).wrapping_mul(0x4973_f715);
            let mixed = pool[to].wrapping_mul(0xca01_f9dd).wrapping_sub(hashed);
            pool[to] = mixed ^ mixed >> 16;
        }
    }
    let mut constant = 0x8b51_f9dd_u32;
    std::array::from_fn(|k| {
        let value = pool[k % 4] ^ constant;
        constant = constant.wrapping_mul(0x58f3_8ded);
        let value = value.wrapping_mul(constant);
        value ^ value >> 16
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // numpy 2.4.6

    #[test]
    fn seeds_mix_as_in_numpy() {
        assert_eq!(
            seed_words(42),
            [3444837047, 2669555309, 2046530742, 3581440988, 1691623607, 2099784219, 1184028159, 862288241]
        );
    }

    #[test]
    fn choices_are_numpys() {
        let mut generator = Generator::new(42);
        for expected in [[5, 6, 10, 11, 4, 0], [8, 11, 7, 5, 10, 6], [9, 4, 1, 7, 8, 6]] {
            assert_eq!(generator.choice(12, 6), expected);
        }
        assert_eq!(Generator::new(42).choice(13824, 8), [1188, 9640, 11867, 9045, 5984, 6065, 1233, 10694]);
    }

    #[test]
    fn large_choices_shuffle_the_tail() {
        let chosen = Generator::new(7).choice(20000, 8000);
        assert_eq!(chosen[..4], [3887, 5149, 4369, 14667]);
        assert_eq!(chosen[7997..], [13682, 12501, 18898]);
    }
}
