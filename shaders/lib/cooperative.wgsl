// Products of small matrices that a subgroup computes together: $T x $T x $T, operands f16 with HALF, else f32, sums f32.
// The importer keeps operands in workgroup memory, in `xs` and `ws`, row-major; the result goes to `cs`.
//
// LANES replaces the cooperative operations by plain loops over workgroup memory and the device's subgroups by groups of LANES
// invocations, a lane holding every LANES-th element of a result: what surrounds the operations then runs, and is tested, on
// devices that have none. Operands are places there: importers leave them alone while they use them.

#if HALF
alias CoopNumber = f16;
#else
alias CoopNumber = f32;
#endif

#if LANES
// Where an operand starts in its array, and the distance of its rows.
alias CoopA = vec2<u32>;
alias CoopB = vec2<u32>;
alias CoopC = array<f32, ${T*T/LANES}>;

var<private> coop_lane: u32;

fn coop_a(at: u32, stride: u32) -> CoopA {
    return vec2<u32>(at, stride);
}

fn coop_b(at: u32, stride: u32) -> CoopB {
    return vec2<u32>(at, stride);
}

fn coop_zero() -> CoopC {
    return CoopC();
}

fn coop_fma(a: CoopA, b: CoopB, c: CoopC) -> CoopC {
    var sum = c;
    for (var e = 0u; e < ${T*T/LANES}u; e++) {
        let element = e * ${LANES}u + coop_lane;
        for (var k = 0u; k < ${T}u; k++) {
            sum[e] = fma(f32(xs[a.x + element / ${T}u * a.y + k]), f32(ws[b.x + k * b.y + element % ${T}u]), sum[e]);
        }
    }
    return sum;
}

fn coop_c(at: u32) -> CoopC {
    var c: CoopC;
    for (var e = 0u; e < ${T*T/LANES}u; e++) {
        c[e] = cs[at + e * ${LANES}u + coop_lane];
    }
    return c;
}

fn coop_store(c: CoopC, at: u32) {
    var elements = c;
    for (var e = 0u; e < ${T*T/LANES}u; e++) {
        cs[at + e * ${LANES}u + coop_lane] = elements[e];
    }
}
#else
alias CoopA = coop_mat${T}x${T}<CoopNumber, A>;
alias CoopB = coop_mat${T}x${T}<CoopNumber, B>;
alias CoopC = coop_mat${T}x${T}<f32, C>;

// The T of coopLoadT: rows are contiguous.
fn coop_a(at: u32, stride: u32) -> CoopA {
    return coopLoadT<CoopA>(&xs[at], stride);
}

fn coop_b(at: u32, stride: u32) -> CoopB {
    return coopLoadT<CoopB>(&ws[at], stride);
}

fn coop_zero() -> CoopC {
    return CoopC();
}

fn coop_fma(a: CoopA, b: CoopB, c: CoopC) -> CoopC {
    return coopMultiplyAdd(a, b, c);
}

// Sums that coop_store left.
fn coop_c(at: u32) -> CoopC {
    return coopLoadT<CoopC>(&cs[at], ${T}u);
}

fn coop_store(c: CoopC, at: u32) {
    coopStoreT(c, &cs[at], ${T}u);
}
#endif
