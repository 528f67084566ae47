//! The cut-outs of a shape: its `alpha` for all rays, its `shadow_alpha` for shadow rays as well.

use antumbra::{Candidate, Coverage, Opacity, QueryKind};
use antumbra_scene::Shape;

use super::Textures;
use super::alpha::AlphaMask;

/// Where a mesh has no surface. A pure function of place and question.
#[derive(Clone, Debug)]
pub struct Cutouts {
    alpha: Option<AlphaMask>,
    shadow: Option<AlphaMask>,
}

impl Cutouts {
    /// The cut-outs of a shape; `None` if it has none.
    pub fn new(shape: &Shape, textures: &mut Textures) -> Option<Self> {
        let mut mask = |param: &Option<_>| {
            let param = param.as_ref()?;
            AlphaMask::new(shape, param, textures)
        };
        let (alpha, shadow) = (mask(&shape.alpha), mask(&shape.shadow_alpha));
        if alpha.is_none() && shadow.is_none() {
            return None;
        }
        Some(Self { alpha, shadow })
    }

    /// Whether there is a surface at the barycentrics of a hit, for a shadow ray or for any other.
    ///
    /// # Panics
    /// If the mesh has no such triangle.
    #[inline]
    pub fn is_opaque_at(&self, triangle: u32, u: f32, v: f32, is_shadow_ray: bool) -> bool {
        let opaque = |mask: &Option<AlphaMask>| {
            let mask = mask.as_ref();
            mask.is_none_or(|mask| mask.is_opaque_at(triangle, u, v))
        };
        opaque(&self.alpha) && (!is_shadow_ray || opaque(&self.shadow))
    }
}

/// All or nothing: as in pbrt-v3, `alpha` above 0 is as good as 1.
impl Opacity for Cutouts {
    fn opacity(&self, found: &Candidate) -> f32 {
        let is_shadow_ray = found.query == QueryKind::Occluded;
        let opaque = self.is_opaque_at(found.prim_id, found.u, found.v, is_shadow_ray);
        f32::from(u8::from(opaque))
    }

    /// For all rays alike: what only shadow rays miss is mixed.
    fn coverage(&self, prim_id: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        let class = |mask: &Option<AlphaMask>| {
            mask.as_ref()
                .map_or(Coverage::Opaque, |mask| mask.coverage(prim_id, corners))
        };
        match (class(&self.alpha), class(&self.shadow)) {
            (Coverage::Clear, _) => Coverage::Clear,
            (class, Coverage::Opaque) | (Coverage::Opaque, class @ Coverage::Unknown) => class,
            (Coverage::Unknown, _) => Coverage::Unknown,
            _ => Coverage::Mixed,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use antumbra_scene::{Geometry, Mapping, Param, Texture, TriangleMesh};

    use super::*;

    /// 1 where v is below one half, 0 above: a checkerboard, so no classes are known.
    fn lower_half() -> Param<f32> {
        Param::Texture(Arc::new(Texture::Checkerboard {
            squares: [1.0.into(), 0.0.into()],
            mapping: Mapping::Uv {
                scale: glam::Vec2::new(0.0, 2.0),
                offset: glam::Vec2::ZERO,
            },
            smooth: false,
        }))
    }

    #[test]
    fn shadow_rays_ask_both_masks() {
        let shape = |alpha, shadow_alpha| Shape {
            geometry: Geometry::Mesh(Arc::new(TriangleMesh {
                positions: vec![[0.0; 3]; 3],
                indices: vec![[0, 1, 2]],
                ..TriangleMesh::default()
            })),
            material: 0,
            area_light: None,
            alpha,
            shadow_alpha,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        };
        let half = || Some(lower_half());
        let zero = || Some(Param::Constant(0.0));
        use Coverage::{Clear, Mixed, Unknown};
        // With default coordinates v is the weight of the third vertex.
        for (alpha, shadow, class, seen, stopping) in [
            (half(), None, Unknown, [true, false], [true, false]),
            (None, half(), Unknown, [true, true], [true, false]),
            (half(), zero(), Unknown, [true, false], [false, false]),
            (None, zero(), Mixed, [true, true], [false, false]),
            (zero(), half(), Clear, [false, false], [false, false]),
        ] {
            let cutouts = Cutouts::new(&shape(alpha, shadow), &mut Textures::default());
            let cutouts = cutouts.expect("cut-outs");
            assert_eq!(
                cutouts.coverage(0, &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
                class
            );
            for (is_shadow_ray, expected) in [(false, seen), (true, stopping)] {
                let found = [0.25, 0.75].map(|v| cutouts.is_opaque_at(0, 0.1, v, is_shadow_ray));
                assert_eq!(found, expected);
            }
        }
        let one = || Some(Param::Constant(1.0));
        assert!(Cutouts::new(&shape(None, None), &mut Textures::default()).is_none());
        assert!(Cutouts::new(&shape(one(), one()), &mut Textures::default()).is_none());
    }
}
