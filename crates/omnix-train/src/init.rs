//! Start values: a function of (seed, tensor name), or a checkpoint where its tensors fit by name and shape.
//!
//! From a seed (`spec/omnix.md` 11.3; where that is silent, what keeps the deviation of a signal from layer to layer):
//!
//! | tensors | value |
//! |---|---|
//! | norms | weight 1, bias 0 |
//! | layer scale (`gamma`) | 0.01, or what the configuration says |
//! | tokens and position table | normal, deviation 0.02, cut at 2 deviations |
//! | linear layers of transformer blocks | normal, deviation 1/√(inputs of an output), cut at 2 deviations |
//! | other linear layers, convolutions | uniform in ±√(3 / inputs of an output) |
//! | last layers of heads, second convolutions of residual units | uniform in ±1/√(inputs of an output) |
//! | projections of the time codes, AdaLN's | 0 |
//! | `offset_head.feature_merge` | `[C, 3C]`: the identity on the first C, which are the feature |
//! | last layer of the sampling head | N(0, 1e-3) |
//! | `st_mod.motion_proj_list.*.2` | weight 0; bias: no motion, which as 6D rotation and translation is 1,0,0, 0,1,0, 0,0,0 |
//! | `cam_dec.fc_qvec`, `fc_fov.0` | bias: no rotation (0,0,0,1); 1 radian, since behind them is a ReLU that would start dead |
//! | other biases | 0 |
//!
//! timm starts every block with a deviation of 0.02 and PyTorch every convolution in ±1/√inputs, of a transposed one by the inputs that it
//! would have if it were none. At the release's width the first is the same; narrow networks fit what they see again and again later with
//! these (benches/log/2026-11-30-learning.md).
//!
//! From a checkpoint: what fits. Of a Depth Anything 3 checkpoint (`spec/omnix.md` 1.2) `head.*` is also the start of `offset_head.*`,
//! but for the ray branch (`aux`) and the last layer. What does not fit starts from the seed.

use omnix_weights::Checkpoint;

use crate::TrainError;
use crate::random::Random;

/// Where a tensor's start values come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// Made from the seed.
    Seed,
    /// From the checkpoint, under its own name.
    Checkpoint,
    /// From the checkpoint's depth head.
    DepthHead,
}

/// Layer scale of `spec/omnix.md` 11.3, for blocks that are added to a trained network.
pub const LAYER_SCALE: f32 = 0.01;

/// What random start values depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeedValues {
    /// The seed.
    pub seed: u64,
    /// Layer scale.
    pub layer_scale: f32,
}

impl SeedValues {
    /// This seed, and [`LAYER_SCALE`].
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self { seed, layer_scale: LAYER_SCALE }
    }
}

/// The start values of a network.
#[derive(Debug)]
pub struct StartValues {
    seed: SeedValues,
    from: Option<Checkpoint>,
    borrow_head: bool,
}

impl StartValues {
    /// Random values.
    #[must_use]
    pub const fn seeded(seed: SeedValues) -> Self {
        Self { seed, from: None, borrow_head: false }
    }

    /// A checkpoint's values where they fit, random ones elsewhere. `borrow_head`: the sampling head, where the checkpoint has none,
    /// starts as the depth head.
    #[must_use]
    pub const fn from_checkpoint(checkpoint: Checkpoint, borrow_head: bool, seed: SeedValues) -> Self {
        Self { seed, from: Some(checkpoint), borrow_head }
    }

    /// Where the start values of a tensor come from.
    #[must_use]
    pub fn origin(&self, name: &str, shape: &[usize]) -> Origin {
        let fits = |name: &str| {
            let info = self.from.as_ref().and_then(|from| from.info(name));
            info.is_some_and(|info| info.shape == shape && info.known().is_some_and(|dtype| dtype.float().is_some()))
        };
        match borrowed(name) {
            _ if fits(name) => Origin::Checkpoint,
            Some(depth) if self.borrow_head && fits(&depth) => Origin::DepthHead,
            _ => Origin::Seed,
        }
    }

    /// The start values of a tensor, row-major.
    ///
    /// # Errors
    /// A tensor of the checkpoint that cannot be read, or that has a NaN or infinite number.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, TrainError> {
        let stored = match self.origin(name, shape) {
            Origin::Seed => return Ok(from_seed(self.seed, name, shape)),
            Origin::Checkpoint => name.to_owned(),
            Origin::DepthHead => borrowed(name).unwrap_or_default(),
        };
        let Some(from) = &self.from else { return Ok(from_seed(self.seed, name, shape)) };
        let values = from.tensor(&stored)?.to_f32();
        from.release(&stored);
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(values),
            Some(index) => {
                let (tensor, value, path) = (stored, values[index], from.path().to_owned());
                Err(TrainError::StartNotFinite { tensor, index, value, path })
            }
        }
    }
}

/// The tensor of the depth head that a tensor of the sampling head may start as.
fn borrowed(name: &str) -> Option<String> {
    let rest = name.strip_prefix("offset_head.")?;
    let own = rest.contains("_aux") || rest.starts_with("scratch.output_conv2.2.");
    (!own).then(|| format!("head.{rest}"))
}

/// What a tensor starts as.
enum Rule {
    Constant(f32),
    Values(&'static [f32]),
    /// Normal with this deviation, cut at the second number of deviations.
    Normal(f64, f64),
    /// Uniform between plus and minus this.
    Uniform(f64),
    /// 1 where row and column are equal, of rows of this length.
    Identity(usize),
}

/// A rotation by nothing as the first two columns of its matrix, and no translation.
const NO_MOTION: &[f32] = &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
/// Ends of the names of last layers of heads, and of second convolutions of residual units.
const LAST: [&str; 4] = ["output_conv2.2", "last_layer", "time_embed_scaling_mlp.6", ".conv2"];
const NO_ROTATION: &[f32] = &[0.0, 0.0, 0.0, 1.0];
/// Deviations at which a normal distribution without a cut is cut all the same: none of a billion numbers comes there.
const UNCUT: f64 = 8.0;

fn rule(name: &str, shape: &[usize], layer_scale: f32) -> Rule {
    let motion = name.contains("motion_proj_list.");
    if let Some(layer) = name.strip_suffix(".bias") {
        return match layer {
            _ if motion && layer.ends_with(".2") && shape == [NO_MOTION.len()] => Rule::Values(NO_MOTION),
            "cam_dec.fc_qvec" if shape == [NO_ROTATION.len()] => Rule::Values(NO_ROTATION),
            "cam_dec.fc_fov.0" => Rule::Constant(1.0),
            _ => Rule::Constant(0.0),
        };
    }
    let Some(layer) = name.strip_suffix(".weight") else {
        // Tokens, the position table, and layer scale.
        return if name.ends_with(".gamma") { Rule::Constant(layer_scale) } else { Rule::Normal(0.02, 2.0) };
    };
    let zero =
        layer.ends_with("_idx_embed.proj") || layer.contains("sp_adaln.t_proj") || motion && layer.ends_with(".2");
    // A transposed convolution whose stride is its size: every output has one number of each channel.
    let transposed = layer.ends_with("resize_layers.0") || layer.ends_with("resize_layers.1");
    let each = shape.get(1..).map_or(1, |rest| rest.iter().product::<usize>());
    let inputs = if transposed { shape[0] } else { each }.max(1) as f64;
    let last =
        LAST.iter().any(|end| layer.ends_with(end)) || layer.contains(".fc_") || layer.contains("output_conv2_aux");
    match (layer, shape) {
        _ if zero => Rule::Constant(0.0),
        (_, [_]) => Rule::Constant(1.0),
        ("offset_head.feature_merge", [_, columns]) => Rule::Identity(*columns),
        ("offset_head.scratch.output_conv2.2", _) => Rule::Normal(1e-3, UNCUT),
        (_, [_, _]) if layer.contains("blocks.") || layer.contains(".trunk.") => {
            Rule::Normal(inputs.sqrt().recip(), 2.0)
        }
        (_, []) => Rule::Constant(0.0),
        _ if last => Rule::Uniform(inputs.sqrt().recip()),
        _ => Rule::Uniform((3.0 / inputs).sqrt()),
    }
}

/// The start values of a tensor from a seed.
#[must_use]
pub fn from_seed(seed: SeedValues, name: &str, shape: &[usize]) -> Vec<f32> {
    let SeedValues { seed, layer_scale } = seed;
    let count = shape.iter().product();
    let mut random = Random::new(seed, &format!("start {name}"), 0);
    let mut fill = |draw: &mut dyn FnMut(&mut Random) -> f64| (0..count).map(|_| draw(&mut random) as f32).collect();
    match rule(name, shape, layer_scale) {
        Rule::Constant(value) => vec![value; count],
        Rule::Values(values) => values.to_vec(),
        Rule::Normal(deviation, cut) => fill(&mut |random| deviation * random.normal_within(cut)),
        Rule::Uniform(bound) => fill(&mut |random| random.between(-bound, bound)),
        Rule::Identity(columns) => (0..count).map(|i| if i / columns == i % columns { 1.0 } else { 0.0 }).collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use omnix_tensors::{Dtype, TensorSpec, TensorWriter};

    use super::*;

    fn deviation(values: &[f32]) -> f64 {
        (values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn special_layers_start_as_the_specification_says() {
        let made = |name: &str, shape: &[usize]| from_seed(SeedValues::new(3), name, shape);
        assert_eq!(made("offset_head.feature_merge.weight", &[2, 6]), [1., 0., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0.]);
        for zero in ["backbone.pretrained.video_idx_embed.proj.weight", "st_mod.local_time_idx_embed.proj.weight"] {
            assert_eq!(made(zero, &[2, 2]), [0.0; 4]);
        }
        assert_eq!(made("st_mod.motion_proj_list.1.2.weight", &[9, 2]), [0.0; 18]);
        assert_eq!(made("st_mod.motion_proj_list.1.2.bias", &[9]), NO_MOTION);
        assert_eq!(made("st_mod.motion_proj_list.1.2.bias", &[3]), [0.0; 3]);
        assert_eq!(made("cam_dec.fc_qvec.bias", &[4]), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(made("cam_dec.fc_fov.0.bias", &[2]), [1.0; 2]);
        assert_eq!(made("st_mod.blocks.0.ls2.gamma", &[3]), [0.01; 3]);
        let larger = SeedValues { layer_scale: 0.5, ..SeedValues::new(3) };
        assert_eq!(from_seed(larger, "st_mod.blocks.0.ls2.gamma", &[3]), [0.5; 3]);
        assert_eq!((made("head.norm.weight", &[3]), made("head.norm.bias", &[3])), (vec![1.0; 3], vec![0.0; 3]));
        let last = made("offset_head.scratch.output_conv2.2.weight", &[109, 32, 1, 1]);
        assert!((deviation(&last) / 1e-3 - 1.0).abs() < 0.05);
    }

    #[test]
    fn transformers_are_normal_and_the_rest_is_uniform() {
        let block = from_seed(SeedValues::new(3), "backbone.pretrained.blocks.3.attn.qkv.weight", &[96, 32]);
        let wanted = 1.0 / 32f64.sqrt();
        assert!((deviation(&block) / (wanted * 0.88) - 1.0).abs() < 0.05);
        assert!(block.iter().all(|v| f64::from(v.abs()) <= 2.0 * wanted));
        let conv = from_seed(SeedValues::new(3), "head.scratch.layer1_rn.weight", &[8, 16, 3, 3]);
        let within = |values: &[f32], bound: f32| {
            values.iter().all(|v| v.abs() < bound) && values.iter().any(|v| v.abs() > 0.98 * bound)
        };
        assert!(within(&conv, (3.0f32 / 144.0).sqrt()));
        let small = from_seed(SeedValues::new(3), "head.scratch.refinenet1.resConfUnit1.conv2.weight", &[8, 8, 3, 3]);
        assert!(within(&small, 1.0 / 72f32.sqrt()));
        // Of a transposed convolution, [in, out, rows, columns].
        let up = from_seed(SeedValues::new(3), "head.resize_layers.0.weight", &[16, 8, 4, 4]);
        assert!(within(&up, (3.0f32 / 16.0).sqrt()));
    }

    #[test]
    fn a_function_of_seed_and_name() {
        let made = |seed, name| from_seed(SeedValues::new(seed), name, &[4, 4]);
        assert_eq!(made(1, "cam_dec.backbone.0.weight"), made(1, "cam_dec.backbone.0.weight"));
        assert_ne!(made(1, "cam_dec.backbone.0.weight"), made(2, "cam_dec.backbone.0.weight"));
        assert_ne!(made(1, "cam_dec.backbone.0.weight"), made(1, "cam_dec.backbone.2.weight"));
    }

    #[test]
    fn a_checkpoint_gives_what_fits_and_its_head_twice() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("config.json"), "{}").unwrap();
        let names = ["model.head.norm.weight", "model.head.scratch.output_conv2.2.bias", "model.cam_dec.fc_t.bias"];
        let specs: Vec<TensorSpec> = names.iter().map(|name| TensorSpec::new(*name, Dtype::F32, [2])).collect();
        let path = dir.path().join("model.safetensors");
        let probe = TensorSpec::new("model.backbone.pretrained.norm.weight", Dtype::F32, [1]);
        let all: Vec<TensorSpec> = specs.iter().cloned().chain([probe]).collect();
        let mut writer = TensorWriter::create(&path, &all, &BTreeMap::new()).unwrap();
        names.iter().for_each(|name| writer.write_f32(name, &[5.0, 6.0]).unwrap());
        writer.write_f32("model.backbone.pretrained.norm.weight", &[f32::NAN]).unwrap();
        writer.finish().unwrap();
        let start = StartValues::from_checkpoint(Checkpoint::open(dir.path()).unwrap(), true, SeedValues::new(1));
        assert_eq!(start.tensor("head.norm.weight", &[2]).unwrap(), [5.0, 6.0]);
        assert_eq!(start.tensor("offset_head.norm.weight", &[2]).unwrap(), [5.0, 6.0]);
        // Its last layer is its own, and other shapes do not fit.
        assert_eq!(start.origin("offset_head.scratch.output_conv2.2.bias", &[2]), Origin::Seed);
        assert_eq!(start.tensor("offset_head.scratch.output_conv2.2.bias", &[2]).unwrap(), [0.0, 0.0]);
        assert_eq!(start.origin("cam_dec.fc_t.bias", &[3]), Origin::Seed);
        let error = start.tensor("backbone.pretrained.norm.weight", &[1]).unwrap_err().to_string();
        assert!(error.contains("backbone.pretrained.norm.weight"), "{error}");
    }
}
