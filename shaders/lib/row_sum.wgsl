// The lanes' parts of 8 rows, the even and the odd ones, to the whole of row `lane` in each lane: of two rows a lane keeps the one
// whose number has its bit and gives the other away, for each of three bits. Every row is summed in one order, whatever its place
// in the tile.
fn lib_row_sum(even: vec4<f32>, odd: vec4<f32>, lane: u32) -> f32 {
    let bit = (vec3<u32>(lane) & vec3<u32>(1u, 2u, 4u)) != vec3<u32>(0u);
    let a = select(even, odd, bit.x) + subgroupShuffleXor(select(odd, even, bit.x), 1u);
    let b = select(a.xz, a.yw, bit.y) + subgroupShuffleXor(select(a.yw, a.xz, bit.y), 2u);
    return select(b.x, b.y, bit.z) + subgroupShuffleXor(select(b.y, b.x, bit.z), 4u);
}
