//! The rate of a step (`spec/omnix.md` 11.3): a linear warm-up, then half a cosine.
//!
//! Of step k (from 0), W steps of warm-up and a length of N steps, the factor on every group's rate is
//!
//! ```text
//! k < W    (k + 1) / W
//! k >= W   last + (1 - last) (1 + cos(π p)) / 2,    p = min(1, (k - W) / (N - 1 - W))
//! ```
//!
//! so step W runs at the full rate, step N − 1 and all later ones at `last` times it. With `full_first_step`, step 0 runs at the full
//! rate too, as in the release. The length is that of the configuration and not where a run is told to stop: a run that stops early
//! and is continued takes the same steps as one that does not.

use serde::{Deserialize, Serialize};

/// How rates change with the steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Schedule {
    /// Steps of the linear warm-up.
    pub warm_up: u64,
    /// Steps until the rate is down to `last`; those of the configuration (`steps`) where this is not given.
    pub length: Option<u64>,
    /// The factor at the end.
    pub last: f64,
    /// Whether the very first step runs at the full rate, warm-up or not.
    pub full_first_step: bool,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { warm_up: 0, length: None, last: 0.1, full_first_step: false }
    }
}

impl Schedule {
    /// The factor on the rates of step `step`, counted from 0; `steps` is the length where the schedule has none of its own.
    #[must_use]
    pub fn factor(&self, step: u64, steps: u64) -> f64 {
        if step == 0 && self.full_first_step {
            return 1.0;
        }
        if step < self.warm_up {
            return (step + 1) as f64 / self.warm_up as f64;
        }
        let last_step = self.length.unwrap_or(steps).saturating_sub(1);
        let (done, of) = (step - self.warm_up, last_step.saturating_sub(self.warm_up));
        // At the end the factor is exactly `last`; a schedule that is no longer than its warm-up has no descent.
        match (of, done >= of) {
            (0, _) => {
                if step > last_step {
                    self.last
                } else {
                    1.0
                }
            }
            (_, true) => self.last,
            (_, false) => {
                let turn = std::f64::consts::PI * done as f64 / of as f64;
                self.last + (1.0 - self.last) * (1.0 + turn.cos()) / 2.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warm_up_then_cosine_to_the_last_factor() {
        let schedule = Schedule { warm_up: 4, ..Schedule::default() };
        let factors: Vec<f64> = (0..4).map(|k| schedule.factor(k, 15)).collect();
        assert_eq!(factors, [0.25, 0.5, 0.75, 1.0]);
        assert_eq!(schedule.factor(4, 15), 1.0);
        // Half way down after 5 of 10 steps.
        assert!((schedule.factor(9, 15) - 0.55).abs() < 1e-12);
        assert_eq!((schedule.factor(14, 15), schedule.factor(99, 15)), (0.1, 0.1));
        assert!((4..14).all(|k| schedule.factor(k + 1, 15) < schedule.factor(k, 15)));
    }

    #[test]
    fn the_very_first_step_at_the_full_rate() {
        let schedule = Schedule { warm_up: 10, full_first_step: true, ..Schedule::default() };
        assert_eq!((schedule.factor(0, 100), schedule.factor(1, 100)), (1.0, 0.2));
    }

    #[test]
    fn a_length_of_its_own_wins_and_short_ones_do_no_harm() {
        let schedule = Schedule { length: Some(11), ..Schedule::default() };
        assert_eq!(schedule.factor(10, 1000), 0.1);
        assert!((schedule.factor(5, 1000) - 0.55).abs() < 1e-12);
        let one = Schedule::default();
        assert_eq!((one.factor(0, 1), one.factor(1, 1), one.factor(0, 0)), (1.0, 0.1, 1.0));
        // Longer than the whole: only the warm-up is seen, and nothing is NaN.
        let long = Schedule { warm_up: 5, ..Schedule::default() };
        assert!((0..10).all(|k| long.factor(k, 3).is_finite()));
    }
}
