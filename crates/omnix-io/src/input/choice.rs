//! Which frames of a video are used.

use crate::IoError;

/// A choice of frames, applied to each video by itself: first the part from a start to an end, then every k-th frame or a number of
/// frames per second, then at most a number of them. The default is every frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameChoice {
    start_s: Option<f64>,
    end_s: Option<f64>,
    every: Option<usize>,
    fps: Option<f64>,
    count: Option<usize>,
}

impl FrameChoice {
    /// Every frame.
    #[must_use]
    pub fn all() -> Self {
        Self::default()
    }

    /// Every frame, but at most `n`, as [`Self::at_most`].
    #[must_use]
    pub fn count(n: usize) -> Self {
        Self::all().at_most(n)
    }

    /// At most this many frames a second, as [`Self::at_rate`].
    #[must_use]
    pub fn fps(rate: f64) -> Self {
        Self::all().at_rate(rate)
    }

    /// Only frames from `start_s` to `end_s` seconds after the first one of their video, both included.
    #[must_use]
    pub fn between(self, start_s: Option<f64>, end_s: Option<f64>) -> Self {
        Self { start_s, end_s, ..self }
    }

    /// Every `k`-th frame, the first among them.
    #[must_use]
    pub fn every(self, k: usize) -> Self {
        Self { every: Some(k), ..self }
    }

    /// At most this many frames a second, by presentation time: the first frame at or after each tick. (The reference takes
    /// every k-th frame, `k = max(1, floor(video_fps / fps))`, which can be nearly twice as many.)
    #[must_use]
    pub fn at_rate(self, fps: f64) -> Self {
        Self { fps: Some(fps), ..self }
    }

    /// At most `n` of the frames that are left, evenly spread, the first and the last among them.
    #[must_use]
    pub fn at_most(self, n: usize) -> Self {
        Self { count: Some(n), ..self }
    }

    /// Seconds after a video's first frame beyond which none is used.
    pub(super) fn end_s(self) -> Option<f64> {
        self.end_s
    }

    /// The number that [`Self::at_most`] asked for.
    pub(super) fn wanted(self) -> Option<usize> {
        self.count
    }

    /// Whether it asks for times, which pictures do not have.
    pub(super) fn needs_times(self) -> bool {
        self.start_s.is_some() || self.end_s.is_some() || self.fps.is_some()
    }

    /// # Errors
    /// A choice that chooses nothing: a count or step of zero, a rate that is not positive and finite, an end before the start.
    pub fn check(self) -> Result<(), IoError> {
        let start = self.start_s.unwrap_or(0.0);
        let reason = match self {
            Self { count: Some(0), .. } => "a choice of 0 frames".to_owned(),
            Self { every: Some(0), .. } => "every 0th frame".to_owned(),
            Self { fps: Some(rate), .. } if !(rate.is_finite() && rate > 0.0) => format!("a frame rate of {rate}"),
            _ if !(start.is_finite() && start >= 0.0) => format!("a start at {start} seconds"),
            Self { end_s: Some(end), .. } if !(end.is_finite() && end >= start) => {
                format!("an end at {end} seconds, with the start at {start}")
            }
            _ => return Ok(()),
        };
        Err(IoError::BadChoice { reason })
    }

    /// Numbers of the chosen frames among `count`, ascending. `times_s` are presentation times in seconds, ascending; without
    /// them what asks for times is left aside.
    #[must_use]
    pub fn pick(self, count: usize, times_s: Option<&[f64]>) -> Vec<usize> {
        let mut picked: Vec<usize> = match times_s {
            Some(times) => (0..count).filter(|&i| self.spans(times[i] - times[0])).collect(),
            None => (0..count).collect(),
        };
        if let Some(k) = self.every {
            picked = picked.into_iter().step_by(k.max(1)).collect();
        }
        if let (Some(rate), Some(times)) = (self.fps, times_s) {
            picked = by_rate(rate, &picked, times);
        }
        match self.count {
            Some(n) if n < picked.len() => spread(n, picked.len()).into_iter().map(|i| picked[i]).collect(),
            _ => picked,
        }
    }

    /// Whether a frame `seconds` after the first is within the start and the end. Containers round times (Matroska to
    /// 1 ms).
    fn spans(self, seconds: f64) -> bool {
        const ROUNDING: f64 = 1e-3;
        self.start_s.is_none_or(|start| seconds >= start - ROUNDING)
            && self.end_s.is_none_or(|end| seconds <= end + ROUNDING)
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

/// Of `frames` the first at or after each tick `t0 + j/rate`. Containers round times, so a frame may be early by 5 % of a period.
fn by_rate(rate: f64, frames: &[usize], times: &[f64]) -> Vec<usize> {
    const EARLY: f64 = 0.05;
    let start = frames.first().map_or(0.0, |&i| times[i]);
    let mut next_tick = 0.0;
    let mut picked = Vec::new();
    for &i in frames {
        let ticks = (times[i] - start) * rate + EARLY;
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
        assert_eq!(FrameChoice::count(4).pick(10, None), [0, 3, 6, 9]);
        assert_eq!(FrameChoice::count(3).pick(10, None), [0, 5, 9]);
        assert_eq!(FrameChoice::count(1).pick(10, None), [0]);
        assert_eq!(FrameChoice::count(20).pick(3, None), [0, 1, 2]);
        for count in 2..60 {
            for n in 2..=count {
                let picked = FrameChoice::count(n).pick(count, None);
                assert_eq!((picked[0], picked[n - 1], picked.len()), (0, count - 1, n));
                assert!(picked.windows(2).all(|w| w[0] < w[1]), "{n} of {count}: {picked:?}");
            }
        }
    }

    #[test]
    fn rate_follows_presentation_times() {
        let ms = |n: usize| (0..n).map(|i| (i as f64 / 30.0 * 1000.0).round() / 1000.0).collect::<Vec<_>>();
        assert_eq!(FrameChoice::fps(30.0).pick(90, Some(&ms(90))).len(), 90);
        assert_eq!(FrameChoice::fps(10.0).pick(90, Some(&ms(90))), (0..30).map(|i| 3 * i).collect::<Vec<_>>());
        assert_eq!(FrameChoice::fps(100.0).pick(90, Some(&ms(90))).len(), 90);
        // A gap in the times skips ticks instead of catching up.
        assert_eq!(FrameChoice::fps(1.0).pick(5, Some(&[5.0, 5.5, 9.2, 9.3, 10.0])), [0, 2, 4]);
    }

    #[test]
    fn parts_steps_rates_and_counts_go_together() {
        // Ten frames a second, the first at 2 s.
        let times: Vec<f64> = (0..30).map(|i| 2.0 + f64::from(i) / 10.0).collect();
        let part = FrameChoice::all().between(Some(0.5), Some(1.0));
        assert_eq!(part.pick(30, Some(&times)), [5, 6, 7, 8, 9, 10], "counted from the first frame, both ends");
        assert_eq!(part.every(2).pick(30, Some(&times)), [5, 7, 9]);
        assert_eq!(part.every(2).at_most(2).pick(30, Some(&times)), [5, 9]);
        assert_eq!(FrameChoice::fps(5.0).at_most(3).pick(30, Some(&times)), [0, 14, 28]);
        assert_eq!(part.at_rate(5.0).pick(30, Some(&times)), [5, 7, 9], "ticks begin at the part's first frame");
        assert_eq!(FrameChoice::all().between(Some(9.0), None).pick(30, Some(&times)), [0usize; 0]);
        assert_eq!(part.every(4).pick(6, None), [0, 4], "pictures have no times");
    }

    #[test]
    fn empty_choices_are_refused() {
        let all = FrameChoice::all();
        for bad in [
            FrameChoice::count(0),
            FrameChoice::fps(0.0),
            FrameChoice::fps(f64::NAN),
            all.every(0),
            all.between(Some(-1.0), None),
            all.between(Some(f64::NAN), None),
            all.between(Some(2.0), Some(1.0)),
            all.between(None, Some(f64::INFINITY)),
        ] {
            assert!(matches!(bad.check(), Err(IoError::BadChoice { .. })), "{bad:?}");
        }
        assert!(all.between(Some(1.0), Some(1.0)).check().is_ok());
    }
}
