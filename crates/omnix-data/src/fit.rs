//! Images to the network's size (`spec/omnix.md` 11.3 and section 2): cropped about the principal point, resized, cropped.
//!
//! 1. The largest rectangle of whole pixels about the principal point, rounded to a pixel edge.
//! 2. OmniX's resize and centre crop (`omnix-io`): the picture with Pillow's filters, depth and masks by the nearest pixel.
//!
//! Intrinsics follow: a pixel edge at x comes to `(x - left) s - crop`.

use omnix_io::preprocess::Framing;
use omnix_io::preprocess::OmnixPreprocess;

use crate::DataError;
use crate::scene::View;

/// The view at this size, `[width, height]`.
///
/// # Errors
/// A size that is not of multiples of 14, a picture that is too narrow for it, a principal point outside of the picture.
pub(crate) fn fit(view: View, [width, height]: [u32; 2]) -> Result<View, DataError> {
    let [across, down] = view.size();
    let View { image, mut camera, depth, moving, moment, seconds } = view;
    let (left, wide) = about(camera.principal[0], across)?;
    let (top, high) = about(camera.principal[1], down)?;
    let image = image.crop(left as u32, top as u32, wide as u32, high as u32);
    camera.principal = [camera.principal[0] - left as f64, camera.principal[1] - top as f64];

    let preprocess = OmnixPreprocess { width, height };
    let Framing { resized, crop } = preprocess.framing(wide as u32, high as u32)?;
    let image = preprocess.apply(&image)?;
    camera.resize([f64::from(resized.0) / wide as f64, f64::from(resized.1) / high as f64]);
    camera.principal = [camera.principal[0] - f64::from(crop[0]), camera.principal[1] - f64::from(crop[1])];

    // The pixel of the source that the centre of each pixel falls on.
    let nearest = |from: usize, start: usize, to: u32, skip: u32, count: u32| -> Vec<usize> {
        let source = |k: u32| (((f64::from(skip + k) + 0.5) * from as f64 / f64::from(to)) as usize).min(from - 1);
        (0..count).map(|k| start + source(k)).collect()
    };
    let columns = nearest(wide, left, resized.0, crop[0], width);
    let rows = nearest(high, top, resized.1, crop[1], height);
    let index: Vec<usize> =
        rows.iter().flat_map(|row| columns.iter().map(move |column| row * across + column)).collect();
    let depth = depth.map(|depth| index.iter().map(|at| depth[*at]).collect());
    let moving = moving.map(|moving| index.iter().map(|at| moving[*at]).collect());
    Ok(View { image, camera, depth, moving, moment, seconds })
}

/// Start and length of the largest range of `0..size` about a principal point.
fn about(principal: f64, size: usize) -> Result<(usize, usize), DataError> {
    let centre = principal.round();
    if !(centre >= 1.0 && centre <= size as f64 - 1.0) {
        // A picture of one pixel has no edge inside.
        return if size == 1 { Ok((0, 1)) } else { Err(DataError::PrincipalPoint { principal, size }) };
    }
    let half = (centre as usize).min(size - centre as usize);
    Ok((centre as usize - half, 2 * half))
}

#[cfg(test)]
mod tests {
    use omnix_io::Picture;

    use super::*;
    use crate::Flag;
    use crate::made;

    fn view(size: [u32; 2], principal: [f64; 2]) -> View {
        let mut camera = made::camera(size, [0.0; 3], [0.0; 2]);
        camera.principal = principal;
        let pixels = (size[0] * size[1]) as usize;
        View {
            image: Picture::new(size[0], size[1], (0..pixels * 3).map(|k| (k / 3 % size[0] as usize) as u8).collect()),
            camera,
            depth: Some((0..pixels).map(|k| 1.0 + (k % size[0] as usize) as f32).collect()),
            moving: Some(vec![Flag::No; pixels]),
            moment: 0,
            seconds: None,
        }
    }

    #[test]
    fn the_principal_point_comes_to_the_centre_and_rays_stay() {
        let before = view([100, 70], [45.2, 36.4]);
        let focal = before.camera.focal;
        let after = fit(before.clone(), [42, 28]).unwrap();
        // 90 x 68 about (45, 36), covered by 42 x 28: 42 x 31 pixels, of which 2 rows are cut off above and 1 below.
        assert_eq!(after.size(), [42, 28]);
        assert!((after.camera.principal[0] - 45.2 * 42.0 / 90.0).abs() < 1e-9, "{:?}", after.camera);
        assert!((after.camera.principal[1] - (34.4 * 31.0 / 68.0 - 2.0)).abs() < 1e-9, "{:?}", after.camera);
        assert!((after.camera.focal[0] - focal[0] * 42.0 / 90.0).abs() < 1e-9);
        // The pixel whose centre falls on a column of the source has that column's depth and shows its colour.
        for column in [0usize, 20, 41] {
            let x = (column as f64 + 0.5 - after.camera.principal[0]) / after.camera.focal[0];
            let source = (x * focal[0] + 45.2).floor();
            assert_eq!(f64::from(after.depth.as_ref().unwrap()[column]), source + 1.0);
            let colour = f64::from(after.image.data[column * 3]);
            assert!((colour - source).abs() <= 1.0, "{colour} {source}");
        }
        assert_eq!(after.moving.unwrap().len(), 42 * 28);
    }

    #[test]
    fn odd_sizes_and_places_are_errors() {
        assert!(matches!(fit(view([100, 70], [50.0, 35.0]), [40, 28]), Err(DataError::Picture(_))));
        let error = fit(view([100, 70], [-3.0, 35.0]), [42, 28]).unwrap_err();
        assert!(matches!(error, DataError::PrincipalPoint { .. }), "{error}");
        assert!(matches!(fit(view([100, 70], [f64::NAN, 35.0]), [42, 28]), Err(DataError::PrincipalPoint { .. })));
    }
}
