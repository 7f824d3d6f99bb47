// attention_grad_q, software devices: see lib/attention_grad_params for the equation and the shapes, lib/attention_grad_software for the
// tile. The blocks of values and the rows of keys have been turned before.
#import attention_grad_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> q: array<Quad>;
@group(0) @binding(2) var<uniform> c_blocks: array<Quad, 4096>;
@group(0) @binding(3) var<uniform> d_blocks: array<Quad, 4096>;
@group(0) @binding(4) var<uniform> c_rows: array<Quad, 4096>;
@group(0) @binding(5) var<storage, read> g: array<Quad>;
@group(0) @binding(6) var<storage, read> facts: array<f32>;
@group(0) @binding(7) var<storage, read_write> dq: array<Quad>;

#import attention_grad_software
