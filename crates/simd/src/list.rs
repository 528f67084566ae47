//! Named lists: each choice that users make by name is one table.
//!
//! A row gives a variant its name, its sentence and its source. The enum, `ALL`, parsing, printing and the
//! documentation all come from the rows, and so do help texts, `antumbra list` and the tests that go through `ALL`.
//! To add an entry, add a row.

use alloc::string::String;
use core::fmt;

/// A name that is in no row of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    /// Kind of the thing named: `order`, `builder` ...
    pub kind: &'static str,
    /// The name found.
    pub name: String,
    /// The names that the list has, separated by commas.
    pub known: String,
}

impl fmt::Display for UnknownName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, name, known } = self;
        write!(f, "unknown {kind} `{name}`; known are {known}")
    }
}

impl core::error::Error for UnknownName {}

/// Declares an enum as a table with one row per variant; for the crates of this project.
///
/// `Variant = "name", "Sentence", source, properties;` where the sentence has no full stop, the source is an
/// `Option<&'static str>`, and the properties are a value of the type named behind the enum. With
/// `Variant if "feature" = ...` the row exists only where the crate has that feature.
#[doc(hidden)]
#[macro_export]
macro_rules! named_list {
    (
        $(#[$meta:meta])*
        pub enum $list:ident($kind:literal): $properties:ty {
            $(
                $(#[$more:meta])*
                $variant:ident $(if $feature:literal)? = $name:literal, $sentence:literal, $source:expr, $row:expr;
            )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum $list {
            $(
                $(#[cfg(feature = $feature)])?
                #[doc = concat!($sentence, ".")]
                $(#[$more])*
                $variant,
            )*
        }

        impl $list {
            /// Every row, in the order of the table.
            pub const ALL: [Self; [$($(#[cfg(feature = $feature)])? $name),*].len()] =
                [$($(#[cfg(feature = $feature)])? Self::$variant),*];

            /// Name on the command line, in scene files and in results.
            pub const fn name(self) -> &'static str {
                match self {
                    $($(#[cfg(feature = $feature)])? Self::$variant => $name,)*
                }
            }

            /// One sentence that describes the entry, without a full stop.
            pub const fn sentence(self) -> &'static str {
                match self {
                    $($(#[cfg(feature = $feature)])? Self::$variant => $sentence,)*
                }
            }

            /// Authors and year of the paper it comes from; `None` for our own and for folklore.
            pub const fn source(self) -> Option<&'static str> {
                match self {
                    $($(#[cfg(feature = $feature)])? Self::$variant => $source,)*
                }
            }

            /// All names, separated by commas.
            pub fn names() -> $crate::alloc::string::String {
                Self::ALL.map(Self::name).join(", ")
            }

            /// The columns that only this list has.
            #[allow(dead_code, reason = "not every list has columns of its own")]
            pub(crate) const fn properties(self) -> $properties {
                match self {
                    $($(#[cfg(feature = $feature)])? Self::$variant => $row,)*
                }
            }
        }

        impl core::fmt::Display for $list {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(self.name())
            }
        }

        impl core::str::FromStr for $list {
            type Err = $crate::UnknownName;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                Self::ALL
                    .into_iter()
                    .find(|row| row.name() == name)
                    .ok_or_else(|| $crate::UnknownName {
                        kind: $kind,
                        name: name.into(),
                        known: Self::names(),
                    })
            }
        }
    };
}
