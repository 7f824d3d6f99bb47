//! Published networks planned for a device: operations by the reference's own count, memory in chunks.

use omnix_graph::{Graph, Plan, PlanOptions};
use omnix_kernels::Caps;
use omnix_model::{BackboneSpec, HeadSpec, Network, NetworkConfig, ReferenceChoice};

const GRID: (usize, usize) = (20, 36);

fn backbone(config: NetworkConfig, images: usize, parts: usize) -> Plan {
    backbone_with(config, images, &PlanOptions::default().parts(parts))
}

fn backbone_with(config: NetworkConfig, images: usize, options: &PlanOptions) -> Plan {
    let spec = BackboneSpec {
        images,
        grid: GRID,
        reference: ReferenceChoice::SaddleBalanced,
        cameras_given: false,
        times: Vec::new(),
        export_layers: Vec::new(),
    };
    let mut g = Graph::new();
    Network::new(config).backbone(&mut g, &spec).unwrap();
    Plan::new(&g, &Caps::lavapipe(), options).unwrap()
}

fn head(config: NetworkConfig, rays: bool) -> Plan {
    let mut g = Graph::new();
    Network::new(config)
        .head(&mut g, &HeadSpec { frames: 1, grid: GRID, rays, points: false, gaussians: false })
        .unwrap();
    Plan::new(&g, &Caps::lavapipe(), &PlanOptions::default()).unwrap()
}

/// `spec/da3.md` section 1, the table of arithmetic at 504x280: total without the head, in 10^9 operations.
#[test]
fn the_backbone_takes_the_operations_of_the_table() {
    let rows = [
        (NetworkConfig::small(), 1, 69.5 - 29.0),
        (NetworkConfig::small(), 16, 1879.0 - 464.0),
        (NetworkConfig::base(), 1, 251.0 - 109.0),
        (NetworkConfig::large(), 1, 908.0 - 420.0),
        (NetworkConfig::giant(), 1, 2187.0 - 425.0),
        (NetworkConfig::giant(), 16, 45_719.0 - 6794.0),
    ];
    for (config, images, expected) in rows {
        let name = config.name.clone();
        let found = backbone(config, images, 1).flops() as f64 / 1e9;
        assert!((found / expected - 1.0).abs() < 0.01, "{name}, {images} images: {found} of {expected}");
    }
}

/// The same for the head, rays and not: below the table, because 1×1 convolutions come before their resize and the
/// unused levels of the ray branch are left out.
#[test]
fn the_head_takes_fewer_operations_than_the_table() {
    for (config, whole, auxiliary) in [(NetworkConfig::small(), 29.0, 17.1), (NetworkConfig::large(), 420.0, 264.0)] {
        let (plain, with_rays) = (head(config.clone(), false), head(config, true));
        let of = |plan: &Plan, expected: f64| plan.flops() as f64 / 1e9 / expected;
        let (plain, with_rays) = (of(&plain, whole - auxiliary), of(&with_rays, whole));
        assert!((0.95..1.0).contains(&plain), "{plain} of the main branch");
        assert!((0.8..0.95).contains(&with_rays), "{with_rays} of the whole head");
    }
}

/// In the smallest chunks the intermediates of 16 views are five streams (the stream before and after, keys, values, the
/// last local output) and a tenth of that for what lives inside chunks; no attention or hidden layer is among them.
#[test]
fn chunks_leave_five_streams_in_memory() {
    let config = NetworkConfig::giant();
    let stream = 16 * 721 * config.backbone.width as u64 * 4;
    let (whole, cut) = (backbone(config.clone(), 16, 1), backbone(config, 16, 64));
    let arena = |plan: &Plan| plan.memory.arena.iter().sum::<u64>();
    assert!(arena(&cut) < stream * 6, "{} MiB", arena(&cut) >> 20);
    assert!(arena(&whole) > 2 * arena(&cut));
    assert_eq!(whole.flops(), cut.flops());
}

/// Weights that pass through: a few matrices; where chains go in chunks, those of half a block.
#[test]
fn a_giant_network_holds_few_of_its_weights() {
    for parts in [1, 64] {
        let options = PlanOptions::default().parts(parts);
        let plan = |streamed| backbone_with(NetworkConfig::giant(), 16, &options.streamed(streamed));
        let (stay, pass) = (plan(false), plan(true));
        let (passing, all) = (pass.resident_weight_bytes(), pass.weight_bytes());
        assert!(passing * 30 < all, "{} of {} MiB in {parts} parts", passing >> 20, all >> 20);
        assert_eq!(all, stay.weight_bytes());
        assert!(pass.working_bytes() <= stay.working_bytes(), "{} MiB", pass.working_bytes() >> 20);
    }
}

/// Where the values between short chains would take more than the weights of a long one, chains stay long.
#[test]
fn short_chains_are_taken_only_where_they_save_memory() {
    let config = NetworkConfig::from_json(&crate::fixture::nano()).unwrap();
    let mut graph = Graph::new();
    let spec =
        omnix_model::MotionSpec { images: 64, grid: (20, 36), times: (0..64).map(|i| (0, i)).collect(), forced: false };
    Network::new(config).motion(&mut graph, &spec).unwrap();
    let plan = |streamed| {
        let options = PlanOptions::default().parts(64).streamed(streamed);
        Plan::new(&graph, &Caps::lavapipe(), &options).unwrap()
    };
    let taken = |plan: &Plan| plan.working_bytes() + plan.resident_weight_bytes();
    let (stay, pass) = (taken(&plan(false)), taken(&plan(true)));
    assert!(pass <= stay, "{} for {} MiB", pass >> 20, stay >> 20);
}
