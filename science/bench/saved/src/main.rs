//! Times of saving and loading trees, objects and worlds, beside a copy of them in memory: `cargo run --release [BOXES]`.
//!
//! Rows take turns, each behind a copy, and CPU times are medians of turns. A copy is `clone`, of the same value. Memory comes
//! from the system anew each time, so pages are part of all times.

use antumbra::recipe::Engine;
use std::hint::black_box;

use antumbra::{Bvh, Geometry, Instance, Object, Recipe, Width, World};

const TURNS: usize = 11;

fn main() {
    let boxes = std::env::args().nth(1);
    let boxes = boxes.map_or(360, |text| text.parse().expect("boxes along a side"));
    let one = rayon_core::ThreadPoolBuilder::new().num_threads(1).build();
    one.expect("a thread").install(|| {
        for width in Width::ALL {
            measure(boxes, width);
        }
    });
}

fn measure(boxes: usize, width: Width) {
    let (positions, indices) = city(boxes);
    let geometry = [Geometry::triangles(&positions[..], &indices[..])];
    let recipe = Recipe::fast().surface_rays(Some(0)).engine(Engine::best(width));
    let bvh = Bvh::build(&geometry, &recipe).expect("indices in range");
    let object = Object::build(&geometry, &recipe).expect("indices in range");
    let place = |object, x| {
        let rows = [
            [1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        Instance::new(object, rows)
    };
    let side = boxes as f32;
    let world = World::new(&[&object], &[place(0, 0.0), place(0, side)]).expect("in range");
    let files = [bvh.to_bytes(), object.to_bytes(), world.to_bytes()];
    println!(
        "{width} children: {} triangles, {:.0} MB of memory, {:.0} MB of file",
        indices.len(),
        bvh.report().bytes as f64 / 1e6,
        files[0].len() as f64 / 1e6
    );

    let clone_tree = || drop(black_box(bvh.clone()));
    let clone_object = || drop(black_box(object.clone()));
    let clone_world = || drop(black_box(world.clone()));
    let written = |write: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = Vec::with_capacity(files[0].len());
        write(&mut bytes);
        drop(black_box(bytes));
    };
    let [tree_file, object_file, world_file] = &files;
    let what = "a file that was just written";
    row("Bvh::to_bytes", &clone_tree, &|| {
        drop(black_box(bvh.to_bytes()))
    });
    row("Bvh::write", &clone_tree, &|| {
        written(&|bytes| bvh.write(bytes).expect("a vector takes anything"));
    });
    row("Bvh::from_bytes", &clone_tree, &|| {
        black_box(Bvh::from_bytes(tree_file).expect(what));
    });
    row("Bvh::read", &clone_tree, &|| {
        black_box(Bvh::read(&tree_file[..]).expect(what));
    });
    row("Object::to_bytes", &clone_object, &|| {
        drop(black_box(object.to_bytes()))
    });
    row("Object::read", &clone_object, &|| {
        black_box(Object::read(&object_file[..]).expect(what));
    });
    row("World::to_bytes", &clone_world, &|| {
        drop(black_box(world.to_bytes()))
    });
    row("World::read", &clone_world, &|| {
        black_box(World::read(&world_file[..]).expect(what));
    });
}

/// Prints the medians of a copy and of `work`, in milliseconds, and their ratio.
fn row(name: &str, copy: &dyn Fn(), work: &dyn Fn()) {
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..TURNS {
        for (work, times) in [copy, work].into_iter().zip(&mut times) {
            let start = cpu_milliseconds();
            work();
            times.push(cpu_milliseconds() - start);
        }
    }
    let [copy, work] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[TURNS / 2]
    });
    println!(
        "{name:20} {work:7.1} ms  {:.2} of a copy, {copy:.1} ms",
        work / copy
    );
}

fn cpu_milliseconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// A square of boxes of all heights: positions and indices of triangles.
fn city(side: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    const QUADS: [[u32; 4]; 6] = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let mut state = 1u64;
    let mut random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    for place in 0..side * side {
        let (x, y) = ((place % side) as f32, (place / side) as f32);
        let (width, depth, height) = (
            0.4 + 0.5 * random(),
            0.4 + 0.5 * random(),
            0.2 + 3.0 * random(),
        );
        let first = positions.len() as u32;
        for corner in 0..8 {
            let far = |axis: u32, size: f32| if corner >> axis & 1 == 1 { size } else { 0.0 };
            positions.push([x + far(0, width), y + far(1, depth), far(2, height)]);
        }
        for quad in QUADS {
            let [a, b, c, d] = quad.map(|corner| first + corner);
            indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    (positions, indices)
}
