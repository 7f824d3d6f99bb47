// attention_grad_kv, software devices: see lib/attention_grad_params for the equation and the shapes, lib/attention_grad_software for the
// tile. The blocks of queries and of gradients have been turned before.
#import attention_grad_params
#import grid
#import quad

@group(0) @binding(1) var<uniform> c_blocks: array<Quad, 4096>;
@group(0) @binding(2) var<uniform> d_blocks: array<Quad, 4096>;
@group(0) @binding(3) var<uniform> c_rows: array<Quad, 4096>;
@group(0) @binding(4) var<uniform> d_rows: array<Quad, 4096>;
@group(0) @binding(5) var<storage, read> k: array<f32>;
@group(0) @binding(6) var<storage, read> v: array<Quad>;
@group(0) @binding(7) var<storage, read> facts: array<Quad>;
@group(0) @binding(8) var<storage, read_write> dk: array<Quad>;
@group(0) @binding(9) var<storage, read_write> dv: array<Quad>;

#import attention_grad_software
