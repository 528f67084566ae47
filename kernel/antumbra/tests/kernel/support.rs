//! What the kernel's tests share.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Coverage, Opacity};
use antumbra::parts::{
    BinaryKind, BinaryNode, BinaryTree, Grow, Learning, Log, Pick, Plan, SlotOrder, Steps, Tree,
    TreeLog, binned_subtree,
};
use antumbra::recipe::{Builder, Collapse, CostModel, Engine, Order, Preset};
use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, Brute, Build, Bvh, Error, Geometry, Hit, Primitives, Ray, Recipe, Width};
use antumbra_testkit::sample::{self, pairs, triples};
use antumbra_testkit::{Mesh, Rng, TestRay};
use proptest::test_runner::{Config as ProptestConfig, RngSeed};

/// Number of random cases of a property: `ANTUMBRA_CASES`, or else `few`.
pub fn cases(few: u32) -> u32 {
    let told = std::env::var("ANTUMBRA_CASES").ok();
    told.map_or(few, |text| text.parse().expect("a number of cases"))
}

/// Settings of a property: `cases` of `few` cases, which are those of every run of the same sources.
pub fn config(few: u32) -> ProptestConfig {
    ProptestConfig {
        cases: cases(few),
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(sample::seed()),
        ..Default::default()
    }
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
    Brute::new(&Primitives::new(geometries).expect("indices in range"))
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

/// What lists say of something that plugs in.
macro_rules! row {
    ($Type:ty, $name:literal, $sentence:literal) => {
        impl antumbra::parts::Row for $Type {
            fn name(&self) -> &'static str {
                $name
            }

            fn sentence(&self) -> &'static str {
                $sentence
            }

            fn source(&self) -> Option<&'static str> {
                None
            }
        }
    };
}
pub(crate) use row;

/// A builder that plugs in and wants rays: every primitive is in two leaves if there are any rays.
struct Twice;

row!(Twice, "twice", "Every primitive in two leaves");

impl Grow for Twice {
    fn needs_rays(&self) -> bool {
        true
    }

    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree> {
        let grow = |primitives: &Primitives| {
            let count = primitives.len() as u32;
            let prims: Vec<_> = (0..count).collect();
            let half = binned_subtree(primitives, &prims, 1);
            if rays.is_empty() || count == 0 {
                return half;
            }
            let kind = BinaryKind::Inner {
                right: 1 + half.nodes.len() as u32,
            };
            let root = BinaryNode {
                kind,
                ..half.nodes[0]
            };
            let mut nodes = [&[root], &half.nodes[..], &half.nodes[..]].concat();
            for node in &mut nodes[1 + half.nodes.len()..] {
                if let BinaryKind::Leaf { first, .. } = &mut node.kind {
                    *first += count;
                }
            }
            BinaryTree::new(nodes, half.prims.repeat(2))
        };
        let objects = primitives.object_list().iter();
        [primitives].into_iter().chain(objects).map(grow).collect()
    }
}

/// A builder that has every primitive in two leaves.
pub const TWICE: Builder = Builder::Other(&Twice);

/// The builders of the kernel, and one that plugs in.
pub const BUILDERS: [Builder; 3] = [Builder::BinnedSah, Builder::Reinsertion, TWICE];

/// A child order that plugs in and looks at the ray: the nearest box first.
struct Nearest;

row!(Nearest, "nearest", "The nearest box first");

impl Plan for Nearest {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        Ok(SlotOrder::of_nothing(tree))
    }

    fn pick(&self) -> Option<&'static dyn Pick> {
        Some(&Nearest)
    }
}

impl Pick for Nearest {
    fn sort(&self, entered: &[f32], lanes: &mut [u32]) {
        lanes.sort_by(|a, b| entered[*b as usize].total_cmp(&entered[*a as usize]));
    }
}

/// A child order that looks at the ray.
pub const BY_RAY: Order = Order::Other(&Nearest);

/// The child orders of the kernel, and one that plugs in.
pub fn orders() -> Vec<Order> {
    Order::ALL.into_iter().chain([BY_RAY]).collect()
}

/// Every engine of the kernel.
pub fn ways() -> Vec<Engine> {
    Engine::all().collect()
}

/// Every engine of the kernel for trees of this width.
pub fn engines_for(width: Width) -> Vec<Engine> {
    Engine::all()
        .filter(|engine| engine.width() == width)
        .collect()
}

/// Every collapse, which sorts the children of nodes or does not.
pub fn collapses() -> Vec<(Collapse, bool)> {
    let sorts = |collapse| [(collapse, false), (collapse, true)];
    Collapse::ALL.into_iter().flat_map(sorts).collect()
}

/// Trees of every preset, builder, order, width and level, a sample of their combinations. What learns learns from `rays`.
pub fn for_every_tree(primitives: &Primitives, rays: &[Ray], mut check: impl FnMut(&Bvh, &str)) {
    let first = rays.first().map_or(0.0, |ray| ray.org[0]);
    let salt = u64::from(first.to_bits()) << 32 ^ primitives.len() as u64;
    // An interpreter takes its time.
    let most = if cfg!(miri) { 3 } else { usize::MAX };
    for (preset, engine) in pairs(salt, &Preset::ALL, &ways()).into_iter().take(most) {
        let bvh = Bvh::learn(primitives, rays, &preset.recipe().engine(engine)).expect("a tree");
        check(&bvh, &format!("preset {preset} {engine:?}"));
    }
    let trees = triples(salt, &BUILDERS, &orders(), &ways());
    for (builder, order, engine) in trees.into_iter().take(most) {
        let recipe = Recipe::default()
            .builder(builder)
            .collapse(Collapse::Area)
            .engine(engine)
            .seed(7);
        let stage = Build::new(primitives).recipe(&recipe).stage();
        let built = stage.expect("a tree").collapse(&[], &recipe, &());
        let mut bvh = built.expect("nobody stops it");
        bvh.relearn(rays, &recipe.order(order));
        check(&bvh, &format!("{builder} {engine:?} {order}"));
    }
}

/// Asserts that trees of every builder, collapse, width and level answer every ray as brute force does.
pub fn equals_brute_by_builders(name: &str, primitives: &Primitives, rays: &[Ray]) {
    let trees = triples(0, &BUILDERS, &Collapse::ALL, &ways());
    for (builder, collapse, way) in trees {
        equals_brute_by(builder, collapse, way, name, primitives, rays);
    }
}

/// Asserts that one tree, driven by `rays` if that is what drives its builder, answers every ray as brute force does.
pub fn equals_brute_by(
    builder: Builder,
    collapse: Collapse,
    engine: Engine,
    name: &str,
    primitives: &Primitives,
    rays: &[Ray],
) {
    let brute = Brute::new(primitives);
    let tree = BinaryTree::build_for(primitives, builder, rays);
    let mut log = TreeLog::new(&tree);
    log.add(primitives, &tree, rays, rays.len() as f32);
    let learning = Learning {
        collapse,
        ..Default::default()
    };
    let bvh = Bvh::collapse_logged(primitives, &tree, &log, &learning, engine);
    let name = format!("{name}, {builder} {collapse} {engine:?}");
    bvh.validate()
        .unwrap_or_else(|broken| panic!("{name}: {broken}"));
    let mut occluded = vec![false; rays.len()];
    let mut hits = vec![None; rays.len()];
    bvh.batch(rays).occluded_into(&mut occluded);
    bvh.batch(rays).intersect_into(&mut hits);
    for (index, ray) in rays.iter().enumerate() {
        let place = || format!("{name}: {ray:?}");
        assert_eq!(occluded[index], brute.occluded(ray), "{}", place());
        assert_eq!(bits(hits[index]), bits(brute.intersect(ray)), "{}", place());
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
    let brute = Brute::new(primitives);
    let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
    let hits: Vec<_> = rays.iter().map(|ray| brute.intersect(ray)).collect();
    let all_hits: Vec<_> = rays.iter().map(|ray| brute.query(ray).all_hits()).collect();
    for_every_tree(primitives, rays, |bvh, tree| {
        bvh.validate()
            .unwrap_or_else(|broken| panic!("{name}, {tree}: {broken}"));
        let mut found_occluded = vec![false; rays.len()];
        let mut found_hits = vec![None; rays.len()];
        bvh.batch(rays).occluded_into(&mut found_occluded);
        bvh.batch(rays).intersect_into(&mut found_hits);
        for (index, ray) in rays.iter().enumerate() {
            let place = || format!("{name}, {tree}, ray {index}: {ray:?}");
            assert_eq!(found_occluded[index], occluded[index], "{}", place());
            assert_eq!(bits(found_hits[index]), bits(hits[index]), "{}", place());
            assert_eq!(bvh.occluded(ray), occluded[index], "single: {}", place());
            assert_eq!(
                bits(bvh.intersect(ray)),
                bits(hits[index]),
                "single: {}",
                place()
            );
            // Slower than the others together.
            if index.is_multiple_of(4) {
                assert_eq!(
                    bvh.query(ray).all_hits(),
                    all_hits[index],
                    "all: {}",
                    place()
                );
            }
            assert_eq!(bvh.occluded(ray), occluded[index], "shared: {}", place());
            assert_eq!(
                bits(bvh.intersect(ray)),
                bits(hits[index]),
                "shared: {}",
                place()
            );
        }
    });
}

/// Triangles in stripes, opaque and clear in turn.
#[derive(Debug)]
pub struct Stripes {
    pub count: f32,
}

impl Stripes {
    fn of(&self, u: f32) -> u32 {
        (u * self.count) as u32
    }
}

impl Opacity for Stripes {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        (self.of(candidate.u) % 2) as f32
    }

    fn coverage(&self, _: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        let [a, b, c] = corners.map(|[u, _]| u);
        // Wider by what may be rounded.
        let first = self.of(a.min(b).min(c) - 1e-3);
        match (first, self.of(a.max(b).max(c) + 1e-3)) {
            (first, last) if first != last => Coverage::Mixed,
            (first, _) if first % 2 == 1 => Coverage::Opaque,
            _ => Coverage::Clear,
        }
    }
}

/// The mesh as quads, each of two triangles that need not share an edge: so quads of all shapes, flat or not, some of them with
/// corners that coincide.
pub fn quads(mesh: &Mesh) -> Geometry<'_> {
    let pairs = mesh.indices.chunks(2).map(|pair| match *pair {
        [[a, b, c], [d, ..]] => [a, b, d, c],
        [[a, b, c]] => [a, b, c, c],
        _ => unreachable!("chunks of two"),
    });
    Geometry::quads(&mesh.positions[..], pairs.collect::<Vec<_>>())
}

/// User geometry that is as odd as it may be: flat boxes, hits outside of them and of the interval, NaN, hits that
/// depend on the interval, and nearest points that are not nearest. All of it is deterministic.
#[derive(Clone, Debug, Default)]
pub struct Odd {
    pub boxes: Vec<Aabb>,
}

impl Odd {
    /// Some boxes around the origin, a few of which are not sound.
    pub fn new(rng: &mut Rng, count: usize) -> Self {
        let boxes = (0..count).map(|_| {
            let (center, mut half) = (rng.point(1.0), rng.point(0.5).map(f32::abs));
            match rng.below(12) {
                0 => half[rng.below(3)] = 0.0,
                1 => half[rng.below(3)] = f32::NAN,
                2 => half[rng.below(3)] = -1.0,
                3 => half = half.map(|x| 10.0 * x),
                _ => {}
            }
            Aabb {
                min: core::array::from_fn(|axis| center[axis] - half[axis]),
                max: core::array::from_fn(|axis| center[axis] + half[axis]),
            }
        });
        Self {
            boxes: boxes.collect(),
        }
    }

    pub fn geometry(&self) -> Geometry<'static> {
        Geometry::user(self.boxes.len() as u32, Arc::new(self.clone()))
    }
}

impl UserGeometry for Odd {
    fn bounds(&self, prim_id: u32) -> Aabb {
        self.boxes[prim_id as usize]
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let Aabb { min, max } = self.boxes[prim_id as usize];
        let (mut along, mut length2) = (0.0, 0.0);
        for axis in 0..3 {
            let center = 0.5 * (min[axis] + max[axis]);
            along += (center - ray.org[axis]) * ray.dir[axis];
            length2 += ray.dir[axis] * ray.dir[axis];
        }
        let nearest = along / length2;
        let t = match prim_id % 7 {
            0 => nearest,
            1 => f32::NAN,
            2 => 1.5 * nearest,
            3 => 1.0,
            4 => 0.5 * (ray.tnear.max(-9.0) + ray.tfar.min(9.0)),
            5 => -0.0,
            _ if ray.dir[0] > 0.0 => f32::INFINITY,
            _ => return None,
        };
        Some(UserHit::new(t, prim_id as f32, t))
    }

    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        let Aabb { min, max } = self.boxes[prim_id as usize];
        let center: [f64; 3] =
            core::array::from_fn(|axis| 0.5 * (f64::from(min[axis]) + f64::from(max[axis])));
        let [x, y, z] = center;
        let center = world_from_object.map(|[a, b, c, d]| a * x + b * y + c * z + d);
        match prim_id % 5 {
            0 => Some(center),
            // Where the box is nearest.
            1 => Some(point),
            2 => Some([center[0], f64::NAN, f64::INFINITY]),
            3 => Some(core::array::from_fn(|axis| {
                9.0 * center[axis] - 8.0 * point[axis]
            })),
            _ => None,
        }
    }
}
