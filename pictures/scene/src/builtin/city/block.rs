//! Cells of the street grid: a block with buildings or a park, and the streets on two of its sides.

use super::brush::{Brushes, Rect};
use super::paint::Paint;
use super::random::{Random, noise};
use super::{building, park};

/// Distance between the middles of neighbouring streets in metres, along x and y.
pub(super) const PITCH: [f32; 2] = [112.0, 86.0];
/// Least number of triangles of a block.
pub(super) const FEWEST_TRIANGLES: usize = 1500;

const STREET: f32 = 15.0;
const PAVEMENT: f32 = 3.5;
const KERB: f32 = 0.18;
/// Length above which a lot is always split.
const LONGEST_LOT: f32 = 46.0;
/// Least length of the parts of a split lot.
const SHORTEST_LOT: f32 = 15.0;

/// Middle of the cell.
pub(super) fn center(column: i32, row: i32) -> [f32; 2] {
    [column as f32 * PITCH[0], row as f32 * PITCH[1]]
}

/// Fills the cell.
pub(super) fn build_block(brushes: &mut Brushes, column: i32, row: i32) {
    let random = &mut Random::of_cell(column, row, 1);
    let [x, y] = center(column, row);
    let half = PITCH.map(|pitch| 0.5 * (pitch - STREET));
    let block = Rect::around([x, y], half);
    brushes.plate(
        Paint::Asphalt,
        Rect::around([x, y], PITCH.map(|p| 0.5 * p)),
        0.0,
    );
    brushes.block(Paint::Pavement, block, 0.0, KERB);

    let inner = block.inset(PAVEMENT);
    // The middle cell is never a park, so that every city has a tower.
    if random.chance(0.13) && (column, row) != (0, 0) {
        park::build(brushes, random, inner, KERB);
    } else {
        for lot in lots(random, inner) {
            let [x, y] = lot.center();
            let height = height(random, x, y);
            let lot = lot.inset(random.between(0.4, 1.6));
            building::build(brushes, random, lot, height, KERB);
        }
    }
    pavement_trees(brushes, random, block);
    streets(brushes, random, block);
}

/// Splits a rectangle into lots.
fn lots(random: &mut Random, whole: Rect) -> Vec<Rect> {
    let mut done = Vec::new();
    let mut open = vec![whole];
    while let Some(lot) = open.pop() {
        let [width, depth] = lot.size();
        let axis = usize::from(depth > width);
        let longest = width.max(depth);
        let keep = longest < LONGEST_LOT && random.chance(0.45);
        if keep || longest < 2.0 * SHORTEST_LOT {
            done.push(lot);
            continue;
        }
        let margin = SHORTEST_LOT / longest;
        let cut = lot.low[axis] + longest * random.between(0.35, 0.65).clamp(margin, 1.0 - margin);
        let (mut a, mut b) = (lot, lot);
        a.high[axis] = cut;
        b.low[axis] = cut;
        open.extend([a, b]);
    }
    done
}

/// Height of a building at a place: a centre, lesser centres around it, and chance.
fn height(random: &mut Random, x: f32, y: f32) -> f32 {
    let distance = (x * x + y * y) / (230.0 * 230.0);
    let quarter = noise(x, y, 420.0, 2);
    let density = 0.75 / (1.0 + distance) + 0.6 * quarter * quarter * quarter;
    let luck = random.unit();
    let tall = if random.chance(0.6 * density) {
        190.0 * density * luck * luck
    } else {
        0.0
    };
    8.0 + 46.0 * density * random.between(0.35, 1.0) + tall
}

/// Trees along the longer sides of the pavement.
fn pavement_trees(brushes: &mut Brushes, random: &mut Random, block: Rect) {
    let edge = 1.3;
    let mut x = block.low[0] + 6.0;
    while x < block.high[0] - 6.0 {
        for y in [block.low[1] + edge, block.high[1] - edge] {
            if random.chance(0.8) {
                let height = random.between(4.5, 7.5);
                park::tree(brushes, random, [x, y], KERB, height);
            }
        }
        x += random.between(8.0, 12.0);
    }
}

/// Markings and cars of the streets to the east and to the north.
fn streets(brushes: &mut Brushes, random: &mut Random, block: Rect) {
    let middle = [block.high[0] + 0.5 * STREET, block.high[1] + 0.5 * STREET];
    for axis in 0..2 {
        // `axis` runs along the street, the other one across it.
        let across = 1 - axis;
        let place = |along: f32, offset: f32, half: [f32; 2]| {
            let mut center = [0.0; 2];
            let mut size = [0.0; 2];
            center[axis] = along;
            center[across] = middle[across] + offset;
            size[axis] = half[0];
            size[across] = half[1];
            Rect::around(center, size)
        };
        let (start, end) = (block.low[axis], block.high[axis]);
        let mut along = start + 6.0;
        while along < end - 6.0 {
            brushes.plate(Paint::Marking, place(along, 0.0, [1.5, 0.08]), 0.02);
            along += 6.0;
        }
        for crossing in [start + 1.8, end - 1.8] {
            for stripe in -5..=5 {
                let offset = stripe as f32 * 1.2;
                brushes.plate(Paint::Marking, place(crossing, offset, [1.3, 0.3]), 0.02);
            }
        }
        // Driving on the right, and parked at both kerbs.
        for lane in [-6.3f32, -2.2, 2.2, 6.3] {
            let mut along = start + random.between(6.0, 20.0);
            while along < end - 6.0 {
                let body = place(along, lane, [2.2, 0.9]);
                let cabin = place(along - 0.2 * lane.signum(), lane, [1.2, 0.75]);
                car(brushes, random, body, cabin);
                along += random.between(6.0, if lane.abs() > 4.0 { 14.0 } else { 45.0 });
            }
        }
    }
}

fn car(brushes: &mut Brushes, random: &mut Random, body: Rect, cabin: Rect) {
    let paint = random.pick(&[
        Paint::White,
        Paint::Metal,
        Paint::DarkStone,
        Paint::Red,
        Paint::White,
    ]);
    brushes.block(paint, body, 0.3, 0.95);
    brushes.block(Paint::Glazing, cabin, 0.95, 1.45);
}
