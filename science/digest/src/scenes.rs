//! Ten small scenes with every kind of geometry, with rays and points for them. All of it follows from fixed seeds.
//!
//! Results must be the same bits on every machine, so nothing here calls sines or cosines.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Coverage, Opacity, Pattern};
use antumbra::shapes::{CurveBasis, Curves, Disk, Sphere, UserGeometry, UserHit};
use antumbra::{Aabb, Geometry, Instance, LocalOrigin, NestedInstances, Ray};
use antumbra_scene::builtin;
use antumbra_testkit::{Mesh, Rng, TestRay, mesh, rays};

pub type Transform = [[f32; 4]; 3];

/// Geometries, objects and where they are, and what is queried.
pub struct Scene {
    pub world: Vec<Geometry<'static>>,
    pub objects: Vec<Vec<Geometry<'static>>>,
    pub instances: Vec<Instance>,
    pub rays: Vec<Ray>,
    pub points: Vec<[f32; 3]>,
}

/// What moves while rays are traced, each ray at its own time.
pub struct Moving {
    pub scene: Scene,
    pub times: Vec<f32>,
}

/// Makes a scene.
pub type Generator = fn(&mut Rng) -> Scene;

/// The scenes that do not move, by name. [`moving`] is the tenth.
pub const STILL: [(&str, Generator); 9] = [
    ("city", city),
    ("quads", quads),
    ("curves", curves),
    ("round", round),
    ("user", user),
    ("cutouts", cutouts),
    ("instances", instances),
    ("mixed", mixed),
    ("far", far),
];

impl Scene {
    /// A scene without instances.
    fn of(rng: &mut Rng, world: Vec<Geometry<'static>>, targets: &Mesh) -> Self {
        let mut points: Vec<_> = (0..400).map(|_| rng.point(1.2)).collect();
        let place = |index: usize| targets.positions[index % targets.positions.len()];
        for (index, point) in points.iter_mut().enumerate().skip(100) {
            // On vertices, and near them.
            let by = if index < 150 { 0.0 } else { 0.05 };
            *point = shifted(place(index * 37), point.map(|x| x * by));
        }
        Self {
            world,
            objects: Vec::new(),
            instances: Vec::new(),
            rays: rays_for(rng, targets),
            points,
        }
    }

    /// The geometries of the world with every vertex moved a little.
    pub fn moved(&self) -> Vec<Geometry<'static>> {
        let mut world = self.world.clone();
        let mut rng = Rng::new(77);
        let mut next = |at: &mut [f32; 3]| *at = shifted(*at, rng.point(0.01));
        for geometry in &mut world {
            match geometry {
                Geometry::Triangles(mesh) => mesh.positions.to_mut().iter_mut().for_each(&mut next),
                Geometry::Quads(mesh) => mesh.positions.to_mut().iter_mut().for_each(&mut next),
                Geometry::Spheres(all) => {
                    (all.to_mut().iter_mut()).for_each(|one| next(&mut one.center))
                }
                Geometry::Disks(all) => {
                    (all.to_mut().iter_mut()).for_each(|one| next(&mut one.center))
                }
                _ => {}
            }
        }
        world
    }
}

fn shifted(at: [f32; 3], by: [f32; 3]) -> [f32; 3] {
    core::array::from_fn(|axis| at[axis] + by[axis])
}

/// Rays of a camera, between surfaces, along axes, and of the other kinds that testkit has, valid or not.
fn rays_for(rng: &mut Rng, targets: &Mesh) -> Vec<Ray> {
    const SIDE: usize = 20;
    let plain = |ray: TestRay| Ray {
        org: ray.org,
        dir: ray.dir,
        tnear: ray.tnear,
        tfar: ray.tfar,
    };
    let mut all: Vec<Ray> = (rays::around(rng, targets, 700).into_iter().map(plain)).collect();
    all.extend(rays::bundles(rng, targets, 300).into_iter().map(plain));
    let bounds = Aabb::around(&targets.positions);
    let at = |share: [f32; 3]| -> [f32; 3] {
        core::array::from_fn(|i| bounds.min[i] + share[i] * (bounds.max[i] - bounds.min[i]))
    };
    for pixel in 0..SIDE * SIDE {
        let [x, y] = [pixel % SIDE, pixel / SIDE].map(|i| (i as f32 + 0.5) / SIDE as f32);
        let (eye, film) = (at([-0.5, -0.7, 1.5]), at([x, 0.4 * y + 0.3, 0.8 - 0.9 * y]));
        all.push(Ray {
            tfar: f32::INFINITY,
            ..Ray::between(eye, film)
        });
    }
    all
}

fn triangles(mesh: &Mesh) -> Geometry<'static> {
    Geometry::triangles(mesh.positions.clone(), mesh.indices.clone())
}

/// Pairs of triangles as quads: of all shapes, flat or not.
fn pairs(mesh: &Mesh) -> Geometry<'static> {
    let quads = mesh.indices.chunks_exact(2);
    let quads = quads.map(|pair| [pair[0][0], pair[0][1], pair[1][0], pair[0][2]]);
    Geometry::quads(mesh.positions.clone(), quads.collect::<Vec<_>>())
}

fn together(meshes: &[&Mesh]) -> Mesh {
    let mut all = mesh::empty(&mut Rng::new(0), 0);
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(&mesh.positions);
        all.indices.extend(
            mesh.indices
                .iter()
                .map(|corners| corners.map(|v| v + first)),
        );
    }
    all
}

fn city(rng: &mut Rng) -> Scene {
    let shapes = builtin::city(0).shapes;
    let mut world = Vec::new();
    let mut targets = mesh::empty(rng, 0);
    for shape in &shapes {
        if let antumbra_scene::Geometry::Mesh(mesh) = &shape.geometry {
            world.push(Geometry::triangles(
                mesh.positions.clone(),
                mesh.indices.clone(),
            ));
            let first = targets.positions.len() as u32;
            targets.positions.extend(&mesh.positions);
            // Not the ground, which is far larger than the rest.
            if mesh.indices.len() > 2 {
                let corners = mesh
                    .indices
                    .iter()
                    .map(|corners| corners.map(|v| v + first));
                targets.indices.extend(corners);
            }
        }
    }
    Scene::of(rng, world, &targets)
}

fn quads(rng: &mut Rng) -> Scene {
    let meshes = [
        mesh::bumpy_grid(rng, 4000),
        mesh::axis_aligned(rng, 1200),
        mesh::soup(rng, 400),
        mesh::coincident(rng, 40),
    ];
    let world = meshes.each_ref().map(pairs).to_vec();
    Scene::of(rng, world, &together(&meshes.each_ref()))
}

/// Curves of every basis, and a chain.
fn curve_geometries(rng: &mut Rng, count: usize) -> (Vec<Geometry<'static>>, Mesh) {
    let mut targets = mesh::soup(rng, count);
    let mut geometries = Vec::new();
    for basis in [
        CurveBasis::Bezier,
        CurveBasis::BSpline,
        CurveBasis::CatmullRom,
    ] {
        let mut points = Vec::new();
        for triangle in &targets.indices {
            let [a, b, c] = triangle.map(|v| targets.positions[v as usize]);
            for [x, y, z] in [a, b, c, shifted(a, rng.point(0.2))] {
                points.push([x, y, z, rng.range(0.001, 0.02)]);
            }
        }
        let first: Vec<u32> = (0..points.len() as u32).step_by(4).collect();
        let cubic = Curves::cubic(&points, &first, basis, 5e-3).expect("control points");
        geometries.push(Geometry::curves(cubic.curves));
        targets
            .positions
            .iter_mut()
            .for_each(|at| *at = shifted(*at, rng.point(0.1)));
    }
    let chain: Vec<_> = (targets.positions.iter().step_by(9))
        .map(|&[x, y, z]| [x, y, z, rng.range(0.0, 0.01)])
        .collect();
    geometries.push(Geometry::curves(Curves::chain(chain)));
    (geometries, targets)
}

fn curves(rng: &mut Rng) -> Scene {
    let (world, targets) = curve_geometries(rng, 40);
    Scene::of(rng, world, &targets)
}

fn spheres(rng: &mut Rng, centers: &[[f32; 3]], most: f32) -> Geometry<'static> {
    let radius = |rng: &mut Rng| most * rng.unit() * rng.unit();
    let sphere = |&center: &[f32; 3]| Sphere {
        center,
        radius: radius(rng),
    };
    Geometry::spheres(centers.iter().map(sphere).collect::<Vec<_>>())
}

fn disks(rng: &mut Rng, centers: &[[f32; 3]], most: f32) -> Geometry<'static> {
    let disk = |&center: &[f32; 3]| Disk {
        center,
        normal: rng.direction(),
        radius: most * rng.unit(),
    };
    Geometry::disks(centers.iter().map(disk).collect::<Vec<_>>())
}

fn round(rng: &mut Rng) -> Scene {
    let targets = mesh::soup(rng, 1500);
    let [a, b, c] = [
        &targets.positions[..2000],
        &targets.positions[2000..2020],
        &targets.positions[2000..],
    ];
    let world = vec![
        spheres(rng, a, 0.06),
        spheres(rng, b, 0.4),
        disks(rng, c, 0.06),
        disks(rng, b, 0.3),
    ];
    Scene::of(rng, world, &targets)
}

/// Boxes, as the user would write them.
#[derive(Debug)]
struct Boxes(Vec<Aabb>);

impl UserGeometry for Boxes {
    fn bounds(&self, prim_id: u32) -> Aabb {
        self.0[prim_id as usize]
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let Aabb { min, max } = self.0[prim_id as usize];
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for axis in 0..3 {
            let [low, high] = [min, max].map(|at| (at[axis] - ray.org[axis]) / ray.dir[axis]);
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        let t = if near > ray.tnear { near } else { far };
        (near <= far && t > ray.tnear && t < ray.tfar).then(|| UserHit::new(t, near, far))
    }

    fn closest_point(&self, prim_id: u32, point: [f64; 3], to_world: &Placed) -> Option<[f64; 3]> {
        let Aabb { min, max } = self.0[prim_id as usize];
        let middle: [f64; 3] =
            core::array::from_fn(|i| 0.5 * (f64::from(min[i]) + f64::from(max[i])));
        let place = to_world.map(|[a, b, c, d]| a * middle[0] + b * middle[1] + c * middle[2] + d);
        // Some way towards the point: a place that depends on it.
        Some(core::array::from_fn(|i| {
            place[i] + 1e-3 * (point[i] - place[i]).clamp(-1.0, 1.0)
        }))
    }

    fn normal(&self, prim_id: u32, _: &Ray, hit: &UserHit) -> Option<[f32; 3]> {
        (!prim_id.is_multiple_of(3)).then_some([1.0, hit.t, 2.0])
    }
}

type Placed = [[f64; 4]; 3];

fn boxes(rng: &mut Rng, centers: &[[f32; 3]]) -> Geometry<'static> {
    let around = |&center: &[f32; 3]| {
        let half = rng.point(0.04).map(f32::abs);
        Aabb::new(shifted(center, half.map(|x| -x)), shifted(center, half))
    };
    let boxes: Vec<_> = centers.iter().map(around).collect();
    Geometry::user(boxes.len() as u32, Arc::new(Boxes(boxes)))
}

fn user(rng: &mut Rng) -> Scene {
    let targets = mesh::soup(rng, 800);
    let [a, b] = [&targets.positions[..2000], &targets.positions[2000..]];
    let world = vec![
        boxes(rng, a),
        boxes(rng, b),
        triangles(&mesh::soup(rng, 50)),
    ];
    Scene::of(rng, world, &targets)
}

/// Stripes of three opacities, and how much is said about them: nothing, coverage, or patterns.
#[derive(Debug)]
struct Stripes(u32);

impl Opacity for Stripes {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        [0.0, 1.0, 0.5, 1.0][(candidate.u * 4.0).min(3.0) as usize]
    }

    fn coverage(&self, _: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        if self.0 == 0 {
            return Coverage::Unknown;
        }
        let [low, high] =
            [f32::min, f32::max].map(|of| of(of(corners[0][0], corners[1][0]), corners[2][0]));
        match ((low - 1e-3) * 4.0 >= 3.0, (high + 1e-3) * 4.0 < 1.0) {
            (true, _) => Coverage::Opaque,
            (_, true) => Coverage::Clear,
            _ => Coverage::Mixed,
        }
    }

    fn pattern(&self, prim_id: u32) -> Option<Pattern> {
        (self.0 == 2).then_some(Pattern([u64::from(prim_id % 2), 0, 0, 0]))
    }
}

fn cut(mesh: &Mesh, kind: u32) -> Geometry<'static> {
    Geometry::cutouts(
        mesh.positions.clone(),
        mesh.indices.clone(),
        Arc::new(Stripes(kind)),
    )
}

fn cutouts(rng: &mut Rng) -> Scene {
    let meshes = [(); 4].map(|()| mesh::soup(rng, 500));
    let [a, b, c, d] = &meshes;
    let world = vec![cut(a, 0), cut(b, 1), cut(c, 2), triangles(d)];
    Scene::of(rng, world, &together(&meshes.each_ref()))
}

/// Turned, scaled by a positive number for each axis, and moved.
fn transform(rng: &mut Rng, way: f32) -> Transform {
    let [x, y, z] = rng.direction();
    let w = rng.range(-1.0, 1.0);
    let s = 2.0 / (x * x + y * y + z * z + w * w);
    let turned = [
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - z * w),
            s * (x * z + y * w),
        ],
        [
            s * (x * y + z * w),
            1.0 - s * (x * x + z * z),
            s * (y * z - x * w),
        ],
        [
            s * (x * z - y * w),
            s * (y * z + x * w),
            1.0 - s * (x * x + y * y),
        ],
    ];
    let (scale, to) = ([(); 3].map(|()| rng.range(0.1, 0.5)), rng.point(way));
    core::array::from_fn(|i| {
        let [a, b, c] = turned[i];
        [a * scale[0], b * scale[1], c * scale[2], to[i]]
    })
}

fn place(rng: &mut Rng, object: u32) -> Instance {
    Instance::new(object, transform(rng, 1.0))
}

/// Objects of several kinds, placed in the world and in each other.
fn placed(rng: &mut Rng, scene: Scene, geometries: Vec<Geometry<'static>>) -> Scene {
    let objects: Vec<_> = geometries.into_iter().map(|one| vec![one]).collect();
    let count = objects.len() as u32;
    let mut world: Vec<_> = (0..5 * count).map(|i| place(rng, i % count)).collect();
    // In the same place twice: every distance is a tie.
    world.push(world[0].clone());
    world.extend((0..6).map(|i| place(rng, count + i % 2)));
    let mut inside = vec![Vec::new(); objects.len()];
    inside.push((0..3).map(|i| place(rng, i % count)).collect());
    inside.push((0..2).map(|i| place(rng, count - i)).collect());
    let nested = NestedInstances::new(&world, &inside, |object| object < count);
    let instances = nested.expect("no circles").instances().to_vec();
    Scene {
        objects,
        instances,
        ..scene
    }
}

fn instances(rng: &mut Rng) -> Scene {
    let [ground, a, b, c] = [200, 300, 300, 200].map(|size| mesh::soup(rng, size));
    let mut objects = vec![triangles(&a), pairs(&b), triangles(&mesh::icosphere(2))];
    objects.push(spheres(rng, &c.positions, 0.1));
    let scene = Scene::of(rng, vec![triangles(&ground)], &ground);
    placed(rng, scene, objects)
}

fn mixed(rng: &mut Rng) -> Scene {
    let meshes = [
        mesh::soup(rng, 400),
        mesh::coincident(rng, 60),
        mesh::slivers(rng, 100),
        mesh::axis_aligned(rng, 400),
    ];
    let mut kinds = |size: usize| {
        let soup = mesh::soup(rng, size);
        let mut geometries = vec![cut(&soup, 1), cut(&soup, 2)];
        geometries.push(spheres(rng, &soup.positions, 0.1));
        geometries.push(disks(rng, &soup.positions[..size], 0.1));
        geometries.push(boxes(rng, &soup.positions[size..]));
        geometries.push(curve_geometries(rng, size / 8).0.swap_remove(1));
        geometries
    };
    let (mut world, objects) = (kinds(150), kinds(60));
    world.extend(meshes[..3].iter().map(triangles));
    world.push(pairs(&meshes[3]));
    let scene = Scene::of(rng, world, &together(&meshes.each_ref()));
    placed(rng, scene, objects)
}

/// Coordinates of a map: rounded to floats as they are, and around an origin nearby.
fn far(rng: &mut Rng) -> Scene {
    let away = [487_300.0, 5_479_200.0, 310.0f64];
    let [grid, soup] = [mesh::bumpy_grid(rng, 2000), mesh::soup(rng, 500)];
    let global = |at: &[f32; 3]| core::array::from_fn(|i| f64::from(at[i]) * 50.0 + away[i]);
    let positions: Vec<[f64; 3]> = grid.positions.iter().map(global).collect();
    // Half way, so that local coordinates are large as well.
    let local = LocalOrigin::middle(&[away, [0.0, 0.0, 0.0], positions[0]]);
    let moved = |mesh: &Mesh| Mesh {
        positions: mesh
            .positions
            .iter()
            .map(|at| local.local(global(at)))
            .collect(),
        ..mesh.clone()
    };
    let world = vec![
        Geometry::triangles_f64(&positions, grid.indices.clone(), &local),
        triangles(&moved(&soup)),
    ];
    let targets = moved(&together(&[&grid, &soup]));
    let mut scene = Scene::of(rng, world, &targets);
    let ends: Vec<[f64; 3]> = (0..400).map(|_| global(&rng.point(1.5))).collect();
    let between = ends
        .chunks_exact(2)
        .map(|ends| local.between(ends[0], ends[1]));
    scene.rays.extend(between);
    scene
}

/// Meshes and instances that move, beside others that do not.
pub fn moving() -> Moving {
    let rng = &mut Rng::new(10);
    let [shape, still, veil] = [600, 200, 100].map(|size| mesh::soup(rng, size));
    let mut keys = vec![shape.positions.clone()];
    while keys.len() < 3 {
        let way = rng.point(0.5);
        let moved = keys[keys.len() - 1]
            .iter()
            .map(|at| shifted(shifted(*at, way), rng.point(0.1)));
        let moved = moved.collect();
        keys.push(moved);
    }
    let mut world = vec![Geometry::moving(keys, shape.indices.clone())];
    world.extend([triangles(&still), cut(&veil, 1), pairs(&veil)]);
    world.push(spheres(rng, &still.positions[..60], 0.1));
    let objects = vec![
        vec![triangles(&veil)],
        vec![spheres(rng, &veil.positions, 0.2)],
    ];
    let path = |number: u32| {
        let keys = if number.is_multiple_of(4) { 1 } else { 3 };
        Instance::moving(number % 2, (0..keys).map(|_| transform(rng, 1.0)))
    };
    let instances = (0..16).map(path).collect();
    let mut rays = rays_for(rng, &together(&[&shape, &still]));
    rays.extend((0..600).map(|_| Ray::between(rng.point(2.0), rng.point(2.0))));
    let few = [0.0, 1.0, 0.5, 0.25, -3.0, 7.0, f32::NAN];
    let time = |_| match rng.below(12) {
        index if index < few.len() => few[index],
        _ => rng.unit(),
    };
    let times = rays.iter().map(time).collect();
    let scene = Scene {
        world,
        objects,
        instances,
        rays,
        points: Vec::new(),
    };
    Moving { scene, times }
}
