//! The labels of samples against a second caster: every triangle of the scene, in the world, one after the other.

use glam::{DMat3, DVec2, DVec3};
use omnix_data::{Flag, Sample};

use crate::assets::Assets;
use crate::cast::Geometry;
use crate::model::samples::{BOX, flower};
use crate::random::Random;
use crate::recipe::{Places, Recipe};
use crate::sample::Samples;
use crate::scene::Scene;

const NONE: Places = Places { room: 0.0, desk: 0.0, street: 0.0, field: 0.0, studio: 0.0 };

/// Recipes of one kind of place each.
fn recipes() -> [Recipe; 5] {
    let of = |places| Recipe { places, movers: [4, 8], still: 0.0, ..Recipe::default() };
    [
        of(Places { room: 1.0, ..NONE }),
        of(Places { desk: 1.0, ..NONE }),
        of(Places { street: 1.0, ..NONE }),
        of(Places { field: 1.0, ..NONE }),
        of(Places { studio: 1.0, ..NONE }),
    ]
}

/// A box and a figure that moves, from files.
fn assets() -> Assets {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), BOX).unwrap();
    std::fs::write(dir.path().join("flower.glb"), flower().glb()).unwrap();
    Assets::read(dir.path()).unwrap()
}

fn samples(recipe: Recipe, visibility: bool) -> Samples {
    Samples { recipe, assets: Assets::default(), size: [28, 18], images: 4, visibility, seed: 77 }
}

/// All triangles at a time, in the world: corners, and where they come from.
fn soup(geometry: &Geometry, instances: u32) -> Vec<([DVec3; 3], (u32, u32))> {
    let mut all = Vec::new();
    for instance in 0..instances {
        let (solid, pose) = geometry.instance(instance);
        let world = |corner: u32| {
            let local = solid.mesh.positions[corner as usize];
            pose.map_or(local, |pose| pose.matrix3 * local + pose.translation)
        };
        for (k, corners) in solid.mesh.triangles.iter().enumerate() {
            all.push((corners.map(world), (instance, k as u32)));
        }
    }
    all
}

/// The first triangle along a ray, by the inverse of [edges, -direction]: t, weights of the second and third corner, which one.
fn first(soup: &[([DVec3; 3], (u32, u32))], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2], usize)> {
    let mut best: Option<(f64, [f64; 2], usize)> = None;
    for (k, ([a, b, c], _)) in soup.iter().enumerate() {
        let matrix = DMat3::from_cols(*b - *a, *c - *a, -direction);
        if matrix.determinant() == 0.0 {
            continue;
        }
        let DVec3 { x: u, y: v, z: t } = matrix.inverse() * (origin - *a);
        if u >= -1e-11 && v >= -1e-11 && u + v <= 1.0 + 1e-11 && t > 0.0 && best.is_none_or(|(least, ..)| t < least) {
            best = Some((t, [u, v], k));
        }
    }
    best
}

/// A camera of a sample as f64: rotation and translation, focal lengths, principal point.
struct Stored {
    rotation: DMat3,
    translation: DVec3,
    focal: DVec2,
    middle: DVec2,
}

impl Stored {
    fn of(sample: &Sample, image: usize) -> Self {
        let camera = &sample.cameras()[image];
        let row = |k: usize| DVec3::from_array([0, 1, 2].map(|j| f64::from(camera.extrinsics[k][j])));
        let k = camera.intrinsics.map(|row| row.map(f64::from));
        Self {
            rotation: DMat3::from_cols(row(0), row(1), row(2)).transpose(),
            translation: DVec3::from_array([0, 1, 2].map(|k| f64::from(camera.extrinsics[k][3]))),
            focal: DVec2::new(k[0][0], k[1][1]),
            middle: DVec2::new(k[0][2], k[1][2]),
        }
    }

    fn centre(&self) -> DVec3 {
        -(self.rotation.inverse() * self.translation)
    }

    fn direction(&self, at: DVec2) -> DVec3 {
        self.rotation.inverse() * ((at - self.middle) / self.focal).extend(1.0)
    }

    fn project(&self, point: DVec3) -> DVec3 {
        let p = self.rotation * point + self.translation;
        (p.truncate() / p.z * self.focal + self.middle).extend(p.z)
    }
}

fn wide(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// The scene that a sample was made of: the first draw whose sample is the same.
fn scene_of(samples: &Samples, index: u64, sample: &Sample) -> Scene {
    let draws =
        (0..samples.recipe.tries).map(|draw| Scene::draw(&samples.recipe, &samples.assets, samples.seed, index, draw));
    let mut same = draws.filter(|scene| samples.of(scene).is_ok_and(|other| other.cameras() == sample.cameras()));
    same.next().expect("one of the draws made the sample")
}

#[test]
fn labels_are_those_of_brute_force() {
    let mut random = Random::new(5, 0, "truth");
    let (mut depths, mut paths, mut moved, mut seen, mut hidden) = (0, 0, 0, 0, 0);
    let plain = recipes().map(|recipe| samples(recipe, true));
    // Rooms and studios with imported models, whose movers are all imported.
    let [room, _, _, _, studio] = recipes();
    let imported = [room, studio].map(|recipe| {
        let recipe = Recipe { models: [8, 8], model_movers: 1.0, ..recipe };
        Samples { assets: assets(), ..samples(recipe, true) }
    });
    for samples in plain.into_iter().chain(imported) {
        let sample = samples.get(3).unwrap();
        let scene = scene_of(&samples, 3, &sample);
        let instances = 1 + scene.actors.iter().map(|actor| actor.parts.len() as u32).sum::<u32>();
        let soups: Vec<_> =
            sample.times().iter().map(|time| soup(&scene.geometry(time.seconds.unwrap()), instances)).collect();
        let cameras: Vec<Stored> = (0..4).map(|image| Stored::of(&sample, image)).collect();
        for draw in 0..60 {
            let source = random.below(4);
            // Half of them on what moves, where something does.
            let movers: Vec<usize> = (0..28 * 18).filter(|&k| sample.moving(source).unwrap()[k] == Flag::Yes).collect();
            let pixel = if draw % 2 == 0 && !movers.is_empty() { *random.pick(&movers) } else { random.below(28 * 18) };
            let at = DVec2::new((pixel % 28) as f64 + 0.5, (pixel / 28) as f64 + 0.5);
            let depth = f64::from(sample.depth(source).unwrap()[pixel]);
            let Some((t, [u, v], place)) =
                first(&soups[source], cameras[source].centre(), cameras[source].direction(at))
            else {
                assert!(depth.is_nan(), "{}: no surface, depth {depth}", scene.place());
                continue;
            };
            // 1e-6, and the rounding to f32.
            assert!((depth - t).abs() < 1.1e-6 * t, "{}: depth {depth}, {t} by brute force", scene.place());
            depths += 1;
            for time in 0..4 {
                let [a, b, c] = soups[time][place].0;
                let point = a + (b - a) * u + (c - a) * v;
                let label = wide(sample.positions(source, time).unwrap()[pixel]);
                let (there, here) = (cameras[time].project(point), cameras[time].project(label));
                if there.z > 0.05 {
                    let away = there.truncate().distance(here.truncate());
                    assert!(away < 0.02, "{}: {away} pixels apart", scene.place());
                    paths += 1;
                    moved += usize::from(label != wide(sample.positions(source, source).unwrap()[pixel]));
                }
                // What is seen has nothing before it; what is not seen is outside, behind something, or seen from its other side.
                let ray = point - cameras[time].centre();
                let before = first(&soups[time], cameras[time].centre(), ray).map_or(f64::INFINITY, |(t, ..)| t);
                let inside = there.z > 0.0 && (0.0..28.0).contains(&there.x) && (0.0..18.0).contains(&there.y);
                let side = |corners: [DVec3; 3], ray: DVec3| {
                    (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(ray) > 0.0
                };
                let same_side =
                    side(soups[source][place].0, cameras[source].direction(at)) == side(soups[time][place].0, ray);
                match sample.visible(source, time).unwrap()[pixel] {
                    Flag::Yes => {
                        assert!(inside && same_side && before > 1.0 - 1e-6, "{}: seen at {there}", scene.place());
                        seen += 1;
                    }
                    Flag::No => {
                        assert!(!inside || !same_side || before < 1.0 - 1e-8, "{}: not seen at {there}", scene.place());
                        hidden += 1;
                    }
                    Flag::Unknown => panic!("a pixel with depth has no visibility"),
                }
            }
            assert_eq!(sample.visible(source, source).unwrap()[pixel], Flag::Yes, "{}", scene.place());
        }
    }
    assert!(
        depths > 150 && paths > 500 && moved > 100 && seen > 300 && hidden > 30,
        "{depths} {paths} {moved} {seen} {hidden}"
    );
}

#[test]
fn the_same_index_gives_the_same_bits_on_any_number_of_threads() {
    let samples = samples(Recipe::default(), true);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for index in 0..6 {
        let (once, again) = (samples.get(index).unwrap(), pool.install(|| samples.get(index)).unwrap());
        // NaN is unequal to itself: bits are compared.
        let bits = |sample: &Sample| {
            let parts = sample.parts();
            let depth: Vec<u32> = parts.depth.iter().flatten().map(|v| v.to_bits()).collect();
            let paths: Vec<u32> = (0..16)
                .flat_map(|k| sample.positions(k / 4, k % 4).unwrap().iter().flatten().map(|v| v.to_bits()))
                .collect();
            (parts.images.clone(), parts.cameras.clone(), parts.moving.clone(), depth, paths)
        };
        assert!(bits(&once) == bits(&again), "sample {index}");
        assert!(bits(&once) != bits(&samples.get(index + 100).unwrap()), "sample {index}");
    }
}

#[test]
fn visible_points_are_where_the_depth_of_the_other_image_is() {
    let samples = samples(Recipe { field_of_view: [50.0, 60.0], ..Recipe::default() }, true);
    let (mut alike, mut count) = (0, 0);
    for index in 0..8 {
        let sample = samples.get(index).unwrap();
        for (source, time) in [(0, 1), (1, 3), (3, 0)] {
            let camera = Stored::of(&sample, time);
            for pixel in (0..28 * 18).filter(|&k| sample.visible(source, time).unwrap()[k] == Flag::Yes) {
                let at = camera.project(wide(sample.positions(source, time).unwrap()[pixel]));
                let (x, y) = ((at.x.max(0.0) as usize).min(27), (at.y.max(0.0) as usize).min(17));
                let depth = f64::from(sample.depth(time).unwrap()[y * 28 + x]);
                count += 1;
                // Pixels of so small a picture are wide.
                alike += usize::from((depth - at.z).abs() < 0.25 * at.z);
            }
        }
    }
    assert!(count > 1000 && alike * 100 > count * 85, "{alike} of {count}");
}

#[test]
fn imported_models_are_a_function_of_the_seed_and_change_nothing_without_them() {
    let recipe = Recipe { places: Places { room: 1.0, ..NONE }, still: 0.0, model_movers: 1.0, ..Recipe::default() };
    let with = |assets: &Assets, models| {
        let recipe = Recipe { models, ..recipe.clone() };
        let scene = Scene::compose(&recipe, assets, 5, 2).unwrap();
        let shape = scene.geometry(0.1);
        (scene.triangles(), shape.instance(0).0.mesh.positions.clone(), scene.actors.len())
    };
    let (assets, none) = (assets(), Assets::default());
    assert!(with(&assets, [6, 6]) == with(&assets, [6, 6]));
    assert!(with(&assets, [6, 6]).1 != with(&assets, [3, 3]).1);
    assert!(with(&none, [6, 6]) == with(&none, [0, 0]));
    // Models that move by themselves are among the movers of a few scenes.
    let figures = (0..6).flat_map(|index| Scene::compose(&recipe, &assets, 5, index).unwrap().actors);
    let played = figures.filter(|actor| matches!(actor.parts[0].change, Some(crate::actor::Change::Played(_)))).count();
    assert!(played > 2, "{played}");
}

#[test]
fn nothing_moves_in_still_scenes() {
    let samples = samples(Recipe { still: 1.0, ..Recipe::default() }, false);
    for index in 0..6 {
        let sample = samples.get(index).unwrap();
        assert!((0..4).all(|image| sample.moving(image).unwrap().iter().all(|&flag| flag == Flag::No)), "{index}");
    }
}

#[test]
fn samples_of_one_image_need_not_move() {
    let samples = Samples { images: 1, ..samples(Recipe { still: 0.0, ..Recipe::default() }, false) };
    (0..4).for_each(|index| assert_eq!(samples.get(index).unwrap().count(), 1, "{index}"));
}

#[test]
fn what_cannot_be_is_an_error() {
    let good = samples(Recipe::default(), false);
    let error = |change: fn(&mut Samples)| {
        let mut samples = good.clone();
        change(&mut samples);
        samples.get(0).unwrap_err().to_string()
    };
    assert!(error(|s| s.images = 0).contains("images"));
    assert!(error(|s| s.images = 65).contains("images"));
    assert!(error(|s| s.size = [0, 10]).contains("size"));
    assert!(error(|s| s.size = [usize::MAX, 2]).contains("size"));
    assert!(error(|s| s.recipe.movers = [2, 1]).contains("movers"));
    // Cameras are never still enough for half of all pixels to move: the index is refused, and says why.
    assert!(error(|s| (s.recipe.least_motion, s.recipe.tries) = (0.5, 2)).contains("refused"));
}
