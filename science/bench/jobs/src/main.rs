//! Whole jobs, from a mesh in memory to finished numbers, beside programs that use Embree 4.
//!
//!     bench/get-embree
//!     ANTUMBRA_SCENES=FOLDER cargo run --release --manifest-path science/bench/jobs/Cargo.toml -- bench/embree/LIBRARY [JOB...]
//!
//! Ours calls the crates as a user would. Embree's program is the best that we can write with few lines: it sorts points and
//! directions, and uses single calls or packets of 16, whichever a trial on an eighth of the job finds faster. Both are functions
//! of one file, `ours` and `embree`.
//!
//! CPU time of one thread, interleaved turns, medians. The time holds the build of the tree. Reading and generating scenes is
//! the same code for both and is left out.
//!
//! FOLDER holds the shared scenes `sponza/sponza.pbrt` and `scans/igea_igea.ply`. Jobs on scenes that are not there are skipped.

mod ambient;
mod city;
mod closest;
mod compare;
#[path = "../../calls/src/embree.rs"]
#[allow(dead_code, reason = "science/bench/calls uses packets of other sizes")]
mod embree;
mod exposure;
mod foliage;
mod input;
mod lidar;
mod rtc;
mod sight;
#[path = "../../calls/src/turns.rs"]
mod turns;

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{SkyDivision, vertex_normals};

use city::City;
use compare::Row;
use input::{Mesh, Sensors};
use rtc::Rtc;

/// A job, or why it cannot run here.
type Outcome = Result<Row, Box<dyn std::error::Error>>;

/// Runs a job by name.
type Run = fn(&Rtc) -> Outcome;

const JOBS: [(&str, Run); 12] = [
    ("sun-street", |rtc| {
        let city = City::new();
        exposure::sun(rtc, &city.mesh, &city.streets.inside(city::MIDDLE))
    }),
    ("sun-roofs", |rtc| {
        let city = City::new();
        exposure::sun(rtc, &city.mesh, &city.roofs.inside(city::MIDDLE))
    }),
    ("sun-hall", |rtc| {
        let mesh = input::read("sponza/sponza.pbrt")?;
        let floor = floor(&mesh)?;
        exposure::sun(rtc, &mesh, &floor)
    }),
    ("sky-145", |rtc| {
        let city = City::new();
        exposure::sky(rtc, &city.mesh, &city.streets, SkyDivision::Tregenza)
    }),
    ("sky-577", |rtc| {
        let city = City::new();
        let walls = city.walls.inside(city::MIDDLE);
        exposure::sky(rtc, &city.mesh, &walls, SkyDivision::Reinhart(2))
    }),
    ("ao-scan", |rtc| {
        let mesh = input::read("scans/igea_igea.ply")?;
        let normals = vertex_normals(&mesh.positions, &mesh.indices);
        let mut vertices = Sensors::default();
        for (&point, normal) in mesh.positions.iter().zip(normals) {
            if normal != [0.0; 3] {
                vertices.push(point, normal);
            }
        }
        ambient::run(rtc, &mesh, &vertices, 256)
    }),
    ("ao-atlas", |rtc| {
        let city = City::new();
        ambient::run(rtc, &city.mesh, &city.texels(384)?, 128)
    }),
    ("visibility", |rtc| {
        let city = City::new();
        sight::matrix(rtc, &city.mesh, &city.scattered(5000))
    }),
    ("viewshed", |rtc| sight::viewshed(rtc, 1415)),
    ("lidar", |rtc| {
        let city = City::new();
        lidar::run(rtc, &city)
    }),
    ("closest", |rtc| {
        let mesh = input::read("scans/igea_igea.ply")?;
        closest::run(rtc, &mesh, 50)
    }),
    ("foliage", foliage::run),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let library = args
        .next()
        .ok_or("name Embree's library, and jobs or none for all")?;
    let named: Vec<String> = args.collect();
    if let Some(unknown) = named
        .iter()
        .find(|name| JOBS.iter().all(|(job, _)| job != name))
    {
        return Err(format!(
            "there is no job {unknown}; there is {}",
            JOBS.map(|(job, _)| job).join(", ")
        )
        .into());
    }
    // Builds of one thread, which is this one.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.use_current_thread().build_global()?;
    let rtc = Rtc::load(&library);
    println!("{}", compare::HEAD);
    let mut ratios = Vec::new();
    for (name, run) in JOBS {
        if !named.is_empty() && !named.iter().any(|named| named == name) {
            continue;
        }
        eprintln!("{name}");
        match run(&rtc) {
            Ok(row) => {
                println!("{name:12} {row}");
                ratios.push(row.ratio());
            }
            Err(error) => println!("{name:12} skipped: {error}"),
        }
    }
    if !ratios.is_empty() {
        let mean = ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64;
        println!("geometric mean of the ratios {:.2}", mean.exp());
    }
    Ok(())
}

/// Our tree of a mesh, by default.
fn build(mesh: &Mesh) -> Bvh {
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    Bvh::build(&geometry, &Recipe::default()).expect("a mesh of finite triangles")
}

/// Sensors where rays from above meet the floor of a hall.
fn floor(mesh: &Mesh) -> Result<Sensors, Box<dyn std::error::Error>> {
    let bvh = build(mesh);
    let bounds = bvh.bounds();
    let size = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
    let at = |axis: usize, part: f32| bounds.min[axis] + part * size[axis];
    let (columns, rows) = (128, 64);
    let mut floor = Sensors::default();
    for index in 0..columns * rows {
        let x = at(0, ((index % columns) as f32 + 0.5) / columns as f32);
        let y = at(1, ((index / columns) as f32 + 0.5) / rows as f32);
        // From below the galleries, to what is not on a pedestal.
        let ray = antumbra::Ray::new([x, y, at(2, 0.2)], [0.0, 0.0, -1.0]);
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
