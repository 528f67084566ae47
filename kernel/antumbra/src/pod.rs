//! Rays and hits as plain bytes for `bytemuck`: the one module of the kernel with `unsafe` code, and only with the feature
//! of that name. Only this crate can say that its types have no padding.
#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};

use crate::ray::{Hit, Ray};

// SAFETY: `repr(C)` and made only of eight `f32`, 32 bytes as the tests of `ray` check: no padding, any bits are a
// value.
unsafe impl Zeroable for Ray {}
// SAFETY: as above.
unsafe impl Pod for Ray {}

// SAFETY: `repr(C)` and made only of three `f32` and three `u32`, 24 bytes as the tests of `ray` check: no padding, any
// bits are a value.
unsafe impl Zeroable for Hit {}
// SAFETY: as above.
unsafe impl Pod for Hit {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_rays_as_they_lie() {
        let floats = [1.0f32, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0, 7.0];
        let rays: &[Ray] = bytemuck::cast_slice(&floats);
        let ray = Ray {
            org: [1.0, 2.0, 3.0],
            tnear: 0.5,
            dir: [4.0, 5.0, 6.0],
            tfar: 7.0,
        };
        assert_eq!(rays, [ray]);
    }
}
