//! Costs of the steps of a traversal, from which the cost of a tree is predicted.

use crate::geometry::primitives::PrimKind;

/// Costs of the steps of a traversal, in units of the user's choice: the constants of the paper's equation (1).
///
/// Costs are finite and not negative; nothing checks them.
///
/// ```
/// use antumbra::Recipe;
/// use antumbra::recipe::CostModel;
///
/// let recipe = Recipe::default().costs(CostModel::default().prim(1.0));
/// assert_eq!((recipe.costs.node, recipe.costs.prim), (1.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CostModel {
    /// Cost of testing the N boxes of a node (`C_mb` of the paper). Only ratios of the costs count, so any unit will do.
    pub node: f32,
    /// Cost of testing one primitive (`C_p` of the paper).
    pub prim: f32,
    /// Cost of entering an instance and leaving it again, without the visits in between.
    pub entry: f32,
    /// Cost of testing one partly transparent triangle, or one primitive of user geometry.
    pub cutout: f32,
}

impl Default for CostModel {
    /// A node costs 1, the other costs are relative to it. A full leaf block takes about as long as a node. The cost of
    /// a cut-out includes a filter which looks up a bit, with half of its calls saved by opacity micromaps (see
    /// [`crate::cutout::Opacity::coverage`]). `docs/notes/kernel.md` in the repository has measurements.
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
    /// With another cost of a node.
    #[must_use]
    pub fn node(self, node: f32) -> Self {
        Self { node, ..self }
    }

    /// With another cost of a primitive.
    #[must_use]
    pub fn prim(self, prim: f32) -> Self {
        Self { prim, ..self }
    }

    /// With another cost of entering and leaving an instance.
    #[must_use]
    pub fn entry(self, entry: f32) -> Self {
        Self { entry, ..self }
    }

    /// With another cost of a partly transparent triangle or a primitive of user geometry.
    #[must_use]
    pub fn cutout(self, cutout: f32) -> Self {
        Self { cutout, ..self }
    }

    /// `C_p` of a kind of primitive.
    pub(crate) fn of(&self, kind: PrimKind) -> f32 {
        match kind {
            PrimKind::Cutout | PrimKind::User => self.cutout,
            _ => self.prim,
        }
    }
}
