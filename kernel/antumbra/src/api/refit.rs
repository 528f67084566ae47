//! Other vertices in the same tree.

use super::bvh::Bvh;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::moved::Moved;
use crate::tree::costs::CostModel;

impl Bvh {
    /// Moves the primitives of the tree. `geometries` are the ones that it was built over, with other vertices, or
    /// spheres of other centres and radii, or user geometry. Boxes of user geometry are requested again, and its
    /// functions are replaced.
    ///
    /// Nodes, collapse and child order stay. Answers equal the answers of a tree built from scratch over `geometries`,
    /// bit for bit. [`BuildReport::quality`](crate::BuildReport::quality) is what a query in the old nodes costs, relative to
    /// the build. A refit is far cheaper than a build, and shared among the threads of the current rayon pool.
    ///
    /// A builder may leave some triangles in several leaves, each with a box around a part
    /// of it. After a refit each of these boxes is around the whole triangle, so such a tree loses more than others.
    /// Filters of cut-outs stay as they were at the build.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// let mut positions = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// let mut bvh = Bvh::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
    /// for position in &mut positions {
    ///     position[2] += 2.0;
    /// }
    /// bvh.refit(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])])?;
    /// let hit = bvh.intersect(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
    /// assert_eq!(hit.map(|hit| hit.t), Some(3.0));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Errors
    /// The tree stays as it is when
    /// - a vertex index is out of range,
    /// - a primitive that was dropped at build is sound now, or one of the tree is not: [`Error::OtherPrimitives`],
    ///   [`Error::PrimitiveIsGone`],
    /// - the tree or one of the geometries moves while rays are traced: [`Error::Moves`],
    /// - the tree has instances: [`Error::HasInstances`]; a [`World`](crate::World) refits its objects.
    pub fn refit(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        Error::if_moves(self.moves(), "a tree that moves cannot be refitted")?;
        if !self.tree.roots.is_empty() {
            return Err(Error::HasInstances);
        }
        let moved = Moved::new(geometries, self.primitives + self.transparent)?;
        let now = || self.tree.sah(&CostModel::default());
        let sah = self.built_sah.unwrap_or_else(now);
        let tree = &mut self.tree;
        let places = tree.all_places();
        tree.check_moved(&places, &moved)?;
        tree.refit(&[(places, moved)]);
        tree.bounds = tree.nodes.get(0).all_bounds();
        tree.reach = tree.bounds.reach();
        self.built_sah = Some(sah);
        // Predicted for what was there before.
        self.predicted_cost = None;
        self.predicted_before = None;
        Ok(())
    }
}
