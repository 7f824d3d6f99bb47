//! A device that goes away in the middle of a run is an error, not a crash.

use omnix::kernels::KernelError;
use omnix::{Engine, Event, OmnixError, Phase, Request, RunPlan, Session, Weights};

/// A session of two images on a device of its own.
fn session() -> (Engine, Session) {
    let engine = Engine::open(std::env::var("OMNIX_DEVICE").ok().as_deref()).unwrap();
    let weights = Weights::builtin().unwrap();
    let plan = RunPlan::new(&weights, &Request::new(2, 56, 56), engine.caps()).unwrap();
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet()).unwrap();
    for image in 0..2 {
        session.set_image(image, &vec![0.5; 3 * 56 * 56]).unwrap();
    }
    (engine, session)
}

#[track_caller]
fn lost<T: std::fmt::Debug>(outcome: Result<T, OmnixError>) {
    let error = outcome.unwrap_err();
    assert!(matches!(error, OmnixError::Kernel(KernelError::DeviceLost { .. })), "{error:?}");
    assert!(error.to_string().contains("another device"), "names a cure: {error}");
}

#[test]
fn before_a_run() {
    let (engine, mut session) = session();
    engine.gpu().device.destroy();
    lost(session.run(&mut omnix::quiet()));
}

#[test]
fn during_a_run() {
    let (engine, mut session) = session();
    let mut finished = 0;
    let outcome = session.run(&mut |event| {
        if matches!(event, Event::Progress(p) if p.phase == Phase::Head) && finished == 0 {
            engine.gpu().device.destroy();
            finished += 1;
        }
        Ok(())
    });
    lost(outcome);
}
