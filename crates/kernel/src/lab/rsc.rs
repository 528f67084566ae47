//! RSC: nodes that sample rays visit often are contracted into their parents.
//!
//! Source: Gu, He and Blelloch (2015), "Ray Specialized Contraction on Bounding Volume Hierarchies". Theirs
//! contracts edges until nodes have as many children as a cost model wants; here nodes have a fixed width, so every
//! node is filled: of its children the one that is visited most is opened, again and again. Opening a child saves
//! its visits. Unlike [`crate::collapse::cheapest`] it does not look ahead.

use alloc::vec::Vec;

use crate::collapse::skeleton::{Children, Contraction};
use crate::tree::binary::BinaryTree;

/// How often each binary node is visited.
pub(crate) struct RscCollapse {
    visits: Vec<f32>,
}

impl RscCollapse {
    /// For rays that visit each inner binary node so often.
    pub fn new(visits: &[f32]) -> Self {
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
    use alloc::vec;

    use super::*;
    use crate::builder::Builder;
    use crate::geometry::test_primitives::primitives;
    use antumbra_testkit::{Rng, mesh};

    /// Below a full node nothing is visited more than any node that was opened for it.
    #[test]
    fn what_is_visited_most_is_opened() {
        let mut rng = Rng::new(66);
        let mesh = mesh::soup(&mut rng, 500);
        let primitives = primitives(&mesh, 0, &mut rng);
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
