// A hash of 32 bits whose every bit depends on every bit of the argument about as often as not (triple32 of hash-prospector, which
// is in the public domain): one to one, integers only, so the same on every device.
fn lib_hash(v: vec4<u32>) -> vec4<u32> {
    var h = v;
    h ^= h >> vec4<u32>(17u);
    h *= vec4<u32>(0xed5ad4bbu);
    h ^= h >> vec4<u32>(11u);
    h *= vec4<u32>(0xac4c1b51u);
    h ^= h >> vec4<u32>(15u);
    h *= vec4<u32>(0x31848babu);
    h ^= h >> vec4<u32>(14u);
    return h;
}
