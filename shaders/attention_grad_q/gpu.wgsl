// attention_grad_q, GPUs: see lib/attention_grad_params for the equation and the shapes, lib/attention_grad_gpu for the tile.
#import attention_grad_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> g: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> facts: array<f32>;
@group(0) @binding(6) var<storage, read_write> dq: array<vec4<f32>>;

#import attention_grad_gpu
