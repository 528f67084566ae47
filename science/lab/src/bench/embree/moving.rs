//! A mesh whose vertices move: a dynamic scene of one geometry of quality REFIT.

use std::ffi::c_uint;
use std::sync::Arc;
use std::time::Instant;

use antumbra::shapes::TriangleMesh;

use super::scene::{FLAG_DYNAMIC, FlushDenormals, Part, QUALITY_LOW, QUALITY_REFIT, VERTEX_BUFFER};
use super::{Device, Handle, RayHit, SingleRay};

/// The only geometry of its scene.
const GEOMETRY: c_uint = 0;

/// A committed scene of one mesh, to be refitted.
pub struct MovingMesh {
    part: Part,
    vertices: usize,
}

impl MovingMesh {
    /// Builds a dynamic scene of quality LOW, as Embree wants it for geometries of quality REFIT.
    ///
    /// # Errors
    /// Message of Embree.
    pub fn build(device: &Arc<Device>, mesh: &TriangleMesh) -> Result<Self, String> {
        let part = Part::new(device, FLAG_DYNAMIC, QUALITY_LOW)?;
        part.attach_mesh(mesh, QUALITY_REFIT)?;
        part.commit()?;
        Ok(Self {
            part,
            vertices: mesh.positions.len(),
        })
    }

    /// Moves the vertices and refits; returns the seconds from `rtcUpdateGeometryBuffer` to the end of `rtcCommitScene`. The
    /// new positions are copied before.
    ///
    /// # Errors
    /// Message of Embree.
    ///
    /// # Panics
    /// If there are not as many positions as before.
    pub fn refit(&mut self, positions: &[[f32; 3]]) -> Result<f64, String> {
        assert_eq!(positions.len(), self.vertices, "as many vertices as before");
        let functions = self.part.functions();
        let geometry = self.geometry();
        // SAFETY: the scene and its geometry are alive, and nobody queries them. The buffer has room for so many vertices of
        // three numbers, and is not ours.
        unsafe {
            let buffer = (functions.buffer_data)(geometry, VERTEX_BUFFER, 0);
            if buffer.is_null() {
                return Err("Embree has no vertex buffer".into());
            }
            std::ptr::copy_nonoverlapping(positions.as_ptr(), buffer.cast(), positions.len());
        }
        let start = Instant::now();
        // SAFETY: as above.
        unsafe {
            (functions.update_buffer)(geometry, VERTEX_BUFFER, 0);
            (functions.commit_geometry)(geometry);
        }
        self.part.commit()?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &mut [SingleRay]) {
        let _mode = FlushDenormals::begin();
        self.part.occluded(rays);
    }

    /// `rtcIntersect1` for every ray.
    pub fn intersect(&self, rays: &mut [RayHit]) {
        let _mode = FlushDenormals::begin();
        self.part.intersect(rays);
    }

    fn geometry(&self) -> Handle {
        // SAFETY: the scene is alive and has this geometry.
        unsafe { (self.part.functions().get_geometry)(self.part.handle, GEOMETRY) }
    }
}
