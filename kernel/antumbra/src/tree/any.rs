//! The one switch between widths.

/// Runs the same code on the [`WideTree`](super::wide::WideTree) that queries see of a tree, of whichever width it is.
macro_rules! on_tree {
    ($any:expr, $tree:ident => $body:expr) => {{
        let any: &$crate::tree::wide::Tree = $any;
        macro_rules! seen {
            ($Width:ident, $nodes:ident) => {{
                let moves = match any.motion.as_deref() {
                    Some($crate::tree::motion::Motion {
                        nodes: $crate::tree::nodes::Nodes::$Width(moves),
                        ..
                    }) => &moves[..],
                    _ => &[],
                };
                let $tree = &$crate::tree::wide::WideTree {
                    nodes: $nodes,
                    moves,
                    tree: any,
                };
                $body
            }};
        }
        match &any.nodes {
            $crate::tree::nodes::Nodes::W4(nodes) => seen!(W4, nodes),
            $crate::tree::nodes::Nodes::W8(nodes) => seen!(W8, nodes),
            $crate::tree::nodes::Nodes::W16(nodes) => seen!(W16, nodes),
        }
    }};
}
pub(crate) use on_tree;
