//! A camera that moves through the scene, and a tree that learns from the frames it has answered.

use antumbra::{Bvh, Ray, RayMemory};
use antumbra_scene::Camera;
use glam::{DMat4, DVec3};

use super::row::Row;
use super::turns::in_turns;
use super::{Part, Subject};
use crate::study::Kind;
use crate::thread_time;
use crate::{Error, SampledRays};

/// Rays that the learning tree keeps.
const KEPT: usize = 4096;

/// The default tree that never saw a ray of the picture, the one that learned the first frame, and the one that
/// learns after every frame.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    let kind = Kind::Shadow;
    let Subject {
        world,
        recipe,
        options,
        ..
    } = *subject;
    let primitives = world.primitives();
    let never = Bvh::build(primitives, &recipe).expect("a tree");
    let mut first: Option<[Bvh; 2]> = None;
    let mut memory = RayMemory::new(KEPT);
    let mut rows = Vec::new();
    for frame in 0..options.frames {
        let camera = camera(&subject.scene.camera, &never, frame, options.frames);
        let spp = subject.scene.sampler.pixel_samples;
        let samples = SampledRays::new(world, &never, spp, options.seed + frame as u64);
        let mut samples = samples.with_camera(&camera)?;
        let lot = samples.take_in_picture_order(options.rays, 0);
        let rays: &[Ray] = &lot.shadow;
        let trees = first.get_or_insert_with(|| {
            let learned = Bvh::learn(primitives, rays, &recipe).expect("a tree");
            [learned.clone(), learned]
        });
        let named = [
            ("never learned", &never),
            ("learned from frame 0", &trees[0]),
            ("relearned every frame", &trees[1]),
        ];
        let mut expected = None;
        let before = rows.len();
        for (technique, bvh) in named {
            let row = Row::new(subject, Part::Moving, kind, technique);
            let mut row = row.counted(bvh, rays, recipe.costs.prim, &mut expected)?;
            row.tree = recipe.builder.name();
            row.collapse = recipe.collapse.name();
            row.frame = Some(frame);
            row.test_rays = rays.len();
            row.log_rays = KEPT;
            rows.push(row);
        }
        if options.rounds > 0 && !rays.is_empty() {
            let mut works: Vec<Box<dyn FnMut() + '_>> = Vec::new();
            for (_, bvh) in named {
                let mut answers = vec![false; rays.len()];
                works.push(Box::new(move || {
                    bvh.batch(rays).on_this_thread().occluded_into(&mut answers);
                }));
            }
            let speeds = in_turns(options.rounds, &mut works);
            for (row, speed) in rows[before..].iter_mut().zip(speeds) {
                row.time(speed, true);
            }
        }
        memory.show(rays);
        memory.fade();
        let start = thread_time::seconds();
        trees[1].relearn(memory.rays(), &recipe);
        if let Some(row) = rows.last_mut() {
            row.learn_ms = Some(1e3 * (thread_time::seconds() - start));
        }
    }
    Ok(rows)
}

/// The camera of a frame: walks half of the way to what it sees, turns round once on the way and comes back.
fn camera(own: &Camera, bvh: &Bvh, frame: usize, frames: usize) -> Camera {
    let share = frame as f64 / frames.max(1) as f64;
    let matrix = own.world_from_camera.as_dmat4();
    let eye = matrix.transform_point3(DVec3::ZERO).as_vec3().to_array();
    let forward = matrix.transform_vector3(DVec3::Z).as_vec3().to_array();
    let seen = bvh.intersect(&Ray::new(eye, forward));
    let way = seen.map_or(0.0, |hit| 0.5 * f64::from(hit.t));
    let way = way * (std::f64::consts::PI * share).sin();
    let turn = DMat4::from_rotation_y(std::f64::consts::TAU * share);
    Camera {
        world_from_camera: (matrix * DMat4::from_translation(DVec3::new(0.0, 0.0, way)) * turn)
            .as_mat4(),
        ..own.clone()
    }
}
