//! Cut-outs of a shape: its `alpha` for all rays, and its `shadow_alpha` for shadow rays as well.

use antumbra::cutout::{Candidate, Coverage, Opacity, Pattern, QueryKind};
use antumbra_scene::Shape;

use super::Textures;
use super::alpha::AlphaMask;

/// Alpha masks of a shape. Answers are a pure function of place and kind of query.
#[derive(Clone, Debug)]
pub struct Cutouts {
    alpha: Option<AlphaMask>,
    shadow: Option<AlphaMask>,
}

impl Cutouts {
    /// Cut-outs of a shape. `None` if it has none.
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

    /// Whether the surface exists at the barycentrics of a hit, for a shadow ray or for another ray.
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

/// Opacity of all or nothing. As in pbrt-v3, any `alpha` but 0 counts as 1.
impl Opacity for Cutouts {
    fn opacity(&self, found: &Candidate) -> f32 {
        let is_shadow_ray = found.query == QueryKind::Occluded;
        let opaque = self.is_opaque_at(found.prim_id, found.u, found.v, is_shadow_ray);
        f32::from(u8::from(opaque))
    }

    /// Coverage for all rays alike. Parts that only shadow rays pass are mixed.
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

    /// Pattern of images laid over the mesh by its own coordinates: coordinates and images.
    fn pattern(&self, prim_id: u32) -> Option<Pattern> {
        /// Id of a missing mask.
        const NONE: u32 = u32::MAX;
        // Both masks are of one mesh, whose coordinates they share.
        let mut uvs = None;
        let mut id = |mask: &Option<AlphaMask>| match mask {
            Some(mask) => {
                let (corners, id) = mask.pattern(prim_id)?;
                uvs = Some(corners);
                Some(id)
            }
            None => Some(NONE),
        };
        let (alpha, shadow) = (id(&self.alpha)?, id(&self.shadow)?);
        let pair = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        let [a, b, c] = uvs?.map(|uv| pair(uv.x.to_bits(), uv.y.to_bits()));
        Some(Pattern([a, b, c, pair(alpha, shadow)]))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use antumbra_scene::{
        Geometry, Image, ImageTexture, Mapping, Param, Pixels, Texture, TextureFilter,
        TriangleMesh, Wrap,
    };

    use super::*;

    /// Mask of 1 where v is below one half, 0 above: a checkerboard, so no classes are known.
    fn lower_half() -> Option<Param<f32>> {
        Some(Param::Texture(Arc::new(Texture::Checkerboard {
            squares: [1.0.into(), 0.0.into()],
            mapping: Mapping::Uv {
                scale: glam::Vec2::new(0.0, 2.0),
                offset: glam::Vec2::ZERO,
            },
            smooth: false,
        })))
    }

    /// Triangles have one pattern if the same part of the same image is laid over them, for the same rays. Other
    /// textures have no pattern.
    #[test]
    fn what_looks_alike_has_one_pattern() {
        let image = |brightness| {
            Arc::new(Image {
                name: String::new(),
                width: 1,
                height: 2,
                pixels: Pixels::Grey8(vec![0, brightness]),
            })
        };
        let images = [image(1), image(2)];
        let laid = |image: usize, scale: f32| {
            Some(Param::Texture(Arc::new(Texture::Image(ImageTexture {
                image: Arc::clone(&images[image]),
                scale: 1.0,
                gamma: false,
                wrap: Wrap::Repeat,
                filter: TextureFilter::Trilinear,
                mapping: Mapping::Uv {
                    scale: glam::Vec2::splat(scale),
                    offset: glam::Vec2::ZERO,
                },
            }))))
        };
        let mesh = |shift: f32| {
            let uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [shift, 1.0]];
            Geometry::Mesh(Arc::new(TriangleMesh {
                positions: vec![[0.0; 3]; 4],
                indices: vec![[0, 1, 2], [0, 1, 2], [0, 1, 3]],
                uvs: uvs.map(glam::Vec2::from).to_vec(),
                ..TriangleMesh::default()
            }))
        };
        let mut textures = Textures::default();
        let mut pattern = |shift, alpha, shadow_alpha, triangle| {
            let shape = Shape {
                geometry: mesh(shift),
                material: 0,
                area_light: None,
                media: None,
                alpha,
                shadow_alpha,
                reverse_orientation: false,
                transform_swaps_handedness: false,
            };
            let cutouts = Cutouts::new(&shape, &mut textures).expect("cut-outs");
            cutouts.pattern(triangle)
        };
        let first = pattern(0.5, laid(0, 1.0), None, 0);
        assert!(first.is_some());
        assert_eq!(first, pattern(0.5, laid(0, 1.0), None, 1), "triangle");
        assert_eq!(first, pattern(0.0, laid(0, 1.0), None, 2), "mesh");
        for (other, what) in [
            (pattern(0.5, laid(0, 1.0), None, 2), "coordinates"),
            (pattern(0.5, laid(1, 1.0), None, 0), "image"),
            (pattern(0.5, laid(0, 2.0), None, 0), "scale"),
            (pattern(0.5, None, laid(0, 1.0), 0), "kind of rays"),
            (pattern(0.5, laid(0, 1.0), laid(0, 1.0), 0), "both masks"),
            (pattern(0.5, laid(0, 1.0), laid(1, 1.0), 0), "other mask"),
        ] {
            assert!(other.is_some() && other != first, "{what}");
        }
        assert_eq!(pattern(0.5, lower_half(), None, 0), None);
        assert_eq!(pattern(0.5, laid(0, 1.0), lower_half(), 0), None);
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
            media: None,
            alpha,
            shadow_alpha,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        };
        let half = lower_half;
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
