//! How a sequence is cut into clips (`eval.md` section 7).

use serde::Serialize;

use crate::EvalError;

/// The frames of a clip in the paper.
pub const CLIP_FRAMES: usize = 16;

/// Which frames are evaluated together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "rule", content = "frames")]
pub enum ClipRule {
    /// All frames of a sequence.
    Whole,
    /// Frames 0 to n-1, n to 2n-1 and so on; an incomplete rest is left out and counted.
    Contiguous(usize),
    /// One clip of n frames, evenly spread from the first to the last.
    Uniform(usize),
}

/// The clips of a sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clips {
    /// Places of the frames of each clip.
    pub clips: Vec<Vec<usize>>,
    /// Frames at the end that fill no clip.
    pub left_out: usize,
}

impl ClipRule {
    /// The clips of a sequence of `frames` frames. A sequence shorter than a clip has none.
    ///
    /// # Errors
    /// [`EvalError::Parameter`] for a clip of fewer than 2 frames.
    pub fn cut(self, frames: usize) -> Result<Clips, EvalError> {
        if let Self::Contiguous(n) | Self::Uniform(n) = self
            && n < 2
        {
            let value = n.to_string();
            return Err(EvalError::Parameter { name: "frames of a clip", value, expected: "give 2 or more" });
        }
        Ok(match self {
            Self::Whole => Clips { clips: vec![(0..frames).collect()], left_out: 0 },
            Self::Contiguous(n) => {
                let clips = (0..frames / n).map(|k| (k * n..(k + 1) * n).collect()).collect();
                Clips { clips, left_out: frames % n }
            }
            Self::Uniform(n) if frames < n => Clips { clips: Vec::new(), left_out: frames },
            Self::Uniform(n) => {
                // Rounded half up: the first and the last frame are always there.
                let places = (0..n).map(|k| (2 * k * (frames - 1) + (n - 1)) / (2 * (n - 1)));
                Clips { clips: vec![places.collect()], left_out: 0 }
            }
        })
    }

    /// The rule in words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Whole => "whole sequences".into(),
            Self::Contiguous(n) => format!("contiguous clips of {n} frames"),
            Self::Uniform(n) => format!("{n} evenly spaced frames"),
        }
    }

    /// Reads `whole`, `contiguous:16` or `uniform:16`.
    ///
    /// # Errors
    /// [`EvalError::Parameter`] for anything else.
    pub fn parse(text: &str) -> Result<Self, EvalError> {
        let wrong = || EvalError::Parameter {
            name: "the rule of clips",
            value: text.into(),
            expected: "give whole, contiguous:N or uniform:N",
        };
        let (rule, frames) = text.split_once(':').map_or((text, None), |(rule, n)| (rule, n.parse().ok()));
        let rule = match (rule, frames) {
            ("whole", None) if !text.contains(':') => Self::Whole,
            ("contiguous", Some(n)) => Self::Contiguous(n),
            ("uniform", Some(n)) => Self::Uniform(n),
            _ => return Err(wrong()),
        };
        rule.cut(0).map(|_| rule)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_cut_as_they_say() {
        let clips = ClipRule::Contiguous(4).cut(10).unwrap();
        assert_eq!(clips, Clips { clips: vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]], left_out: 2 });
        assert_eq!(ClipRule::Uniform(4).cut(10).unwrap().clips, [[0, 3, 6, 9]]);
        assert_eq!(ClipRule::Uniform(16).cut(16).unwrap().clips, [(0..16).collect::<Vec<_>>()]);
        assert_eq!(ClipRule::Uniform(4).cut(3).unwrap(), Clips { clips: vec![], left_out: 3 });
        assert_eq!(ClipRule::Whole.cut(2).unwrap().clips, [[0, 1]]);
    }

    #[test]
    fn names_are_read_and_nonsense_is_refused() {
        assert_eq!(ClipRule::parse("contiguous:16").unwrap(), ClipRule::Contiguous(16));
        assert_eq!(ClipRule::parse("uniform:8").unwrap(), ClipRule::Uniform(8));
        assert_eq!(ClipRule::parse("whole").unwrap(), ClipRule::Whole);
        for bad in ["", "whole:3", "contiguous", "contiguous:0", "uniform:1", "uniform:x", "contiguous:-4"] {
            assert!(ClipRule::parse(bad).is_err(), "{bad}");
        }
    }
}
