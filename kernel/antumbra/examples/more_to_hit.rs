//! User geometry, quads, masks and filters: an example of the book in `docs/`, run by its tests.

use std::sync::Arc;

use antumbra::saved::Functions;
use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, Bvh, Error, Geometry, Masks, Ray, Recipe};

// ANCHOR: user
/// Discs that face upwards: centre and radius.
#[derive(Debug)]
struct Discs(Vec<([f32; 3], f32)>);

impl UserGeometry for Discs {
    fn bounds(&self, prim_id: u32) -> Aabb {
        let ([x, y, z], radius) = self.0[prim_id as usize];
        Aabb {
            min: [x - radius, y - radius, z],
            max: [x + radius, y + radius, z],
        }
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let ([x, y, z], radius) = self.0[prim_id as usize];
        let t = (z - ray.org[2]) / ray.dir[2];
        let [px, py, _] = ray.at(t);
        let [u, v] = [(px - x) / radius, (py - y) / radius];
        (u * u + v * v <= 1.0).then_some(UserHit::new(t, u, v))
    }

    fn normal(&self, _: u32, _: &Ray, _: &UserHit) -> Option<[f32; 3]> {
        Some([0.0, 0.0, 1.0])
    }
}
// ANCHOR_END: user

fn main() -> Result<(), Error> {
    // ANCHOR: scene
    let discs = vec![([2.0, 2.0, 3.0], 1.0), ([5.0, 5.0, 4.0], 2.0)];
    let table = [
        [0.0, 0.0, 1.0],
        [8.0, 0.0, 1.0],
        [8.0, 8.0, 1.0],
        [0.0, 8.0, 1.0],
    ];
    let geometry = [
        Geometry::quads(&table[..], vec![[0, 1, 2, 3]]),
        Geometry::user(2, Arc::new(Discs(discs.clone()))),
    ];
    let mut bvh = Bvh::build(&geometry, &Recipe::default())?;
    // ANCHOR_END: scene

    let down = |x, y| Ray::new([x, y, 9.0], [0.0, 0.0, -1.0]);
    let hit = bvh.intersect(&down(2.5, 2.0)).expect("the first disc");
    assert_eq!((hit.geom_id, hit.prim_id, hit.t, hit.u), (1, 0, 6.0, 0.5));
    let hit = bvh.intersect(&down(6.0, 2.0)).expect("the table");
    assert_eq!((hit.geom_id, hit.u, hit.v), (0, 0.75, 0.25));

    // ANCHOR: masks
    let (furniture, lamps) = (0b01, 0b10);
    bvh.set_masks(Masks::new().world(vec![furniture, lamps]));

    // Light from a lamp is not blocked by lamps.
    let ray = down(5.0, 5.0);
    let blocker = bvh.query(&ray).mask(furniture).intersect();
    // ANCHOR_END: masks
    assert_eq!(blocker.map(|hit| hit.geom_id), Some(0));

    // ANCHOR: filters
    // The rim of a disc is all there is of it.
    let is_solid = |hit: &antumbra::Hit| hit.geom_id == 0 || hit.u * hit.u + hit.v * hit.v > 0.5;
    let first = bvh.query(&ray).filter(&is_solid).intersect();

    // Each ray of a batch ignores a geometry of its own.
    let rays = [ray, ray];
    let ignored = [0, 1];
    let own = |ray: usize, hit: &antumbra::Hit| hit.geom_id != ignored[ray];
    let hits = bvh.batch(&rays).filter(&own).intersect();
    // ANCHOR_END: filters
    assert_eq!(first.map(|hit| hit.geom_id), Some(0));
    assert_eq!(
        hits.iter()
            .flatten()
            .map(|hit| hit.geom_id)
            .collect::<Vec<_>>(),
        [1, 0]
    );
    let mut file = Vec::new();
    bvh.write(&mut file)?;
    let discs = Arc::new(Discs(discs));
    // ANCHOR: functions
    let functions = Functions::new().shapes(vec![discs]);
    let loaded: Bvh = functions.read(&file[..])?;
    // ANCHOR_END: functions
    assert_eq!(loaded.intersect(&ray), bvh.intersect(&ray));

    println!("a disc hides the table at {:?}", ray.at(5.0));
    Ok(())
}
