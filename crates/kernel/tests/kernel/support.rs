//! What the kernel's tests share.

use antumbra::{
    AnyBvh, BinaryTree, Builder, CostModel, Geometry, Isa, Order, Primitives, Ray, Width,
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
