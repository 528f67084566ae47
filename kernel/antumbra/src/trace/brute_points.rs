//! Queries about points without any tree: the oracle of those with one.

use crate::geometry::instance::Affine;
use crate::geometry::nearest::Place;
use crate::geometry::primitives::{Prim, Primitives};
use crate::geometry::winding::crossing;
use crate::ray::INVALID_ID;
use crate::trace::inside::{Around, into_object};
use crate::trace::nearest::{Candidate, Seeker};

/// Offers everything in a world.
pub(crate) fn offer_all(world: &Primitives, point: [f32; 3], seeker: &mut dyn Seeker) {
    let point = point.map(f64::from);
    let place = Place {
        point,
        affine: None,
    };
    offer_list(world, &place, INVALID_ID, seeker);
    for placed in &world.instances {
        let affine = Affine::new(&placed.world_from_object);
        let place = Place {
            point,
            affine: Some(&affine),
        };
        let object = &world.objects[placed.object as usize];
        offer_list(object, &place, placed.placement.inst_id, seeker);
    }
}

fn offer_list(list: &Primitives, place: &Place<'_>, inst_id: u32, seeker: &mut dyn Seeker) {
    for index in 0..list.len() {
        let prim = list.prim(index);
        let near = || match prim {
            Prim::Triangle(corners, _) => Some(place.triangle(corners)),
            Prim::Scalar(shape, id) => shape.near(id.prim_id, place),
        };
        if let Some(reach) = seeker.of_reach() {
            reach.measure(list.kind(index), place, near, || list.bounds_of(index));
            continue;
        }
        let (Prim::Triangle(_, id) | Prim::Scalar(_, id)) = prim;
        if let Some(near) = near() {
            seeker.offer(Candidate { near, id, inst_id });
        }
    }
}

/// Winding number around a point, which is finite, and whether the point is inside.
pub(crate) fn around(world: &Primitives, point: [f32; 3]) -> Around {
    let point = point.map(f64::from);
    let mut around = around_in(world, point);
    for placed in &world.instances {
        let object = &world.objects[placed.object as usize];
        if let Some((point, sign)) =
            into_object(&placed.placement, &placed.world_from_object, point)
        {
            around.add(sign, around_in(object, point));
        }
    }
    around
}

fn around_in(list: &Primitives, point: [f64; 3]) -> Around {
    let crossings = (0..list.len()).map(|index| match list.prim(index) {
        Prim::Triangle(corners, id) => (id, crossing(corners, point)),
        Prim::Scalar(shape, id) => (id, shape.crossing(point)),
    });
    Around::new(&mut crossings.collect())
}
