//! Trees for comparison with the ones in the kernel: builders, collapses and child orders from papers and other renderers, which
//! plug into [`antumbra::parts`], a bound for every order, and queries for trees of any width.
//!
//! [`ORDERS`], [`BUILDERS`] and [`COLLAPSES`] have the kernel's rows and these, in the order in which studies show them.
//!
//! ```
//! use antumbra::{Bvh, Geometry, Ray, Recipe};
//!
//! let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
//! for order in antumbra_trees::ORDERS {
//!     let bvh = Bvh::build(&geometry, &Recipe::default().order(order))?;
//!     assert!(bvh.occluded(&ray), "{order}");
//! }
//! # Ok::<(), antumbra::Error>(())
//! ```

mod builders;
mod collapses;
mod engines;
mod orders;
#[cfg(test)]
mod test_primitives;

pub use builders::{
    BUILDERS, PBRT, PBRT_2015, PLOC, PLOC_REINSERTION, RDH, SBVH, SRDH, VDBVH, builder,
};
pub use collapses::{COLLAPSES, LEARNED_UNSORTED, RSC, collapse};
pub use engines::{engine, engines};
pub use orders::oracle::{Visits, oracle_visits, visits};
pub use orders::{FTOB, ORDERS, RANDOM, RTSAH, order};

use antumbra::recipe::UnknownName;

/// The row of a list that has this name.
fn find<T: Copy>(
    kind: &'static str,
    list: &[T],
    name_of: impl Fn(T) -> &'static str,
    name: &str,
) -> Result<T, UnknownName> {
    let names = || list.iter().map(|row| name_of(*row));
    let found = names().position(|other| other == name);
    found.map(|place| list[place]).ok_or_else(|| UnknownName {
        kind,
        name: name.into(),
        known: names().collect::<Vec<_>>().join(", "),
    })
}

/// Declares rows of a list: a type and a constant each, and what the list says of it.
macro_rules! rows {
    ($List:ident; $($ROW:ident $Type:ident = $name:literal, $sentence:literal, $source:expr;)*) => {
        $(
            #[doc = concat!($sentence, ".")]
            pub const $ROW: $List = $List::Other(&$Type);

            struct $Type;

            impl antumbra::parts::Row for $Type {
                fn name(&self) -> &'static str {
                    $name
                }

                fn sentence(&self) -> &'static str {
                    $sentence
                }

                fn source(&self) -> Option<&'static str> {
                    $source
                }
            }
        )*
    };
}
use rows;
