//! Materials with bump maps and normal maps.

use super::material;

material! {
    /// Material with a bump map: shading normals are tilted as if the surface were displaced (Blinn 1978).
    Bumped {
        /// Material, neither [`Bumped`] nor [`Material::None`](crate::Material::None).
        material: Material,
        /// Height above the surface in scene units.
        height: Number,
    }
}

material! {
    /// Material with a normal map: shading normals are read from an image, relative to the surface.
    NormalMapped {
        /// Material, neither [`Bumped`], [`NormalMapped`] nor [`Material::None`](crate::Material::None).
        material: Material,
        /// Normal as a colour from 0 to 1: red along u, green along v, blue along the surface's normal. 1/2 is 0.
        normal: Color,
        /// Factor of the normal's parts along u and v.
        scale: Setting,
    }
}
