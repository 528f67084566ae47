//! Builders x collapses x orders equal brute force, ray by ray, bit for bit, on geometry nice and nasty. They know nothing
//! of each other, so each row of a list comes in turns with those of the others, with every width and instruction set.

use std::collections::HashSet;
use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity};
use antumbra::shapes::Sphere;
use antumbra::{Brute, Bvh, Geometry, Hit, Instance, Isa, Primitives, Ray, Recipe, Width};
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS, engine};

use crate::{geometry, kernel_ray};

/// Open on one side of the diagonal.
#[derive(Debug)]
struct Half;

impl Opacity for Half {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        f32::from(u8::from(candidate.u > candidate.v))
    }
}

fn cutouts(mesh: &Mesh) -> Geometry<'_> {
    Geometry::cutouts(&mesh.positions[..], &mesh.indices[..], Arc::new(Half))
}

/// Everything is compared by its bits.
fn bits(hit: Option<Hit>) -> Option<([u32; 3], [u32; 3])> {
    hit.map(|hit| {
        (
            [hit.t, hit.u, hit.v].map(f32::to_bits),
            [hit.geom_id, hit.prim_id, hit.inst_id],
        )
    })
}

/// Recipes of every builder with every collapse. Orders and widths take turns, which the next call goes on with.
struct Turns(usize);

impl Turns {
    fn recipes(&mut self) -> Vec<Recipe> {
        let mut all = Vec::new();
        for builder in BUILDERS {
            for collapse in COLLAPSES {
                let turn = self.0;
                self.0 += 1;
                let recipe = Recipe::default().builder(builder).collapse(collapse);
                let width = Width::ALL[turn % Width::ALL.len()];
                all.push(
                    recipe
                        .order(ORDERS[turn % ORDERS.len()])
                        .engine(engine(Isa::best(), width)),
                );
            }
        }
        all
    }
}

/// Trees that learn from some of the rays answer all of them as brute force does.
fn check(name: &str, primitives: &Primitives, rays: &[Ray], turns: &mut Turns) {
    let brute = Brute::new(primitives);
    let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
    let hits: Vec<_> = rays.iter().map(|ray| bits(brute.intersect(ray))).collect();
    let all_hits: Vec<_> = rays.iter().map(|ray| brute.query(ray).all_hits()).collect();
    for recipe in turns.recipes() {
        let Recipe {
            builder,
            collapse,
            order,
            ..
        } = recipe;
        let width = recipe.engine.width();
        let mut bvh = Bvh::learn(primitives, &rays[..rays.len() / 2], &recipe).expect("a tree");
        for isa in Isa::available() {
            engine(isa, bvh.width()).run(&mut bvh).expect("its width");
            let tree = format!("{builder} {collapse} {order} x{width} {}", isa.level());
            bvh.validate()
                .unwrap_or_else(|broken| panic!("{name}, {tree}: {broken}"));
            let mut found = (vec![false; rays.len()], vec![None; rays.len()]);
            bvh.batch(rays).occluded_into(&mut found.0);
            bvh.batch(rays).intersect_into(&mut found.1);
            for (index, ray) in rays.iter().enumerate() {
                let place = || format!("{name}, {tree}, ray {index}: {ray:?}");
                assert_eq!(found.0[index], occluded[index], "{}", place());
                assert_eq!(bits(found.1[index]), hits[index], "{}", place());
                assert_eq!(bvh.occluded(ray), occluded[index], "single: {}", place());
                assert_eq!(bits(bvh.intersect(ray)), hits[index], "single: {}", place());
                // Slower than the others together.
                if index.is_multiple_of(8) {
                    let found = bvh.query(ray).all_hits();
                    assert_eq!(found, all_hits[index], "all: {}", place());
                }
            }
        }
    }
}

#[test]
fn every_pair_of_rows_takes_its_turn() {
    let mut turns = Turns(0);
    let recipes: Vec<_> = mesh::ALL.iter().flat_map(|_| turns.recipes()).collect();
    let pairs = |pair: fn(&Recipe) -> (String, String)| {
        recipes.iter().map(pair).collect::<HashSet<_>>().len()
    };
    let [builders, collapses, orders, widths] = [
        BUILDERS.len(),
        COLLAPSES.len(),
        ORDERS.len(),
        Width::ALL.len(),
    ];
    assert_eq!(
        pairs(|one| (one.builder.to_string(), one.collapse.to_string())),
        builders * collapses
    );
    assert_eq!(
        pairs(|one| (one.builder.to_string(), one.engine.width().to_string())),
        builders * widths
    );
    assert_eq!(
        pairs(|one| (one.collapse.to_string(), one.order.to_string())),
        collapses * orders
    );
    assert_eq!(
        pairs(|one| (one.collapse.to_string(), one.engine.width().to_string())),
        collapses * widths
    );
    assert_eq!(
        pairs(|one| (one.order.to_string(), one.engine.width().to_string())),
        orders * widths
    );
}

/// Triangles, cut-outs and spheres, in the world and in objects.
#[test]
fn every_tree_equals_brute_force() {
    let seed = 31;
    let mut rng = Rng::new(seed);
    let mut turns = Turns(0);
    for generate in mesh::ALL {
        let [mesh, holes] = [40, 25].map(|size| generate(&mut rng, size));
        let spheres: Vec<_> = (0..12)
            .map(|_| Sphere {
                center: rng.point(1.0),
                radius: 0.3 * rng.unit(),
            })
            .collect();
        let list = [
            geometry(&mesh),
            cutouts(&holes),
            Geometry::spheres(&spheres[..]),
        ];
        let objects = [list.to_vec(), vec![cutouts(&mesh)]];
        let instances: Vec<_> = (0..12)
            .map(|index| {
                let transform =
                    std::array::from_fn(|_| std::array::from_fn(|_| rng.range(-0.8, 0.8)));
                Instance::new(index % 2, transform)
            })
            .collect();
        let primitives =
            Primitives::with_instances(&list, &objects, &instances).expect("indices in range");
        let mut rays = rays::around(&mut rng, &mesh, 90);
        rays.extend(rays::bundles(&mut rng, &mesh, 90));
        let rays: Vec<_> = rays.iter().map(kernel_ray).collect();
        let name = format!("seed {seed}, {}", mesh.name);
        check(&name, &primitives, &rays, &mut turns);
    }
}

/// What is unfit is dropped before any builder sees it; what is extreme is built over.
#[test]
fn every_builder_takes_any_input() {
    let mut rng = Rng::new(26);
    let (spoiled, _) = mesh::spoiled(&mut rng, 200);
    let soup = mesh::soup(&mut rng, 200);
    let huge = soup.map("huge", |p| p.map(|x| x * 3e37));
    let tiny = soup.map("tiny", |p| p.map(|x| x * 1e-37));
    let flat = soup.map("flat", |[x, y, _]| [x, y, -0.0]);
    let line = soup.map("line", |[x, _, _]| [x, x, x]);
    let coincident = mesh::coincident(&mut rng, 200);
    let mut turns = Turns(0);
    for mesh in [spoiled, huge, tiny, flat, line, coincident] {
        for size in [0.0, 1.0, 1e19] {
            let spheres = (0..20).map(|_| Sphere {
                center: rng.point(size),
                radius: 0.1 * size,
            });
            let geometries = [
                geometry(&mesh),
                Geometry::spheres(spheres.collect::<Vec<_>>()),
            ];
            let primitives = Primitives::new(&geometries).expect("indices in range");
            let rays: Vec<_> = (0..60)
                .map(|_| Ray::new(rng.point(1.5), rng.direction()))
                .collect();
            check(mesh.name, &primitives, &rays, &mut turns);
        }
    }
}
