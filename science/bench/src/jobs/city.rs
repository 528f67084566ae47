//! A city of boxes on a square kilometre of ground: blocks of nine lots between streets, turned against the axes.

use antumbra_bake::{Atlas, Error};
use antumbra_testkit::Rng;

use crate::input::Sensors;
use antumbra_lab::harness::{Mesh, cross, dot, less, unit};

/// Blocks along each side.
const BLOCKS: u32 = 20;
/// Metres from one block to the next, and of a lot.
const BLOCK: f32 = 50.0;
const LOT: f32 = 12.0;
/// Metres of a cell of the ground.
const CELL: f32 = 4.0;
/// Metres between sensors of walls and roofs.
const STEP: f32 = 2.5;
/// Half the side of the middle of the city.
pub const MIDDLE: f32 = 200.0;

pub struct City {
    pub mesh: Mesh,
    /// On the ground between blocks.
    pub streets: Sensors,
    pub roofs: Sensors,
    pub walls: Sensors,
    /// Four walls and the roof of each house.
    faces: Vec<[[f32; 3]; 4]>,
}

/// Place in the scene of a place of the plan, with the axes of the streets.
fn turned([x, y, z]: [f32; 3]) -> [f32; 3] {
    let (sin, cos) = 0.3_f32.sin_cos();
    let half = 0.5 * BLOCK * BLOCKS as f32;
    let (x, y) = (x - half, y - half);
    [cos * x - sin * y, sin * x + cos * y, z]
}

fn ground(x: f32, y: f32) -> f32 {
    3.0 * (x / 140.0).sin() * (y / 190.0).cos()
}

impl City {
    pub fn new() -> Self {
        let mut city = Self {
            mesh: Mesh::default(),
            streets: Sensors::default(),
            roofs: Sensors::default(),
            walls: Sensors::default(),
            faces: Vec::new(),
        };
        city.pave();
        let mut rng = Rng::new(1);
        for block in 0..BLOCKS * BLOCKS {
            for lot in 0..9 {
                let corner = |index: u32, lot: u32| {
                    BLOCK * index as f32 + 0.5 * (BLOCK - 3.0 * LOT) + LOT * lot as f32
                };
                let low = [
                    corner(block % BLOCKS, lot % 3),
                    corner(block / BLOCKS, lot / 3),
                ];
                if rng.unit() < 0.85 {
                    city.house(low, &mut rng);
                }
            }
        }
        city
    }

    fn pave(&mut self) {
        let cells = (BLOCK * BLOCKS as f32 / CELL) as u32;
        self.mesh.push_field(cells + 1, cells + 1, |column, row| {
            let (x, y) = (CELL * column as f32, CELL * row as f32);
            turned([x, y, ground(x, y)])
        });
        for (index, corners) in (0u32..).zip(&self.mesh.indices) {
            let corners = corners.map(|corner| self.mesh.positions[corner as usize]);
            let (cell, second) = (index / 2, index % 2);
            let within = |cell: u32, third: f32| (CELL * (cell as f32 + third)).rem_euclid(BLOCK);
            // The lower triangle leans to the right, the upper one to the left.
            let thirds = [[2.0 / 3.0, 1.0 / 3.0], [1.0 / 3.0, 2.0 / 3.0]][second as usize];
            let street = 0.5 * (BLOCK - 3.0 * LOT);
            let is_free = |at: f32| at < street - 0.1 || at > BLOCK - street + 0.1;
            if is_free(within(cell % cells, thirds[0])) || is_free(within(cell / cells, thirds[1]))
            {
                let normal = cross(less(corners[1], corners[0]), less(corners[2], corners[0]));
                let middle = [0, 1, 2]
                    .map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f32>() / 3.0);
                self.streets.push(middle, unit(normal));
            }
        }
    }

    fn house(&mut self, low: [f32; 2], rng: &mut Rng) {
        let mut edge = || 1.5 * rng.unit();
        let (west, south, east, north) = (
            low[0] + edge(),
            low[1] + edge(),
            low[0] + LOT - edge(),
            low[1] + LOT - edge(),
        );
        let floor = ground(low[0] + 0.5 * LOT, low[1] + 0.5 * LOT);
        let (bottom, top) = (floor - 2.0, floor + 6.0 + 40.0 * rng.unit().powi(3));
        let plan = [[west, south], [east, south], [east, north], [west, north]];
        let at = |corner: usize, z: f32| turned([plan[corner % 4][0], plan[corner % 4][1], z]);
        let roof = [0, 1, 2, 3].map(|corner| at(corner, top));
        for side in 0..4 {
            let wall = [
                at(side, bottom),
                at(side + 1, bottom),
                at(side + 1, top),
                at(side, top),
            ];
            sensors(&mut self.walls, wall, floor + 0.5);
            self.faces.push(wall);
        }
        sensors(&mut self.roofs, roof, f32::NEG_INFINITY);
        self.faces.push(roof);
        let floor = [3, 2, 1, 0].map(|corner| at(corner, bottom));
        for &face in self.faces[self.faces.len() - 5..].iter().chain([&floor]) {
            self.mesh.push_quad(face);
        }
    }

    /// Points and normals of a light map of all houses, of so many texels to a side: a chart for each wall and roof.
    pub fn texels(&self, size: u32) -> Result<Sensors, Error> {
        let mut charts = antumbra_bake::Mesh::default();
        let across = (self.faces.len() as f64).sqrt().ceil() as usize;
        for (index, face) in self.faces.iter().enumerate() {
            let at = |cell: usize, part: f32| (cell as f32 + part) / across as f32;
            let uvs = [[0.05, 0.05], [0.95, 0.05], [0.95, 0.95], [0.05, 0.95]]
                .map(|[u, v]| [at(index % across, u), at(index / across, v)]);
            charts.push((face, &[[0, 1, 2], [0, 2, 3]]), &[], &uvs, false);
        }
        let atlas = Atlas::new(&charts, size)?;
        let (points, normals) = (atlas.points, atlas.normals);
        Ok(Sensors { points, normals })
    }

    /// Some of the points of streets and walls, a metre away from them, in no order, none twice.
    pub fn scattered(&self, count: usize) -> Vec<[f32; 3]> {
        let mut all = [self.streets.lifted(1.0), self.walls.lifted(1.0)].concat();
        let mut rng = Rng::new(2);
        for place in 0..count {
            let other = place + rng.bits() as usize % (all.len() - place);
            all.swap(place, other);
        }
        all.truncate(count);
        all
    }
}

/// Sensors on a rectangle, above some height.
fn sensors(list: &mut Sensors, [a, b, _, d]: [[f32; 3]; 4], above: f32) {
    let sides = [less(b, a), less(d, a)];
    let normal = unit(cross(sides[0], sides[1]));
    let counts = sides.map(|side| (dot(side, side).sqrt() / STEP).max(1.0) as usize);
    for index in 0..counts[0] * counts[1] {
        let parts = [index % counts[0], index / counts[0]];
        let parts = [0, 1].map(|side| (parts[side] as f32 + 0.5) / counts[side] as f32);
        let point =
            [0, 1, 2].map(|axis| a[axis] + parts[0] * sides[0][axis] + parts[1] * sides[1][axis]);
        if point[2] > above {
            list.push(point, normal);
        }
    }
}
