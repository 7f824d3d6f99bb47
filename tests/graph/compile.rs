//! Kernels are compiled before they are needed, on the device or on another of its adapter.

use std::process::Command;

use omnix_graph::{Plan, PlanOptions};
use omnix_kernels::attention::Attention;
use omnix_kernels::compile::compile;
use omnix_kernels::{Gpu, Tier, WeightType, adapter};
use omnix_tests::gpu;

use crate::support::{run, two_blocks};

fn opened() -> Gpu {
    let wanted = std::env::var("OMNIX_DEVICE").ok();
    let adapter = adapter::choose(wanted.as_deref()).expect("a device");
    let (device, queue) = adapter::open(&adapter).expect("opens");
    Gpu::new(&device, &queue).from_adapter(&adapter)
}

#[test]
fn every_kernel_of_a_plan_compiles_with_nothing_bound_and_changes_nothing() {
    let graph = two_blocks(2, 75, (2, 32));
    let first = opened();
    let sibling = first.sibling().expect("the adapter opens twice");
    assert_eq!(sibling.caps, first.caps);
    assert!(gpu().sibling().is_none(), "whose adapter is not known has none");
    // Weights through uniform windows too, where the device takes them.
    for registers in [16, 32] {
        for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
            let caps = first.caps.clone().with_vector_registers(registers);
            let options = PlanOptions::default().storage(storage);
            let plan = Plan::new(&graph, &caps, &options).expect("plans");
            let kernels = plan.kernels().expect("records");
            for kernel in ["attention", "layer_norm", "linear", "split_heads"] {
                assert!(kernels.iter().any(|dispatch| dispatch.shader.kernel == kernel), "no {kernel}");
            }
            for device in [&first.with_caps(caps.clone()), &sibling.with_caps(caps)] {
                for dispatch in &kernels {
                    compile(device, dispatch).expect("compiles");
                }
                let bits = |gpu: &Gpu| run(gpu, &graph, &options).iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(device), bits(&gpu().with_caps(device.caps.clone())), "{storage:?}");
            }
        }
    }
}

/// Says to the test below that its process has a cache of its own.
const CHILD: &str = "OMNIX_TEST_EMPTY_CACHE";

#[test]
fn what_a_sibling_compiled_the_first_device_finds() {
    if std::env::var_os(CHILD).is_none() {
        let cache = tempfile::tempdir().expect("a folder");
        let mut again = Command::new(std::env::current_exe().expect("this program"));
        again.args(["compile::what_a_sibling_compiled_the_first_device_finds", "--exact", "--nocapture"]);
        let ran = again.env(CHILD, "1").env("MESA_SHADER_CACHE_DIR", cache.path()).output().expect("runs");
        let said = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success() && said.contains("1 passed"), "{said}");
        return;
    }
    let first = opened();
    if first.caps.tier != Tier::Software {
        return;
    }
    let sibling = first.sibling().expect("the adapter opens twice");
    let spec = Attention { groups: 1, heads: 1, head_dim: 64, nq: 40, nk: 40, keep_state: false };
    let kernel = spec.record(&first.caps).expect("records").remove(0);
    assert!(!first.is_prepared(&kernel));
    let compiled = compile(&sibling, &kernel).expect("compiles");
    assert!(!first.is_prepared(&kernel) && sibling.is_prepared(&kernel));
    let found = compile(&first, &kernel).expect("finds it");
    // Seconds against hundredths of one.
    assert!(found * 3 < compiled, "{found:?} after {compiled:?}");
    assert!(first.is_prepared(&kernel));
}
