//! Material `mix`.

use super::material;

material! {
    /// Lobes of two materials, scaled and added. Neither is [`Bumped`](super::Bumped) or
    /// [`Material::None`](crate::Material::None): bump maps apply to the whole mixture.
    Mix {
        /// First and second material.
        materials: Materials,
        /// Scale of the first material. The scale of the second is 1 minus `amount`.
        amount: Color,
    }
}
