//! Nested instances: objects that hold instances of other objects, made flat.
//!
//! A ray goes through two levels, however deep the nesting is: each path from the world to an object with geometry becomes one
//! instance, whose transform is the product along the path.

use alloc::vec;
use alloc::vec::Vec;

use crate::error::Error;
use crate::geometry::instance::{Affine, Instance};
use crate::geometry::primitives::MAX_INSTANCES;
use crate::ray::INVALID_ID;

/// Instances of objects that hold instances themselves, to any depth that memory allows.
///
/// [`NestedInstances::instances`] are the instances to build with. Each takes 200 bytes or so in a tree, so a forest of 1000
/// trees of 1000 leaves has a million of them. Products are computed in double precision and rounded once.
///
/// ```
/// use antumbra::{Bvh, Geometry, Instance, NestedInstances, Primitives, Ray, Recipe};
///
/// let right = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// let leaf = vec![Geometry::triangles(vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], vec![[0, 1, 2]])];
/// // Object 0 is a leaf, object 1 a twig of two leaves. The world has two twigs.
/// let objects = [leaf, vec![]];
/// let inside = [vec![], vec![Instance::new(0, right(0.0)), Instance::new(0, right(2.0))]];
/// let world = [Instance::new(1, right(0.0)), Instance::new(1, right(10.0))];
/// let nested = NestedInstances::new(&world, &inside, |object| !objects[object as usize].is_empty())?;
///
/// let scene = Primitives::with_instances(&[], &objects, nested.instances())?;
/// let bvh = Bvh::build(&scene, &Recipe::default())?;
/// let hit = bvh.intersect(&Ray::new([12.1, 0.1, 0.0], [0.0, 0.0, 1.0])).expect("the second leaf of the second twig");
/// assert_eq!(nested.path(hit.inst_id), [1, 1]);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NestedInstances {
    instances: Vec<Instance>,
    /// Step at which the path of each instance ends.
    ends: Vec<u32>,
    steps: Vec<Step>,
}

/// Step of a path from the world inwards.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    /// Step before, or [`INVALID_ID`] in the world.
    before: u32,
    /// Place in the list of instances of the world, or of the object where the step begins.
    place: u32,
}

impl NestedInstances {
    /// `world` are the instances in the world, and `inside[i]` those in object `i`. `has_geometry` says whether an object has
    /// geometry of its own; an object without geometry and without instances is left out.
    ///
    /// Paths are in the order of the lists: the geometry of an object before the instances inside.
    ///
    /// # Errors
    /// - [`Error::ObjectOutOfRange`] for an object that is not in `inside`; `inst_id` is the place in the list of the world, or
    ///   of the object that holds the instance.
    /// - [`Error::NestsItself`] for a circle.
    /// - [`Error::Moves`] for an instance that moves while rays are traced.
    /// - [`Error::TooMany`] for more than 2²⁹ - 2 paths, ends without geometry included.
    pub fn new(
        world: &[Instance],
        inside: &[impl AsRef<[Instance]>],
        has_geometry: impl Fn(u32) -> bool,
    ) -> Result<Self, Error> {
        let lists = Lists { world, inside };
        let count = lists.count(&has_geometry)?;
        let mut nested = Self {
            instances: Vec::with_capacity(count),
            ends: Vec::with_capacity(count),
            steps: Vec::new(),
        };
        // Instances still to place, the next one last: the step before, the product up to there, and what is left of a list.
        let mut open = vec![(INVALID_ID, None::<Affine>, (INVALID_ID, 0))];
        while let Some((before, outer, (object, place))) = open.pop() {
            let Some(instance) = lists.of(object).get(place) else {
                continue;
            };
            open.push((before, outer, (object, place + 1)));
            instance.stands_still("instances inside of objects cannot move")?;
            let inner = Affine::new(&instance.transform);
            let product = match &outer {
                Some(outer) => outer.times(&inner),
                None => inner,
            };
            let step = nested.steps.len() as u32;
            nested.steps.push(Step {
                before,
                place: place as u32,
            });
            if has_geometry(instance.object) {
                let transform = product.rows.map(|row| row.map(|x| x as f32));
                nested
                    .instances
                    .push(Instance::new(instance.object, transform));
                nested.ends.push(step);
            }
            open.push((step, Some(product), (instance.object, 0)));
        }
        Ok(nested)
    }

    /// One instance for each path from the world to an object with geometry.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Path to an instance, from the world inwards: places in the list of the world, then in the lists of the objects.
    ///
    /// # Panics
    /// If there is no such instance.
    pub fn path(&self, inst_id: u32) -> Vec<u32> {
        let mut path = Vec::new();
        let mut step = self.ends[inst_id as usize];
        while let Some(Step { before, place }) = self.steps.get(step as usize) {
            path.push(*place);
            step = *before;
        }
        path.reverse();
        path
    }
}

/// Lists of instances: the list of the world has the name [`INVALID_ID`].
struct Lists<'a, L> {
    world: &'a [Instance],
    inside: &'a [L],
}

impl<L: AsRef<[Instance]>> Lists<'_, L> {
    fn of(&self, object: u32) -> &[Instance] {
        match object {
            INVALID_ID => self.world,
            _ => self.inside[object as usize].as_ref(),
        }
    }

    /// Steps of all paths, and whether they end: checked before there are any, for each level can multiply them.
    fn count(&self, has_geometry: &impl Fn(u32) -> bool) -> Result<usize, Error> {
        /// Counting has begun, but not ended.
        const OPEN: u64 = u64::MAX;
        /// Steps and instances below each object that is counted.
        type Below = Option<(u64, u64)>;
        let objects = self.inside.len();
        let mut below: Vec<Below> = vec![None; objects];
        // Lists being counted, each with the next place and the counts up to there.
        let mut open = vec![(INVALID_ID, 0, 0_u64, 0_u64)];
        let (mut steps, mut ends) = (0, 0);
        while let Some((object, place, so_far, ends_so_far)) = open.pop() {
            let Some(instance) = self.of(object).get(place) else {
                match below.get_mut(object as usize) {
                    Some(below) => *below = Some((so_far, ends_so_far)),
                    None => (steps, ends) = (so_far, ends_so_far),
                }
                continue;
            };
            let Some(inner) = below.get_mut(instance.object as usize) else {
                return Err(Error::ObjectOutOfRange {
                    inst_id: place as u32,
                    object: instance.object,
                    objects,
                });
            };
            match *inner {
                Some((OPEN, _)) => {
                    return Err(Error::NestsItself {
                        object: instance.object,
                    });
                }
                Some((inner_steps, inner_ends)) => {
                    let own = u64::from(has_geometry(instance.object));
                    let steps = so_far.saturating_add(1 + inner_steps).min(OPEN - 2);
                    let ends = ends_so_far.saturating_add(own + inner_ends).min(OPEN - 2);
                    open.push((object, place + 1, steps, ends));
                }
                None => {
                    *inner = Some((OPEN, 0));
                    open.push((object, place, so_far, ends_so_far));
                    open.push((instance.object, 0, 0, 0));
                }
            }
        }
        let found = usize::try_from(steps.max(ends)).unwrap_or(usize::MAX);
        if found > MAX_INSTANCES {
            return Err(Error::TooMany {
                what: "nested instances",
                found,
                limit: MAX_INSTANCES,
            });
        }
        Ok(ends as usize)
    }
}

#[cfg(test)]
mod tests {
    use antumbra_testkit::Rng;

    use super::*;

    fn right(x: f32) -> [[f32; 4]; 3] {
        [
            [1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ]
    }

    /// Each object holds only objects of lower numbers, so that nothing nests itself.
    #[test]
    fn transforms_are_the_products_along_the_paths() {
        let mut rng = Rng::new(4);
        for _ in 0..50 {
            let mut instance = |below: u32| {
                let row = |rng: &mut Rng| [(); 4].map(|()| rng.range(-1.0, 1.0));
                let transform = [row(&mut rng), row(&mut rng), row(&mut rng)];
                Instance::new(rng.below(below as usize) as u32, transform)
            };
            let inside: Vec<Vec<Instance>> = (0..6)
                .map(|object| (0..object.min(3)).map(|_| instance(object)).collect())
                .collect();
            let world = [instance(6), instance(6)];
            let solid = |object: u32| object.is_multiple_of(2);
            let nested = NestedInstances::new(&world, &inside, solid).expect("no circle");
            let mut paths: Vec<Vec<u32>> = Vec::new();
            for (flat, inst_id) in nested.instances().iter().zip(0..) {
                let path = nested.path(inst_id);
                let mut list = &world[..];
                let mut product: Option<Affine> = None;
                let mut object = 0;
                for &place in &path {
                    let step = &list[place as usize];
                    let inner = Affine::new(&step.transform);
                    product = Some(product.map_or(inner, |outer| outer.times(&inner)));
                    object = step.object;
                    list = &inside[object as usize];
                }
                let rows = product.expect("a step").rows;
                assert_eq!(flat.transform, rows.map(|row| row.map(|x| x as f32)));
                assert_eq!(flat.object, object);
                assert!(solid(object));
                paths.push(path);
            }
            assert!(paths.is_sorted(), "in the order of the lists");
            let count = paths.len();
            paths.dedup();
            assert_eq!(paths.len(), count, "each path once");
        }
    }

    #[test]
    fn a_long_chain_is_followed_and_a_circle_is_refused() {
        let count = 100_000;
        let chain = |last: u32| -> Vec<[Instance; 1]> {
            let next = (1..count).chain([last]);
            next.map(|object| [Instance::new(object, right(1.0))])
                .collect()
        };
        let mut inside: Vec<Vec<Instance>> = chain(0).iter().map(|list| list.to_vec()).collect();
        inside.last_mut().expect("an object").clear();
        let world = [Instance::new(0, right(0.0))];
        let nested = NestedInstances::new(&world, &inside, |object| object == count - 1);
        let nested = nested.expect("no circle");
        assert_eq!(nested.instances().len(), 1);
        assert_eq!(nested.instances()[0].transform[0][3], (count - 1) as f32);
        assert_eq!(nested.path(0).len(), count as usize);
        let circle = NestedInstances::new(&world, &chain(7), |_| true);
        assert_eq!(circle, Err(Error::NestsItself { object: 7 }));
    }

    #[test]
    fn what_explodes_or_is_not_there_is_refused_before_it_takes_memory() {
        let inside: Vec<Vec<Instance>> = (0..40)
            .map(|object: u32| match object.checked_sub(1) {
                Some(below) => vec![Instance::new(below, right(1.0)); 10],
                None => vec![],
            })
            .collect();
        let world = [Instance::new(39, right(0.0))];
        let found = NestedInstances::new(&world, &inside, |object| object == 0);
        assert!(matches!(found, Err(Error::TooMany { .. })), "{found:?}");
        let found = NestedInstances::new(&[Instance::new(40, right(0.0))], &inside, |_| true);
        let missing = Error::ObjectOutOfRange {
            inst_id: 0,
            object: 40,
            objects: 40,
        };
        assert_eq!(found, Err(missing));
        let none = NestedInstances::new(&world, &vec![vec![]; 40], |_| false).expect("nothing");
        assert!(none.instances().is_empty());
    }
}
