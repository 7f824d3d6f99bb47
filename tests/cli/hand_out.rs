//! When results reach the caller: in order, while the device has the next images to compute, and all that was computed.

use std::cell::RefCell;
use std::ops::ControlFlow;

use omnix::{Engine, OmnixError, Phase, Request, RunPlan, Session, Weights};

const IMAGES: usize = 5;

/// What the caller saw, in order.
#[derive(Clone, Debug, PartialEq)]
enum Event {
    /// The device was given a chunk of images.
    Submitted,
    /// An image came.
    Image(usize),
}

use Event::{Image, Submitted};

/// Runs five images, three a chunk; breaks off when the `stop`th chunk was submitted, fails at image `fail`.
fn run(stop: usize, fail: usize) -> (Vec<Event>, Result<(), OmnixError>) {
    let engine = Engine::open(std::env::var("OMNIX_DEVICE").ok().as_deref()).unwrap();
    let weights = Weights::builtin().unwrap();
    let request = Request { head_images: Some(3), ..Request::new(IMAGES, 56, 56) };
    let plan = RunPlan::new(&weights, &request, engine.caps()).unwrap();
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet()).unwrap();
    for image in 0..IMAGES {
        session.set_image(image, &vec![0.1 * image as f32; 3 * 56 * 56]).unwrap();
    }
    let events = RefCell::new(Vec::new());
    let outcome = session.run(
        &mut |p| {
            if p.phase != Phase::Head {
                return ControlFlow::Continue(());
            }
            events.borrow_mut().push(Submitted);
            let chunks = events.borrow().iter().filter(|e| **e == Submitted).count();
            if chunks == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
        &mut |frame| {
            if frame.index == fail {
                return Err(OmnixError::Request { reason: "the caller's own".to_owned() });
            }
            assert!(frame.depth.iter().all(|d| d.is_finite() && *d > 0.0));
            events.borrow_mut().push(Image(frame.index));
            Ok(())
        },
    );
    (events.into_inner(), outcome.map(|_| ()))
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
