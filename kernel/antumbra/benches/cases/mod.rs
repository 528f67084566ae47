//! What is counted: whole queries, on a small scene that is fixed for ever, so that what is measured today can be compared with what was measured before.

use antumbra::recipe::{Collapse, Engine, Order};
use antumbra::{Bvh, Geometry, Hit, Ray, Recipe};
use antumbra_testkit::{mesh, rng::Rng};

/// The tree fits into a first-level cache: steps are measured, not memory.
const TRIANGLES: usize = 128;

/// Too many for a CPU to learn by heart which way each of them goes.
const RAYS: usize = 1024;

/// A tree and rays.
pub struct Scene {
    bvh: Bvh,
    /// Between two places in the scene each; some are occluded.
    rays: Vec<Ray>,
    /// As many, none of which comes near any box.
    misses: Vec<Ray>,
}

impl Scene {
    /// The tree is collapsed by area, so that the figures do not move with what is learned.
    pub fn new(engine: Engine) -> Self {
        let mut rng = Rng::new(1);
        let soup = mesh::soup(&mut rng, TRIANGLES);
        let geometry = [Geometry::triangles(&soup.positions[..], soup.indices)];
        let options = Recipe::default()
            .engine(engine)
            .collapse(Collapse::Area)
            .order(Order::Simple);
        let bvh = Bvh::build(&geometry, &options).expect("a proper mesh");
        let mut rays = Vec::new();
        let mut misses = Vec::new();
        for _ in 0..RAYS {
            rays.push(Ray::between(rng.point(1.0), rng.point(1.0)));
            let [x, y, z] = rng.direction();
            misses.push(Ray::new([10.0, 0.0, 0.0], [x.abs() + 0.1, y, z]));
        }
        Self { bvh, rays, misses }
    }
}

/// Everything that is measured: each method does something many times and returns how many times.
pub struct Work<'a> {
    scene: &'a Scene,
    occluded: Vec<bool>,
    hits: Vec<Option<Hit>>,
}

impl<'a> Work<'a> {
    /// Checks the answers first: the time of a wrong one is of no interest. That also leaves all memory
    /// allocated.
    pub fn new(scene: &'a Scene) -> Self {
        let mut work = Self {
            scene,
            occluded: vec![false; RAYS],
            hits: vec![None; RAYS],
        };
        work.check();
        work
    }

    fn check(&mut self) {
        self.missed();
        assert!(!self.occluded.contains(&true));
        self.batch_occluded();
        self.batch_intersect();
        let occluded = self.occluded.clone();
        let hit: Vec<_> = self.hits.iter().map(Option::is_some).collect();
        assert_eq!(occluded, hit);
        let count = occluded.iter().filter(|occluded| **occluded).count();
        assert!(RAYS / 4 < count && count < RAYS);
        self.single_occluded();
        assert_eq!(occluded, self.occluded);
        let hits = self.hits.clone();
        self.single_intersect();
        assert_eq!(hits, self.hits);
    }

    /// Rays that a set-up and one node step are enough for: the rest is the cost of keeping a stream going.
    pub fn missed(&mut self) -> usize {
        let rays = self.scene.bvh.batch(&self.scene.misses);
        rays.on_this_thread().occluded_into(&mut self.occluded);
        RAYS
    }

    pub fn batch_occluded(&mut self) -> usize {
        let rays = self.scene.bvh.batch(&self.scene.rays);
        rays.on_this_thread().occluded_into(&mut self.occluded);
        RAYS
    }

    pub fn batch_intersect(&mut self) -> usize {
        let rays = self.scene.bvh.batch(&self.scene.rays);
        rays.on_this_thread().intersect_into(&mut self.hits);
        RAYS
    }

    pub fn single_occluded(&mut self) -> usize {
        for (ray, occluded) in self.scene.rays.iter().zip(&mut self.occluded) {
            *occluded = self.scene.bvh.occluded(ray);
        }
        RAYS
    }

    pub fn single_intersect(&mut self) -> usize {
        for (ray, hit) in self.scene.rays.iter().zip(&mut self.hits) {
            *hit = self.scene.bvh.intersect(ray);
        }
        RAYS
    }
}
