//! Rays through the whole binary tree without ever stopping: every box they hit, every primitive they hit.
//!
//! A [`Witness`] decides what is kept: the log that collapses are learned from, or the sample that ray-driven builders
//! judge splits by.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};

use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::slab_test::hits_box;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{BLOCK, QueryKind};
use crate::ray::Ray;
use crate::tree::binary::{BinaryKind, BinaryTree};

/// Receives the nodes and hits of rays in one tree, the tree of the world or of an object, one ray after the other.
pub trait Witness {
    /// A ray, made ready for this tree, begins. Returns whether it is to be followed.
    fn begin(&mut self, ray: &RaySetup) -> bool;

    /// The ray enters a node. Nodes are ascending, as depth-first order has them. Every ray enters the root, whatever
    /// its box: no traversal tests that.
    fn node(&mut self, node: u32);

    /// Whether the ray goes on, queried at every node. One that does not is at its end. Default: it does.
    fn goes_on(&self) -> bool {
        true
    }

    /// The node entered last is a leaf, and the ray hits something in it.
    fn hits(&mut self, ray: &RaySetup, hits: LeafHits<'_>);

    /// The ray is at its end.
    fn end(&mut self);
}

/// The hits of a ray in a leaf.
#[derive(Clone, Copy)]
pub struct LeafHits<'a> {
    primitives: &'a Primitives,
    /// All primitives of the leaf, or its instance.
    prims: &'a [u32],
    /// Index of the first of `prims` in [`BinaryTree::prims`].
    pub(crate) first: u32,
    lanes: u32,
}

impl LeafHits<'_> {
    /// The primitives that are hit, with their distances. An instance is left out: what is hit in it is reported to the
    /// witness of its object.
    pub fn prims(self, ray: &RaySetup) -> impl Iterator<Item = (u32, f32)> {
        let (primitives, prims) = (self.primitives, self.prims);
        self.filter_map(move |lane| {
            let prim = prims[lane] as usize;
            if primitives.instance(prim).is_some() {
                return None;
            }
            let hit = primitives.hit(prim, ray, QueryKind::Occluded)?;
            Some((prim as u32, hit.t))
        })
    }
}

impl Iterator for LeafHits<'_> {
    /// Index in `prims` of a primitive that is hit.
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.lanes.trailing_zeros() as usize;
        self.lanes &= self.lanes.wrapping_sub(1);
        (lane < self.prims.len()).then_some(lane)
    }
}

/// Follows rays through a binary tree over `primitives` to their ends, whatever they hit on the way: `world` receives what
/// happens in the tree of the world, `objects` what happens in the tree of each object, where a ray is one ray for each
/// instance that it enters. Rays that cannot hit anything are left out, and a tree over nothing reports nothing.
pub fn follow<W: Witness>(
    primitives: &Primitives,
    tree: &BinaryTree,
    rays: &[Ray],
    world: &mut W,
    objects: &mut [W],
) {
    if !tree.nodes.is_empty() {
        Isa::best().dispatch(Exhaustive {
            primitives,
            tree,
            rays,
            world,
            objects,
        });
    }
}

/// Follows rays to their ends, one by one. Rays that cannot hit anything are left out.
pub(crate) struct Exhaustive<'a, W> {
    pub primitives: &'a Primitives,
    /// Has at least one node.
    pub tree: &'a BinaryTree,
    pub rays: &'a [Ray],
    /// For the tree of the world.
    pub world: &'a mut W,
    /// For the tree of each object. There, a ray is one ray per instance that it enters.
    pub objects: &'a mut [W],
}

impl<W: Witness> WithSimd<BLOCK> for Exhaustive<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<BLOCK>>(self, simd: S) {
        let Self {
            primitives,
            tree,
            rays,
            world,
            objects,
        } = self;
        let extent = tree.nodes[0].bounds.reach();
        let mut top = Follower::new(primitives, tree, world);
        let trees = primitives.objects.iter().zip(&tree.objects);
        let mut instances = Instances {
            placed: primitives,
            setup: RaySetup::IDLE,
            objects: (trees.zip(objects))
                .map(|((primitives, tree), witness)| Follower::new(primitives, tree, witness))
                .collect(),
        };
        for ray in rays {
            if let Some(setup) = RaySetup::new(ray, extent) {
                top.follow(simd, &setup, &mut instances);
            }
        }
    }
}

/// The trees below leaves that are not blocks of primitives.
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
struct Instances<'a, W> {
    placed: &'a Primitives,
    /// The ray made ready for an object.
    setup: RaySetup,
    objects: Vec<Follower<'a, W>>,
}

impl<W: Witness> Below for Instances<'_, W> {
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, world: &RaySetup, index: usize) -> Option<bool> {
        let placed = self.placed.instance(index)?;
        let interval = placed.placement.enter(simd, world, &mut self.setup);
        let object = &mut self.objects[placed.object as usize];
        Some(interval.is_some() && object.follow(simd, &self.setup, &mut Nothing))
    }
}

/// Follows rays through one tree.
struct Follower<'a, W> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    blocks: Blocks<'a>,
    stack: Vec<usize>,
    witness: &'a mut W,
}

impl<'a, W: Witness> Follower<'a, W> {
    fn new(primitives: &'a Primitives, tree: &'a BinaryTree, witness: &'a mut W) -> Self {
        Self {
            primitives,
            tree,
            blocks: Blocks::new(primitives, tree),
            stack: Vec::new(),
            witness,
        }
    }

    /// Follows one ray through the tree, which has at least one node, and reports its nodes and hits to the witness.
    /// Returns whether the ray hits anything.
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, setup: &RaySetup, below: &mut impl Below) -> bool {
        let Self {
            primitives,
            tree,
            blocks,
            stack,
            witness,
        } = self;
        if !witness.begin(setup) {
            return false;
        }
        let mut any = false;
        stack.push(0);
        while let Some(index) = stack.pop() {
            witness.node(index as u32);
            if !witness.goes_on() {
                stack.clear();
                break;
            }
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
                    let lanes = match blocks.get(index) {
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
                    if lanes != 0 {
                        any = true;
                        let prims = &tree.prims[first as usize..][..count as usize];
                        let hits = LeafHits {
                            primitives,
                            prims,
                            first,
                            lanes,
                        };
                        witness.hits(setup, hits);
                    }
                }
            }
        }
        witness.end();
        any
    }
}

/// Primitives of a leaf that the ray hits, as bits. A partly transparent triangle is hit by the rays that it occludes,
/// so that it counts with its opacity (Ogaki and Derouet-Jourdan 2016, section 4.2): stochastically, but each ray as it
/// would be answered.
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
        hits |= u32::from(primitives.occluder(prim, ray).is_some()) << lane;
    }
    hits
}

/// Blocks kept at a time, some megabytes. Rays through coincident triangles come to all leaves of a scene.
const MAX_BLOCKS: usize = 1 << 14;

/// Blocks of the leaves of triangles, opaque or not, that some ray has come to. Rays that follow each other visit much
/// the same leaves, and most rays visit only a small part of a large scene.
struct Blocks<'a> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    blocks: Vec<TriangleBlock>,
    /// Leaf of each block.
    filled: Vec<u32>,
    /// Per node, the place of its block after the next one; 0 if it has none yet.
    places: Vec<u32>,
}

impl<'a> Blocks<'a> {
    fn new(primitives: &'a Primitives, tree: &'a BinaryTree) -> Self {
        Self {
            primitives,
            tree,
            blocks: Vec::new(),
            filled: Vec::new(),
            places: vec![0; tree.nodes.len()],
        }
    }

    /// The block of a leaf; `None` if that is one of other primitives, or an instance.
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
        if self.primitives.instance(first).is_some() || !self.primitives.kind(first).is_triangle() {
            return None;
        }
        let mut block = TriangleBlock::EMPTY;
        self.primitives.set_triangles(&mut block, prims);
        if self.blocks.len() == MAX_BLOCKS {
            self.blocks.clear();
            for leaf in self.filled.drain(..) {
                self.places[leaf as usize] = 0;
            }
        }
        self.blocks.push(block);
        self.filled.push(leaf as u32);
        self.places[leaf] = self.blocks.len() as u32;
        Some(())
    }
}
