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

/// What a named list says of an entry, for entries that are in no table.
pub trait Row: Send + Sync {
    /// Name on the command line and in results.
    fn name(&self) -> &'static str;

    /// One sentence that describes the entry, without a full stop.
    fn sentence(&self) -> &'static str;

    /// Authors and year of the paper it comes from; `None` for one's own and for folklore.
    fn source(&self) -> Option<&'static str>;
}

/// Declares an enum as a table with one row per variant; for the crates of this project.
///
/// `Variant = "name", "Sentence", source, properties;` where the sentence has no full stop, the source is an
/// `Option<&'static str>`, and the properties are a value of the type named behind the enum. With `open Trait` behind
/// the properties, the enum also has a variant `Other` for entries that are in no table: whatever implements the trait,
/// which has [`Row`] above it. Two of them are the same if their names are. The properties are then made by
/// `of(&dyn Trait)`.
#[doc(hidden)]
#[macro_export]
macro_rules! named_list {
    (
        $(#[$meta:meta])*
        pub enum $list:ident($kind:literal): $properties:ty $(, open $Other:ident)? {
            $(
                $(#[$more:meta])*
                $variant:ident = $name:literal, $sentence:literal, $source:expr, $row:expr;
            )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum $list {
            $(
                #[doc = concat!($sentence, ".")]
                $(#[$more])*
                $variant,
            )*
            $(
                #[doc = concat!("One that is in no table: see [`", stringify!($Other), "`].")]
                Other(&'static dyn $Other),
            )?
        }

        impl $list {
            /// Every row, in the order of the table.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// Name on the command line, in scene files and in results.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                    $(Self::Other(row) => <dyn $Other as $crate::Row>::name(row),)?
                }
            }

            /// One sentence that describes the entry, without a full stop.
            pub fn sentence(self) -> &'static str {
                match self {
                    $(Self::$variant => $sentence,)*
                    $(Self::Other(row) => <dyn $Other as $crate::Row>::sentence(row),)?
                }
            }

            /// Authors and year of the paper it comes from; `None` for our own and for folklore.
            pub fn source(self) -> Option<&'static str> {
                match self {
                    $(Self::$variant => $source,)*
                    $(Self::Other(row) => <dyn $Other as $crate::Row>::source(row),)?
                }
            }

            /// All names, separated by commas.
            pub fn names() -> $crate::alloc::string::String {
                Self::ALL.map(Self::name).join(", ")
            }

            /// The columns that only this list has.
            #[allow(dead_code, reason = "not every list has columns of its own")]
            pub(crate) fn properties(self) -> $properties {
                match self {
                    $(Self::$variant => $row,)*
                    $(Self::Other(row) => {
                        let row: &dyn $Other = row;
                        <$properties>::of(row)
                    },)?
                }
            }
        }

        $(
            impl PartialEq for dyn $Other {
                fn eq(&self, other: &Self) -> bool {
                    self.name() == other.name()
                }
            }

            impl Eq for dyn $Other {}

            impl core::hash::Hash for dyn $Other {
                fn hash<H: core::hash::Hasher>(&self, state: &mut H) {
                    self.name().hash(state);
                }
            }

            impl core::fmt::Debug for dyn $Other {
                fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                    f.write_str(self.name())
                }
            }
        )?

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
