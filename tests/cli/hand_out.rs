//! When results reach the caller: in order, while the device has the next images to compute, and all that was computed.

use omnix::{Engine, Event, OmnixError, Phase, Request, RunPlan, Session, Weights};

const IMAGES: usize = 5;

/// What the caller saw, in order.
#[derive(Clone, Debug, PartialEq)]
enum Seen {
    /// The device was given a chunk of images.
    Submitted,
    /// An image came.
    Image(usize),
}

use Seen::{Image, Submitted};

/// Runs five images, three a chunk; breaks off when the `stop`th chunk was submitted, fails at image `fail`.
fn run(stop: usize, fail: usize) -> (Vec<Seen>, Result<(), OmnixError>) {
    let engine = Engine::open(std::env::var("OMNIX_DEVICE").ok().as_deref()).unwrap();
    let weights = Weights::builtin().unwrap();
    let request = Request::new(IMAGES, 56, 56).head_images(3);
    let plan = RunPlan::new(&weights, &request, engine.caps()).unwrap();
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet()).unwrap();
    for image in 0..IMAGES {
        session.set_image(image, &vec![0.1 * image as f32; 3 * 56 * 56]).unwrap();
    }
    let mut seen = Vec::new();
    let outcome = session.run(&mut |event| {
        match event {
            Event::Progress(p) if p.phase == Phase::Head => {
                seen.push(Submitted);
                if seen.iter().filter(|e| **e == Submitted).count() == stop {
                    return Err(OmnixError::Interrupted);
                }
            }
            Event::Frame(frame) if frame.index == fail => {
                return Err(OmnixError::Request { reason: "the caller's own".to_owned() });
            }
            Event::Frame(frame) => {
                assert!(frame.depth.iter().all(|d| d.is_finite() && *d > 0.0));
                seen.push(Image(frame.index));
            }
            _ => {}
        }
        Ok(())
    });
    (seen, outcome)
}

#[test]
fn images_come_in_order_while_the_next_are_computed() {
    let (events, outcome) = run(usize::MAX, usize::MAX);
    outcome.unwrap();
    assert_eq!(events, [Submitted, Image(0), Submitted, Image(1), Image(2), Image(3), Image(4)]);
}

#[test]
fn what_was_computed_comes_before_the_interruption() {
    let (events, outcome) = run(2, usize::MAX);
    assert!(matches!(outcome, Err(OmnixError::Interrupted)));
    assert_eq!(events, [Submitted, Image(0), Submitted, Image(1), Image(2)]);
}

#[test]
fn the_callers_error_ends_the_run() {
    for fail in [0, 1, 4] {
        let (events, outcome) = run(usize::MAX, fail);
        let error = outcome.unwrap_err().to_string();
        assert!(error.contains("the caller's own"), "{error}");
        assert_eq!(events.iter().filter(|e| matches!(e, Image(_))).count(), fail);
    }
}
