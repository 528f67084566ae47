//! A million triangles in a thousand objects that all move and bend: what a frame costs.
//!
//! Every frame refits all objects, builds the top level again and traces a shadow ray per pixel. A copy of the world learns the child
//! order from a sample of these rays, on a thread of its own. What it learned is adopted between two frames.
//!
//! `cargo run --release -p antumbra --example frame_loop`

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use antumbra::{ChildOrder, Error, Geometry, Instance, Object, Ray, Recipe, World};

const OBJECTS: usize = 1000;
/// Squares along a side of the sheet that each object is: two triangles each.
const SIDE: u32 = 22;
const WIDTH: usize = 640;
const HEIGHT: usize = 480;

/// A sheet that waves.
fn positions(phase: f32) -> Vec<[f32; 3]> {
    let place = |i: u32| i as f32 / SIDE as f32 - 0.5;
    let vertex = |i: u32| {
        let (x, y) = (place(i % (SIDE + 1)), place(i / (SIDE + 1)));
        [
            x,
            y,
            0.2 * (6.0 * x + phase).sin() * (5.0 * y + phase).cos(),
        ]
    };
    (0..(SIDE + 1) * (SIDE + 1)).map(vertex).collect()
}

fn triangles() -> Vec<[u32; 3]> {
    let corner = |x: u32, y: u32| y * (SIDE + 1) + x;
    let square = |i: u32| {
        let (x, y) = (i % SIDE, i / SIDE);
        let [a, b, c, d] = [
            corner(x, y),
            corner(x + 1, y),
            corner(x + 1, y + 1),
            corner(x, y + 1),
        ];
        [[a, b, c], [a, c, d]]
    };
    (0..SIDE * SIDE).flat_map(square).collect()
}

/// Sheets on a wobbling lattice.
fn instances(time: f32) -> Vec<Instance> {
    let place = |index: usize| {
        let [x, y, z] = [index % 10, index / 10 % 10, index / 100].map(|i| i as f32 - 4.5);
        let turn = time + index as f32;
        let (s, c) = turn.sin_cos();
        Instance::new(
            index as u32,
            [
                [c, 0.0, s, x + 0.2 * s],
                [0.0, 1.0, 0.0, y + 0.2 * c],
                [-s, 0.0, c, z],
            ],
        )
    };
    (0..OBJECTS).map(place).collect()
}

/// All objects at a moment.
fn meshes(time: f32, indices: &[[u32; 3]]) -> Vec<[Geometry<'_>; 1]> {
    let mesh = |index| [Geometry::triangles(positions(index as f32 + time), indices)];
    (0..OBJECTS).map(mesh).collect()
}

/// Moves everything to where it is at a moment.
fn move_all(world: &mut World, time: f32, meshes: &[[Geometry<'_>; 1]]) -> Result<(), Error> {
    let moved: Vec<_> = (0..).zip(meshes.iter().map(|mesh| &mesh[..])).collect();
    world.refit(&moved, &instances(time))
}

/// A moment, and some of its rays.
type Sample = (f32, Vec<Ray>);

/// Learns from one sample after the other.
fn learn(
    mut copy: World,
    indices: &[[u32; 3]],
    samples: Receiver<Sample>,
    learned: Sender<(ChildOrder, Duration)>,
) -> Result<(), Error> {
    for (time, rays) in samples {
        let start = Instant::now();
        move_all(&mut copy, time, &meshes(time, indices))?;
        let order = copy.relearn(&rays, &Recipe::default());
        if learned.send((order, start.elapsed())).is_err() {
            break;
        }
    }
    Ok(())
}

/// Milliseconds.
fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn main() -> Result<(), Error> {
    let indices = triangles();
    let start = Instant::now();
    let objects: Vec<_> = (0..OBJECTS)
        .map(|index| {
            let geometry = [Geometry::triangles(positions(index as f32), &indices[..])];
            Object::build(&geometry, &Recipe::default())
        })
        .collect::<Result<_, _>>()?;
    let mut world = World::new(&objects, &instances(0.0))?;
    println!(
        "{} triangles in {OBJECTS} objects, built in {:.0} ms",
        world.report().primitives,
        ms(start.elapsed())
    );

    let camera = [0.0, 0.0, -12.0];
    let pixels: Vec<_> = (0..WIDTH * HEIGHT)
        .map(|pixel| {
            let at = |place: usize, size: usize| place as f32 / size as f32 - 0.5;
            let (x, y) = (at(pixel % WIDTH, WIDTH), at(pixel / WIDTH, HEIGHT));
            Ray::new(camera, [1.2 * x, 0.9 * y, 1.0])
        })
        .collect();
    let lamp = [3.0, 20.0, -4.0];
    let mut hits = vec![None; pixels.len()];
    let mut shadows: Vec<Ray> = Vec::new();
    let mut occluded = Vec::new();

    thread::scope(|scope| {
        let copy = world.clone();
        let (to_learner, samples) = channel();
        let (to_frames, learned) = channel();
        let learner = scope.spawn(|| learn(copy, &indices, samples, to_frames));
        let mut is_learning = false;

        println!("times in ms; rates in Mray/s");
        println!(
            "{:>5} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}",
            "frame", "vertices", "refit", "camera", "shadows", "rate", "learn", "quality"
        );
        for frame in 1..=24u32 {
            let time = 0.05 * frame as f32;
            let start = Instant::now();
            let meshes = meshes(time, &indices);
            let vertices = start.elapsed();

            // Before the top level is built again, so that it has the learned order.
            let start = Instant::now();
            let learned = learned.try_recv();
            if let Ok((order, _)) = &learned {
                world.adopt(order);
            }
            let mut learning = start.elapsed();

            let start = Instant::now();
            move_all(&mut world, time, &meshes)?;
            let refit = start.elapsed();

            let start = Instant::now();
            world.batch(&pixels).intersect_into(&mut hits);
            let seen = start.elapsed();

            shadows = (pixels.iter().zip(&hits))
                .filter_map(|(ray, hit)| {
                    // A little before the surface.
                    let t = hit.as_ref()?.t * 0.9999;
                    let point = std::array::from_fn(|axis| ray.org[axis] + t * ray.dir[axis]);
                    Some(Ray::between(point, lamp))
                })
                .collect();
            occluded.clear();
            occluded.resize(shadows.len(), false);
            let start = Instant::now();
            world.batch(&shadows).occluded_into(&mut occluded);
            let shadow = start.elapsed();

            let start = Instant::now();
            if learned.is_ok() || !is_learning {
                let sample = shadows.iter().step_by(shadows.len() / 4096 + 1).copied();
                is_learning = to_learner.send((time, sample.collect())).is_ok();
            }
            learning += start.elapsed();
            println!(
                "{frame:5} {:8.1} {:8.1} {:8.1} {:8.1} {:8.2} {:8.3} {:8.2}{}",
                ms(vertices),
                ms(refit),
                ms(seen),
                ms(shadow),
                shadows.len() as f64 / shadow.as_secs_f64() / 1e6,
                ms(learning),
                world.quality(0),
                match learned {
                    Ok((_, time)) => format!("  adopted what took {:.0} ms beside", ms(time)),
                    Err(_) => String::new(),
                },
            );
        }
        drop(to_learner);
        learner.join().expect("it does not panic")
    })?;

    // Objects that move and do not bend.
    let start = Instant::now();
    world.set_instances(&instances(0.7))?;
    println!("instances alone: {:.1} ms", ms(start.elapsed()));
    Ok(())
}
