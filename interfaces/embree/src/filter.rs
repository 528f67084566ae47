//! Filters: functions of the client that accept or reject hits.

use std::marker::PhantomData;

use crate::abi::{
    Arguments, Context, FilterArguments, FilterFunction, INVOKE_ARGUMENT_FILTER, RtcHit, RtcRay,
    RtcRayHit,
};
use crate::commit::{Placed, PlacedInstance};
use crate::query::in_object;

/// Which of two kinds of query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    Intersect,
    Occluded,
}

/// Filters of a query.
#[derive(Clone, Copy)]
pub struct Filters<'a> {
    query: Query,
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

    pub fn query(&self) -> Query {
        self.query
    }

    /// The filter of the arguments for a geometry that takes it or not.
    pub fn of_arguments(&self, is_taken: bool) -> Option<FilterFunction> {
        self.argument.filter(|_| is_taken || self.is_for_all)
    }

    /// Whether the filter of the arguments may be called.
    pub fn may_call_argument(&self, is_taken: bool) -> bool {
        self.of_arguments(is_taken).is_some()
    }

    /// Calls the filters of a geometry about a hit at distance `t`, and returns the hit as they leave it if they accept.
    pub fn accept(
        &self,
        (placed, instance): (&Placed, Option<&PlacedInstance>),
        ray: &RtcRay,
        (t, hit): (f32, RtcHit),
        context: *mut Context,
    ) -> Option<(f32, RtcHit)> {
        let state = &placed.state;
        let own = match self.query {
            Query::Intersect => state.intersect_filter,
            Query::Occluded => state.occluded_filter,
        };
        let functions = [own, self.of_arguments(state.takes_argument_filter)];
        if functions.iter().all(Option::is_none) {
            return Some((t, hit));
        }
        let mut rayhit = RtcRayHit {
            ray: RtcRay { tfar: t, ..*ray },
            hit: RtcHit::MISS,
        };
        // In an instance, the ray is in the space of the object.
        let mut entered = Entered::new(context, instance);
        (rayhit.ray.org, rayhit.ray.dir) = in_object(instance, ray.org, ray.dir);
        let mut hit = hit;
        let mut valid = -1;
        for function in functions.into_iter().flatten() {
            let arguments = FilterArguments {
                valid: &raw mut valid,
                user: placed.geometry.user(),
                context: entered.context(),
                ray: (&raw mut rayhit).cast(),
                hit: (&raw mut hit).cast(),
                n: 1,
            };
            // SAFETY: the client's function, with arguments as documented.
            unsafe { function(&raw const arguments) };
            if valid == 0 {
                return None;
            }
        }
        Some((rayhit.ray.tfar, hit))
    }
}

/// A context inside an instance, put back at the end.
struct Entered {
    context: *mut Context,
    before: Option<Context>,
    own: Context,
}

impl Entered {
    fn new(context: *mut Context, instance: Option<&PlacedInstance>) -> Self {
        let mut entered = Self {
            context,
            before: None,
            own: Context::WORLD,
        };
        let inside = instance.map(|instance| Context {
            inst_id: instance.geom_id,
            inst_prim_id: instance.prim_id,
        });
        // SAFETY: null or the context of the client, which only this thread uses during the query.
        match (unsafe { context.as_mut() }, inside) {
            (Some(context), Some(inside)) => {
                entered.before = Some(*context);
                *context = inside;
            }
            (None, Some(inside)) => entered.own = inside,
            _ => {}
        }
        entered
    }

    fn context(&mut self) -> *mut Context {
        if self.context.is_null() {
            &raw mut self.own
        } else {
            self.context
        }
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        if let Some(before) = self.before {
            // SAFETY: as in `new`; there is a context if there was one.
            unsafe { *self.context = before };
        }
    }
}
