//! What exports of motion refuse.

use omnix_io::{
    Export, IoError,
    output::{MotionOptions, MotionStream, motion::SourceMotion, write_motion},
};

use crate::made;

const ALL: [Export; 3] = [Export::Tracks, Export::Omx4d, Export::Glb];

#[test]
fn contradicting_points() {
    let dir = tempfile::tempdir().unwrap();
    let mut short = made::points(2, 5);
    short.motion.pop();
    let mut outside = made::points(2, 5);
    outside.pixel[3] = [8, 0];
    let mut unknown = made::points(2, 5);
    *unknown.source.last_mut().unwrap() = 2;
    let mut shuffled = made::points(2, 5);
    shuffled.source.reverse();
    for export in ALL {
        let refused = |points| write_motion(&[export], points, dir.path(), &MotionOptions::default()).unwrap_err();
        assert!(matches!(refused(&short), IoError::WrongSize { .. }));
        assert!(matches!(refused(&outside), IoError::BadPoint { point: 3, .. }));
        assert!(matches!(refused(&unknown), IoError::BadPoint { .. }));
        assert!(matches!(refused(&shuffled), IoError::BadPoint { .. }));
    }
    let options = MotionOptions::default().fps(0.0);
    for export in [Export::Omx4d, Export::Glb] {
        assert!(matches!(
            write_motion(&[export], &made::points(2, 5), dir.path(), &options),
            Err(IoError::BadChoice { .. })
        ));
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "a refused export leaves nothing");
}

#[test]
fn nothing_finite() {
    let dir = tempfile::tempdir().unwrap();
    let mut points = made::points(2, 5);
    points.positions.fill(f32::NAN);
    let error = write_motion(&[Export::Omx4d], &points, dir.path(), &MotionOptions::default()).unwrap_err();
    assert!(matches!(error, IoError::NoPoints { .. }), "{error}");
    // The others have forms without points.
    write_motion(&[Export::Tracks, Export::Glb], &points, dir.path(), &MotionOptions::default()).unwrap();
}

#[test]
fn streams_need_whole_images_and_paths() {
    let dir = tempfile::tempdir().unwrap();
    let (points, ones) = (vec![0.0; 3 * made::PIXELS], vec![1.0; made::PIXELS]);
    let image = SourceMotion {
        index: 0,
        pixels: None,
        points: &points,
        trajectory: None,
        confidence: &ones,
        motion: &ones,
        moving: &[false; made::PIXELS],
    };
    let open = |export| MotionStream::open(&[export], made::views(2), dir.path()).unwrap();
    for export in [Export::Tracks, Export::St4rtrack] {
        assert!(matches!(open(export).image(&image), Err(IoError::MissingField { .. })));
    }
    open(Export::Masks).image(&image).unwrap();
    let one = SourceMotion {
        pixels: Some(&[[1, 1]]),
        points: &points[..3],
        confidence: &ones[..1],
        motion: &ones[..1],
        moving: &[true],
        ..image
    };
    assert!(matches!(open(Export::Masks).image(&one), Err(IoError::WrongSize { .. })));
    assert!(matches!(open(Export::Masks).image(&SourceMotion { index: 2, ..image }), Err(IoError::WrongSize { .. })));
    assert!(open(Export::Npz).is_empty());
}
