//! Every engine against a plain loop, on two levels with holes.

use antumbra_trees::engine;
use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::shapes::TriangleMesh;
use antumbra::{Bvh, Geometry, Instance, Isa, Ray, Recipe, Width};
use antumbra_render::Lowered;

use super::engine::{Engine, Query, TreeLabel};
use super::ours::{Api, Ours, Tree};
use super::rival::{Rival, Variant};
use crate::embree::{self, Device, Embree, Scene, SceneFlags};
use crate::harness::Answers;

/// Holes in the squares of a checkerboard; closest hits see one more hole than occlusion does.
#[derive(Debug)]
struct Checker;

impl Checker {
    fn is_hole(u: f64, v: f64, query: QueryKind) -> bool {
        let squares = (4.0 * u).floor() + (4.0 * v).floor();
        squares % 2.0 != 0.0 || query == QueryKind::Intersect && u + v < 0.2
    }
}

impl Opacity for Checker {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        let (u, v) = (f64::from(candidate.u), f64::from(candidate.v));
        if Self::is_hole(u, v, candidate.query) {
            0.0
        } else {
            1.0
        }
    }
}

/// Random numbers (splitmix64).
struct Random(u64);

impl Random {
    /// A number from -1 to 1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (bits >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(&mut self) -> [f32; 3] {
        [self.next(), self.next(), self.next()]
    }

    /// Some triangles in a cube of side 2.
    fn mesh(&mut self, triangles: u32, size: f32) -> TriangleMesh<'static> {
        let mut positions = Vec::new();
        for _ in 0..triangles {
            let center = self.point();
            for _ in 0..3 {
                let offset = self.point();
                positions.push(std::array::from_fn(|axis| {
                    center[axis] + size * offset[axis]
                }));
            }
        }
        let indices = (0..triangles).map(|index| [0, 1, 2].map(|corner| 3 * index + corner));
        TriangleMesh::new(positions, indices.collect::<Vec<_>>())
    }

    fn holed_mesh(&mut self, triangles: u32) -> Geometry<'static> {
        let mesh = self.mesh(triangles, 0.8);
        Geometry::cutouts(mesh.positions, mesh.indices, Arc::new(Checker))
    }

    /// A placement with mirrors, shears and uneven scales, none of them nearly flat.
    fn instance(&mut self, object: u32) -> Instance {
        loop {
            let transform = [(); 3].map(|()| {
                let [x, y, z] = self.point();
                [x, y, z, 2.0 * self.next()]
            });
            let [[a, b, c, _], [d, e, f, _], [g, h, i, _]] = transform;
            let det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
            if det.abs() > 0.2 {
                return Instance::new(object, transform);
            }
        }
    }

    fn ray(&mut self) -> Ray {
        let mut ray = Ray::new(self.point().map(|x| 2.0 * x), self.point());
        if self.next() > 0.0 {
            ray.tfar = 4.0 + 3.0 * self.next();
        }
        ray
    }
}

fn model(random: &mut Random) -> Lowered<'static> {
    let mut mesh = |triangles, size| Geometry::Triangles(random.mesh(triangles, size));
    let [first, second, third] = [mesh(30, 0.8), mesh(50, 0.6), mesh(20, 0.6)];
    Lowered {
        world: vec![first, random.holed_mesh(30)],
        objects: vec![vec![second], vec![third, random.holed_mesh(40)]],
        instances: [0, 1, 1, 0, 1, 0]
            .map(|object| random.instance(object))
            .into(),
    }
}

/// Where a ray hits a triangle: (t, u, v), by Cramer's rule.
fn meet(ray: &Ray, corners: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let minus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| a[axis] - b[axis]);
    let det = |[a, b, c]: [f64; 3], [d, e, f]: [f64; 3], [g, h, i]: [f64; 3]| {
        a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    };
    let (org, dir) = (ray.org.map(f64::from), ray.dir.map(f64::from));
    let back = dir.map(|x| -x);
    let (first, second) = (minus(corners[1], corners[0]), minus(corners[2], corners[0]));
    let from = minus(org, corners[0]);
    let all = det(first, second, back);
    let [u, v, t] = [
        det(from, second, back),
        det(first, from, back),
        det(first, second, from),
    ]
    .map(|part| part / all);
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    let within = t > f64::from(ray.tnear) && t < f64::from(ray.tfar);
    (inside && within).then_some([t, u, v])
}

/// The distance of the first thing in the ray's interval that the query sees.
fn first_hit(model: &Lowered, ray: &Ray, query: QueryKind) -> f32 {
    const IDENTITY: [[f32; 4]; 3] = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    let objects = (model.instances.iter())
        .map(|instance| (&model.objects[instance.object as usize], instance.transform));
    let mut first = f64::INFINITY;
    for (meshes, transform) in std::iter::once((&model.world, IDENTITY)).chain(objects) {
        for geometry in meshes {
            let Geometry::Triangles(mesh) = geometry else {
                continue;
            };
            for triangle in &*mesh.indices {
                let corners = triangle.map(|index| {
                    let [x, y, z] = mesh.positions[index as usize].map(f64::from);
                    transform.map(|row| {
                        let [a, b, c, d] = row.map(f64::from);
                        a * x + b * y + c * z + d
                    })
                });
                let Some([t, u, v]) = meet(ray, corners) else {
                    continue;
                };
                if mesh.opacity.is_none() || !Checker::is_hole(u, v, query) {
                    first = first.min(t);
                }
            }
        }
    }
    first as f32
}

/// Traces all rays in an engine; returns how many answers differ from the loop.
fn wrong(engine: &dyn Engine, query: Query, rays: &[Ray], expected: &Answers) -> Option<usize> {
    let mut work = engine.work(query, rays)?;
    work.reset();
    work.run();
    Some(work.answers().differing_from(expected, 1e-4))
}

/// Rays that may be answered otherwise: through edges of triangles or of holes, within rounding.
const DOUBTFUL: usize = 3;

#[test]
fn engines_agree_with_a_plain_loop_about_instances_and_holes() {
    let seed = 7;
    let mut random = Random(seed);
    let model = model(&mut random);
    let rays: Vec<Ray> = (0..1003).map(|_| random.ray()).collect();
    let distances = |query| -> Vec<f32> {
        rays.iter()
            .map(|ray| first_hit(&model, ray, query))
            .collect()
    };
    let occluded = distances(QueryKind::Occluded);
    let occluded = occluded.iter().map(|t| t.is_finite()).collect();
    let expected = [
        Answers::Occluded(occluded),
        Answers::Distances(distances(QueryKind::Intersect)),
    ];
    for answers in &expected {
        let share = answers.occluded_share();
        assert!((0.2..0.8).contains(&share), "{share}");
    }
    let check = |engine: &dyn Engine| {
        for (query, expected) in Query::ALL.into_iter().zip(&expected) {
            let wrong = wrong(engine, query, &rays, expected);
            let what = engine.label();
            assert!(
                wrong <= Some(DOUBTFUL),
                "seed {seed}: {query}, {what:?}: {wrong:?}"
            );
        }
    };
    let primitives = model.primitives().expect("few");
    for isa in Isa::available() {
        for width in Width::ALL {
            let options = Recipe::default().engine(engine(isa, width));
            let tree = Tree {
                bvh: Bvh::build(&primitives, &options).expect("a tree"),
                label: TreeLabel {
                    builder: "",
                    collapse: "",
                    width: width.lanes(),
                    order: "",
                },
            };
            for api in [Api::Single, Api::Batch] {
                check(&Ours { tree: &tree, api });
            }
        }
    }
    let library = std::env::var_os("ANTUMBRA_EMBREE").filter(|path| !path.is_empty());
    let Some(library) = library else {
        println!("skipped in part: no Embree");
        return;
    };
    let embree = Embree::load(library.as_ref()).expect("Embree");
    for isa in antumbra::recipe::Level::available().filter_map(embree::isa) {
        let device = Device::new(embree, Some(isa), 1).expect("a device");
        for flags in [SceneFlags::default(), SceneFlags::ROBUST] {
            let scene = Scene::build(&device, &model, flags).expect("a scene");
            let scene = &scene;
            check(&Rival {
                scene,
                variant: Variant::Default,
            });
            check(&Rival {
                scene,
                variant: Variant::Packets,
            });
        }
    }
}
