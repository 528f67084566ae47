//! Rays through the whole binary tree without ever stopping: every box they hit, every primitive they
//! hit. What orders and collapses are learned from.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::aabb::Aabb;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{BLOCK, QueryKind};
use crate::ray::Ray;
use crate::trace::node_lists::NodeLists;
use crate::tree::binary::{BinaryKind, BinaryTree};

/// What rays meet in a binary tree, one ray after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Met {
    /// Nodes that each ray entered, ascending, as depth-first order has them. The root counts as entered
    /// by every ray, whatever its box: no traversal tests that. [`Met::HIT`] marks leaves of which a
    /// primitive was hit. Rays that cannot hit anything are left out.
    pub nodes: NodeLists,
    /// The primitives and instances hit, by their places in [`BinaryTree::prims`].
    pub prims: Vec<u32>,
}

impl Met {
    /// Leaves are at most 2³⁰, so node indices leave this bit free.
    pub const HIT: u32 = NodeLists::MARK;
}

/// What rays meet in the tree of the world and in those of the objects.
#[derive(Debug)]
pub(crate) struct MetAll {
    pub top: Met,
    /// For an object, a ray is one ray per instance that it enters.
    pub objects: Vec<Met>,
}

/// Follows rays to their ends, one by one.
pub(crate) struct Exhaustive<'a> {
    pub primitives: &'a Primitives,
    /// Has at least one node.
    pub tree: &'a BinaryTree,
    pub rays: &'a [Ray],
}

impl WithSimd<BLOCK> for Exhaustive<'_> {
    type Output = MetAll;

    #[inline(always)]
    fn with_simd<S: Simd + Width<BLOCK>>(self, simd: S) -> MetAll {
        let Self {
            primitives,
            tree,
            rays,
        } = self;
        let reach = tree.nodes[0].bounds.reach();
        let mut top = Follower::new(primitives, tree);
        let objects = primitives.objects.iter().zip(&tree.objects);
        let mut instances = Instances {
            placed: primitives,
            setup: RaySetup::IDLE,
            objects: objects
                .map(|(primitives, tree)| Follower::new(primitives, tree))
                .collect(),
        };
        for ray in rays {
            if let Some(setup) = RaySetup::new(ray, reach) {
                top.follow(simd, &setup, &mut instances);
            }
        }
        MetAll {
            top: top.met,
            objects: instances.objects.into_iter().map(|one| one.met).collect(),
        }
    }
}

/// What is below leaves that are not blocks of primitives.
trait Below {
    /// Follows the ray into the instance of this index; `None` if that is a primitive. Returns whether the ray
    /// hits anything in it.
    fn follow<S: Simd>(&mut self, simd: S, world: &RaySetup, index: usize) -> Option<bool>;
}

/// Nothing: there are no instances in an object.
struct Nothing;

impl Below for Nothing {
    #[inline(always)]
    fn follow<S: Simd>(&mut self, _: S, _: &RaySetup, _: usize) -> Option<bool> {
        None
    }
}

/// The objects.
struct Instances<'a> {
    placed: &'a Primitives,
    /// Of the ray in an object.
    setup: RaySetup,
    objects: Vec<Follower<'a>>,
}

impl Below for Instances<'_> {
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, world: &RaySetup, index: usize) -> Option<bool> {
        let placed = self.placed.instance(index)?;
        let interval = placed.placement.enter(simd, world, &mut self.setup);
        let object = &mut self.objects[placed.object as usize];
        Some(interval.is_some() && object.follow(simd, &self.setup, &mut Nothing))
    }
}

/// Follows rays through one tree.
struct Follower<'a> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    blocks: Blocks<'a>,
    stack: Vec<usize>,
    /// Nodes that the ray has entered so far.
    nodes: Vec<u32>,
    met: Met,
}

impl<'a> Follower<'a> {
    fn new(primitives: &'a Primitives, tree: &'a BinaryTree) -> Self {
        Self {
            primitives,
            tree,
            blocks: Blocks::new(primitives, tree),
            stack: Vec::new(),
            nodes: Vec::new(),
            met: Met::default(),
        }
    }

    /// Writes down what one ray meets in the tree, which has at least one node. Returns whether it hits
    /// anything.
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, setup: &RaySetup, below: &mut impl Below) -> bool {
        let Self {
            primitives,
            tree,
            blocks,
            stack,
            nodes,
            met,
        } = self;
        let mut any = false;
        nodes.clear();
        stack.push(0);
        while let Some(index) = stack.pop() {
            nodes.push(index as u32);
            match tree.nodes[index].kind {
                BinaryKind::Inner { right } => {
                    let (left, right) = (index + 1, index + right as usize);
                    if hits_box(setup, &tree.nodes[right].bounds) {
                        stack.push(right);
                    }
                    if hits_box(setup, &tree.nodes[left].bounds) {
                        stack.push(left);
                    }
                }
                BinaryKind::Leaf { first, count } => {
                    let prim = tree.prims[first as usize] as usize;
                    let mut hits = match blocks.get(index) {
                        Some(block) => {
                            let hits = block.occluders::<S, false>(simd, setup);
                            match primitives.kind(prim) {
                                PrimKind::Cutout if hits != 0 => {
                                    hits & prim_hits(primitives, tree, setup, first, count)
                                }
                                _ => hits,
                            }
                        }
                        None => match below.follow(simd, setup, prim) {
                            Some(inside) => u32::from(inside),
                            None => prim_hits(primitives, tree, setup, first, count),
                        },
                    };
                    if hits != 0 {
                        any = true;
                        let last = nodes.len() - 1;
                        nodes[last] |= Met::HIT;
                    }
                    while hits != 0 {
                        met.prims.push(first + hits.trailing_zeros());
                        hits &= hits - 1;
                    }
                }
            }
        }
        met.nodes.push(nodes);
        any
    }
}

/// Which of the primitives of a leaf the ray hits, as bits. A partly transparent triangle is hit by the rays that
/// it occludes, so that it counts with its opacity (Ogaki and Derouet-Jourdan 2016, section 4.2):
/// stochastically, but each ray as it would be answered.
fn prim_hits(
    primitives: &Primitives,
    tree: &BinaryTree,
    ray: &RaySetup,
    first: u32,
    count: u32,
) -> u32 {
    let mut hits = 0;
    for lane in 0..count {
        let prim = tree.prims[(first + lane) as usize] as usize;
        let hit = primitives.hit(prim, ray, QueryKind::Occluded);
        hits |= u32::from(hit.is_some()) << lane;
    }
    hits
}

/// Blocks of the leaves of triangles, opaque or not, that some ray has come to: rays that follow each other meet
/// much the same ones, and few rays meet but a small part of a large scene.
struct Blocks<'a> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    blocks: Vec<TriangleBlock>,
    /// Per node, the place of its block after the next one; 0 if it has none yet.
    places: Vec<u32>,
}

impl<'a> Blocks<'a> {
    fn new(primitives: &'a Primitives, tree: &'a BinaryTree) -> Self {
        Self {
            primitives,
            tree,
            blocks: Vec::new(),
            places: vec![0; tree.nodes.len()],
        }
    }

    /// The block of a leaf; `None` if that is one of spheres or an instance.
    #[inline(always)]
    fn get(&mut self, leaf: usize) -> Option<&TriangleBlock> {
        if self.places[leaf] == 0 {
            self.fill(leaf)?;
        }
        Some(&self.blocks[self.places[leaf] as usize - 1])
    }

    #[inline(never)]
    fn fill(&mut self, leaf: usize) -> Option<()> {
        let BinaryKind::Leaf { first, count } = self.tree.nodes[leaf].kind else {
            return None;
        };
        let prims = &self.tree.prims[first as usize..][..count as usize];
        let first = *prims.first()? as usize;
        if self.primitives.instance(first).is_some()
            || self.primitives.kind(first) == PrimKind::Sphere
        {
            return None;
        }
        let mut block = TriangleBlock::EMPTY;
        self.primitives.set_triangles(&mut block, prims);
        self.blocks.push(block);
        self.places[leaf] = self.blocks.len() as u32;
        Some(())
    }
}

/// The conservative box test of all traversals, for one box.
#[inline(always)]
pub(crate) fn hits_box(ray: &RaySetup, bounds: &Aabb) -> bool {
    let (mut enter, mut leave) = (ray.tnear, ray.tfar);
    for axis in 0..3 {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        let (near, far) = if !ray.negative(axis) {
            (low, high)
        } else {
            (high, low)
        };
        let near = near * ray.rdir(axis) - ray.slabs[1][axis];
        let far = far * ray.rdir(axis) - ray.slabs[2][axis];
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    enter <= leave
}
