// The order in which workgroups take the tiles of a product (software variants): groups of `group` row tiles, within a
// group one column block after the other, so that what is read again is still in a cache. The host chooses the group
// (`PackedWeights::row_group`).

// Row tile and column block of a workgroup; the tile lies past the last where there is nothing to do.
fn lib_walk(index: u32, row_tiles: u32, group: u32, blocks: u32) -> vec2<u32> {
    let first = index / (group * blocks) * group;
    let inside = index - first * blocks;
    // At least 1 past the end too: nothing divides by 0.
    let rows = min(group, max(row_tiles, first + 1u) - first);
    return vec2<u32>(first + inside % rows, inside / rows);
}
