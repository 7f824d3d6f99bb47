// linear of few columns, software devices: see lib/linear_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $ROWS rows x 4 columns, where the other tiles compute 32. Of 32 k at a time
// lane l owns k 4l..4l+4, whose weights serve all rows; rows come in one contiguous load each, and lanes' parts are summed
// eight rows at once (lib/row_sum). No workgroup memory, no barrier. Needs k to be a multiple of 4; a lane's sum runs over k in order.
#import linear_params
#import grid
#import quad
#import row_sum

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read> w: array<Quad>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> gamma: array<f32>;
@group(0) @binding(5) var<storage, read> residual: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let index = lib_fold(group, groups);
    let fours = (p.n + 3u) / 4u;
    let row0 = index / fours * ${ROWS}u;
    let n4 = index % fours;
    if (row0 >= p.m) {
        return;
    }
    let k4 = p.k / 4u;
#for r in 0..$ROWS
    // Rows past the end read the last row; they are not written.
    let x$r = min(row0 + ${r}u, p.m - 1u) * k4;
    var c$r = vec4<f32>(0.0);
#end
    for (var k = lane; k < k4; k += 8u) {
#if W16
        var wpos = k * 16u + n4;
#else
#if W8
        var wpos = k * 8u + n4;
#else
        var wpos = k * 32u + n4;
#endif
#endif
#import product_weights
#for r in 0..$ROWS
        let a$r = lib_quad(x[x$r + k]);
        c$r += (a$r.x * b0 + a$r.y * b1) + (a$r.z * b2 + a$r.w * b3);
#end
    }
    let n = n4 * 4u;
    var added = vec4<f32>(0.0);
    var scaled = vec4<f32>(1.0);
#for j in 0..4
    if ((p.flags & HAS_BIAS) != 0u && n + ${j}u < p.n) {
        added[$j] = bias[n + ${j}u];
    }
    if ((p.flags & HAS_GAMMA) != 0u && n + ${j}u < p.n) {
        scaled[$j] = gamma[n + ${j}u];
    }
#end
#for g in 0..${ROWS/8}
    {
#for j in 0..4
        let sum$j = lib_row_sum(
            vec4<f32>(c${g*8}[$j], c${g*8+2}[$j], c${g*8+4}[$j], c${g*8+6}[$j]),
            vec4<f32>(c${g*8+1}[$j], c${g*8+3}[$j], c${g*8+5}[$j], c${g*8+7}[$j]), lane);
#end
        let row = row0 + ${g*8}u + lane;
        let v = lib_activate(lib_scaled(vec4<f32>(sum0, sum1, sum2, sum3), n) + added, p.act) * scaled;
#for j in 0..4
        if (row < p.m && n + ${j}u < p.n) {
            let at = row * p.n + n + ${j}u;
            var out = v[$j];
            if ((p.flags & HAS_RESIDUAL) != 0u) {
                out += residual[at];
            }
            y[at] = out;
        }
#end
    }
#end
}
