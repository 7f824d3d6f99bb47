//! What the objective compares with, as inputs of a plan: the values of a graph, and the numbers of a sample for them.

use omnix_data::{Flag, Sample, targets};
use omnix_graph::{Graph, GraphError, Value};
use omnix_model::{PATCH, TrainingOutputs};

use super::size::Size;
use crate::TrainError;
use crate::loss::{Cameras, Depths, Displacements, LossConfig, Rays, Scored, Scores, Terms, Tracks, still};
use crate::random::Random;

/// Rows and columns of a ray map for each patch.
const RAYS: usize = 8;

const DEPTH: &str = "target.depth";
const VALID: &str = "target.valid";
const RAY: &str = "target.ray";
const RAY_VALID: &str = "target.ray.valid";
const CAMERA: &str = "target.camera";
const CAMERA_VALID: &str = "target.camera.valid";
const PATHS: &str = "target.paths";
const KNOWN: &str = "target.paths.known";
const MOVING_KNOWN: &str = "target.paths.moving";
const COUNTED: &str = "target.paths.counted";
const LABEL: [&str; 2] = ["target.label.pixel", "target.label.token"];
const LABELLED: [&str; 2] = ["target.labelled.pixel", "target.labelled.token"];

/// The terms over a recorded network, with inputs for everything that comes from a sample.
pub(super) fn terms(
    g: &mut Graph,
    made: &TrainingOutputs,
    size: &Size,
    config: &LossConfig,
) -> Result<Terms, GraphError> {
    let (images, [rows, columns]) = (size.images, size.pixels());
    let (pixels, cells) = (rows * columns, rows * columns / PATCH / PATCH);
    let map = [images, rows, columns];
    let valid = g.input(VALID, map);
    let target = g.input(DEPTH, map);
    let depth = Depths { prediction: made.depth, confidence: made.depth_confidence, target, valid };
    let ray = [images, rows / PATCH * RAYS, columns / PATCH * RAYS, 6];
    let rays = Rays {
        prediction: made.rays.0,
        confidence: made.rays.1,
        target: g.input(RAY, ray),
        valid: g.input(RAY_VALID, [ray[0], ray[1], ray[2]]),
    };
    let first_image = Some(g.slice(valid, 0, 0, 1)?);
    let camera = Cameras {
        prediction: made.pose_codes,
        target: g.input(CAMERA, [images, 9]),
        valid: g.input(CAMERA_VALID, [images, 9]),
        first_image,
    };
    let mut terms = Terms { depth: Some(depth), rays: Some(rays), camera: Some(camera), ..Terms::default() };
    let Some(motion) = &made.motion else { return Ok(terms) };
    let shape = [images, images, pixels, 3];
    let target = g.input(PATHS, shape);
    let confidence = g.reshape(motion.confidence, [images, pixels])?;
    terms.tracks = Some(Tracks {
        prediction: g.reshape(motion.trajectories, shape)?,
        confidence,
        target,
        valid: g.input(KNOWN, [images, images, pixels]),
        counted: config.moving_share.map(|_| g.input(COUNTED, [images, images, pixels])),
    });
    if let Some(free) = motion.ungated.filter(|_| config.weights.displacement != 0.0) {
        let valid = g.input(MOVING_KNOWN, [images, images, pixels]);
        let prediction = g.reshape(free, shape)?;
        terms.displacement = Some(Displacements { prediction, target, valid, own: (0..images).collect() });
    }
    let mut scored = |probability: Value, at: usize, count: usize| {
        let probability = g.reshape(probability, [images, count])?;
        let (label, labelled) = (g.input(LABEL[at], [images, count]), g.input(LABELLED[at], [images, count]));
        Ok::<_, GraphError>(Scored { probability, label, labelled })
    };
    let pixel = scored(motion.theta, 0, pixels)?;
    terms.score = Some(Scores { pixels: pixel, tokens: scored(motion.score, 1, cells)? });
    Ok(terms)
}

/// What of a sample the inputs hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// Where its points go.
    pub moves: bool,
    /// Share of moving entries among those of the trajectory term that count.
    pub share: Option<f64>,
}

/// What the inputs hold for a normalised sample. `number` is the sample's, for what is drawn.
pub(super) fn of(
    sample: &Sample,
    Wanted { moves, share }: Wanted,
    number: u64,
) -> Result<Vec<(&'static str, Vec<f32>)>, TrainError> {
    let (images, pixels) = (sample.count(), sample.pixels());
    let unknown = vec![f32::NAN; pixels];
    let depth: Vec<f32> = (0..images).flat_map(|image| sample.depth(image).unwrap_or(&unknown)).copied().collect();
    let valid: Vec<f32> = depth.iter().map(|d| mask(d.is_finite())).collect();
    let ray = targets::rays(sample)?;
    let codes = targets::pose_codes(sample).concat();
    let mut inputs = vec![
        (RAY_VALID, vec![1.0; ray.len() / 6]),
        (RAY, ray),
        (CAMERA_VALID, vec![1.0; codes.len()]),
        (CAMERA, codes),
    ];
    if moves {
        let paths = targets::paths(sample);
        let labels = targets::moving_labels(sample, true);
        let tokens = targets::token_labels(sample, &labels)?;
        // A path counts where its pixel has depth and the point is known at this time.
        let source = |entry: usize| entry / pixels / images * pixels + entry % pixels;
        let known: Vec<f32> = (paths.iter().enumerate())
            .map(|(i, point)| mask(valid[source(i)] != 0.0 && point.iter().all(|v| v.is_finite())))
            .collect();
        let own = |entry: usize| {
            let image = entry / pixels / images;
            (image * images + image) * pixels + entry % pixels
        };
        let moving: Vec<f32> = (0..known.len())
            .map(|i| mask(labels[source(i)] == Flag::Yes && known[i] != 0.0 && known[own(i)] != 0.0))
            .collect();
        if let Some(share) = share {
            let mut random = Random::new(0, "still entries", number);
            let mut draw = |wanted: usize, left: usize| random.uniform() * (left as f64) < wanted as f64;
            inputs.push((COUNTED, still::drawn(&moving, &known, share, &mut draw)?));
        }
        for (at, flags) in [labels, tokens].iter().enumerate() {
            inputs.push((LABEL[at], flags.iter().map(|f| mask(*f == Flag::Yes)).collect()));
            inputs.push((LABELLED[at], flags.iter().map(|f| mask(*f != Flag::Unknown)).collect()));
        }
        inputs.extend([(PATHS, paths.concat()), (KNOWN, known), (MOVING_KNOWN, moving)]);
    }
    inputs.extend([(DEPTH, depth), (VALID, valid)]);
    Ok(inputs)
}

fn mask(counts: bool) -> f32 {
    if counts { 1.0 } else { 0.0 }
}
