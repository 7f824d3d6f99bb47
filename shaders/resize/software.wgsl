// resize, software devices, bilinear: see lib/resize_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and walks along $STRIP columns of two neighbouring rows of y, p.lanes lanes of channels
// (lib/value) at a time; where those are fewer than 8, several pairs of rows go side by side. Columns of x are blended vertically
// first and kept, so that pixels of y between the same two columns share the loads, as the two rows share a row of x that both need:
// loads cost more than anything else.
// PAIR needs c to be a multiple of 2, QUAD of 4, WIDE of 8, which gains only where no lane is without channels.
#import resize_params
#import grid
#import value

#if WIDE
fn blend(a: Value, b: Value, t: f32) -> Value {
    return Value(mix(a[0], b[0], t), mix(a[1], b[1], t));
}
#else
fn blend(a: Value, b: Value, t: f32) -> Value {
    return mix(a, b, t);
}
#endif

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> code: array<Stored>;
@group(0) @binding(3) var<storage, read_write> y: array<Stored>;

// Of two rows of y: where the rows of x start that each lies between, and how far from the first of them.
struct Rows {
    top0: u32,
    bottom0: u32,
    top1: u32,
    bottom1: u32,
    fraction0: f32,
    fraction1: f32,
}

// A column of x, blended for each of two rows of y.
struct Column {
    first: Value,
    second: Value,
}

fn column(rows: Rows, at: u32) -> Column {
    let top = lib_value(x[rows.top0 + at]);
    let bottom = lib_value(x[rows.bottom0 + at]);
    var top1 = top;
    var bottom1 = bottom;
    if (rows.top1 != rows.top0) {
        top1 = bottom;
        bottom1 = lib_value(x[rows.bottom1 + at]);
        if (rows.top1 != rows.bottom0) {
            top1 = lib_value(x[rows.top1 + at]);
        }
    }
    return Column(blend(top, bottom, rows.fraction0), blend(top1, bottom1, rows.fraction1));
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let strips = (p.wo + ${STRIP-1}u) / ${STRIP}u;
    let rows = p.frame_pixels / p.wo;
    let pairs = (rows + 1u) / 2u;
    let tile = lib_fold(group, groups);
    // Pairs of rows of all frames in order.
    let line_of_tiles = tile / strips;
    let pair = line_of_tiles * (8u / p.lanes) + local.x / p.lanes;
    let frame = pair / pairs;
    if (frame * p.frame_pixels >= p.pixels) {
        return;
    }
    let start = (tile - line_of_tiles * strips) * ${STRIP}u;
    let count = min(${STRIP}u, p.wo - start);
    let row = (pair - frame * pairs) * 2u;
    let both = row + 1u < rows;
    let v0 = lib_coordinate(p.oy0 + row, p.y_a, p.y_b, p.y_d);
    let v1 = lib_coordinate(p.oy0 + select(row, row + 1u, both), p.y_a, p.y_b, p.y_d);
    let last_row = i32(p.hi) - 1;
    let line = p.wi * p.c;
    let origin = p.x_rest + (frame * p.hi - p.iy0) * line;
    let between = Rows(
        origin + u32(min(v0.cell, last_row)) * line, origin + u32(min(v0.cell + 1, last_row)) * line,
        origin + u32(min(v1.cell, last_row)) * line, origin + u32(min(v1.cell + 1, last_row)) * line,
        v0.fraction, v1.fraction);
    let last = p.wi - 1u;
    // The horizontal coordinate of lib_coordinate, from pixel to pixel without a division.
    let n0 = start * p.x_a + p.x_b;
    let whole = p.x_a / p.x_d;
    let part = p.x_a - whole * p.x_d;
    let next = p.wo * p.c;
    for (var c = local.x % p.lanes; c < p.c; c += max(p.lanes, 1u)) {
        var cell1 = n0 / p.x_d;
        var over = n0 - cell1 * p.x_d;
        var to = p.y_rest + ((frame * rows + row) * p.wo + start) * p.c + c;
        // The code of the two rows; that of columns changes along the way.
        let half = p.c / 2u;
        let by_column = p.has_code != 0u && c < half;
        var along = p.code_rest + start * half + c;
        var code_first = Value();
        var code_second = Value();
        if (p.has_code != 0u && c >= half) {
            let at = p.code_rest + (p.wo + p.oy0 + row) * half + c - half;
            code_first = lib_value(code[at]);
            if (both) {
                code_second = lib_value(code[at + half]);
            }
        }
        // The columns a and b are of; none yet.
        var left = 0xffffffffu;
        var right = 0xffffffffu;
        var a = Column();
        var b = Column();
        for (var o = 0u; o < count; o++) {
            // Coordinates are one cell up, so that none is negative; those before the first column count as the first.
            let l = min(max(cell1, 1u) - 1u, last);
            let r = min(max(cell1, 1u), last);
            let t = select(f32(over) / f32(p.x_d), 0.0, cell1 == 0u);
            if (l != left) {
                if (l == right) {
                    a = b;
                } else {
                    a = column(between, l * p.c + c);
                }
                left = l;
            }
            if (r != right) {
                b = column(between, r * p.c + c);
                right = r;
            }
            var first = blend(a.first, b.first, t) + code_first;
            var second = blend(a.second, b.second, t) + code_second;
            if (by_column) {
                let column_code = lib_value(code[along]);
                first += column_code;
                second += column_code;
                along += half;
            }
            y[to] = lib_stored(first);
            if (both) {
                y[to + next] = lib_stored(second);
            }
            to += p.c;
            cell1 += whole;
            over += part;
            if (over >= p.x_d) {
                over -= p.x_d;
                cell1 += 1u;
            }
        }
    }
}
