//! Bakes ambient occlusion into the vertices of a mesh: reads an OBJ file, writes a PLY file with grey vertices.
//!
//! `cargo run --release -p antumbra --example ao_bake [IN.obj OUT.ply]`
//!
//! Without files a built-in pile of blocks is baked, and nothing is written.

use std::error::Error;
use std::io::Write;
use std::time::Instant;

use antumbra::{Bvh, Geometry, Ray, Recipe};

/// Rays per vertex.
const SAMPLES: usize = 64;
/// Rays that are traced at one go.
const BATCH: usize = 1 << 16;

struct Mesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Positions and faces of an OBJ file; faces of more corners become fans.
fn read_obj(text: &str) -> Result<Mesh, Box<dyn Error>> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (number, line) in (1..).zip(text.lines()) {
        let wrong = |what: &str| format!("line {number}: {what}: {line}");
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.map_while(|word| word.parse().ok()).collect();
                let [x, y, z, ..] = numbers[..] else {
                    return Err(wrong("not three numbers").into());
                };
                positions.push([x, y, z]);
            }
            Some("f") => {
                let corner = |word: &str| -> Option<u32> {
                    let index: i64 = word.split('/').next()?.parse().ok()?;
                    let count = positions.len() as i64;
                    // Indices begin at 1, and negative ones count from the end.
                    let index = if index < 0 { count + index } else { index - 1 };
                    u32::try_from(index).ok()
                };
                let corners: Option<Vec<u32>> = words.map(corner).collect();
                let corners = corners.ok_or_else(|| wrong("a corner is no index"))?;
                let fan = corners.windows(2).skip(1);
                triangles.extend(fan.map(|pair| [corners[0], pair[0], pair[1]]));
            }
            _ => {}
        }
    }
    Ok(Mesh {
        positions,
        triangles,
    })
}

/// Blocks on a floor, each side divided so that its vertices see shadows.
fn blocks() -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut side = |corner: [f32; 3], a: [f32; 3], b: [f32; 3], parts: u32| {
        let first = positions.len() as u32;
        let at = |i: u32, j: u32| first + j * (parts + 1) + i;
        for j in 0..=parts {
            for i in 0..=parts {
                let [s, t] = [i, j].map(|place| place as f32 / parts as f32);
                positions.push([0, 1, 2].map(|axis| corner[axis] + s * a[axis] + t * b[axis]));
            }
        }
        for (i, j) in (0..parts * parts).map(|place| (place % parts, place / parts)) {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[p, q, r], [p, r, s]]);
        }
    };
    side([0.0; 3], [40.0, 0.0, 0.0], [0.0, 40.0, 0.0], 160);
    for place in 0..400u32 {
        let [x, y] = [place % 20, place / 20].map(|place| 2.0 * place as f32 + 0.4);
        let z = 0.5 + (place * 7919 % 97) as f32 / 25.0;
        side([x, y, z], [1.2, 0.0, 0.0], [0.0, 1.2, 0.0], 6);
        side([x, y, 0.0], [1.2, 0.0, 0.0], [0.0, 0.0, z], 6);
        side([x + 1.2, y + 1.2, 0.0], [-1.2, 0.0, 0.0], [0.0, 0.0, z], 6);
        side([x, y + 1.2, 0.0], [0.0, -1.2, 0.0], [0.0, 0.0, z], 6);
        side([x + 1.2, y, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, z], 6);
    }
    Mesh {
        positions,
        triangles,
    }
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = a.iter().map(|x| x * x).sum::<f32>().sqrt();
    a.map(|x| x / length)
}

/// Normals at the vertices, weighed by area; NaN where no triangle has an area.
fn normals(mesh: &Mesh) -> Result<Vec<[f32; 3]>, Box<dyn Error>> {
    let mut sums = vec![[0.0; 3]; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let corner = |index: u32| mesh.positions.get(index as usize).copied();
        let [Some(a), Some(b), Some(c)] = triangle.map(corner) else {
            return Err(format!("no such vertex: {triangle:?}").into());
        };
        let edge = |to: [f32; 3]| [0, 1, 2].map(|axis| to[axis] - a[axis]);
        let normal = cross(edge(b), edge(c));
        for &index in triangle {
            (0..3).for_each(|axis| sums[index as usize][axis] += normal[axis]);
        }
    }
    Ok(sums.into_iter().map(unit).collect())
}

/// Directions above the plane of a normal, as often as their cosine: a spiral, turned by another angle at every vertex.
fn direction(normal: [f32; 3], sample: usize, turn: f32) -> [f32; 3] {
    let other = if normal[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let tangent = unit(cross(normal, other));
    let bitangent = cross(normal, tangent);
    let height = (sample as f32 + 0.5) / SAMPLES as f32;
    let (sin, cos) = (2.399_963 * sample as f32 + turn).sin_cos();
    let (radius, up) = (height.sqrt(), (1.0 - height).sqrt());
    [0, 1, 2].map(|axis| radius * (cos * tangent[axis] + sin * bitangent[axis]) + up * normal[axis])
}

fn main() -> Result<(), Box<dyn Error>> {
    let names: Vec<_> = std::env::args().skip(1).collect();
    let mesh = match &names[..] {
        [] => blocks(),
        [input, _] => read_obj(&std::fs::read_to_string(input)?)?,
        _ => return Err("give no file, or IN.obj and OUT.ply".into()),
    };
    let normals = normals(&mesh)?;

    // ANCHOR: book
    let start = Instant::now();
    let geometry = [Geometry::triangles(
        &mesh.positions[..],
        &mesh.triangles[..],
    )];
    let bvh = Bvh::build(&geometry, &Recipe::default())?;
    let built = start.elapsed().as_secs_f64();

    // Rays begin a little above the surface, all along the mesh and vertex by vertex.
    let offset = bvh.bounds().origin_offset();
    let ray = |index: usize| {
        let (vertex, sample) = (index / SAMPLES, index % SAMPLES);
        let (position, normal) = (mesh.positions[vertex], normals[vertex]);
        let origin = [0, 1, 2].map(|axis| position[axis] + offset * normal[axis]);
        Ray::new(origin, direction(normal, sample, vertex as f32))
    };
    let count = mesh.positions.len() * SAMPLES;
    let mut open = vec![0u32; mesh.positions.len()];
    let (mut rays, mut occluded) = (Vec::new(), Vec::new());
    let mut seconds = 0.0;
    for first in (0..count).step_by(BATCH) {
        rays.clear();
        rays.extend((first..count.min(first + BATCH)).map(ray));
        occluded.resize(rays.len(), false);
        let start = Instant::now();
        bvh.batch(&rays).occluded_into(&mut occluded);
        seconds += start.elapsed().as_secs_f64();
        for (index, occluded) in (first..).zip(&occluded) {
            open[index / SAMPLES] += u32::from(!occluded);
        }
    }
    // ANCHOR_END: book

    let report = bvh.report();
    println!(
        "{} vertices, {} triangles, {} dropped, built in {:.0} ms",
        mesh.positions.len(),
        report.primitives,
        report.dropped,
        built * 1e3
    );
    let mean = open.iter().map(|open| f64::from(*open)).sum::<f64>() / count as f64;
    println!(
        "{count} rays at {:.2} Mray/s, {:.1} % of the sky is open",
        count as f64 / seconds / 1e6,
        100.0 * mean
    );

    if let [_, output] = &names[..] {
        let mut file = std::io::BufWriter::new(std::fs::File::create(output)?);
        writeln!(file, "ply\nformat ascii 1.0")?;
        writeln!(file, "element vertex {}", mesh.positions.len())?;
        for name in [
            "float x",
            "float y",
            "float z",
            "uchar red",
            "uchar green",
            "uchar blue",
        ] {
            writeln!(file, "property {name}")?;
        }
        writeln!(file, "element face {}", mesh.triangles.len())?;
        writeln!(file, "property list uchar uint vertex_indices\nend_header")?;
        for ([x, y, z], open) in mesh.positions.iter().zip(&open) {
            let grey = 255 * *open as usize / SAMPLES;
            writeln!(file, "{x} {y} {z} {grey} {grey} {grey}")?;
        }
        for [a, b, c] in &mesh.triangles {
            writeln!(file, "3 {a} {b} {c}")?;
        }
        file.flush()?;
    }
    Ok(())
}
