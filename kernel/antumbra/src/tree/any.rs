//! The one switch between widths.

/// Runs the same code on the [`WideTree`](super::wide::WideTree) that queries see of a tree, of whichever width it is.
macro_rules! on_tree {
    ($any:expr, $tree:ident => $body:expr) => {{
        let any: &$crate::tree::wide::Tree = $any;
        match any.width() {
            $crate::tree::width::Width::W4 => {
                let $tree = &any.wide::<4>();
                $body
            }
            $crate::tree::width::Width::W8 => {
                let $tree = &any.wide::<8>();
                $body
            }
            $crate::tree::width::Width::W16 => {
                let $tree = &any.wide::<16>();
                $body
            }
        }
    }};
}
pub(crate) use on_tree;
