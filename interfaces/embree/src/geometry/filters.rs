//! Which filters of the client decide about hits on a geometry.

use std::marker::PhantomData;

use super::State;
use crate::abi::{Arguments, FilterFunction, INVOKE_ARGUMENT_FILTER};

/// Which of two kinds of query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    Intersect,
    Occluded,
}

/// Filters of a query.
#[derive(Clone, Copy)]
pub struct Filters<'a> {
    pub query: Query,
    /// From the arguments of the query.
    argument: Option<FilterFunction>,
    /// Whether that one is called for every geometry.
    is_for_all: bool,
    arguments: PhantomData<&'a Arguments>,
}

impl<'a> Filters<'a> {
    pub fn new(query: Query, arguments: Option<&'a Arguments>) -> Self {
        Self {
            query,
            argument: arguments.and_then(|arguments| arguments.filter),
            is_for_all: arguments
                .is_some_and(|arguments| arguments.flags & INVOKE_ARGUMENT_FILTER != 0),
            arguments: PhantomData,
        }
    }

    /// The same for another query.
    pub fn of_query(self, query: Query) -> Self {
        Self { query, ..self }
    }

    /// The filter of the arguments for a geometry that takes it or not.
    pub fn of_arguments(&self, is_taken: bool) -> Option<FilterFunction> {
        self.argument.filter(|_| is_taken || self.is_for_all)
    }

    /// The functions that decide about hits on a geometry, in their order.
    pub fn of(&self, state: &State) -> impl Iterator<Item = FilterFunction> + use<> {
        let own = match self.query {
            Query::Intersect => state.intersect_filter,
            Query::Occluded => state.occluded_filter,
        };
        (own.into_iter()).chain(self.of_arguments(state.takes_argument_filter))
    }
}
