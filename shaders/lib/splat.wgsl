// A point as a disc in the picture: what the two passes of `splat` over the points share.
//
// VIEW is three rows of world to camera [R|t]; then fx, skew, cx, fy; then cy, near, layer, 0; then the background, which only
// `resolve` reads. Pixel (x, y) has its centre at (x + 0.5, y + 0.5).
#import splat_params
#import hash

@group(0) @binding(1) var<storage, read> points: array<f32>;
@group(0) @binding(2) var<storage, read> sizes: array<f32>;
@group(0) @binding(3) var<storage, read> view: array<vec4<f32>>;

// A smaller disc would fall between the samples of a pixel.
const LIB_LEAST_RADIUS: f32 = 0.7;
// Discs below this radius lie closer together than samples do: of them, a share of the points that falls with their area is drawn.
const LIB_THIN_RADIUS: f32 = 0.25;
// Farther from the picture's corner no pixel is.
const LIB_FAR: f32 = 1e6;
// The four samples of a pixel, from its centre: no two share a column or a row.
const LIB_ACROSS: vec4<f32> = vec4<f32>(-0.125, 0.375, -0.375, 0.125);
const LIB_DOWN: vec4<f32> = vec4<f32>(-0.375, -0.125, 0.125, 0.375);
const LIB_OUTERMOST: f32 = 0.375;

struct Splat {
    // Centre and radius in pixels, and the depth.
    centre: vec2<f32>,
    radius: f32,
    z: f32,
    // How far behind the front a sample still belongs to the same surface: half the disc's radius in the world.
    thickness: f32,
    // The pixels it may touch, last ones included; none where the first is behind the last.
    low: vec2<i32>,
    high: vec2<i32>,
}

// Point i of this dispatch.
fn lib_splat(i: u32) -> Splat {
    var splat: Splat;
    splat.high = vec2<i32>(-1);
    let at = p.points_rest + 3u * i;
    let world = vec4<f32>(points[at], points[at + 1u], points[at + 2u], 1.0);
    let seen = vec3<f32>(dot(view[0], world), dot(view[1], world), dot(view[2], world));
    let lens = view[3];
    let rest = view[4];
    // Also false for what is no number.
    if (!(seen.z > rest.y && seen.z < 1e30)) {
        return splat;
    }
    let u = seen.xy / seen.z;
    let centre = vec2<f32>(lens.x * u.x + lens.y * u.y + lens.z, lens.w * u.y + rest.x);
    let size = sizes[p.sizes_rest + i];
    let world_size = size >= 0.0;
    let radius = select(-size, max(lens.x, lens.w) * size / seen.z, world_size);
    if (!(abs(centre.x) < LIB_FAR && abs(centre.y) < LIB_FAR && radius >= 0.0)) {
        return splat;
    }
    if (world_size && radius < LIB_THIN_RADIUS) {
        let share = radius / LIB_THIN_RADIUS;
        if (f32(lib_hash(vec4<u32>(p.first + i)).x) > share * share * 4294967296.0) {
            return splat;
        }
    }
    splat.centre = centre;
    splat.radius = clamp(radius, LIB_LEAST_RADIUS, p.largest);
    splat.z = seen.z;
    splat.thickness = select(0.0, 0.5 * size, world_size);
    // Pixels whose outermost samples it may reach.
    let reach = vec2<f32>(splat.radius + LIB_OUTERMOST);
    let top = vec2<f32>(0.0, f32(p.row));
    let bottom = vec2<f32>(f32(p.width), f32(p.row + p.rows));
    splat.low = vec2<i32>(clamp(ceil(centre - 0.5 - reach), top, bottom));
    splat.high = vec2<i32>(clamp(floor(centre - 0.5 + reach), top - 1.0, bottom - 1.0));
    return splat;
}

// Squared distances of the four samples of pixel (x, y) from the centre.
fn lib_distances(splat: Splat, x: i32, y: i32) -> vec4<f32> {
    let across = LIB_ACROSS + (f32(x) + 0.5 - splat.centre.x);
    let down = LIB_DOWN + (f32(y) + 0.5 - splat.centre.y);
    return across * across + down * down;
}

// The first and the last column of row y that the disc may touch: corners of the box around it have no part of it.
fn lib_span(splat: Splat, y: i32) -> vec2<i32> {
    let down = max(abs(f32(y) + 0.5 - splat.centre.y) - LIB_OUTERMOST, 0.0);
    // A little more, so that rounding loses no sample on the edge.
    let half = sqrt(max(splat.radius * splat.radius - down * down, 0.0)) + LIB_OUTERMOST + 0.001;
    let middle = splat.centre.x - 0.5;
    let low = max(ceil(middle - half), f32(splat.low.x));
    let high = min(floor(middle + half), f32(splat.high.x));
    return vec2<i32>(vec2<f32>(low, high));
}

// The pixel's place in the band.
fn lib_pixel(x: i32, y: i32) -> u32 {
    return (u32(y) - p.row) * p.width + u32(x);
}
