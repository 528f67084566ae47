//! Random numbers by hashing: equal on every machine, and independent of the order of the cells.

/// Stream of random numbers for one cell and one purpose.
pub(super) struct Random {
    state: u64,
}

impl Random {
    /// Stream of a cell of the street grid for one purpose.
    pub fn of_cell(column: i32, row: i32, purpose: u32) -> Self {
        let place = u64::from(column as u32) << 32 | u64::from(row as u32);
        Self {
            state: mix(place ^ mix(u64::from(purpose))),
        }
    }

    /// Uniform 64-bit integer (SplitMix by Steele, Lea and Flood 2014).
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.state)
    }

    /// Uniform number in `0.0..1.0`.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform number in `low..high`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform integer in `0..count`, where `count` is at least 1.
    pub fn below(&mut self, count: u32) -> u32 {
        (self.bits() % u64::from(count)) as u32
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// Random element of `choices`, which must not be empty.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u32) as usize]
    }
}

/// Bijection that scatters similar numbers.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Smooth noise over the plan from 0 to 1, with features about `scale` metres wide.
pub(super) fn noise(x: f32, y: f32, scale: f32, purpose: u32) -> f32 {
    let (x, y) = (x / scale, y / scale);
    let (column, row) = (x.floor(), y.floor());
    let corner =
        |i: f32, j: f32| Random::of_cell((column + i) as i32, (row + j) as i32, purpose).unit();
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - column), smooth(y - row));
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    mix(
        mix(corner(0.0, 0.0), corner(1.0, 0.0), u),
        mix(corner(0.0, 1.0), corner(1.0, 1.0), u),
        v,
    )
}
