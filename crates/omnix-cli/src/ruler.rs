//! `--scale`: a distance that the user measured, as text and among the frames.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use omnix::KnownDistance;
use omnix::io::{InputPlan, PlannedFrame};

use crate::error::CliError;

/// Two pixels of a picture and the metres between what they show.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ruler {
    picture: Option<String>,
    ends: [[f64; 2]; 2],
    metres: f64,
}

impl FromStr for Ruler {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (place, metres) = text.rsplit_once('=')?;
            let (picture, pixels) = match place.rsplit_once(':') {
                Some((picture, pixels)) => (Some(picture.to_owned()), pixels),
                None => (None, place),
            };
            let numbers: Vec<f64> = pixels.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
            let [a, b, c, d] = <[f64; 4]>::try_from(numbers).ok()?;
            let metres: f64 = metres.trim().parse().ok()?;
            let sound = [a, b, c, d].iter().all(|n| n.is_finite()) && metres.is_finite() && metres > 0.0;
            sound.then_some(Self { picture, ends: [[a, b], [c, d]], metres })
        };
        read().ok_or_else(|| {
            "a picture, two of its pixels and the metres between them, such as 007.jpg:120,300,480,310=1.85".to_owned()
        })
    }
}

impl fmt::Display for Ruler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [[a, b], [c, d]] = self.ends;
        let picture = self.picture.as_ref().map(|name| format!("{name}:")).unwrap_or_default();
        write!(f, "{picture}{a},{b},{c},{d}={}", self.metres)
    }
}

impl Ruler {
    /// The same in what the network sees; `seen` says where a place of a frame's picture is there, if it is.
    ///
    /// # Errors
    /// A picture that is not there or is not one, and pixels that are outside or cut off.
    pub(crate) fn place(
        &self,
        input: &InputPlan,
        seen: impl Fn(&PlannedFrame, [f64; 2]) -> Option<[f32; 2]>,
    ) -> Result<KnownDistance, CliError> {
        let wrong = |what: String| CliError::Usage(format!("--scale {self}: {what}"));
        let image = match &self.picture {
            None => 0,
            Some(wanted) => {
                let names = input.picture_names();
                let fits = |at: &usize| {
                    names[*at] == *wanted || (names[*at].ends_with(wanted) && Path::new(&names[*at]).ends_with(wanted))
                };
                let found: Vec<usize> = (0..names.len()).filter(fits).collect();
                match found[..] {
                    [one] => one,
                    [] => {
                        let first = names.first().map(String::as_str).unwrap_or_default();
                        return Err(wrong(format!("no picture has this name; the first is called {first}")));
                    }
                    _ => {
                        return Err(wrong(format!("{} pictures have this name: put its folder in front", found.len())));
                    }
                }
            }
        };
        let frame = &input.frames[image];
        let place = |end: [f64; 2]| {
            seen(frame, end).ok_or_else(|| {
                let (width, height) = (frame.width, frame.height);
                wrong(format!(
                    "{},{} is outside the picture of {width}x{height}, or cut off for the network",
                    end[0], end[1]
                ))
            })
        };
        Ok(KnownDistance { image, places: [place(self.ends[0])?, place(self.ends[1])?], metres: self.metres })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_read_and_written_again() {
        for text in ["1,2,3,4=0.5", "a b.jpg:1,2,3,4=2", "0/x.png:1.5,2,3,4=1.85"] {
            assert_eq!(text.parse::<Ruler>().unwrap().to_string(), text);
        }
        for bad in ["1,2,3=1", "1,2,3,4", "1,2,3,4=0", "1,2,3,4=-1", "1,2,3,4=nan", "x:y=1", "1,2,3,inf=1"] {
            assert!(bad.parse::<Ruler>().is_err(), "{bad}");
        }
    }
}
