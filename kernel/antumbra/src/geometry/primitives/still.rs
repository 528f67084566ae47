//! Primitives that move, at a time.

use alloc::vec;
use alloc::vec::Vec;

use super::Primitives;
use super::dropped::{DropReason, Dropped};
use super::identity::Identity;
use crate::geometry::PrimRef;
use crate::geometry::instance::{ObjectShape, PlacedObject, Placement};
use crate::geometry::motion::{is_always_unsound, locate};
use crate::geometry::path::between;
use crate::geometry::sound::is_sound;

/// A triangle at both keys of a span.
type Keys = [[[f32; 3]; 3]; 2];

/// Scenes that move while rays are traced: see [`Geometry::moving`](crate::Geometry::moving) and
/// [`Instance::moving`](crate::Instance::moving). All other methods are of time 0.
impl Primitives {
    /// Whether anything moves.
    pub fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// Spans between two keys: one less than there are keys, and 1 if nothing moves.
    pub fn spans(&self) -> usize {
        (self.motion.as_ref()).map_or(1, |motion| motion.spans().len())
    }

    /// Primitives at a time, clamped to 0 to 1, none of which moves: what a tree that moves is traced over at that time.
    #[must_use]
    pub fn at(&self, time: f32) -> Self {
        let (span, share) = locate(time, self.spans());
        self.still(span, share, |keys| corners_at(keys, share))
    }

    /// Primitives in the middle of a span, over which the tree of the span is built: see [`Bvh::moving`](crate::Bvh::moving).
    ///
    /// # Panics
    /// If there is no such span.
    #[must_use]
    pub fn middle(&self, span: usize) -> Self {
        assert!(span < self.spans(), "{} spans", self.spans());
        self.still(span, 0.5, middle_of)
    }

    /// The primitives at a share of a span.
    fn still(&self, span: usize, share: f32, corners: impl Fn(&Keys) -> [[f32; 3]; 3]) -> Self {
        let mut still = self.clone();
        let Some(motion) = still.motion.take() else {
            return still;
        };
        still.identity = Identity::default();
        let (mut kept, mut dropped) = (0, Vec::new());
        for index in 0..still.triangles.len() {
            let id = still.triangle_refs[index];
            let keys = motion.spans()[span].corners(id);
            let triangle = keys.map_or(still.triangles[index], |keys| corners(&keys));
            if is_sound(&triangle) {
                still.triangles[kept] = triangle;
                still.triangle_refs[kept] = id;
                kept += 1;
            } else {
                let PrimRef { geom_id, prim_id } = id;
                dropped.push(Dropped::Primitive {
                    object: None,
                    geom_id,
                    prim_id,
                    reason: DropReason::CornersCoincide,
                });
            }
        }
        still.triangles.truncate(kept);
        still.triangle_refs.truncate(kept);
        still.dropped.splice(0..0, dropped);
        still.place_at(|inst_id| motion.transform(inst_id, span, share));
        still
    }

    /// Places instances again, where there is a transform for their number.
    pub(super) fn place_at(&mut self, transform: impl Fn(u32) -> Option<[[f32; 4]; 3]>) {
        let mut shapes: Vec<Option<ObjectShape>> = vec![None; self.objects.len()];
        let (objects, dropped) = (&self.objects, &mut self.dropped);
        self.instances.retain_mut(|placed| {
            let &mut PlacedObject {
                placement, object, ..
            } = placed;
            let Some(transform) = transform(placement.inst_id) else {
                return true;
            };
            let object = object as usize;
            let shape = shapes[object].get_or_insert_with(|| ObjectShape::new(&objects[object]));
            let inst_id = placement.inst_id;
            match Placement::new(&transform, shape, inst_id) {
                Some(placement) => {
                    (placed.placement, placed.world_from_object) = (placement, transform);
                    true
                }
                None => {
                    let reason = DropReason::Transform;
                    dropped.push(Dropped::Instance { inst_id, reason });
                    false
                }
            }
        });
    }
}

fn corners_at([start, end]: &Keys, share: f32) -> [[f32; 3]; 3] {
    [0, 1, 2].map(|corner| between(&start[corner], &end[corner], share))
}

/// A triangle in the middle of a span, for a build. One whose corners coincide only there is replaced by a tiny one, as a
/// build drops those.
fn middle_of(keys: &Keys) -> [[f32; 3]; 3] {
    let middle = corners_at(keys, 0.5);
    if is_sound(&middle) || is_always_unsound(keys) {
        return middle;
    }
    let [x, y, z] = middle[0];
    [[x, y, z], [x.next_up(), y, z], [x, y.next_up(), z]]
}
