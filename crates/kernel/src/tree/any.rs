//! The one switch between widths.

use super::wide::WideTree;

/// A wide tree of one of the widths.
#[derive(Clone, Debug)]
pub(crate) enum Tree {
    W4(WideTree<4>),
    W8(WideTree<8>),
    W16(WideTree<16>),
}

/// Runs the same code on whichever tree it is.
macro_rules! on_tree {
    ($any:expr, $tree:ident => $body:expr) => {
        match $any {
            $crate::tree::any::Tree::W4($tree) => $body,
            $crate::tree::any::Tree::W8($tree) => $body,
            $crate::tree::any::Tree::W16($tree) => $body,
        }
    };
}
pub(crate) use on_tree;
