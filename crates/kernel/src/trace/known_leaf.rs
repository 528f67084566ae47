//! The test of one leaf for each ray, out of turn: what a tree would have found anyway, found at once.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::leaf_places::LeafPlaces;
use crate::trace::step::leaf_occluder;
use crate::tree::node::{Child, ChildKind};
use crate::tree::wide::WideTree;

/// A ray of a batch and the leaf that may occlude it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guess {
    /// Index of the ray.
    pub ray: u32,
    /// The leaf, as a [`Child`].
    pub leaf: u32,
    /// Index of its instance plus 1, or 0.
    pub instance: u32,
    /// Where the guess comes from; for the caller.
    pub place: u32,
}

/// Leaves asked for before they are tested.
const AHEAD: usize = 6;

/// Tests guesses, and keeps those that are right in front of the others. Returns how many those are.
///
/// A guess that is right is an answer: the leaf step is the one of every traversal, and boxes never hide what a leaf holds
/// (see [`crate::geometry::ray_setup`]).
pub(crate) struct TestGuesses<'a, const N: usize> {
    pub bvh: &'a WideTree<N>,
    pub rays: &'a [Ray],
    pub guesses: &'a [Guess],
    /// As long as `guesses`: whether each is right.
    pub right: &'a mut [bool],
}

impl<const N: usize> WithSimd<N> for TestGuesses<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self {
            bvh,
            rays,
            guesses,
            right,
        } = self;
        let places = LeafPlaces::new(bvh);
        let ask = |guess: &Guess| {
            places.prefetch(simd, Child(guess.leaf));
            if let Some(placed) = bvh.instances.get(guess.instance.wrapping_sub(1) as usize) {
                simd.prefetch(placed);
            }
        };
        guesses.iter().take(AHEAD).for_each(ask);
        let mut setup = RaySetup::IDLE;
        let mut object = RaySetup::IDLE;
        for (index, (guess, right)) in guesses.iter().zip(right).enumerate() {
            if let Some(coming) = guesses.get(index + AHEAD) {
                ask(coming);
            }
            let ChildKind::Leaf(leaf) = Child(guess.leaf).kind() else {
                *right = false;
                continue;
            };
            let ray = &rays[guess.ray as usize];
            *right = setup.set(simd, ray, bvh.reach)
                && match bvh.instances.get(guess.instance.wrapping_sub(1) as usize) {
                    None => leaf_occluder::<S, N, false>(simd, bvh, leaf, &setup).is_some(),
                    Some(placed) => {
                        placed.placement.enter(simd, &setup, &mut object).is_some()
                            && leaf_occluder::<S, N, false>(simd, bvh, leaf, &object).is_some()
                    }
                };
        }
    }
}
