//! The hook of an observer: somebody else answers, times or keeps the queries of a rendering.

use antumbra::{Bvh, Hit, Ray};

/// Observer of the queries of a rendering on all threads.
pub trait Observer: Sync {
    /// Observer of the queries of one more thread. Once `stop` returns true, the results of the thread are dropped.
    fn thread<'t>(&'t self, stop: &'t dyn Fn() -> bool) -> Box<dyn Queries + 't>;
}

/// Queries of one thread. Each method is called once for a batch of up to some ten thousand rays.
///
/// Answers must equal the answers of the tree, or the picture changes.
pub trait Queries {
    /// A batch of paths of the main pass begins.
    fn begin(&mut self, paths: &PathBatch<'_>) {
        let _ = paths;
    }

    /// Writes the closest hits of `rays` over `hits`.
    fn intersect(&mut self, bvh: &Bvh, rays: &[Ray], hits: &mut [Option<Hit>]) {
        bvh.batch(rays).on_this_thread().intersect_into(hits);
    }

    /// Writes over `occluded` whether `rays` are occluded.
    fn occluded(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) {
        bvh.batch(rays).on_this_thread().occluded_into(occluded);
    }

    /// Place in the batch of the path of every ray of the last occlusion query. Called for cost maps only.
    fn attribute(&mut self, paths: &mut dyn Iterator<Item = u32>) {
        let _ = paths;
    }

    /// The paths of the batch are traced.
    fn traced(&mut self) {}

    /// The samples of the batch are on the film.
    fn filmed(&mut self) {}

    /// The thread has traced its last path.
    fn end(self: Box<Self>) {}
}

/// Camera paths that a thread traces together.
#[derive(Clone, Copy, Debug)]
pub struct PathBatch<'a> {
    /// Number of the tile of the picture.
    pub tile: usize,
    /// Number of the first sample in its pixel.
    pub first: u32,
    /// Pixel of every path.
    pub pixels: &'a [[i32; 2]],
}
