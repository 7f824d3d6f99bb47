// The sum over the 8 lanes of a software device's subgroup, the same bits in every lane.
fn lib_total(v: f32) -> f32 {
    var s = v;
    s += subgroupShuffleXor(s, 1u);
    s += subgroupShuffleXor(s, 2u);
    s += subgroupShuffleXor(s, 4u);
    return s;
}
