//! One set of bits: evaluated at once, streamed in any chunks, chosen pixels alone, from the device, a spool or a saved file,
//! whatever the chunks of the run.

use omnix::{
    Chunk, Event, Field, FieldPlace, FieldPrecision, OmnixError, Phase, Pixels, Query, RunPlan, Session, Weights,
};

use crate::made::{HEIGHT, WIDTH, bits, engine, field, request, session, show};

const IMAGES: usize = 3;

/// Everything a field can be asked for.
fn all(field: &Field) -> Vec<Vec<u32>> {
    let images = field.shape().images;
    let of = |i: usize| {
        let paths = field.paths(&Query::new(i, Pixels::All, 0..images)).unwrap();
        let (theta, confidence) = (field.theta(i).unwrap(), field.confidence(i).unwrap());
        [bits(&paths.positions), bits(&paths.theta), bits(&theta), bits(&confidence)]
    };
    (0..images).flat_map(of).collect()
}

#[test]
fn a_point_stays_where_it_is_at_its_own_time() {
    let field = field(&Weights::builtin().unwrap(), &request(IMAGES));
    for i in 0..IMAGES {
        let own = field.paths(&Query::new(i, Pixels::All, i..i + 1)).unwrap();
        let points = field.points(i).unwrap();
        let worst = own.positions.iter().zip(&points).fold(0.0f32, |w, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-4, "image {i}: {worst}");
        assert!(own.positions.iter().chain(&own.theta).all(|v| v.is_finite()));
    }
}

#[test]
fn chunks_of_the_run_change_no_bit() {
    let weights = Weights::builtin().unwrap();
    let whole = all(&field(&weights, &request(IMAGES)));
    for other in [
        request(IMAGES).parts(4),
        request(IMAGES).head_images(2).sampling_images(3),
        request(IMAGES).keep_weights(false),
        request(IMAGES).keep_weights(false).parts(4),
        // All images through the heads at once, so that all weights pass through.
        request(IMAGES).keep_weights(false).head_images(IMAGES).sampling_images(IMAGES),
    ] {
        assert!(whole == all(&field(&weights, &other)), "{other:?}");
    }
    for keep_weights in [true, false] {
        let with = |budget| request(IMAGES).budget(budget).keep_weights(keep_weights);
        let least = match RunPlan::new(&weights, &with(1), engine().caps()) {
            Err(omnix::OmnixError::Budget { least, .. }) => least,
            other => panic!("a budget of one byte: {other:?}"),
        };
        let plan = RunPlan::new(&weights, &with(least), engine().caps()).unwrap();
        assert!(plan.peak_bytes() <= least);
        assert!(whole == all(&field(&weights, &with(least))), "the least budget, weights stay: {keep_weights}");
    }
}

/// Everything that a session gives: depths, and the field's paths.
fn run_of(session: &mut Session) -> Result<Vec<Vec<u32>>, OmnixError> {
    show(session, IMAGES);
    let mut found = Vec::new();
    let mut field = None;
    session.run(&mut |event| {
        match event {
            Event::Frame(frame) => found.push(bits(&frame.depth)),
            Event::Field(made) => field = Some(made),
            _ => {}
        }
        Ok(())
    })?;
    found.extend(all(&field.expect("motion was asked for")));
    Ok(found)
}

#[test]
fn a_session_without_weights_of_its_own_runs_again_also_after_a_break() {
    let weights = Weights::builtin().unwrap();
    let engine = engine();
    let apart = request(IMAGES).keep_weights(false);
    // Through the heads all at once: no stage's weights are loaded beforehand.
    let at_once = apart.clone().head_images(IMAGES).sampling_images(IMAGES);
    for (request, loads) in [(apart, true), (at_once, false)] {
        let mut session = session(&engine, &weights, &request);
        let first = run_of(&mut session).unwrap();
        for phase in [Phase::Backbone, Phase::Weights, Phase::Head, Phase::Motion, Phase::Sampling] {
            // At the first report of the phase, and at the second, when some of a stage is done.
            for at in 1..=2 {
                show(&mut session, IMAGES);
                let mut heard = 0;
                let outcome = session.run(&mut |event| {
                    heard += usize::from(matches!(event, Event::Progress(p) if p.phase == phase));
                    if heard == at { Err(OmnixError::Interrupted) } else { Ok(()) }
                });
                let broken = matches!(outcome, Err(OmnixError::Interrupted));
                assert_eq!(broken, heard == at, "{phase:?} {at}: {heard} reports");
                assert!(broken || at == 2 || phase == Phase::Weights && !loads, "{phase:?} is not heard of");
            }
        }
        assert!(run_of(&mut session).unwrap() == first);
    }
}

#[test]
fn a_run_tells_geometry_then_what_moves_then_the_field_and_nothing_more() {
    let weights = Weights::builtin().unwrap();
    let mut told = Vec::new();
    let mut scores = Vec::new();
    let run = session(&engine(), &weights, &request(IMAGES)).run(&mut |event| {
        match event {
            Event::Progress(_) => return Ok(()),
            Event::Frame(frame) => told.push(format!("frame {}", frame.index)),
            Event::Motion(motion) => {
                told.push(format!("motion {}", motion.index));
                scores.push((bits(&motion.theta), bits(&motion.confidence)));
            }
            Event::Field(field) => {
                told.push("field".to_owned());
                let kept = |image| (bits(&field.theta(image).unwrap()), bits(&field.confidence(image).unwrap()));
                assert!(scores.iter().enumerate().all(|(image, told)| *told == kept(image)));
            }
            other => panic!("{other:?}"),
        }
        Ok(())
    });
    run.unwrap();
    assert_eq!(told.join(", "), "frame 0, frame 1, frame 2, motion 0, motion 1, motion 2, field");
}

#[test]
fn images_are_set_before_each_run() {
    let weights = Weights::builtin().unwrap();
    let engine = engine();
    let plan = RunPlan::new(&weights, &request(IMAGES).motion(false), engine.caps()).unwrap();
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet()).unwrap();
    let missing = |session: &mut Session| session.run(&mut omnix::quiet()).unwrap_err().to_string();
    assert!(missing(&mut session).contains("image 0 has not been set"));
    for image in [0, 2] {
        session.set_image(image, &crate::made::image(image as u32)).unwrap();
    }
    assert!(missing(&mut session).contains("image 1 has not been set"), "a run of black images would follow");
    show(&mut session, IMAGES);
    session.run(&mut omnix::quiet()).unwrap();
    assert!(missing(&mut session).contains("image 0 has not been set"), "a run uses the images up");
}

#[test]
fn a_file_gives_what_the_device_gives() {
    let (weights, dir) = (Weights::builtin().unwrap(), tempfile::tempdir().unwrap());
    let resident = field(&weights, &request(IMAGES));
    let whole = all(&resident);
    let spooled = field(&weights, &request(IMAGES).field(FieldPlace::Spool(dir.path().to_owned())));
    assert!(resident.on_device() && !spooled.on_device());
    assert!(whole == all(&spooled), "spooled");
    let path = dir.path().join("field.safetensors");
    for from in [&resident, &spooled] {
        from.save(&path, FieldPrecision::F32).unwrap();
        let opened = Field::open(&engine(), &path).unwrap();
        assert!(whole == all(&opened), "saved and opened");
        assert_eq!((opened.shape(), opened.motion(), opened.images()), (from.shape(), from.motion(), from.images()));
    }
    let long = std::fs::metadata(&path).unwrap().len();
    resident.save(&path, FieldPrecision::F16).unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < long * 6 / 10);
    let opened = Field::open(&engine(), &path).unwrap();
    let query = Query::new(1, Pixels::All, 0..IMAGES);
    let (exact, half) = (resident.paths(&query).unwrap(), opened.paths(&query).unwrap());
    let norm = |v: &mut dyn Iterator<Item = f32>| v.map(|x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    let off = norm(&mut exact.positions.iter().zip(&half.positions).map(|(a, b)| a - b));
    assert!(off < 5e-3 * norm(&mut exact.positions.iter().copied()), "{off}");
}

#[test]
fn chosen_pixels_and_times_are_parts_of_the_whole() {
    let field = field(&Weights::builtin().unwrap(), &request(IMAGES));
    let whole = field.paths(&Query::new(1, Pixels::All, 0..IMAGES)).unwrap();
    let list = vec![[3, 5], [WIDTH as u32 - 1, HEIGHT as u32 - 1], [0, 0], [3, 5]];
    let mut mask = vec![false; WIDTH * HEIGHT];
    (0..mask.len()).step_by(7).for_each(|i| mask[i] = true);
    for (pixels, times) in [
        (Pixels::List(list), 0..IMAGES),
        (Pixels::Mask(mask), 1..2),
        (Pixels::Stride(5), 1..IMAGES),
        (Pixels::Stride(1), 0..1),
    ] {
        let some = field.paths(&Query::new(1, pixels, times.clone())).unwrap();
        let flat = some.pixels.clone().unwrap_or_else(|| (0..(WIDTH * HEIGHT) as u32).collect());
        let expected: Vec<f32> = times
            .flat_map(|t| flat.iter().map(move |p| 3 * (t * WIDTH * HEIGHT + *p as usize)))
            .flat_map(|at| &whole.positions[at..at + 3])
            .copied()
            .collect();
        assert_eq!(bits(&some.positions), bits(&expected));
    }
}

#[test]
fn chunks_of_an_evaluation_change_no_bit() {
    let mut field = field(&Weights::builtin().unwrap(), &request(IMAGES));
    let query = Query::new(2, Pixels::All, 0..IMAGES);
    let whole = field.paths(&query).unwrap();
    for chunk in
        [Chunk { pixels: 100, times: 1 }, Chunk { pixels: 1, times: 2 }, Chunk { pixels: usize::MAX, times: 2 }]
    {
        // One pixel at a time takes a dispatch each: a few are enough.
        let pixels = if chunk.pixels == 1 { Pixels::Stride(13) } else { Pixels::All };
        let asked = Query::new(query.image, pixels, query.times.clone());
        let of_all = field.paths(&asked).unwrap();
        let some = field.paths(&asked.chunk(chunk)).unwrap();
        assert_eq!(bits(&some.positions), bits(&of_all.positions), "{chunk:?}");
        assert_eq!(bits(&some.theta), bits(&of_all.theta), "{chunk:?}");
    }
    field.set_room(Some(1 << 20));
    assert_eq!(bits(&field.paths(&query).unwrap().positions), bits(&whole.positions), "a mebibyte of room");
}

#[test]
fn queries_outside_are_refused_by_name() {
    let field = field(&Weights::builtin().unwrap(), &request(2));
    let reason = |query: &Query| field.paths(query).unwrap_err().to_string();
    assert!(reason(&Query::new(2, Pixels::All, 0..2)).contains("images go from 0 to 1"));
    assert!(reason(&Query::new(0, Pixels::All, 0..3)).contains("times 0..2"));
    assert!(reason(&Query::new(0, Pixels::List(vec![[WIDTH as u32, 0]]), 0..2)).contains("columns go from 0 to 55"));
    assert!(reason(&Query::new(0, Pixels::Mask(vec![true; 3]), 0..2)).contains("a mask of 3 pixels"));
    assert!(reason(&Query::new(0, Pixels::Stride(0), 0..2)).contains("stride"));
}
