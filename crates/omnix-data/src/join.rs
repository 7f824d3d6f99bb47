//! Several samples as one: images of scenes that have nothing to do with each other, in one step of training.

use crate::{DataError, Motion, Sample, SampleParts, Unit};

/// The images of all samples one after the other, videos counted on. Each keeps its own frame and its own unit, so that cameras and depth of
/// different samples cannot be compared; what moves is left out, since an image would need a place at the times of the others. Depth is
/// unknown in samples without, unless none has any.
///
/// # Errors
/// No sample, or samples of different sizes.
pub fn join(samples: Vec<Sample>) -> Result<Sample, DataError> {
    let mut all = SampleParts {
        size: samples.first().map_or([0, 0], Sample::size),
        images: Vec::new(),
        times: Vec::new(),
        cameras: Vec::new(),
        depth: samples.iter().any(|sample| sample.depth(0).is_some()).then(Vec::new),
        moving: None,
        motion: Motion::Unknown,
        unit: samples.first().map_or(Unit::Scene, Sample::unit),
    };
    for sample in samples {
        let (pixels, count) = (sample.pixels(), sample.count());
        let parts = sample.into_parts();
        if parts.size != all.size {
            let [expected, found] = [all.size, parts.size].map(|[width, height]| width as usize * height as usize);
            return Err(DataError::Length { what: "joined samples", layout: "[H][W]", expected, found });
        }
        let videos = all.times.iter().map(|time| time.video + 1).max().unwrap_or(0);
        let moments = all.times.iter().map(|time| time.moment + 1).max().unwrap_or(0);
        all.times.extend(parts.times.into_iter().map(|mut time| {
            time.video += videos;
            time.moment += moments;
            time
        }));
        all.images.extend(parts.images);
        all.cameras.extend(parts.cameras);
        if let Some(depth) = &mut all.depth {
            depth.extend(parts.depth.unwrap_or_else(|| vec![f32::NAN; count * pixels]));
        }
        if parts.unit != all.unit {
            all.unit = Unit::Scene;
        }
    }
    Sample::new(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::video;

    #[test]
    fn images_cameras_and_depth_follow_each_other() {
        let (a, b) = (video([14, 14], 2), video([14, 14], 3));
        let joined = join(vec![a.clone(), b.clone()]).unwrap();
        assert_eq!((joined.count(), joined.size()), (5, [14, 14]));
        assert_eq!((joined.image(1), joined.image(2)), (a.image(1), b.image(0)));
        assert_eq!(joined.cameras()[4], b.cameras()[2]);
        assert_eq!(format!("{:?}", joined.depth(3)), format!("{:?}", b.depth(1)));
        let last = |sample: &Sample| sample.times().iter().map(|time| time.video).max().unwrap();
        assert!(joined.times()[..2].iter().all(|first| joined.times()[2..].iter().all(|t| t.video > first.video)));
        assert_eq!(last(&joined), last(&a) + last(&b) + 1);
        assert!(matches!(joined.motion(), Motion::Unknown));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(join(vec![video([14, 14], 1), video([28, 14], 1)]).is_err());
        assert!(join(Vec::new()).is_err());
    }
}
