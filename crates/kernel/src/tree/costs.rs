//! What a step of a traversal costs, for whoever predicts costs.

use crate::geometry::primitives::PrimKind;

/// What a step costs, in units of the user's choice: the constants of the paper's equation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    /// `C_mb`: testing the N boxes of a node.
    pub node: f32,
    /// `C_p`: testing one primitive.
    pub prim: f32,
    /// Entering an instance and leaving it again, without what is visited in between.
    pub entry: f32,
    /// The same of a partly transparent triangle.
    pub cutout: f32,
}

impl Default for CostModel {
    /// A node costs 1. A leaf block, of six or seven primitives as a rule, takes 1.0 to 1.4 times as long
    /// as a node. In batches of rays 0.15 is 2 to 4 % faster than 0.25; to cost blocks instead of
    /// primitives changes nothing. A cut-out takes 0.3 with a filter that costs nothing, 0.5 with one that looks
    /// up a bit and 0.8 with one that interpolates texels, all with half of the questions answered before they are
    /// asked (see [`crate::cutout::Opacity::coverage`]).
    fn default() -> Self {
        Self {
            node: 1.0,
            prim: 0.15,
            entry: 2.0,
            cutout: 0.5,
        }
    }
}

impl CostModel {
    /// `C_p` of a kind of primitive.
    pub(crate) fn of(&self, kind: PrimKind) -> f32 {
        match kind {
            PrimKind::Triangle | PrimKind::Sphere => self.prim,
            PrimKind::Cutout => self.cutout,
        }
    }
}
