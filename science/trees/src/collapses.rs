//! Collapses. RSC: nodes that sample rays visit often are contracted into their parents.
//!
//! Source: Gu, He and Blelloch (2015), "Ray Specialized Contraction on Bounding Volume Hierarchies". Theirs
//! contracts edges until nodes have as many children as a cost model wants; here nodes have a fixed width, so every
//! node is filled: of its children the one that is visited most is opened, again and again. Opening a child saves
//! its visits. Unlike the kernel's learned collapse it does not look ahead.

use antumbra::parts::{BinaryTree, Children, Contract, Contraction, Contractor};
use antumbra::recipe::{Collapse, UnknownName};

use crate::{find, rows};

rows! {
    Collapse;
    LEARNED_UNSORTED Unsorted = "learned-unsorted", "The nodes of `learned`, whose children stay in the order of the binary tree: for ablations", None;
    RSC Rsc = "rsc", "Children that training rays visit most are opened first", Some("Gu, He and Blelloch 2015");
}

/// Collapses of the kernel and of this crate.
pub const COLLAPSES: [Collapse; 5] = [
    Collapse::Area,
    Collapse::Sah,
    Collapse::Learned,
    LEARNED_UNSORTED,
    RSC,
];

/// The collapse of this name among [`COLLAPSES`].
///
/// # Errors
/// Another name, with those that there are.
pub fn collapse(name: &str) -> Result<Collapse, UnknownName> {
    find("collapse", &COLLAPSES, Collapse::name, name)
}

impl Contract for Unsorted {
    fn sorts(&self) -> bool {
        false
    }

    fn contraction(&self) -> Option<Contractor> {
        None
    }
}

impl Contract for Rsc {
    fn contraction(&self) -> Option<Contractor> {
        Some(|_, visits, _| Box::new(RscCollapse::new(visits)))
    }
}

/// How often each binary node is visited.
struct RscCollapse {
    visits: Vec<f32>,
}

impl RscCollapse {
    /// For rays that visit each inner binary node so often.
    fn new(visits: &[f32]) -> Self {
        Self {
            visits: visits.to_vec(),
        }
    }
}

impl Contraction for RscCollapse {
    fn children(&self, tree: &BinaryTree, binary: usize, width: usize) -> Children {
        let mut children = Children::new(binary);
        while children.len() < width {
            // The first of equals.
            let mut most: Option<(f32, usize, [usize; 2])> = None;
            for (place, &node) in children.as_slice().iter().enumerate() {
                let visits = self.visits[node as usize];
                if let Some(pair) = tree.children(node as usize)
                    && most.is_none_or(|(most, ..)| visits > most)
                {
                    most = Some((visits, place, pair));
                }
            }
            let Some((_, place, pair)) = most else {
                break;
            };
            children.open(place, pair);
        }
        children
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::recipe::Builder;
    use antumbra::{Geometry, Primitives};
    use antumbra_testkit::{Rng, mesh};

    /// Below a full node nothing is visited more than any node that was opened for it.
    #[test]
    fn what_is_visited_most_is_opened() {
        let mut rng = Rng::new(66);
        let mesh = mesh::soup(&mut rng, 500);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        // Rays that visit a node visit its parent, too.
        let mut visits = vec![1000.0; tree.nodes.len()];
        for node in 0..tree.nodes.len() {
            for child in tree.children(node).into_iter().flatten() {
                visits[child] = visits[node] * rng.unit();
            }
        }
        let collapse = RscCollapse::new(&visits);
        for node in 0..tree.nodes.len() {
            let children = collapse.children(&tree, node, 8);
            let children: Vec<_> = children
                .as_slice()
                .iter()
                .map(|child| *child as usize)
                .collect();
            let closed = children
                .iter()
                .filter(|child| tree.children(**child).is_some());
            let most = closed.map(|child| visits[*child]).fold(0.0, f32::max);
            let mut open = vec![node];
            while let Some(inner) = open.pop() {
                if children.contains(&inner) {
                    continue;
                }
                assert!(visits[inner] >= most, "node {node}");
                open.extend(tree.children(inner).expect("an inner node"));
            }
            assert!(children.len() == 8 || most == 0.0, "node {node} is full");
        }
    }
}
