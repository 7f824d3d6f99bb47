//! An order of nodes with some of them twice, and what it takes.

use super::facts::Facts;

/// All nodes in their order, and before a node of the backward pass what it needs of the forward pass that does not stay: by node of the
/// graph, whether its results do.
pub(super) fn order(facts: &Facts, stays: &[bool]) -> Vec<u32> {
    let mut there = stays.to_vec();
    let mut order: Vec<u32> = (0..facts.late as u32).collect();
    // Nodes on their way, each with the number of its reads that have been looked at.
    let mut pending: Vec<(usize, usize)> = Vec::new();
    for at in facts.late..facts.nodes.len() {
        for value in &facts.nodes[at].reads {
            let maker = facts.values[*value as usize].maker;
            if maker < facts.late && !there[maker] {
                pending.push((maker, 0));
            }
            while let Some((node, looked)) = pending.last_mut() {
                let Some(value) = facts.nodes[*node].reads.get(*looked) else {
                    there[*node] = true;
                    order.push(*node as u32);
                    pending.pop();
                    continue;
                };
                *looked += 1;
                let maker = facts.values[*value as usize].maker;
                if !there[maker] {
                    pending.push((maker, 0));
                }
            }
        }
        order.push(at as u32);
    }
    order
}

/// Bytes that are alive at once at most, but for what is always there.
pub(super) fn peak(facts: &Facts, order: &[u32]) -> u64 {
    let mut alive = vec![false; facts.values.len()];
    let (mut sum, mut peak) = (0, 0);
    for at in order.iter().rev() {
        let node = &facts.nodes[*at as usize];
        for value in &node.reads {
            if !std::mem::replace(&mut alive[*value as usize], true) {
                sum += facts.values[*value as usize].bytes;
            }
        }
        let bytes = |value: &&u32| facts.values[**value as usize].bytes;
        let unread: u64 = node.makes.iter().filter(|value| !alive[**value as usize]).map(|value| bytes(&value)).sum();
        peak = peak.max(sum + unread);
        for value in &node.makes {
            if std::mem::take(&mut alive[*value as usize]) {
                sum -= facts.values[*value as usize].bytes;
            }
        }
    }
    peak
}

/// Operations of what comes a second time.
pub(super) fn repeated(facts: &Facts, order: &[u32]) -> u64 {
    let mut seen = vec![false; facts.nodes.len()];
    let again = order.iter().filter(|at| std::mem::replace(&mut seen[**at as usize], true));
    again.map(|at| facts.nodes[*at as usize].flops).sum()
}
