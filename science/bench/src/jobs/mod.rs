//! Whole jobs: two programs for one job, interleaved. The time holds the build of the tree. Reading and generating scenes is the same
//! code for both and is left out.
//!
//! Ours calls the crates as a user would. Embree's program sorts points and directions, and uses single calls or packets of 16,
//! whichever a trial on an eighth of the job finds faster.

mod ambient;
mod city;
mod closest;
mod exposure;
mod foliage;
mod lidar;
mod sight;

use std::path::Path;

use antumbra::{Bvh, Ray};
use antumbra_bake::{SkyDivision, vertex_normals};
use antumbra_lab::embree::{Scene, SceneFlags};
use antumbra_lab::harness::{Bench, Mesh, Row, interleave, median, ratios, spread};
use antumbra_lab::thread_seconds as seconds;

use crate::Outcome;
use crate::input::Sensors;
use city::City;

/// Turns of each program.
const ROUNDS: usize = 3;

/// Part of a job that decides which calls of Embree are fastest: one in so many.
const TRIAL: usize = 8;

/// Name of our program.
pub const OURS: &str = "ours";

/// The jobs by name.
pub const NAMES: [&str; 12] = [
    "sun-street",
    "sun-roofs",
    "sun-hall",
    "sky-145",
    "sky-577",
    "ao-scan",
    "ao-atlas",
    "visibility",
    "viewshed",
    "lidar",
    "closest",
    "foliage",
];

/// Does the jobs that are wanted. One that cannot run here is skipped.
pub fn run(bench: &mut Bench, is_wanted: &dyn Fn(&str) -> bool) {
    for name in NAMES.into_iter().filter(|name| is_wanted(name)) {
        if let Err(error) = job(bench, name) {
            println!("{name:24} skipped: {error}");
        }
    }
}

fn job(bench: &mut Bench, name: &'static str) -> Outcome {
    let part = bench.part;
    let some = |sensors: &Sensors| sensors.only(|index, _| index % part == 0);
    let middle = |sensors: &Sensors| {
        sensors.only(|_, [x, y, _]| x.abs() < city::MIDDLE && y.abs() < city::MIDDLE)
    };
    let mut bench = Job { bench, name };
    match name {
        "sun-hall" => {
            let mesh = read("sponza/sponza.pbrt")?;
            exposure::sun(&mut bench, &mesh, &some(&floor(&mesh)?))
        }
        "ao-scan" => {
            let mesh = read("scans/igea_igea.ply")?;
            let normals = vertex_normals(&mesh.positions, &mesh.indices);
            let vertices = Sensors {
                points: mesh.positions.clone(),
                normals: normals.clone(),
            };
            let vertices = vertices.only(|index, _| normals[index] != [0.0; 3]);
            ambient::run(&mut bench, &mesh, &some(&vertices), 256)
        }
        "closest" => closest::run(&mut bench, &read("scans/igea_igea.ply")?, 50 / part.min(50)),
        "viewshed" => sight::viewshed(&mut bench, (1415 / part).max(8) as u32),
        "foliage" => foliage::run(&mut bench, 320 / part.min(320)),
        _ => {
            let city = City::new();
            let mesh = &city.mesh;
            match name {
                "sun-street" => exposure::sun(&mut bench, mesh, &some(&middle(&city.streets))),
                "sun-roofs" => exposure::sun(&mut bench, mesh, &some(&middle(&city.roofs))),
                "sky-145" => exposure::sky(
                    &mut bench,
                    mesh,
                    &some(&city.streets),
                    SkyDivision::Tregenza,
                ),
                "sky-577" => {
                    let walls = some(&middle(&city.walls));
                    exposure::sky(&mut bench, mesh, &walls, SkyDivision::Reinhart(2))
                }
                "ao-atlas" => ambient::run(&mut bench, mesh, &some(&city.texels(384)?), 128),
                "visibility" => sight::matrix(&mut bench, mesh, &city.scattered(5000 / part)),
                _ => lidar::run(&mut bench, mesh, &middle(&city.streets), 50 / part.min(50)),
            }
        }
    }
}

/// Reads a scene of the shared folder as one mesh, without its lights.
fn read(name: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    let folder = std::env::var("ANTUMBRA_SCENES").unwrap_or_default();
    let path = Path::new(&folder).join(name);
    match path.to_str().filter(|_| path.exists()) {
        Some(path) => Mesh::read(path),
        None => Err("no shared scenes".into()),
    }
}

/// A job under way.
pub struct Job<'b> {
    bench: &'b mut Bench,
    name: &'static str,
}

/// Two programs for one job.
pub struct Programs<'w, W, O, E> {
    pub mesh: &'w Mesh,
    pub flags: SceneFlags,
    pub ours: O,
    /// Ways to call Embree, by name.
    pub ways: &'w [(&'static str, W)],
    /// Embree's program, by a way, of one part in so many of the job.
    pub embree: E,
}

impl Job<'_> {
    /// Runs both programs, builds included, ours with default trees. `judge` says how many answers there are, and how many of
    /// them differ. Returns the results of ours.
    pub fn compare<T, W: Copy>(
        &mut self,
        programs: Programs<W, impl Fn(&Bvh) -> T, impl Fn(&Scene, W, usize) -> T>,
        judge: impl Fn(&T, &T) -> [usize; 2],
    ) -> Result<T, Box<dyn std::error::Error>> {
        let (mesh, ours) = (programs.mesh, &programs.ours);
        let Programs {
            flags,
            ways,
            embree,
            ..
        } = &programs;
        self.compare_with((mesh, *flags), || mesh.tree(), ours, (ways, embree), judge)
    }

    /// [`Job::compare`], where ours builds something else than a tree.
    pub fn compare_with<B, T, W: Copy>(
        &mut self,
        (mesh, flags): (&Mesh, SceneFlags),
        build: impl Fn() -> B,
        ours: impl Fn(&B) -> T,
        (ways, embree): (&[(&'static str, W)], impl Fn(&Scene, W, usize) -> T),
        judge: impl Fn(&T, &T) -> [usize; 2],
    ) -> Result<T, Box<dyn std::error::Error>> {
        let (device, model) = (self.bench.device()?, mesh.model());
        let scene = || Scene::build(&device, &model, flags);
        let trial = |scene: &Scene, way: W| {
            let once = |_| {
                let start = seconds();
                embree(scene, way, TRIAL);
                seconds() - start
            };
            [0, 1].map(once).into_iter().fold(f64::INFINITY, f64::min)
        };
        let tried = scene()?;
        let (mut best, mut fastest) = (ways[0], f64::INFINITY);
        for &(calls, way) in ways {
            let time = trial(&tried, way);
            eprintln!("    trial: {calls:24} {time:.3} s");
            if time < fastest {
                (best, fastest) = ((calls, way), time);
            }
        }
        drop(tried);
        let mut results = [None, None];
        let mut builds = [Vec::new(), Vec::new()];
        let times = interleave(ROUNDS, 2, |which| {
            let start = seconds();
            let (result, built) = if which == 0 {
                let built = build();
                let time = seconds() - start;
                (ours(&built), time)
            } else {
                let scene = scene()?;
                let time = seconds() - start;
                (embree(&scene, best.1, 1), time)
            };
            let time = seconds() - start;
            results[which] = Some(result);
            builds[which].push(built);
            Ok::<_, antumbra_lab::Error>(time)
        })?;
        let [ours, theirs] = results.map(|result| result.expect("a turn"));
        let [count, differ] = judge(&ours, &theirs);
        let over = format!("Embree, {}", best.0);
        for (which, name) in [(1, &*over), (0, OURS)] {
            self.bench.add(Row {
                case: self.name.to_owned(),
                work: name.to_owned(),
                count,
                seconds: spread(times[which].iter().copied()),
                over: over.clone(),
                speedup: spread(ratios(&times[which], &times[1])),
                differ: if which == 0 { differ } else { 0 },
                // The first round fetches memory.
                build_seconds: Some(median(builds[which].split_off(1))),
                lines: None,
            });
        }
        Ok(ours)
    }
}

/// How many of a list differ.
pub fn differing<T>(differs: impl Fn(&T, &T) -> bool) -> impl Fn(&Vec<T>, &Vec<T>) -> [usize; 2] {
    move |a, b| {
        let both = a.iter().zip(b);
        [a.len(), both.filter(|(a, b)| differs(a, b)).count()]
    }
}

/// Sensors where rays from above hit the floor of a hall.
fn floor(mesh: &Mesh) -> Result<Sensors, Box<dyn std::error::Error>> {
    let bvh = mesh.tree();
    let bounds = bvh.bounds();
    let size = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
    let at = |axis: usize, part: f32| bounds.min[axis] + part * size[axis];
    let (columns, rows) = (128, 64);
    let mut floor = Sensors::default();
    for index in 0..columns * rows {
        let x = at(0, ((index % columns) as f32 + 0.5) / columns as f32);
        let y = at(1, ((index / columns) as f32 + 0.5) / rows as f32);
        // From below the galleries, to what is not on a pedestal.
        let ray = Ray::new([x, y, at(2, 0.2)], [0.0, 0.0, -1.0]);
        let hit = bvh.intersect(&ray).map(|hit| ray.at(hit.t));
        if let Some(point) = hit.filter(|point| point[2] < at(2, 0.1)) {
            floor.push(point, [0.0, 0.0, 1.0]);
        }
    }
    match floor.points.len() {
        0 => Err("there is no floor".into()),
        _ => Ok(floor),
    }
}
