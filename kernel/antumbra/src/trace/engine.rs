//! The one switch between instruction sets and widths: a table of the functions that answer queries, compiled for both.
//!
//! A product has one width per level, the one that suits its registers, and every width in plain code: see
//! [`Engine::new`]. Comparisons compile the others where they need them: see [`Engine::compiled`].

use alloc::boxed::Box;
use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Isa, Scalar, Simd, Width as Lanes, WithSimd};

use crate::error::Error;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::instrumented::{Instrumented, Open};
use crate::trace::locate::{Located as Place, locate};
use crate::trace::memory::Memory;
use crate::trace::nearest::{Search, Seeker};
use crate::trace::observe::Observer;
use crate::trace::packet::group::{GroupQuery, Part};
use crate::trace::packet::{PacketQuery, Packets};
use crate::trace::pick::Pick;
use crate::trace::query::{Closest, Located, Occluder, Occlusion, Query};
use crate::trace::ray_batch::RayBatch;
use crate::trace::several::Nearest;
use crate::trace::single::Single;
use crate::trace::stream::Stream;
use crate::trace::view::{Shares, Still, on_view};
use crate::trace::visit::{Ahead, Visit, Visiting};
use crate::tree::wide::Tree;
use crate::tree::width::Width;

/// How queries run: compiled for trees of one width, on one instruction set. No engine changes an answer.
///
/// ```
/// use antumbra::recipe::{Engine, Level};
/// use antumbra::{Isa, Recipe, Width};
///
/// // The best of this CPU is what recipes have.
/// let best = Recipe::default().engine;
/// assert_eq!((best.isa(), best.width()), (Isa::best(), Width::auto(Isa::best().level())));
/// // Plain code has all widths.
/// let scalar = Isa::new(Level::Scalar)?;
/// let recipe = Recipe::default().engine(Engine::new(scalar, Width::W4)?);
/// assert_eq!(recipe.engine.width(), Width::W4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Engine(pub(crate) &'static dyn Table);

impl Engine {
    /// The engine of an instruction set for trees of a width. Levels with vectors have the width of their registers,
    /// [`Width::auto`]; plain code has all widths.
    ///
    /// # Errors
    /// [`Error::NoEngine`] for a width that the level does not have.
    pub fn new(isa: Isa, width: Width) -> Result<Self, Error> {
        let engine = match width {
            Width::W4 => Dispatch::<4>::dispatch(isa, Make::<true>),
            Width::W8 => Dispatch::<8>::dispatch(isa, Make::<true>),
            Width::W16 => Dispatch::<16>::dispatch(isa, Make::<true>),
        };
        let level = isa.level();
        engine.ok_or(Error::NoEngine { level, width })
    }

    /// The engine of an instruction set, for the width that suits it.
    pub fn of(isa: Isa) -> Self {
        let width = Width::auto(isa.level());
        Self::new(isa, width).unwrap_or_else(|_| Self::plain(width))
    }

    /// The fastest engine for trees of a width: plain code, where no level of this CPU has that width.
    pub fn best(width: Width) -> Self {
        Self::new(Isa::best(), width).unwrap_or_else(|_| Self::plain(width))
    }

    /// An engine that [`Engine::new`] does not have, for trees of `N` children per node. It is compiled by the crate that
    /// calls this, which takes as long as the kernel's own. `None` where there is an own one.
    pub fn compiled<const N: usize>(isa: Isa) -> Option<Self>
    where
        Isa: Dispatch<N>,
    {
        isa.dispatch(Make::<false>)
    }

    /// Every engine of the kernel that this CPU has.
    pub fn all() -> impl Iterator<Item = Self> {
        let of_level = |isa| {
            Width::ALL
                .into_iter()
                .filter_map(move |width| Self::new(isa, width).ok())
        };
        Isa::available().flat_map(of_level)
    }

    fn plain(width: Width) -> Self {
        match width {
            Width::W4 => Self::with_code::<_, 4>(Scalar),
            Width::W8 => Self::with_code::<_, 8>(Scalar),
            Width::W16 => Self::with_code::<_, 16>(Scalar),
        }
    }

    fn with_code<S: Simd + Lanes<N>, const N: usize>(simd: S) -> Self {
        // Of no size: no memory is taken.
        Self(Box::leak(Box::new(Compiled::<S, N>(simd))))
    }

    /// The instruction set that queries run on.
    pub fn isa(self) -> Isa {
        self.0.isa()
    }

    /// Children per node of the trees that it answers from.
    pub fn width(self) -> Width {
        self.0.width()
    }
}

impl Default for Engine {
    /// The best of this CPU.
    fn default() -> Self {
        Self::of(Isa::best())
    }
}

impl core::fmt::Debug for Engine {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Engine({}, {})", self.isa().level(), self.width())
    }
}

/// Makes the engine of a level and width, if it is one of the kernel's own, or if it is not.
struct Make<const OWN: bool>;

impl<const OWN: bool, const N: usize> WithSimd<N> for Make<OWN> {
    type Output = Option<Engine>;

    #[inline(always)]
    fn with_simd<S: Simd + Lanes<N>>(self, simd: S) -> Option<Engine> {
        // What is not made is not compiled.
        match const { OWN == (S::LANES == N || S::LANES == 0) } {
            true => Some(Engine::with_code::<S, N>(simd)),
            false => None,
        }
    }
}

/// A query of rays one after another.
pub(crate) trait Each<Q: Query> {
    /// Answers `rays`, under the conditions of their batch and at its times, with memory of a stack for the tree.
    fn each(
        &self,
        tree: &Tree,
        stack: &mut [Q::Item],
        rays: &[Ray],
        batch: Option<&RayBatch<'_>>,
        answers: &mut [Q::Answer],
    );
}

/// A query of rays in packets.
pub(crate) trait Packs<Q: PacketQuery> {
    /// Answers the rays of a batch that go in packets, and lists the others in `pending`.
    fn packets(
        &self,
        tree: &Tree,
        stack: &mut [Q::Item],
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
        pending: &mut Vec<u32>,
    );
}

/// A query of rays in a stream.
pub(crate) trait Streams<Q: Query> {
    /// Answers the `pending` rays of a batch, with room for [`items`](crate::trace::stream::items) items and
    /// [`SETUPS`](crate::trace::stream::SETUPS) rays.
    fn stream(
        &self,
        tree: &Tree,
        room: (&mut [Q::Item], &mut [RaySetup]),
        batch: &RayBatch<'_>,
        pending: &[u32],
        answers: &mut [Q::Answer],
        prefetch: bool,
    );
}

/// Everything that is compiled for a width and an instruction set. Trees are of that width.
pub(crate) trait Table:
    Each<Occlusion>
    + Each<Occluder>
    + Each<Closest>
    + Each<Located<true>>
    + Packs<Occlusion>
    + Packs<Closest>
    + Streams<Occlusion>
    + Streams<Occluder>
    + Streams<Closest>
    + Streams<Located<false>>
    + Streams<Located<true>>
    + Streams<Nearest>
    + Sync
{
    fn isa(&self) -> Isa;

    fn width(&self) -> Width;

    /// See [`Instrumented`].
    fn observe(
        &self,
        tree: &Tree,
        stack: &mut Vec<Open>,
        observer: (Pick, &mut dyn Observer),
        rays: &[Ray],
        answers: &mut [bool],
    );

    /// See [`Visiting`].
    fn visit(
        &self,
        tree: &Tree,
        share: Option<f32>,
        ahead: &mut Ahead,
        query: (&Ray, &Condition<'_>),
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit>;

    /// See [`locate`].
    fn locate(&self, tree: &Tree, stack: &mut [u32], ray: &Ray, hit: &Hit) -> Option<Place>;

    /// See [`GroupQuery`]. Returns the row to go on with.
    fn group(&self, tree: &Tree, stack: &mut [u32], part: Part<'_>) -> usize;

    /// See [`Search`].
    fn search(&self, tree: &Tree, point: [f32; 3], memory: &mut Memory, seeker: &mut dyn Seeker);
}

/// The code itself, with the proof that the CPU has the level.
struct Compiled<S, const N: usize>(S);

impl<S: Simd + Lanes<N>, const N: usize> Compiled<S, N> {
    /// Whether the level has vectors. Packets, streams and groups pay only with them, and are not compiled without.
    const HAS_VECTORS: bool = S::LANES > 0;
}

// Only queries with conditions look at times: the others have no code for them.

impl<S: Simd + Lanes<N>, Q: Query, const N: usize> Each<Q> for Compiled<S, N> {
    fn each(
        &self,
        tree: &Tree,
        stack: &mut [Q::Item],
        rays: &[Ray],
        batch: Option<&RayBatch<'_>>,
        answers: &mut [Q::Answer],
    ) {
        let bvh = &tree.wide::<N>();
        if const { Q::CONDITIONAL }
            && let Some(shares) = batch.and_then(RayBatch::shares)
        {
            let views = Shares(shares);
            return self.0.run(Single::<Q, _, N> {
                bvh,
                views,
                batch,
                stack,
                rays,
                answers,
            });
        }
        let views = Still;
        self.0.run(Single::<Q, _, N> {
            bvh,
            views,
            batch,
            stack,
            rays,
            answers,
        });
    }
}

impl<S: Simd + Lanes<N>, Q: PacketQuery, const N: usize> Packs<Q> for Compiled<S, N> {
    fn packets(
        &self,
        tree: &Tree,
        stack: &mut [Q::Item],
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
        pending: &mut Vec<u32>,
    ) {
        if const { Self::HAS_VECTORS } {
            let bvh = &tree.wide::<N>();
            self.0.run(Packets::<Q, N> {
                bvh,
                stack,
                batch,
                answers,
                pending,
            });
        }
    }
}

impl<S: Simd + Lanes<N>, Q: Query, const N: usize> Streams<Q> for Compiled<S, N> {
    fn stream(
        &self,
        tree: &Tree,
        (items, setups): (&mut [Q::Item], &mut [RaySetup]),
        batch: &RayBatch<'_>,
        pending: &[u32],
        answers: &mut [Q::Answer],
        prefetch: bool,
    ) {
        if const { !Self::HAS_VECTORS } {
            return;
        }
        let bvh = &tree.wide::<N>();
        if const { Q::CONDITIONAL }
            && let Some(shares) = batch.shares()
        {
            let views = Shares(shares);
            return self.0.run(Stream::<Q, _, N> {
                bvh,
                views,
                items,
                setups,
                batch,
                pending,
                answers,
                prefetch,
            });
        }
        let views = Still;
        self.0.run(Stream::<Q, _, N> {
            bvh,
            views,
            items,
            setups,
            batch,
            pending,
            answers,
            prefetch,
        });
    }
}

impl<S: Simd + Lanes<N>, const N: usize> Table for Compiled<S, N> {
    fn isa(&self) -> Isa {
        Isa::of(self.0)
    }

    fn width(&self) -> Width {
        const { Width::from_lanes(N).expect("nodes have 4, 8 or 16 children") }
    }

    fn observe(
        &self,
        tree: &Tree,
        stack: &mut Vec<Open>,
        (pick, observer): (Pick, &mut dyn Observer),
        rays: &[Ray],
        answers: &mut [bool],
    ) {
        let bvh = &tree.wide::<N>();
        self.0.run(Instrumented {
            bvh,
            stack,
            pick,
            observer,
            rays,
            answers,
        });
    }

    fn visit(
        &self,
        tree: &Tree,
        share: Option<f32>,
        ahead: &mut Ahead,
        (ray, condition): (&Ray, &Condition<'_>),
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit> {
        let bvh = &tree.wide::<N>();
        on_view!(share, view => self.0.run(Visiting { bvh, view, ahead, ray, condition, visit }))
    }

    fn locate(&self, tree: &Tree, stack: &mut [u32], ray: &Ray, hit: &Hit) -> Option<Place> {
        locate(&tree.wide::<N>(), stack, ray, hit)
    }

    fn group(&self, tree: &Tree, stack: &mut [u32], part: Part<'_>) -> usize {
        let bvh = &tree.wide::<N>();
        match const { Self::HAS_VECTORS } {
            true => self.0.run(GroupQuery { bvh, stack, part }),
            false => part.rows.points.len(),
        }
    }

    fn search(&self, tree: &Tree, point: [f32; 3], memory: &mut Memory, seeker: &mut dyn Seeker) {
        let tree = &tree.wide::<N>();
        self.0.run(Search {
            tree,
            point,
            memory,
            seeker,
        });
    }
}
