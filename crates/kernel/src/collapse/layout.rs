//! From the skeleton of a wide tree to its nodes and leaf blocks in memory.

use std::borrow::Cow;
use std::sync::Arc;

use antumbra_simd::{Scalar, Simd};

use crate::aabb::Aabb;
use crate::collapse::skeleton::Skeleton;
use crate::geometry::BLOCK;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::cutout::micromap::Cutout;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::parallel;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::directed::Rule;
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::{Bvh, PlacedTree};

/// Nodes or blocks that are written at one go: so many at least, and in so many pieces at most.
const MIN_CHUNK: usize = 256;
const MAX_CHUNKS: usize = 64;
/// Primitives are fetched from memory so many blocks before they are written.
const AHEAD: usize = 3;

/// A tree over nothing: a root without children.
pub(crate) fn empty<const N: usize>() -> Bvh<N> {
    Bvh {
        nodes: vec![Node::EMPTY],
        triangle_blocks: vec![TriangleBlock::EMPTY],
        sphere_blocks: Vec::new(),
        instances: Vec::new(),
        roots: Vec::new(),
        cutout_blocks: Vec::new(),
        filters: Arc::default(),
        bounds: Aabb::EMPTY,
        reach: 0.0,
        depth: 1,
        pick: Rule::Slots,
    }
}

/// A tree to be laid out: that of the world, or that of an object. It has at least one node.
pub(crate) struct Part<'a, const N: usize> {
    pub primitives: &'a Primitives,
    pub tree: Cow<'a, BinaryTree>,
    pub skeleton: Skeleton<N>,
    /// How often each place of [`BinaryTree::prims`] was hit, if anybody knows.
    pub prim_hits: Option<Cow<'a, [f32]>>,
}

/// A node or a leaf to be written.
#[derive(Clone, Copy)]
struct Job {
    /// Which tree it belongs to.
    part: u32,
    /// The node of the skeleton, or the binary node that is the leaf.
    node: u32,
}

/// Writes the tree of the world and behind it those of the objects that there are. Slots are as the skeletons
/// have them; primitives of a leaf by how often they were hit, if that is known. Nodes and blocks of each
/// tree stand in visiting order, depth first.
pub(crate) fn lay_out<const N: usize>(top: &Part<N>, objects: &[Option<Part<N>>]) -> Bvh<N> {
    // Where each tree begins; those that are not there begin nowhere.
    let mut parts = vec![top];
    let mut roots = Vec::new();
    let mut object_roots = vec![u32::MAX; objects.len()];
    let mut end = top.skeleton.nodes.len();
    for (object, root) in objects.iter().zip(&mut object_roots) {
        if let Some(object) = object {
            *root = end as u32;
            roots.push(end as u32);
            parts.push(object);
            end += object.skeleton.nodes.len();
        }
    }

    let mut node_jobs = Vec::with_capacity(end);
    let mut references = Vec::with_capacity(end);
    // No leaf stands for triangle block 0.
    let (mut triangle_jobs, mut sphere_jobs, mut cutout_jobs) = (vec![], vec![], vec![]);
    let mut instances = Vec::new();
    for (part, part_index) in parts.iter().zip(0u32..) {
        let Part {
            primitives,
            tree,
            skeleton,
            ..
        } = part;
        let first = node_jobs.len();
        let order = skeleton.visiting_order();
        let mut places = vec![0; order.len()];
        for (place, &index) in order.iter().enumerate() {
            places[index] = first + place;
        }
        for &index in &order {
            node_jobs.push(Job {
                part: part_index,
                node: index as u32,
            });
            let mut own_references = [Child::EMPTY; N];
            let children = skeleton.nodes[index].children();
            for (reference, child) in own_references.iter_mut().zip(children) {
                let job = Job {
                    part: part_index,
                    node: child.binary,
                };
                *reference = match tree.nodes[child.binary as usize].kind {
                    BinaryKind::Inner { .. } => Child::inner(places[index + child.offset as usize]),
                    BinaryKind::Leaf { first, .. } => {
                        let prim = tree.prims[first as usize] as usize;
                        if let Some(placed) = primitives.instance(prim) {
                            instances.push(PlacedTree {
                                placement: placed.placement,
                                root: object_roots[placed.object as usize],
                            });
                            Child::instance(instances.len() - 1)
                        } else {
                            Child::leaf(match primitives.kind(prim) {
                                PrimKind::Triangle => {
                                    triangle_jobs.push(job);
                                    Leaf::Triangles(triangle_jobs.len())
                                }
                                PrimKind::Cutout => {
                                    cutout_jobs.push(job);
                                    Leaf::Cutouts(cutout_jobs.len() - 1)
                                }
                                PrimKind::Sphere => {
                                    sphere_jobs.push(job);
                                    Leaf::Spheres(sphere_jobs.len() - 1)
                                }
                            })
                        }
                    }
                };
            }
            references.push(own_references);
        }
    }

    let chunk = |count: usize| count.div_ceil(MAX_CHUNKS).max(MIN_CHUNK);
    let count = node_jobs.len();
    let nodes = parallel::fill(count, chunk(count), |places, slots| {
        for place in places {
            let Job { part, node: index } = node_jobs[place];
            let Part { tree, skeleton, .. } = parts[part as usize];
            let node = slots.push(Node::EMPTY);
            let children = skeleton.nodes[index as usize].children();
            for (slot, child) in children.iter().enumerate() {
                let bounds = &tree.nodes[child.binary as usize].bounds;
                node.set(slot, references[place][slot], bounds);
            }
        }
    });
    let leaf_prims = |job: &Job| {
        let part = parts[job.part as usize];
        let prims = LeafPrims::new(&part.tree, job.node, part.prim_hits.as_deref());
        (part.primitives, prims)
    };
    let count = triangle_jobs.len() + 1;
    let triangle_blocks = parallel::fill(count, chunk(count), |places, slots| {
        for place in places {
            let block = slots.push(TriangleBlock::EMPTY);
            if let Some(leaf) = place.checked_sub(1) {
                if let Some(later) = triangle_jobs.get(leaf + AHEAD) {
                    let Part {
                        primitives, tree, ..
                    } = parts[later.part as usize];
                    prefetch_triangles(primitives, tree, later.node);
                }
                let (primitives, prims) = leaf_prims(&triangle_jobs[leaf]);
                primitives.set_triangles(block, prims.as_slice());
            }
        }
    });
    let sphere_blocks = parallel::map(sphere_jobs.len(), MIN_CHUNK, |leaf| {
        let (primitives, prims) = leaf_prims(&sphere_jobs[leaf]);
        sphere_block(primitives, prims.as_slice())
    });
    let count = cutout_jobs.len();
    let cutout_blocks = parallel::fill(count, chunk(count), |places, slots| {
        for place in places {
            let job = &cutout_jobs[place];
            let (primitives, prims) = leaf_prims(job);
            let block = slots.push(CutoutBlock::EMPTY);
            set_cutouts(block, primitives, prims.as_slice());
        }
    });
    let bounds = top.tree.nodes[0].bounds;
    let deepest = parts[1..].iter().map(|part| part.skeleton.depth()).max();
    Bvh {
        nodes,
        triangle_blocks,
        sphere_blocks,
        cutout_blocks,
        filters: Arc::clone(&top.primitives.filters),
        instances,
        roots,
        bounds,
        reach: bounds.reach(),
        depth: top.skeleton.depth() + deepest.unwrap_or(0),
        pick: Rule::Slots,
    }
}

/// The primitives of a leaf, in the order in which its lanes hold them.
struct LeafPrims {
    prims: [u32; BLOCK],
    len: usize,
}

impl LeafPrims {
    /// Those hit more often come first; where nobody knows, as the binary tree has them.
    fn new(tree: &BinaryTree, leaf: u32, prim_hits: Option<&[f32]>) -> Self {
        let BinaryKind::Leaf { first, count } = tree.nodes[leaf as usize].kind else {
            unreachable!("not a leaf");
        };
        let (first, len) = (first as usize, count as usize);
        let mut prims = [0; BLOCK];
        prims[..len].copy_from_slice(&tree.prims[first..][..len]);
        let hits = |place: usize| prim_hits.map_or(0.0, |hits| hits[place]);
        // Most leaves are met by no ray of the log.
        if (first..first + len).any(|place| hits(place) > 0.0) {
            let mut places: [usize; BLOCK] = core::array::from_fn(|lane| first + lane);
            places[..len].sort_by(|&a, &b| hits(b).total_cmp(&hits(a)));
            for (prim, place) in prims.iter_mut().zip(&places[..len]) {
                *prim = tree.prims[*place];
            }
        }
        Self { prims, len }
    }

    fn as_slice(&self) -> &[u32] {
        &self.prims[..self.len]
    }
}

/// Asks for the triangles of a leaf, which stand anywhere.
fn prefetch_triangles(primitives: &Primitives, tree: &BinaryTree, leaf: u32) {
    let BinaryKind::Leaf { first, count } = tree.nodes[leaf as usize].kind else {
        return;
    };
    for &prim in &tree.prims[first as usize..][..count as usize] {
        let [first, _, last] = &primitives.triangles[prim as usize];
        Scalar.prefetch(first);
        Scalar.prefetch(last);
        Scalar.prefetch(&primitives.triangle_refs[prim as usize]);
    }
}

/// Writes partly transparent triangles into the lanes of a block.
fn set_cutouts(block: &mut CutoutBlock, primitives: &Primitives, prims: &[u32]) {
    primitives.set_triangles(&mut block.triangles, prims);
    for (lane, &prim) in prims.iter().enumerate() {
        let Cutout { map, pattern } = primitives.cutout(prim as usize);
        block.maps[lane] = map;
        block.patterns[lane] = pattern;
    }
}

fn sphere_block(primitives: &Primitives, prims: &[u32]) -> SphereBlock {
    let mut block = SphereBlock::EMPTY;
    for &prim in prims {
        let index = prim as usize - primitives.triangles.len();
        block.push(primitives.spheres[index], primitives.sphere_refs[index]);
    }
    block
}
