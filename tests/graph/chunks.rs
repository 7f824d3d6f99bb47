//! Chunk sizes change memory and nothing else.

use omnix_graph::ops::Binary;
use omnix_graph::{Graph, GraphError, Plan, PlanOptions};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::{gpu, tiers, with_max_binding};

use crate::support::{run, two_blocks};

/// 6 sequences of 75 tokens, 2 heads of 32: 450 rows in all.
const GROUPS: usize = 6;
const TOKENS: usize = 75;
const HEADS: (usize, usize) = (2, 32);

fn bits(gpu: &Gpu, parts: usize) -> Vec<u32> {
    let graph = two_blocks(GROUPS, TOKENS, HEADS);
    let y = run(gpu, &graph, &PlanOptions::default().parts(parts));
    assert!(y.iter().all(|v| v.is_finite()));
    y.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn chunk_sizes_change_no_bit() {
    for gpu in tiers() {
        let whole = bits(&gpu, 1);
        assert_eq!(whole, bits(&gpu, 1), "{}: two runs", gpu.caps.tier);
        for parts in [2, 3, 6, 64] {
            assert_eq!(whole, bits(&gpu, parts), "{}: {parts} parts", gpu.caps.tier);
        }
    }
}

#[test]
fn a_small_binding_limit_changes_no_bit() {
    for gpu in tiers() {
        // Hidden rows are 450 x 256 floats, 460,800 bytes; 64 of them are 65,536.
        let small = with_max_binding(&gpu, 131_072);
        assert_eq!(bits(&gpu, 1), bits(&small, 1), "{}", gpu.caps.tier);
    }
}

/// A parameter or a constant with a row for every row of `x` (a position table at its own size), in a chain.
#[test]
fn tables_as_long_as_their_operand_are_cut_with_it() {
    let (rows, c) = (300, 64);
    let mut g = Graph::new();
    let x = g.input("x", [rows, c]);
    let table = g.parameter("table", [rows, c]);
    let fixed = g.constant("fixed", [rows, c], (0..rows * c).map(|i| (i % 97) as f32 / 97.0).collect());
    let scales = g.parameter("scales", [rows]);
    let weight = g.parameter("weight", [c, c]);
    let sum = g.add_values(x, table).expect("table");
    let sum = g.add_values(sum, fixed).expect("constant");
    let scaled = g.zip_rows(Binary::Mul, sum, scales).expect("a number per row");
    let normed = g.layer_norm(scaled, None, None, 1e-6).expect("norm");
    let y = g.linear(normed, weight, None).expect("linear");
    g.output(y, "y");
    for gpu in tiers() {
        let of = |parts| {
            let options = PlanOptions::default().parts(parts);
            let plan = Plan::new(&g, &gpu.caps, &options).expect("plans");
            assert_eq!(plan.chunks().iter().any(|(_, all, chunk)| chunk < all), parts > 1, "chunks in {parts} parts");
            run(&gpu, &g, &options)
        };
        let whole = of(1);
        for parts in [2, 3, 64] {
            assert_eq!(whole, of(parts), "{}: {parts} parts", gpu.caps.tier);
        }
    }
}

#[test]
fn a_budget_is_met_or_the_least_is_named() {
    let graph = two_blocks(64, 75, HEADS);
    let caps = Caps::baseline();
    let free = Plan::new(&graph, &caps, &PlanOptions::default()).expect("plans").working_bytes();
    let budget = free * 17 / 20;
    let options = |budget| PlanOptions::default().budget(budget);
    let tight = Plan::new(&graph, &caps, &options(budget)).expect("fits in chunks");
    assert!(
        tight.working_bytes() <= budget && tight.parts > 1,
        "{} of {budget} in {} parts",
        tight.working_bytes(),
        tight.parts
    );
    let Err(GraphError::Budget { least, .. }) = Plan::new(&graph, &caps, &options(1000)) else {
        panic!("1000 bytes cannot do")
    };
    assert!(least > 1000 && least <= tight.working_bytes());
    assert!(Plan::new(&graph, &caps, &options(least)).is_ok(), "the least that was named works");
}

#[test]
fn allocated_bytes_are_the_planned_bytes() {
    let graph = two_blocks(GROUPS, TOKENS, HEADS);
    let plan = Plan::new(&graph, &gpu().caps, &PlanOptions::default()).expect("plans");
    let arena: u64 = plan.memory.arena.iter().sum();
    // Input and output of 450 x 64 floats, each rounded to 256 bytes.
    assert_eq!(plan.working_bytes(), arena + 2 * 450 * 64 * 4);
    // Never all intermediates at once: far less than their sum.
    let sum: u64 = plan.graph.nodes().iter().map(|n| plan.graph.shape(n.outputs[0]).bytes()).sum();
    assert!(arena < sum / 2, "{arena} of {sum}");
}
