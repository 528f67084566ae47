//! The kernel against brute force: any triangles, quads, spheres, cut-outs, user geometry, instances, masks, rays and points,
//! every builder, width and level, one by one and in batches, moved and refitted, bit for bit.
#![no_main]

use std::sync::Arc;

use antumbra::cutout::{Candidate, Coverage, Opacity};
use antumbra::shapes::{Sphere, UserGeometry, UserHit};
use antumbra::{
    Aabb, Brute, Build, Bvh, Geometry, Hit, Instance, Isa, Masks, Object, PrimId, Primitives, Ray,
    RayQuery, Recipe, Width, World,
};
use antumbra_trees::{BUILDERS, ORDERS, engine};
use libfuzzer_sys::fuzz_target;

/// What the input says, byte by byte; zeros when it has said everything.
struct Script<'a>(&'a [u8]);

/// Numbers that are worth a byte.
const TELLING: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN_POSITIVE,
    1e-45,
    1e-7,
    1e7,
    -1e15,
    1e-15,
    0.333_333_34,
    1.000_000_1,
];

impl Script<'_> {
    fn byte(&mut self) -> u8 {
        match self.0.split_first() {
            Some((&first, rest)) => {
                self.0 = rest;
                first
            }
            None => 0,
        }
    }

    fn below(&mut self, end: u8) -> u8 {
        self.byte() % end
    }

    /// Mostly a multiple of a sixteenth, so that coordinates coincide; sometimes one that tells; sometimes any bits.
    fn number(&mut self) -> f32 {
        match self.byte() {
            kind @ 0..16 => TELLING[usize::from(kind)],
            16..24 => f32::from_bits(u32::from_le_bytes([
                self.byte(),
                self.byte(),
                self.byte(),
                self.byte(),
            ])),
            24..32 => 2f32.powi(i32::from(self.byte() as i8) / 2),
            value => (f32::from(value) - 144.0) / 16.0,
        }
    }

    fn point(&mut self) -> [f32; 3] {
        [self.number(), self.number(), self.number()]
    }

    fn ray(&mut self) -> Ray {
        let (org, target) = (self.point(), self.point());
        let ray = match self.below(4) {
            0 => Ray::new(org, target),
            _ => Ray::between(org, target),
        };
        match self.below(4) {
            0 => Ray {
                tnear: self.number(),
                tfar: self.number(),
                ..ray
            },
            1 => ray,
            _ => Ray {
                tfar: f32::INFINITY,
                ..ray
            },
        }
    }

    fn mesh<'a>(&mut self, most: u8) -> Geometry<'a> {
        let vertices: Vec<_> = (0..3 + self.below(most)).map(|_| self.point()).collect();
        let count = vertices.len() as u8;
        let triangles: Vec<_> = (0..1 + self.below(most))
            .map(|_| [0; 3].map(|_: u32| u32::from(self.below(count))))
            .collect();
        match self.below(5) {
            0 => Geometry::cutouts(vertices, triangles, Arc::new(Holes(self.byte()))),
            1 => {
                let fourth = |[a, b, c]: [u32; 3]| [a, b, c, u32::from(self.below(count))];
                Geometry::quads(
                    vertices,
                    triangles.into_iter().map(fourth).collect::<Vec<_>>(),
                )
            }
            2 => {
                let corner = |index: u32| vertices[index as usize];
                let boxes = triangles.into_iter().map(|[a, b, _]| Aabb {
                    min: corner(a),
                    max: corner(b),
                });
                let prims: Vec<_> = boxes
                    .map(|bounds| (bounds, self.byte(), self.number()))
                    .collect();
                Geometry::user(prims.len() as u32, Arc::new(Anything(prims)))
            }
            _ => Geometry::triangles(vertices, triangles),
        }
    }

    /// Masks for some of what there is.
    fn masks(&mut self) -> Masks {
        let mut list = || -> Vec<u32> {
            let masks = (0..self.below(4)).map(|_| [0, 1, 2, u32::MAX][usize::from(self.below(4))]);
            masks.collect()
        };
        let mut masks = Masks::default();
        masks.world = list();
        masks.instances = list();
        masks.objects = vec![list(), list()];
        masks
    }

    fn spheres<'a>(&mut self) -> Geometry<'a> {
        let spheres = (0..self.below(4)).map(|_| Sphere {
            center: self.point(),
            radius: self.number(),
        });
        Geometry::spheres(spheres.collect::<Vec<_>>())
    }
}

/// User geometry with any boxes and any hits: each primitive has a rule and a number.
#[derive(Debug)]
struct Anything(Vec<(Aabb, u8, f32)>);

impl UserGeometry for Anything {
    fn bounds(&self, prim_id: u32) -> Aabb {
        self.0[prim_id as usize].0
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let (bounds, rule, number) = self.0[prim_id as usize];
        let axis = usize::from(rule / 8 % 3);
        let t = match rule % 8 {
            0 => return None,
            1 => number,
            2 => ray.tnear + number,
            3 => ray.tfar - number,
            4 => (bounds.max[axis] - ray.org[axis]) / ray.dir[axis],
            _ => (bounds.min[axis] - ray.org[axis]) / ray.dir[axis],
        };
        Some(UserHit::new(t, number, ray.dir[axis]))
    }

    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        to_world: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        let (bounds, rule, number) = self.0[prim_id as usize];
        let corner = |[x, y, z]: [f32; 3]| {
            let [x, y, z] = [x, y, z].map(f64::from);
            to_world.map(|[a, b, c, d]| a * x + b * y + c * z + d)
        };
        match rule % 4 {
            0 => None,
            1 => Some([number.into(); 3]),
            2 => Some(corner(bounds.min)),
            _ => Some(point),
        }
    }
}

/// A decision that depends on all that a hit has.
fn accepts(hit: &Hit) -> bool {
    let words = [
        hit.t.to_bits(),
        hit.u.to_bits(),
        hit.prim_id,
        hit.geom_id,
        hit.inst_id,
    ];
    let mixed = words.iter().fold(7u32, |mixed, word| {
        (mixed ^ word).wrapping_mul(0x9e37_79b1).rotate_left(13)
    });
    !mixed.is_multiple_of(3)
}

/// A hit by its bits.
type Bits = Option<([u32; 3], [u32; 3])>;

/// Answers to questions with conditions.
#[derive(Debug, PartialEq)]
struct Answers {
    occluded: [bool; 2],
    closest: [Bits; 3],
    all: Vec<Bits>,
}

impl Answers {
    fn new(query: RayQuery<'_>, mask: u32, excluded: PrimId) -> Self {
        let seen = query.mask(mask).except(excluded);
        let closest = [
            query.filter(&accepts).intersect(),
            seen.intersect(),
            seen.filter(&accepts).intersect(),
        ];
        Self {
            occluded: [query.filter(&accepts).occluded(), seen.occluded()],
            closest: closest.map(bits),
            all: query
                .all_hits()
                .into_iter()
                .map(|hit| bits(Some(hit)))
                .collect(),
        }
    }
}

/// A filter that lets through what a hash of its input says, and lies about nothing.
#[derive(Debug)]
struct Holes(u8);

impl Opacity for Holes {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        match (candidate.prim_id as u8).wrapping_add(self.0) % 5 {
            0 => 1.0,
            1 => 0.0,
            2 => f32::NAN,
            _ if candidate.u > candidate.v => 1.0,
            _ => 0.0,
        }
    }

    fn coverage(&self, prim_id: u32, _: &[[f32; 2]; 3]) -> Coverage {
        match (prim_id as u8).wrapping_add(self.0) % 5 {
            0 => Coverage::Opaque,
            1 => Coverage::Clear,
            _ => Coverage::Unknown,
        }
    }
}

fn bits(hit: Option<Hit>) -> Bits {
    hit.map(|hit| {
        (
            [hit.t, hit.u, hit.v].map(f32::to_bits),
            [hit.geom_id, hit.prim_id, hit.inst_id],
        )
    })
}

fuzz_target!(|bytes: &[u8]| {
    let mut script = Script(bytes);
    let world = [script.mesh(20), script.spheres(), script.mesh(6)];
    let objects = [
        vec![script.mesh(10)],
        vec![script.mesh(4), script.spheres()],
    ];
    let instances: Vec<_> = (0..script.below(5))
        .map(|_| {
            Instance::new(
                u32::from(script.below(2)),
                [0; 3].map(|_: u32| [0; 4].map(|_: u32| script.number())),
            )
        })
        .collect();
    let rays: Vec<_> = (0..1 + script.below(24)).map(|_| script.ray()).collect();
    let (masks, mask) = (script.masks(), [1, 2, 3, 0][usize::from(script.below(4))]);
    let (builder, order) = (
        script.below(BUILDERS.len() as u8),
        script.below(ORDERS.len() as u8 + 4),
    );

    let Ok(primitives) = Primitives::with_instances(&world, &objects, &instances) else {
        panic!("all indices are in range");
    };
    let mut brute = Brute::new(&primitives);
    brute.set_masks(masks.clone());
    let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
    let hits: Vec<_> = rays.iter().map(|ray| bits(brute.intersect(ray))).collect();

    let excluded = |index: usize| {
        let hit = brute.intersect(&rays[index]);
        hit.filter(|_| index.is_multiple_of(2))
            .map_or(PrimId::NONE, PrimId::from)
    };
    let conditions: Vec<_> = (0..rays.len())
        .map(|index| Answers::new(brute.query(&rays[index]), mask, excluded(index)))
        .collect();

    // An order beyond the last stands for the default recipe: learned collapse, `joint`.
    let recipe = match ORDERS.get(usize::from(order)) {
        None => Recipe::default(),
        Some(&order) => Recipe::fast().order(order),
    };
    let recipe = recipe.builder(BUILDERS[usize::from(builder)]);
    let build = Build::new(&primitives).rays(&rays).recipe(&recipe);
    let stage = build.stage().expect("nobody stops it");
    for width in Width::ALL {
        let learned = stage.learn(&rays, &recipe.engine(engine(Isa::best(), width)), &());
        let mut bvh = learned.expect("nobody stops it");
        bvh.validate().expect("a sound tree");
        bvh.set_masks(masks.clone());
        for isa in Isa::available() {
            engine(isa, width).run(&mut bvh).expect("its width");
            let mut found_occluded = vec![false; rays.len()];
            let mut found_hits = vec![None; rays.len()];
            bvh.batch(&rays).occluded_into(&mut found_occluded);
            bvh.batch(&rays).intersect_into(&mut found_hits);
            for (index, ray) in rays.iter().enumerate() {
                let place = (width, isa.level(), ray);
                assert_eq!(found_occluded[index], occluded[index], "{place:?}");
                assert_eq!(bits(found_hits[index]), hits[index], "{place:?}");
                assert_eq!(bvh.occluded(ray), occluded[index], "single {place:?}");
                assert_eq!(bits(bvh.intersect(ray)), hits[index], "single {place:?}");
                let found = Answers::new(bvh.query(ray), mask, excluded(index));
                assert_eq!(found, conditions[index], "conditions {place:?}");
            }
        }
        points(&mut script, &bvh, &brute, &rays);
    }
    moved(
        &mut script,
        [&world[..], &objects[0], &objects[1]],
        &instances,
        &rays,
        &recipe,
    );
});

/// Queries about points against brute force.
fn points(script: &mut Script<'_>, bvh: &Bvh, brute: &Brute, rays: &[Ray]) {
    for ray in rays.iter().take(4) {
        let (point, radius) = (ray.org, script.number());
        let near = bvh.closest(point, radius);
        assert_eq!(near, brute.closest(point, radius), "{point:?} {radius}");
        let all = bvh.within(point, radius);
        assert_eq!(all, brute.within(point, radius), "{point:?} {radius}");
        assert_eq!(all.first().copied(), near, "{point:?} {radius}");
        assert_eq!(bvh.contains(point), brute.contains(point), "{point:?}");
    }
}

/// Asserts that a tree answers as brute force over primitives does, in batches and all hits of a ray.
fn answers_as(bvh: &Bvh, primitives: &Primitives, rays: &[Ray], place: &str) {
    let brute = Brute::new(primitives);
    bvh.validate().expect("a sound tree");
    let mut occluded = vec![false; rays.len()];
    let mut hits = vec![None; rays.len()];
    bvh.batch(rays).occluded_into(&mut occluded);
    bvh.batch(rays).intersect_into(&mut hits);
    for (index, ray) in rays.iter().enumerate() {
        assert_eq!(occluded[index], brute.occluded(ray), "{place} {ray:?}");
        assert_eq!(
            bits(hits[index]),
            bits(brute.intersect(ray)),
            "{place} {ray:?}"
        );
        let all = |hits: Vec<Hit>| {
            hits.into_iter()
                .map(|hit| bits(Some(hit)))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            all(bvh.query(ray).all_hits()),
            all(brute.query(ray).all_hits()),
            "{place} {ray:?}"
        );
    }
}

/// A world of the same objects, whose instances and vertices move.
fn moved(
    script: &mut Script<'_>,
    [ground, first, second]: [&[Geometry<'_>]; 3],
    instances: &[Instance],
    rays: &[Ray],
    recipe: &Recipe,
) {
    let object = |list: &[Geometry<'_>]| Object::build(list, recipe).expect("indices in range");
    let objects = [object(first), object(second)];
    let mut world = World::on_ground(&object(ground), &objects, instances).expect("in range");
    let over = |first: &[Geometry<'_>], instances: &[Instance]| {
        Primitives::with_instances(ground, &[first, second], instances).expect("in range")
    };
    answers_as(&world, &over(first, instances), rays, "world");
    let mut instances = instances.to_vec();
    instances.reverse();
    let by = script.point();
    if let Some(last) = instances.last_mut() {
        (0..3).for_each(|axis| last.transform[axis][3] += by[axis]);
    }
    let vertices = first.iter().map(|geometry| match geometry {
        Geometry::Triangles(mesh) => {
            let positions = mesh.positions.iter().map(|position| {
                let [x, y, z] = script.point();
                [position[0] + x, position[1] + y, position[2] + z]
            });
            let positions: Vec<_> = positions.collect();
            match &mesh.opacity {
                None => Geometry::triangles(positions, &mesh.indices[..]),
                Some(opacity) => Geometry::cutouts(positions, &mesh.indices[..], opacity.clone()),
            }
        }
        other => other.clone(),
    });
    let vertices: Vec<_> = vertices.collect();
    let changed = world.refit(&[(0, &vertices)], &instances).is_ok();
    if !changed {
        world.set_instances(&instances).expect("in range");
    }
    let first = if changed { &vertices } else { first };
    answers_as(&world, &over(first, &instances), rays, "moved world");
}
