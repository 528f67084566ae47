//! What the filters of partly transparent triangles are asked: no more than is needed.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use antumbra::cutout::{Candidate, Coverage, Opacity, Pattern};
use antumbra::{Bvh, Geometry, Ray};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{bits, brute, cutouts, kernel_rays, square, upwards};

/// Opaque triangles are never asked about, clear ones neither.
#[test]
fn the_filter_is_asked_of_mixed_triangles_only() {
    #[derive(Debug, Default)]
    struct Asked(AtomicUsize);
    impl Opacity for Asked {
        fn opacity(&self, candidate: &Candidate) -> f32 {
            assert_eq!((candidate.prim_id, candidate.geom_id), (2, 1));
            assert!((0.0..=1.0).contains(&candidate.u) && (0.0..=1.0).contains(&candidate.v));
            self.0.fetch_add(1, Ordering::Relaxed);
            0.0
        }
        fn coverage(&self, prim_id: u32, _: &[[f32; 2]; 3]) -> Coverage {
            [Coverage::Opaque, Coverage::Clear, Coverage::Mixed][prim_id as usize]
        }
    }
    let mut mesh = square(1.0);
    mesh.indices = vec![[0, 1, 2], [0, 2, 3], [0, 2, 3]];
    let filter = Arc::new(Asked::default());
    let rays = upwards(&mut Rng::new(45), 1000);
    let geometries = [Geometry::spheres(vec![]), cutouts(&mesh, filter.clone())];
    let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
    filter.0.store(0, Ordering::Relaxed);
    let mut occluded = vec![false; rays.len()];
    bvh.batch(&rays).occluded_into(&mut occluded);
    let below = |ray: &Ray| ray.org[1] < ray.org[0];
    for (ray, occluded) in rays.iter().zip(occluded) {
        assert_eq!(occluded, below(ray), "{ray:?}");
    }
    let asked = filter.0.load(Ordering::Relaxed);
    let above = rays.iter().filter(|ray| !below(ray)).count();
    assert_eq!(asked, above);
}

/// One triangle is asked for all that show the same, in whatever mesh they are; what stops a ray by chance is still each of them
/// by itself.
#[test]
fn one_of_a_pattern_is_asked_for_all() {
    #[derive(Debug, Default)]
    struct Veils(Mutex<BTreeSet<(u32, u32)>>);
    impl Opacity for Veils {
        fn opacity(&self, found: &Candidate) -> f32 {
            self.0
                .lock()
                .unwrap()
                .insert((found.geom_id, found.prim_id));
            if found.prim_id.is_multiple_of(2) {
                0.2
            } else {
                0.4
            }
        }
        fn pattern(&self, prim_id: u32) -> Option<Pattern> {
            Some(Pattern([u64::from(prim_id % 2), 0, 0, 0]))
        }
    }
    let seed = 49;
    let mut rng = Rng::new(seed);
    let meshes = [mesh::soup(&mut rng, 200), mesh::soup(&mut rng, 100)];
    let filters = [(); 2].map(|()| Arc::new(Veils::default()));
    let geometries: [_; 2] = core::array::from_fn(|i| cutouts(&meshes[i], filters[i].clone()));
    let brute = brute(&geometries);
    let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
    let rays = kernel_rays(&rays::around(&mut rng, &meshes[0], 500));
    let mut occluded = vec![false; rays.len()];
    let asked = || {
        let mut asked = filters.each_ref().map(|filter| filter.0.lock().unwrap());
        asked
            .each_mut()
            .map(|asked| core::mem::take(&mut **asked).len())
    };
    asked();
    bvh.batch(&rays).occluded_into(&mut occluded);
    assert_eq!(asked(), [2, 0]);
    for (ray, occluded) in rays.iter().zip(occluded) {
        assert_eq!(occluded, brute.occluded(ray), "seed {seed} {ray:?}");
        let found = bvh.intersect(ray);
        assert_eq!(
            bits(found),
            bits(brute.intersect(ray)),
            "seed {seed} {ray:?}"
        );
    }
}

/// What has decided about a ray is enough, also when the other hits lie in the same leaf.
#[test]
fn nothing_is_asked_behind_an_occluder() {
    #[derive(Debug, Default)]
    struct Asked(AtomicUsize);
    impl Opacity for Asked {
        fn opacity(&self, _: &Candidate) -> f32 {
            self.0.fetch_add(1, Ordering::Relaxed);
            1.0
        }
    }
    let mut mesh = square(1.0);
    mesh.indices = vec![[0, 1, 2]; 6];
    let filter = Arc::new(Asked::default());
    let rays = upwards(&mut Rng::new(48), 1000);
    let bvh = Bvh::build(&[cutouts(&mesh, filter.clone())], &Default::default());
    let bvh = bvh.expect("indices in range");
    let mut occluded = vec![false; rays.len()];
    filter.0.store(0, Ordering::Relaxed);
    bvh.batch(&rays).occluded_into(&mut occluded);
    let stopped = occluded.iter().filter(|&&occluded| occluded).count();
    assert!((300..700).contains(&stopped), "{stopped}");
    assert_eq!(filter.0.load(Ordering::Relaxed), stopped);
}
