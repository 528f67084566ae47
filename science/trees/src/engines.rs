//! Widths that the kernel has no code for: it has one per level, and studies compare all.

use antumbra::recipe::Engine;
use antumbra::{Isa, Width};

/// What answers queries for trees of a width on an instruction set: the kernel's own engine, or else one that is compiled here.
///
/// ```
/// use antumbra::{Isa, Width};
///
/// for width in Width::ALL {
///     let engine = antumbra_trees::engine(Isa::best(), width);
///     assert_eq!((engine.isa(), engine.width()), (Isa::best(), width));
/// }
/// ```
pub fn engine(isa: Isa, width: Width) -> Engine {
    let other = || match width {
        Width::W4 => Engine::compiled::<4>(isa),
        Width::W8 => Engine::compiled::<8>(isa),
        Width::W16 => Engine::compiled::<16>(isa),
        _ => None,
    };
    let own = Engine::new(isa, width).ok();
    own.or_else(other).unwrap_or_else(|| Engine::best(width))
}

/// Every engine that this CPU can run: all widths on all of its levels.
pub fn engines() -> impl Iterator<Item = Engine> {
    let of_level = |isa| Width::ALL.into_iter().map(move |width| engine(isa, width));
    Isa::available().flat_map(of_level)
}
