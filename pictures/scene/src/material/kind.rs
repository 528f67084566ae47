//! What a kind of material is made of: a struct with the fields of one list.

/// Declares a kind of material: a struct over [`Slots`](super::Slots), and how its parameters are replaced and read.
///
/// A field is a `Color`, a `Number`, a `Pair` of numbers along u and v, a `Switch`, a `Setting` that no texture may vary, an
/// `Inside<T>` with parameters of its own, a `Table`, a `Material` or two `Materials`.
macro_rules! material {
    ($(#[$doc:meta])* $Kind:ident $(, $read:ident)? { $($fields:tt)* }) => {
        material!(@fields [$(#[$doc])* $Kind $($read)?] [] [] $($fields)*);
    };
    (@fields $head:tt [$($declared:tt)*] [$($listed:tt)*]
        $(#[$doc:meta])* $field:ident: $Slot:ident $(<$Inside:ident>)? $(= $source:expr)?, $($rest:tt)*) => {
        material!(@typed $head [$($declared)* $(#[$doc])* pub $field:] $Slot $($Inside)?
            [$($listed)* $field $Slot [$($source)?],] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Color $($rest:tt)*) => {
        material!(@fields $head [$($declared)* S::Color,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Number $($rest:tt)*) => {
        material!(@fields $head [$($declared)* S::Number,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Pair $($rest:tt)*) => {
        material!(@fields $head [$($declared)* [S::Number; 2],] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Switch $($rest:tt)*) => {
        material!(@fields $head [$($declared)* bool,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Setting $($rest:tt)*) => {
        material!(@fields $head [$($declared)* f32,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Inside $Inside:ident $($rest:tt)*) => {
        material!(@fields $head [$($declared)* $Inside<S>,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Table $($rest:tt)*) => {
        material!(@fields $head [$($declared)* S::Table,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Material $($rest:tt)*) => {
        material!(@fields $head [$($declared)* std::sync::Arc<crate::Material<S>>,] $($rest)*);
    };
    (@typed $head:tt [$($declared:tt)*] Materials $($rest:tt)*) => {
        material!(@fields $head [$($declared)* [std::sync::Arc<crate::Material<S>>; 2],] $($rest)*);
    };
    (@fields [$(#[$doc:meta])* $Kind:ident $($read:ident)?] [$($declared:tt)*] [$($field:ident $Slot:ident $source:tt,)*]) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        #[serde(bound = "S::Color: serde::Serialize, S::Number: serde::Serialize, S::Table: serde::Serialize")]
        pub struct $Kind<S: crate::material::Slots = crate::material::Authored> { $($declared)* }

        impl<S: crate::material::Slots> $Kind<S> {
            /// The same kind with other parameters.
            pub fn map<'a, T: crate::material::Slots>(&'a self, with: &mut impl crate::material::Map<'a, S, T>) -> $Kind<T> {
                $Kind { $($field: material!(@map $Slot with &self.$field),)* }
            }
        }

        material!(@reads $Kind $($read)? $($field $Slot $source,)*);
    };
    (@reads $Kind:ident read $($field:ident $Slot:ident $source:tt,)*) => {
        impl $Kind {
            /// Reads the parameters, or takes their defaults.
            pub fn read(reader: &mut impl crate::material::Reader) -> Self {
                Self { $($field: material!(@read $Slot reader $source),)* }
            }
        }
    };
    (@reads $Kind:ident $($field:ident $Slot:ident $source:tt,)*) => {};
    (@map Color $with:ident $value:expr) => { $with.color($value) };
    (@map Number $with:ident $value:expr) => { $with.number($value) };
    (@map Pair $with:ident $value:expr) => { $value.each_ref().map(|value| $with.number(value)) };
    (@map Switch $with:ident $value:expr) => { $with.setting((*$value).into()) != 0.0 };
    (@map Setting $with:ident $value:expr) => { $with.setting(*$value) };
    (@map Inside $with:ident $value:expr) => { $value.map($with) };
    (@map Table $with:ident $value:expr) => { $with.table($value) };
    (@map Material $with:ident $value:expr) => { std::sync::Arc::new($with.material($value)) };
    (@map Materials $with:ident $value:expr) => {
        $value.each_ref().map(|material| std::sync::Arc::new($with.material(material)))
    };
    (@read Color $reader:ident [$source:expr]) => { $reader.color(&$source) };
    (@read Number $reader:ident [$source:expr]) => { $reader.number(&$source) };
    (@read Pair $reader:ident [$source:expr]) => { $source.map(|source| $reader.number(&source)) };
    (@read Switch $reader:ident [$source:expr]) => { $reader.switch($source) };
    (@read Inside $reader:ident []) => { Default::default() };
}

pub(super) use material;
