//! Buildings: tiers that step back with height, and the machines and masts on the roofs.

use super::brush::{Brushes, Rect};
use super::facade::{Paints, STOREY, Style, walls};
use super::paint::Paint;
use super::random::Random;

/// Puts a building of about the given height on a lot.
pub(super) fn build(
    brushes: &mut Brushes,
    random: &mut Random,
    lot: Rect,
    height: f32,
    ground: f32,
) {
    if height < 13.0 {
        return house(brushes, random, lot, height, ground);
    }
    let (style, paints) = look(random, height);
    let mut rect = lot;
    let mut z = ground;
    let mut left = height;
    loop {
        let [width, depth] = rect.size();
        let slim = width.min(depth) < 17.0;
        let last = slim || left < 28.0 || random.chance(0.2);
        let rise = if last {
            left
        } else {
            left * random.between(0.4, 0.75)
        };
        let top = z + (rise / STOREY).round().max(2.0) * STOREY;
        walls(brushes, style, paints, rect, z, top);
        brushes.plate(Paint::Roofing, rect, top - 0.05);
        parapet(brushes, paints.wall, rect, top);
        if last {
            crown(
                brushes,
                random,
                paints.wall,
                rect.inset(1.2),
                top - 0.05,
                height,
            );
            return;
        }
        left -= top - z;
        // The next tier stands on the roof of this one.
        z = top - 0.05;
        let step = |random: &mut Random, size: f32| size * random.between(0.06, 0.17);
        let steps: [f32; 4] =
            std::array::from_fn(|side| step(random, if side % 2 == 0 { width } else { depth }));
        rect = Rect {
            low: [rect.low[0] + steps[0], rect.low[1] + steps[1]],
            high: [rect.high[0] - steps[2], rect.high[1] - steps[3]],
        };
    }
}

/// Style and materials of a building. Tall buildings have more glass.
fn look(random: &mut Random, height: f32) -> (Style, Paints) {
    let style = if height < 30.0 {
        random.pick(&[Style::Punched, Style::Punched, Style::Grid, Style::Bands])
    } else if height < 70.0 {
        random.pick(&[Style::Punched, Style::Grid, Style::Grid, Style::Bands])
    } else {
        random.pick(&[Style::Grid, Style::Grid, Style::Bands, Style::Mullions])
    };
    let wall = match style {
        Style::Punched => random.pick(&[
            Paint::Brick,
            Paint::Brick,
            Paint::Limestone,
            Paint::Plaster,
            Paint::Concrete,
        ]),
        Style::Grid => random.pick(&[
            Paint::Limestone,
            Paint::Concrete,
            Paint::Plaster,
            Paint::Brick,
            Paint::DarkStone,
        ]),
        Style::Bands => random.pick(&[Paint::Concrete, Paint::Plaster, Paint::White]),
        Style::Mullions => random.pick(&[Paint::Metal, Paint::DarkStone, Paint::White]),
    };
    let glass = match style {
        Style::Punched => Paint::Glazing,
        _ => random.pick(&[Paint::Glazing, Paint::BlueGlazing]),
    };
    (style, Paints { wall, glass })
}

/// Low building with a tiled hip roof.
fn house(brushes: &mut Brushes, random: &mut Random, lot: Rect, height: f32, ground: f32) {
    let paints = Paints {
        wall: random.pick(&[Paint::Plaster, Paint::Brick, Paint::Limestone]),
        glass: Paint::Glazing,
    };
    let top = ground + (height / STOREY).round().max(2.0) * STOREY;
    walls(brushes, Style::Punched, paints, lot, ground, top);
    let [width, depth] = lot.size();
    let eaves = lot.inset(-0.7);
    let rise = 0.3 * width.min(depth);
    brushes.hip_roof(Paint::Tile, eaves, top + 0.26, top + rise);
    // Two chimneys that start below the tiles.
    for _ in 0..2 {
        let at = lot.at(random.between(0.3, 0.7), random.between(0.3, 0.7));
        let chimney = Rect::around(at, [0.45, 0.6]);
        brushes.block(Paint::Brick, chimney, top + 0.3, top + rise + 1.2);
    }
}

/// Low wall around a flat roof.
fn parapet(brushes: &mut Brushes, paint: Paint, rect: Rect, top: f32) {
    let (low, high) = (rect.low, rect.high);
    let thick = 0.4;
    let inner = rect.inset(thick);
    let sides = [
        Rect {
            low,
            high: [high[0], inner.low[1]],
        },
        Rect {
            low: [low[0], inner.high[1]],
            high,
        },
        Rect {
            low: [low[0], inner.low[1]],
            high: [inner.low[0], inner.high[1]],
        },
        Rect {
            low: [inner.high[0], inner.low[1]],
            high: [high[0], inner.high[1]],
        },
    ];
    for side in sides {
        brushes.block(paint, side, top - 0.04, top + 0.9);
    }
}

/// Top of the highest roof: machines, ducts, tanks and, on towers, a mast.
fn crown(brushes: &mut Brushes, random: &mut Random, wall: Paint, roof: Rect, z: f32, height: f32) {
    let [width, depth] = roof.size();
    // The lift house.
    let size = [width, depth].map(|side| side * random.between(0.14, 0.22));
    let at = roof.at(random.between(0.3, 0.7), random.between(0.3, 0.7));
    let lifts = Rect::around(at, size);
    let rise = random.between(3.0, 5.5);
    brushes.block(wall, lifts, z, z + rise);
    if height > 80.0 && random.chance(0.6) {
        let tall = height * random.between(0.1, 0.22);
        brushes.column(Paint::Metal, at, [0.7, 0.12], [z + rise, z + rise + tall]);
    }
    let area = width * depth;
    for _ in 0..(area / 60.0).clamp(2.0, 14.0) as u32 {
        let at = roof.at(random.between(0.08, 0.92), random.between(0.08, 0.92));
        let half = [random.between(0.5, 1.5), random.between(0.5, 1.5)];
        let machine = Rect::around(at, half);
        let tall = random.between(0.9, 2.2);
        brushes.block(Paint::Metal, machine, z, z + tall);
        if random.chance(0.5) {
            let radius = 0.6 * half[0].min(half[1]);
            let top = z + tall;
            brushes.column(Paint::DarkStone, at, [radius; 2], [top, top + 0.3]);
        }
    }
    // Ducts from the lift house to the edge.
    for _ in 0..2 {
        let y = random.between(lifts.low[1], lifts.high[1] - 0.5);
        let duct = Rect {
            low: [roof.low[0], y],
            high: [lifts.low[0] - 0.05, y + 0.5],
        };
        if duct.size()[0] > 1.0 {
            brushes.block(Paint::Metal, duct, z, z + 0.6);
        }
    }
    if height < 90.0 && random.chance(0.35) {
        water_tank(brushes, roof.at(0.15, 0.85), z);
    }
}

/// Wooden tank on four legs under a conical lid.
fn water_tank(brushes: &mut Brushes, [x, y]: [f32; 2], z: f32) {
    for (dx, dy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let leg = Rect::around([x + dx, y + dy], [0.12, 0.12]);
        brushes.block(Paint::Metal, leg, z, z + 2.5);
    }
    brushes.column(Paint::Bark, [x, y], [1.8; 2], [z + 2.5, z + 5.5]);
    brushes.column(Paint::DarkStone, [x, y], [2.0, 0.1], [z + 5.5, z + 6.8]);
}
