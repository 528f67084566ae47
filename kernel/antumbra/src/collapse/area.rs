//! The collapse that needs no rays: large boxes are opened first.
//!
//! Source: surface area contraction as in Wald, Benthin and Boulos (2008), "Getting Rid of Packets".

use crate::collapse::skeleton::{Children, Contraction};
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::node::MAX_WIDTH;

/// A node starts with one binary node; the one with the largest area is replaced by its own two children,
/// in its place, until the wide node is full or only leaves are left.
pub(crate) struct AreaCollapse;

impl Contraction for AreaCollapse {
    fn children(&self, tree: &BinaryTree, binary: usize, width: usize) -> Children {
        let mut children = Children::new(binary);
        // Areas of those that can be opened. The node itself is, if it can be, whatever its area.
        let mut areas = [-1.0; MAX_WIDTH];
        areas[0] = openable_area(tree, binary);
        while children.len() < width {
            // The first of equals, so that the result is one and the same everywhere.
            let (mut place, mut largest) = (0, -1.0);
            for (index, &area) in areas[..children.len()].iter().enumerate() {
                if area > largest {
                    (place, largest) = (index, area);
                }
            }
            let Some(pair) = tree.children(children.as_slice()[place] as usize) else {
                break;
            };
            areas.copy_within(place + 1..children.len(), place + 2);
            children.open(place, pair);
            for (offset, child) in pair.into_iter().enumerate() {
                areas[place + offset] = openable_area(tree, child);
            }
        }
        children
    }
}

/// Half the area of an inner node; less than any area for a leaf.
fn openable_area(tree: &BinaryTree, node: usize) -> f32 {
    match tree.nodes[node].kind {
        BinaryKind::Inner { .. } => tree.nodes[node].bounds.half_area(),
        BinaryKind::Leaf { .. } => -1.0,
    }
}
