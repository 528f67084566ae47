//! Walls of one tier of a building, in the styles of different decades.

use super::brush::{Brushes, Rect};
use super::paint::Paint;

/// Height of a storey in metres.
pub(super) const STOREY: f32 = 3.8;

/// Style of walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Style {
    /// Solid wall with recessed windows and a cornice.
    Punched,
    /// Glass behind piers and floor slabs.
    Grid,
    /// Glass between broad horizontal bands.
    Bands,
    /// Glass behind narrow mullions over the full height.
    Mullions,
}

/// Side of a rectangle: a line of the plan with an outside.
struct Wall {
    origin: [f32; 2],
    along: [f32; 2],
    out: [f32; 2],
    length: f32,
}

impl Wall {
    fn all(rect: Rect) -> [Self; 4] {
        let corners = rect.corners();
        let [width, depth] = rect.size();
        let wall = |corner: usize, along: [f32; 2], length| Self {
            origin: corners[corner],
            along,
            out: [along[1], -along[0]],
            length,
        };
        [
            wall(0, [1.0, 0.0], width),
            wall(1, [0.0, 1.0], depth),
            wall(2, [-1.0, 0.0], width),
            wall(3, [0.0, -1.0], depth),
        ]
    }

    /// Point `u` along the wall, `depth` in front of it, at height `z`.
    fn at(&self, u: f32, depth: f32, z: f32) -> [f32; 3] {
        [
            self.origin[0] + u * self.along[0] + depth * self.out[0],
            self.origin[1] + u * self.along[1] + depth * self.out[1],
            z,
        ]
    }

    /// Adds a rectangle parallel to the wall.
    fn panel(&self, brushes: &mut Brushes, paint: Paint, u: [f32; 2], z: [f32; 2], depth: f32) {
        brushes.quad(
            paint,
            [
                self.at(u[0], depth, z[0]),
                self.at(u[1], depth, z[0]),
                self.at(u[1], depth, z[1]),
                self.at(u[0], depth, z[1]),
            ],
        );
    }

    /// Adds a box from the wall to `depth` in front of it, without its back.
    fn relief(&self, brushes: &mut Brushes, paint: Paint, u: [f32; 2], z: [f32; 2], depth: f32) {
        let (back, front) = (0.0, depth);
        let vertices = [
            self.at(u[0], back, z[0]),
            self.at(u[1], back, z[0]),
            self.at(u[1], back, z[1]),
            self.at(u[0], back, z[1]),
            self.at(u[0], front, z[0]),
            self.at(u[1], front, z[0]),
            self.at(u[1], front, z[1]),
            self.at(u[0], front, z[1]),
        ];
        #[rustfmt::skip]
        let faces = [
            [4, 5, 6], [4, 6, 7], // front
            [0, 1, 5], [0, 5, 4], // underside
            [7, 6, 2], [7, 2, 3], // top
            [0, 4, 7], [0, 7, 3], // left
            [5, 1, 2], [5, 2, 6], // right
        ];
        brushes.mesh(paint, &vertices, &faces);
    }

    /// Adds a window with its four reveals, `depth` behind the wall.
    fn window(&self, brushes: &mut Brushes, paints: Paints, u: [f32; 2], z: [f32; 2], depth: f32) {
        let vertices: [[f32; 3]; 8] = std::array::from_fn(|i| {
            let (right, top) = (matches!(i % 4, 1 | 2), i % 4 >= 2);
            let depth = if i < 4 { 0.0 } else { -depth };
            self.at(u[right as usize], depth, z[top as usize])
        });
        #[rustfmt::skip]
        let reveals = [
            [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7],
        ];
        brushes.mesh(paints.wall, &vertices, &reveals);
        self.panel(brushes, paints.glass, u, z, -depth);
    }
}

/// Materials of a façade.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paints {
    pub wall: Paint,
    pub glass: Paint,
}

/// Adds the walls of a tier over `rect` between two heights; the top is left open.
pub(super) fn walls(
    brushes: &mut Brushes,
    style: Style,
    paints: Paints,
    rect: Rect,
    z0: f32,
    z1: f32,
) {
    let storeys = ((z1 - z0) / STOREY).round().max(1.0) as u32;
    let storey = (z1 - z0) / storeys as f32;
    for wall in Wall::all(rect) {
        match style {
            Style::Punched => punched(brushes, paints, &wall, z0, storey, storeys),
            Style::Grid => {
                wall.panel(brushes, paints.glass, [0.0, wall.length], [z0, z1], 0.0);
                let bays = (wall.length / 4.4).round().max(2.0) as u32;
                uprights(brushes, paints.wall, &wall, bays, [0.9, 0.45], [z0, z1]);
                slabs(
                    brushes,
                    paints.wall,
                    &wall,
                    z0,
                    storey,
                    storeys,
                    [0.8, 0.35],
                );
            }
            Style::Bands => {
                wall.panel(brushes, paints.glass, [0.0, wall.length], [z0, z1], 0.0);
                slabs(brushes, paints.wall, &wall, z0, storey, storeys, [1.5, 0.4]);
            }
            Style::Mullions => {
                wall.panel(brushes, paints.glass, [0.0, wall.length], [z0, z1], 0.0);
                let bays = (wall.length / 2.4).round().max(2.0) as u32;
                uprights(brushes, paints.wall, &wall, bays, [0.25, 0.3], [z0, z1]);
            }
        }
    }
}

/// Adds recessed windows, storey by storey, and a cornice on top.
fn punched(brushes: &mut Brushes, paints: Paints, wall: &Wall, z0: f32, storey: f32, storeys: u32) {
    let bays = (wall.length / 4.2).round().max(1.0) as u32;
    let bay = wall.length / bays as f32;
    for level in 0..storeys {
        let floor = z0 + level as f32 * storey;
        // The ground floor has shop windows.
        let (sill, head, side) = if level == 0 {
            (0.4, 0.85 * storey, 0.10 * bay)
        } else {
            (0.26 * storey, 0.80 * storey, 0.26 * bay)
        };
        let z = [floor + sill, floor + head];
        let all = [0.0, wall.length];
        wall.panel(brushes, paints.wall, all, [floor, z[0]], 0.0);
        wall.panel(brushes, paints.wall, all, [z[1], floor + storey], 0.0);
        let mut pier = 0.0;
        for i in 0..bays {
            let u = [i as f32 * bay + side, (i + 1) as f32 * bay - side];
            wall.panel(brushes, paints.wall, [pier, u[0]], z, 0.0);
            wall.window(brushes, paints, u, z, 0.35);
            pier = u[1];
        }
        wall.panel(brushes, paints.wall, [pier, wall.length], z, 0.0);
    }
    // The cornice reaches round the corners. The ends overlap inside the neighbouring cornice.
    let top = z0 + storeys as f32 * storey;
    let u = [-0.44, wall.length + 0.44];
    wall.relief(brushes, paints.wall, u, [top - 0.55, top + 0.25], 0.45);
    let first = z0 + storey;
    let u = [-0.19, wall.length + 0.19];
    wall.relief(brushes, paints.wall, u, [first - 0.2, first], 0.2);
}

/// Adds vertical bars `[width, depth]` between the bays and at the corners.
fn uprights(
    brushes: &mut Brushes,
    paint: Paint,
    wall: &Wall,
    bays: u32,
    [width, depth]: [f32; 2],
    z: [f32; 2],
) {
    let bay = (wall.length - width) / bays as f32;
    for i in 0..=bays {
        let u = i as f32 * bay;
        wall.relief(brushes, paint, [u, u + width], z, depth);
    }
}

/// Adds horizontal bars `[height, depth]` at every floor and the roof.
fn slabs(
    brushes: &mut Brushes,
    paint: Paint,
    wall: &Wall,
    z0: f32,
    storey: f32,
    storeys: u32,
    [height, depth]: [f32; 2],
) {
    // Bars end slightly before their depth round the corner, so that no two faces coincide.
    let u = [0.01 - depth, wall.length + depth - 0.01];
    for level in 0..=storeys {
        let z = z0 + level as f32 * storey;
        let bottom = if level == 0 { z } else { z - 0.5 * height };
        wall.relief(brushes, paint, u, [bottom, z + 0.5 * height], depth);
    }
}
