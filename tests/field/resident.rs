//! What stays on the device for a host's own passes has the bits of what is read back, whichever way its weights came, and lives as
//! long as the host holds it.

use omnix::{Engine, Event, Field, Pixels, Query, Weights};
use omnix_kernels::{BufferSlice, readback};

use crate::made::{HEIGHT, WIDTH, bits, engine, made, request, session};

const IMAGES: usize = 3;

/// A lent device, and one of the engine's own, whose memory is not all wgpu's.
fn engines() -> [Engine; 2] {
    [engine(), Engine::open(std::env::var("OMNIX_DEVICE").ok().as_deref()).unwrap()]
}

fn read(engine: &Engine, slice: &BufferSlice) -> Vec<u32> {
    readback::read(engine.gpu(), slice).unwrap()
}

fn query(image: usize) -> Query {
    Query::new(image, Pixels::Stride(3), 0..IMAGES)
}

/// The paths of a field, read back by the engine.
fn paths(field: &Field) -> Vec<Vec<u32>> {
    let of = |i| field.paths(&query(i)).unwrap();
    (0..IMAGES).map(of).flat_map(|paths| [bits(&paths.positions), bits(&paths.theta)]).collect()
}

#[test]
fn a_run_that_reads_nothing_back_finds_the_same() {
    let weights = Weights::builtin().unwrap();
    let all_at_once = request(IMAGES).head_images(IMAGES).sampling_images(IMAGES);
    for engine in engines() {
        for request in [
            request(IMAGES).rays(true),
            // Heads that run once, so that their weights pass through: with and without motion after them.
            all_at_once.clone().keep_weights(false),
            all_at_once.clone().keep_weights(false).motion(false).rays(true),
        ] {
            let mut expected = Vec::new();
            let mut field = None;
            let run = session(&engine, &weights, &request).run(&mut |event| {
                match event {
                    Event::Frame(frame) => {
                        let (rays, rays_confidence) = frame.rays.unwrap_or_default();
                        let confidence = frame.confidence.unwrap();
                        let tensors = [&frame.depth, &confidence, &rays, &rays_confidence].map(|v| bits(v));
                        expected.push((frame.index, tensors, frame.camera));
                    }
                    Event::Field(made) => field = Some(made),
                    _ => {}
                }
                Ok(())
            });
            run.unwrap();
            let (mut found, mut points) = (Vec::new(), Vec::new());
            let mut resident = None;
            let run = session(&engine, &weights, &request).run_resident(&mut |event| {
                let frame = match event {
                    Event::Resident(frame) => frame,
                    Event::Field(made) => {
                        resident = Some(made);
                        return Ok(());
                    }
                    _ => return Ok(()),
                };
                let rays = frame.rays.map(|(rays, confidence)| [rays, confidence].map(|slice| read(&engine, &slice)));
                let [rays, rays_confidence] = rays.unwrap_or_default();
                let [depth, confidence] = [&frame.depth, &frame.confidence.unwrap()].map(|slice| read(&engine, slice));
                assert_eq!((depth.len(), frame.depth_scale), (HEIGHT * WIDTH, 1.0));
                found.push((frame.index, [depth, confidence, rays, rays_confidence], frame.camera));
                points.extend(frame.points.map(|slice| read(&engine, &slice)));
                Ok(())
            });
            run.unwrap();
            assert!(expected.len() == IMAGES && expected == found, "{request:?}");
            assert_eq!((field.is_some(), resident.is_some()), (request.motion, request.motion));
            let (Some(field), Some(resident)) = (field, resident) else { continue };
            assert!(paths(&field) == paths(&resident), "{request:?}");
            let known: Vec<_> = (0..IMAGES).map(|i| bits(&field.points(i).unwrap())).collect();
            assert!(points == known, "{request:?}");
        }
    }
}

#[test]
fn paths_on_the_device_outlive_what_made_them() {
    let weights = Weights::builtin().unwrap();
    for engine in engines() {
        let field = made(&mut session(&engine, &weights, &request(IMAGES)));
        let expected = paths(&field);
        let resident: Vec<_> = (0..IMAGES).map(|i| field.resident_paths(&query(i)).unwrap()).collect();
        let none = field.resident_paths(&Query::new(0, Pixels::List(Vec::new()), 0..IMAGES));
        assert!(none.unwrap_err().to_string().contains("no pixels"));
        drop(field);
        // Work that would take memory that was given back too early.
        session(&engine, &weights, &request(IMAGES)).run(&mut omnix::quiet()).unwrap();
        let found: Vec<_> = resident.iter().flat_map(|p| [&p.positions, &p.theta]).map(|s| read(&engine, s)).collect();
        assert!(expected == found);
    }
}
