//! Parks, and the trees of parks and pavements.

use super::brush::{Brushes, Rect};
use super::paint::Paint;
use super::random::Random;

/// Lawns between two crossing paths, a round basin in the middle and many trees.
pub(super) fn build(brushes: &mut Brushes, random: &mut Random, lot: Rect, ground: f32) {
    let path = 1.6;
    let [x, y] = lot.center();
    let lawns = [
        Rect {
            low: lot.low,
            high: [x - path, y - path],
        },
        Rect {
            low: [x + path, lot.low[1]],
            high: [lot.high[0], y - path],
        },
        Rect {
            low: [lot.low[0], y + path],
            high: [x - path, lot.high[1]],
        },
        Rect {
            low: [x + path, y + path],
            high: lot.high,
        },
    ];
    for lawn in lawns {
        brushes.block(Paint::Grass, lawn, ground, ground + 0.15);
        let [width, depth] = lawn.size();
        for _ in 0..(width * depth / 55.0) as u32 {
            let at = lawn.at(random.between(0.06, 0.94), random.between(0.06, 0.94));
            let away = (at[0] - x).abs().max((at[1] - y).abs());
            if away > 9.0 {
                let height = random.between(6.0, 13.0);
                tree(brushes, random, at, ground + 0.15, height);
            }
        }
    }
    brushes.column(Paint::Limestone, [x, y], [6.0, 6.0], [ground, ground + 0.6]);
    brushes.column(
        Paint::BlueGlazing,
        [x, y],
        [5.4, 5.4],
        [ground, ground + 0.65],
    );
    brushes.column(Paint::Limestone, [x, y], [1.0, 0.4], [ground, ground + 3.0]);
}

/// Tree: a trunk and two ragged blobs of leaves.
pub(super) fn tree(
    brushes: &mut Brushes,
    random: &mut Random,
    [x, y]: [f32; 2],
    ground: f32,
    height: f32,
) {
    let trunk = Rect::around([x, y], [0.025 * height; 2]);
    brushes.block(Paint::Bark, trunk, ground, ground + 0.6 * height);
    let paint = if random.chance(0.2) {
        Paint::AutumnLeaf
    } else {
        Paint::Leaf
    };
    for _ in 0..2 {
        let spread = 0.14 * height;
        let center = [
            x + random.between(-spread, spread),
            y + random.between(-spread, spread),
            ground + height * random.between(0.5, 0.8),
        ];
        let size = height * random.between(0.18, 0.26);
        brushes.blob(paint, center, || {
            let ragged = size * random.between(0.75, 1.2);
            [ragged, ragged, 0.9 * ragged]
        });
    }
}
