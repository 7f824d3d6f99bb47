//! No node reads and writes one buffer; values alive together never share.

use omnix_graph::memory::Place;
use omnix_graph::{Plan, PlanOptions};
use omnix_kernels::Caps;

use crate::support::two_blocks;

#[test]
fn values_of_one_node_never_share_a_buffer() {
    for parts in [1, 3] {
        let graph = two_blocks(6, 75, (2, 32));
        let plan =
            Plan::new(&graph, &Caps::baseline(), &PlanOptions { parts, ..PlanOptions::default() }).expect("plans");
        for node in plan.graph.nodes() {
            let inputs = node.op.inputs();
            let mut seen: Vec<_> = inputs.iter().chain(&node.outputs).map(|v| plan.graph.root(*v)).collect();
            seen.sort_unstable();
            seen.dedup();
            let buffers: Vec<_> =
                seen.iter().map(|v| plan.place(*v)).filter(|p| matches!(p, Place::Arena(_))).collect();
            let mut distinct = buffers.clone();
            distinct.sort_by_key(|p| format!("{p:?}"));
            distinct.dedup();
            assert_eq!(buffers.len(), distinct.len(), "{}: {buffers:?}", node.op.name());
        }
    }
}
