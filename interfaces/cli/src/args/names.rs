//! Names of orders, builders, collapses, levels and widths, for help and for parsing.

use std::error::Error;
use std::str::FromStr;

use antumbra::Width;
use antumbra::recipe::{Level, UnknownName};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Stands for what suits the machine.
pub const AUTO: &str = "auto";

/// Names of rows, in the order of their list.
pub fn all<T: ToString>(rows: &[T]) -> Vec<String> {
    rows.iter().map(ToString::to_string).collect()
}

/// Names of rows that are no texts themselves.
pub fn named<T: Copy>(rows: &[T], name: impl Fn(T) -> &'static str) -> Vec<String> {
    rows.iter().map(|row| name(*row).to_owned()).collect()
}

/// Names of all levels, and `auto`.
pub fn levels() -> Vec<String> {
    with_auto(all(&Level::ALL))
}

/// Names of all widths, and `auto`.
pub fn widths() -> Vec<String> {
    with_auto(all(&Width::ALL))
}

fn with_auto(names: Vec<String>) -> Vec<String> {
    std::iter::once(AUTO.to_owned()).chain(names).collect()
}

/// A parser of one of the names. Shells complete them, and an error lists them.
pub fn one_of<T>(names: Vec<String>) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Clone + Send + Sync + 'static,
    T::Err: Into<Box<dyn Error + Send + Sync>>,
{
    let names = names.into_iter().map(PossibleValue::new);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<T>())
}

/// A parser of one of the names of a list of trees.
pub fn row<T: Clone + Send + Sync + 'static>(
    names: Vec<String>,
    find: fn(&str) -> Result<T, UnknownName>,
) -> impl TypedValueParser<Value = T> {
    let names = names.into_iter().map(PossibleValue::new);
    PossibleValuesParser::new(names).try_map(move |name| find(&name))
}

/// Long help of a flag that takes one of the names.
pub fn help_one(what: &str, names: &[String], more: &str) -> String {
    format!("{what}: {}\n\n{more}", names.join(", "))
        .trim_end()
        .to_owned()
}

/// Long help of a flag that takes a list of names.
pub fn help_list(what: &str, names: &[String], more: &str) -> String {
    let names = names.join(", ");
    format!("{what}, separated by commas: {names}\n\n{more}")
        .trim_end()
        .to_owned()
}
