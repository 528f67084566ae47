//! What the kernel's tests share.

use std::sync::Arc;

use antumbra::{
    AnyBvh, BinaryTree, Brute, Builder, Collapse, CostModel, Geometry, Hit, Isa, Learning, Opacity,
    Order, Primitives, Ray, TreeLog, Width,
};
use antumbra_testkit::{Mesh, Rng, TestRay};

/// Number of random cases of a property: `ANTUMBRA_CASES`, or else `few`.
pub fn cases(few: u32) -> u32 {
    let told = std::env::var("ANTUMBRA_CASES").ok();
    told.map_or(few, |text| text.parse().expect("a number of cases"))
}

/// The mesh as kernel geometry.
pub fn geometry(mesh: &Mesh) -> Geometry<'_> {
    Geometry::triangles(&mesh.positions[..], &mesh.indices[..])
}

/// The same, with holes.
pub fn cutouts(mesh: &Mesh, opacity: Arc<dyn Opacity>) -> Geometry<'_> {
    Geometry::cutouts(&mesh.positions[..], &mesh.indices[..], opacity)
}

/// Two triangles that fill the square from -1 to 1 at a height.
pub fn square(height: f32) -> Mesh {
    let corner = |x: f32, y: f32| [x, y, height];
    Mesh {
        name: "square",
        positions: vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ],
        indices: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// Upward rays through the square, no two the same.
pub fn upwards(rng: &mut Rng, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|_| {
            let [x, y, _] = rng.point(0.99);
            Ray::new([x, y, 0.0], [0.0, 0.0, 1.0])
        })
        .collect()
}

/// The oracle.
pub fn brute(geometries: &[Geometry<'_>]) -> Brute {
    Brute::new(Primitives::new(geometries).expect("indices in range"))
}

/// The test rays as kernel rays.
pub fn kernel_rays(rays: &[TestRay]) -> Vec<Ray> {
    rays.iter()
        .map(
            |&TestRay {
                 org,
                 dir,
                 tnear,
                 tfar,
             }| Ray {
                org,
                dir,
                tnear,
                tfar,
            },
        )
        .collect()
}

/// Every builder and every collapse, but not every pair of them: they know nothing of each other.
pub fn builders_and_collapses() -> impl Iterator<Item = (Builder, Collapse)> {
    let collapses = Collapse::ALL.map(|collapse| (Builder::default(), collapse));
    let builders = Builder::ALL
        .into_iter()
        .zip(Collapse::ALL.into_iter().cycle());
    collapses.into_iter().chain(builders.skip(1))
}

/// The same of builders and widths.
pub fn builders_and_widths() -> impl Iterator<Item = (Builder, Width)> {
    let widths = Width::ALL.map(|width| (Builder::default(), width));
    let builders = Builder::ALL.into_iter().zip(Width::ALL.into_iter().cycle());
    widths.into_iter().chain(builders.skip(1))
}

/// A tree of every builder, width and order, traced at each level in turn. Learned orders learn from
/// `rays`. Orders and builders know nothing of each other, so only the first builder has every order with every
/// width; the others have one order after the other.
pub fn for_every_tree(primitives: &Primitives, rays: &[Ray], mut check: impl FnMut(&AnyBvh, &str)) {
    let mut turns = Order::ALL.into_iter().cycle();
    // An interpreter takes its time.
    let builders = if cfg!(miri) { 1 } else { Builder::ALL.len() };
    for builder in Builder::ALL.into_iter().take(builders) {
        let tree = BinaryTree::build(primitives, builder);
        for width in Width::ALL {
            let built = AnyBvh::collapse(primitives, &tree, width, Isa::best());
            let orders = match builder {
                Builder::BinnedSah if !cfg!(miri) => Order::ALL.to_vec(),
                _ => turns.by_ref().take(1).collect(),
            };
            for order in orders {
                let mut bvh = built.clone();
                let log = order.log_kind().map(|kind| {
                    let mut log = bvh.new_log(kind, 7);
                    let mut occluded = vec![false; rays.len()];
                    let mut costs = vec![Default::default(); rays.len()];
                    bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
                    log
                });
                let plan = bvh
                    .plan(order, log.as_ref(), &CostModel::default())
                    .expect("a log");
                bvh.apply(&plan);
                for isa in Isa::available() {
                    bvh.set_isa(isa);
                    check(&bvh, &format!("{builder} x{width} {order} {}", isa.level()));
                }
            }
        }
    }
}

/// Asserts that the trees of every builder, driven by `rays` if that is what drives it, answer every ray as brute force
/// does, in every collapse.
pub fn equals_brute_by_builders(name: &str, primitives: &Primitives, rays: &[Ray]) {
    let brute = Brute::new(primitives.clone());
    for builder in Builder::ALL {
        let tree = BinaryTree::build_for(primitives, builder, rays);
        let mut log = TreeLog::new(&tree);
        log.add(primitives, &tree, rays, rays.len() as f32);
        for (collapse, width) in Collapse::ALL.into_iter().zip([4, 8, 16, 8]) {
            let learning = Learning {
                collapse,
                ..Default::default()
            };
            let width = Width::from_lanes(width).expect("a width");
            let bvh =
                AnyBvh::collapse_logged(primitives, &tree, &log, &learning, width, Isa::best());
            let place = |index: usize| format!("{name}, {builder} {collapse}: {:?}", rays[index]);
            bvh.validate()
                .unwrap_or_else(|broken| panic!("{name}, {builder} {collapse}: {broken}"));
            let mut occluded = vec![false; rays.len()];
            let mut hits = vec![None; rays.len()];
            bvh.occluded_batch(rays, &mut occluded);
            bvh.intersect_batch(rays, &mut hits);
            for (index, ray) in rays.iter().enumerate() {
                assert_eq!(occluded[index], brute.occluded(ray), "{}", place(index));
                assert_eq!(
                    bits(hits[index]),
                    bits(brute.intersect(ray)),
                    "{}",
                    place(index)
                );
            }
        }
    }
}

/// Everything but NaN is compared by its bits.
pub fn bits(hit: Option<Hit>) -> Option<([u32; 3], [u32; 3])> {
    hit.map(|hit| {
        (
            [hit.t, hit.u, hit.v].map(f32::to_bits),
            [hit.geom_id, hit.prim_id, hit.inst_id],
        )
    })
}

/// Asserts that every tree answers every ray as brute force does, bit for bit, one by one and in batches.
pub fn equals_brute(name: &str, primitives: &Primitives, rays: &[Ray]) {
    let brute = Brute::new(primitives.clone());
    let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
    let hits: Vec<_> = rays.iter().map(|ray| brute.intersect(ray)).collect();
    for_every_tree(primitives, rays, |bvh, tree| {
        bvh.validate()
            .unwrap_or_else(|broken| panic!("{name}, {tree}: {broken}"));
        let mut found_occluded = vec![false; rays.len()];
        let mut found_hits = vec![None; rays.len()];
        bvh.occluded_batch(rays, &mut found_occluded);
        bvh.intersect_batch(rays, &mut found_hits);
        let mut tracer = bvh.tracer();
        for (index, ray) in rays.iter().enumerate() {
            let place = || format!("{name}, {tree}, ray {index}: {ray:?}");
            assert_eq!(found_occluded[index], occluded[index], "{}", place());
            assert_eq!(bits(found_hits[index]), bits(hits[index]), "{}", place());
            assert_eq!(tracer.occluded(ray), occluded[index], "single: {}", place());
            assert_eq!(
                bits(tracer.intersect(ray)),
                bits(hits[index]),
                "single: {}",
                place()
            );
        }
    });
}
