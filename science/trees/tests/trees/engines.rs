//! Widths that the kernel has no code for answer every kind of query as its own do.

use antumbra::recipe::Engine;
use antumbra::{
    Bvh, Directions, Geometry, Hit, Instance, Masks, PrimId, Primitives, Ray, Recipe, Visit,
};
use antumbra_testkit::{Rng, mesh, rays};
use antumbra_trees::engines;

use crate::{geometry, kernel_ray};

/// What a tree says to every kind of query, by kind.
fn answers(
    bvh: &Bvh,
    rays: &[Ray],
    points: &[[f32; 3]],
    times: &[f32],
) -> Vec<(&'static str, String)> {
    let batch = bvh.batch(rays).at(times);
    let hits = batch.intersect();
    let id = |hit: &Option<Hit>| hit.map_or(PrimId::NONE, PrimId::from);
    let ids: Vec<_> = hits.iter().map(id).collect();
    let odd = |_: usize, hit: &Hit| hit.prim_id % 2 == 1;
    let mut found = vec![("all", format!("{hits:?}"))];
    for (kind, batch) in [
        ("mask", batch.mask(1)),
        ("except", batch.except(&ids)),
        ("filter", batch.filter(&odd)),
        ("closed", batch.closed()),
    ] {
        found.push((
            kind,
            format!("{:?} {:?}", batch.occluded(), batch.surfaces()),
        ));
    }
    found.push((
        "lists",
        format!("{:?} {:?}", batch.all_hits(), batch.count_hits()),
    ));
    let mut visited = vec![0u32; rays.len()];
    batch.visit_hits(&mut visited, |visited, hit| {
        *visited = visited.wrapping_mul(31).wrapping_add(hit.prim_id);
        Visit::Reject
    });
    found.push(("visits", format!("{visited:?}")));
    for ((ray, time), id) in rays.iter().zip(times).zip(&ids).step_by(5) {
        let query = bvh.query(ray).at(*time);
        found.push((
            "query",
            format!("{:?} {}", query.intersect(), query.occluded()),
        ));
        let query = query.mask(1).except(*id);
        found.push((
            "masked query",
            format!("{:?} {}", query.all_hits(), query.occluded()),
        ));
    }
    let directions: Vec<_> = rays.iter().map(|ray| ray.dir).take(70).collect();
    let sky = Directions::new(&directions);
    let group = bvh.group(points, &sky);
    let mut open = vec![0; points.len() * group.words_per_row()];
    group.open_into(&mut open);
    found.push(("group", format!("{open:?}")));
    found.push(("points", format!("{:?}", bvh.points(points).closest())));
    found
}

#[test]
fn every_engine_answers_every_query() {
    let mut rng = Rng::new(48);
    let soup = mesh::soup(&mut rng, 400);
    let ball = mesh::icosphere(1);
    let place = |x: f32| {
        [
            [0.3, 0.0, 0.0, x],
            [0.0, 0.3, 0.0, 0.2],
            [0.0, 0.0, 0.3, -0.1],
        ]
    };
    let instances: Vec<_> = (0..9)
        .map(|index| Instance::new(0, place(0.3 * index as f32 - 1.0)))
        .collect();
    let still = Primitives::with_instances(&[geometry(&soup)], &[[geometry(&ball)]], &instances);
    let later: Vec<_> = soup
        .positions
        .iter()
        .map(|[x, y, z]| [x + 0.4, *y, 1.1 * z])
        .collect();
    let moving = Geometry::moving([soup.positions.clone(), later], soup.indices.clone());
    let moving = Primitives::with_instances(&[moving], &[[geometry(&ball)]], &instances);
    let own = rays::around(&mut rng, &soup, 300);
    let rays: Vec<_> = own.iter().map(kernel_ray).collect();
    let points: Vec<_> = (0..40).map(|_| rng.point(1.0)).collect();
    let times: Vec<_> = rays.iter().map(|_| rng.unit()).collect();
    for primitives in [still, moving].map(|primitives| primitives.expect("in range")) {
        let tree = |engine: Engine| {
            let recipe = Recipe::fast().engine(engine);
            let mut bvh = Bvh::build(&primitives, &recipe).expect("a tree");
            bvh.set_masks(
                Masks::new()
                    .world(vec![3])
                    .instances(vec![1, 2, 3, 1, 2, 3, 1, 2, 3]),
            );
            bvh
        };
        let expected = answers(&tree(Engine::default()), &rays, &points, &times);
        for engine in engines() {
            let found = answers(&tree(engine), &rays, &points, &times);
            for ((kind, found), (_, expected)) in found.iter().zip(&expected) {
                assert!(found == expected, "{engine:?} {kind}:\n{found}\n{expected}");
            }
        }
    }
}
