//! What the kernel's tests share.

use antumbra::{
    AnyBvh, BinaryTree, Brute, Builder, CostModel, Geometry, Hit, Isa, Order, Primitives, Ray,
    Width,
};
use antumbra_testkit::{Mesh, TestRay};

/// The mesh as kernel geometry.
pub fn geometry(mesh: &Mesh) -> Geometry<'_> {
    Geometry::triangles(&mesh.positions[..], &mesh.indices[..])
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

/// A tree of every builder, width and order, traced at each level in turn. Learned orders learn from
/// `rays`.
pub fn for_every_tree(primitives: &Primitives, rays: &[Ray], mut check: impl FnMut(&AnyBvh, &str)) {
    for builder in Builder::ALL {
        let tree = BinaryTree::build(primitives, builder);
        for width in Width::ALL {
            let built = AnyBvh::collapse(primitives, &tree, width, Isa::best());
            for order in Order::ALL {
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
