//! Which frames of a video are used.

use crate::IoError;

/// A choice of frames, applied to each video by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum FrameChoice {
    /// Every frame.
    All,
    /// This many frames, evenly spread, the first and the last among them; all of them if there are fewer.
    Count(usize),
    /// At most this many frames a second, by presentation time: the first frame at or after each tick. (The reference takes every
    /// k-th frame, `k = max(1, floor(video_fps / fps))`, which can be nearly twice as many.)
    Fps(f64),
}

impl FrameChoice {
    /// # Errors
    /// A count of zero, or a rate that is not positive and finite.
    pub fn check(self) -> Result<(), IoError> {
        let reason = match self {
            Self::Count(0) => "a choice of 0 frames".to_owned(),
            Self::Fps(rate) if !(rate.is_finite() && rate > 0.0) => {
                format!("a frame rate of {rate}")
            }
            _ => return Ok(()),
        };
        Err(IoError::BadChoice { reason })
    }

    /// Numbers of the chosen frames among `count`, ascending. `times_s` are presentation times in seconds, ascending; without
    /// them a rate keeps everything.
    #[must_use]
    pub fn pick(self, count: usize, times_s: Option<&[f64]>) -> Vec<usize> {
        match (self, times_s) {
            (Self::Count(n), _) if n < count => spread(n, count),
            (Self::Fps(rate), Some(times)) => by_rate(rate, times),
            _ => (0..count).collect(),
        }
    }
}

/// `n < count` numbers from 0 to `count - 1`, both ends included, by exact integer rounding (halves up).
fn spread(n: usize, count: usize) -> Vec<usize> {
    if n <= 1 {
        return vec![0; n];
    }
    let (last, steps) = (count as u128 - 1, n as u128 - 1);
    (0..n as u128).map(|i| ((2 * i * last + steps) / (2 * steps)) as usize).collect()
}

/// The first frame at or after each tick `t0 + j/rate`. Containers round times (Matroska to 1 ms), so a frame may be early by
/// 5 % of a period.
fn by_rate(rate: f64, times: &[f64]) -> Vec<usize> {
    const EARLY: f64 = 0.05;
    let start = times.first().copied().unwrap_or(0.0);
    let mut next_tick = 0.0;
    let mut picked = Vec::new();
    for (i, &t) in times.iter().enumerate() {
        let ticks = (t - start) * rate + EARLY;
        if ticks >= next_tick {
            picked.push(i);
            next_tick = ticks.floor() + 1.0;
        }
    }
    picked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn count_is_even_and_has_both_ends() {
        assert_eq!(FrameChoice::Count(4).pick(10, None), [0, 3, 6, 9]);
        assert_eq!(FrameChoice::Count(3).pick(10, None), [0, 5, 9]);
        assert_eq!(FrameChoice::Count(1).pick(10, None), [0]);
        assert_eq!(FrameChoice::Count(20).pick(3, None), [0, 1, 2]);
        for count in 2..60 {
            for n in 2..=count {
                let picked = FrameChoice::Count(n).pick(count, None);
                assert_eq!((picked[0], picked[n - 1], picked.len()), (0, count - 1, n));
                assert!(picked.windows(2).all(|w| w[0] < w[1]), "{n} of {count}: {picked:?}");
            }
        }
    }

    #[test]
    fn rate_follows_presentation_times() {
        let ms = |n: usize| (0..n).map(|i| (i as f64 / 30.0 * 1000.0).round() / 1000.0).collect::<Vec<_>>();
        assert_eq!(FrameChoice::Fps(30.0).pick(90, Some(&ms(90))).len(), 90);
        assert_eq!(FrameChoice::Fps(10.0).pick(90, Some(&ms(90))), (0..30).map(|i| 3 * i).collect::<Vec<_>>());
        assert_eq!(FrameChoice::Fps(100.0).pick(90, Some(&ms(90))).len(), 90);
        // A gap in the times skips ticks instead of catching up.
        assert_eq!(FrameChoice::Fps(1.0).pick(5, Some(&[5.0, 5.5, 9.2, 9.3, 10.0])), [0, 2, 4]);
    }

    #[test]
    fn empty_choices_are_refused() {
        for bad in [FrameChoice::Count(0), FrameChoice::Fps(0.0), FrameChoice::Fps(f64::NAN)] {
            assert!(matches!(bad.check(), Err(IoError::BadChoice { .. })), "{bad:?}");
        }
    }
}
