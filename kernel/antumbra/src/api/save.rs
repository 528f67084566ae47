//! Trees, objects and worlds in files.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::io::{Read, Write};

use super::bvh::Bvh;
use super::object::Object;
use super::world::World;
use crate::error::Error;
use crate::geometry::Functions;
use crate::trace::engine::Engine;
use crate::trace::memory::Pool;
use crate::tree::costs::CostModel;
use crate::tree::recollapse::Recollapsed;
use crate::tree::validate::Walked;
use crate::tree::wide::Tree;
use crate::tree::width::Width;
use crate::words::{self, Kind, Sink, Words};

/// What a file can hold: a [`Bvh`], an [`Object`] or a [`World`]. [`Functions::read`] returns any of them.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::Error;
/// use antumbra::saved::{Functions, Saved};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// fn load<T: Saved>(bytes: &[u8]) -> Result<T, Error> {
///     Functions::new().from_bytes(bytes)
/// }
/// let again: Bvh = load(&bvh.to_bytes())?;
/// assert_eq!(again.bounds(), bvh.bounds());
/// # Ok::<(), antumbra::Error>(())
/// ```
pub trait Saved: Contents {}

impl<T: Contents> Saved for T {}

/// Contents of a file.
pub trait Contents: Sized {
    const KIND: Kind;

    fn tree(&self) -> &Bvh;

    fn write_words(&self, sink: &mut Sink<'_>);

    fn read_words(words: &mut Words<'_>, functions: &Functions) -> Result<Self, Error>;
}

const UNSAVED: &str = "a tree that moves cannot be saved";

#[cfg(feature = "std")]
fn write(saved: &impl Contents, out: impl Write) -> Result<(), Error> {
    Error::if_moves(saved.tree().moves(), UNSAVED)?;
    words::write(kind_of(saved), out, |sink| saved.write_words(sink))
}

fn to_bytes(saved: &impl Contents) -> Vec<u8> {
    assert!(!saved.tree().moves(), "{UNSAVED}");
    let most = saved.tree().tree.file_bytes();
    words::to_bytes(kind_of(saved), most, |sink| saved.write_words(sink))
}

fn kind_of<T: Contents>(_: &T) -> Kind {
    T::KIND
}

impl Functions {
    /// Reads what [`Bvh::write`], [`Object::write`] or [`World::write`] wrote, with these functions.
    ///
    /// ```
    /// # use antumbra::saved::Functions;
    /// # use antumbra::{Error, World};
    /// fn load(file: std::fs::File, functions: &Functions) -> Result<World, Error> {
    ///     functions.read(file)
    /// }
    /// ```
    ///
    /// # Errors
    /// As [`Bvh::read`]; [`Error::OtherFunctions`] if there are too few or too many of them.
    #[cfg(feature = "std")]
    pub fn read<T: Saved>(&self, input: impl Read) -> Result<T, Error> {
        words::read(T::KIND, input, |words| T::read_words(words, self))
    }

    /// [`Functions::read`] from memory, of which nothing may be left.
    ///
    /// # Errors
    /// As [`Functions::read`], but for [`Error::Io`].
    pub fn from_bytes<T: Saved>(&self, bytes: &[u8]) -> Result<T, Error> {
        words::from_bytes(T::KIND, bytes, |words| T::read_words(words, self))
    }
}

impl Bvh {
    /// Writes the tree: geometry, nodes and child order. [`Bvh::read`] makes a tree of it that gives the same answers, on any
    /// machine and instruction set.
    ///
    /// Not written are masks, the times of the [report](Bvh::report), and the functions of filters and user geometry, which
    /// whoever reads the file gives again: see [`Functions`]. Give any writer, buffered or not: the tree is written in large
    /// pieces, and takes about as long as a copy of it.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails, [`Error::Moves`] for a tree that moves.
    #[cfg(feature = "std")]
    pub fn write(&self, out: impl Write) -> Result<(), Error> {
        write(self, out)
    }

    /// Reads a tree that [`Bvh::write`] wrote, for the best instruction set of this CPU. A tree of a width that this does not
    /// have is collapsed again, with the leaves in the order that was learned; [`file_width`](crate::BuildReport::file_width) says so. Takes no byte
    /// behind its end. Give any reader, buffered or not.
    ///
    /// Files are not trusted. A wrong checksum is an error, and so is a file with a right one whose tree would let a query
    /// panic or run for ever, or has boxes that do not hold what is below them. Nothing checks that the geometry is the one
    /// that you saved: [`Bvh::validate`] finds primitives that somebody put in twice. Memory grows with the bytes that
    /// are read.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let mut file = Vec::new();
    /// bvh.write(&mut file)?;
    /// let again = Bvh::read(&file[..])?;
    /// assert_eq!(again.bounds(), bvh.bounds());
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong, [`Error::OtherFunctions`] if the tree needs [`Functions`], [`Error::Io`] if
    /// reading fails.
    #[cfg(feature = "std")]
    pub fn read(input: impl Read) -> Result<Self, Error> {
        Functions::new().read(input)
    }

    /// The bytes that [`Bvh::write`] writes.
    ///
    /// # Panics
    /// If the tree [moves](Bvh::moving), for which [`Bvh::write`] returns an error.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(self)
    }

    /// [`Bvh::read`] from memory, of which nothing may be left.
    ///
    /// # Errors
    /// As [`Bvh::read`], but for [`Error::Io`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        Functions::new().from_bytes(bytes)
    }

    /// The tree in the width that suits this CPU. A tree of another width has leaves and order of the one that was read.
    fn of_own_width(mut self) -> Self {
        let Some(engine) = self.other_engine() else {
            return self;
        };
        let mut roots = vec![0];
        roots.extend(self.tree.roots.iter().map(|root| *root as usize));
        let recollapsed = self.tree.recollapse(engine.width(), 0, &roots);
        let deepest = recollapsed.roots[1..].iter().map(|(_, depth)| *depth);
        self.tree.depth = recollapsed.roots[0].1 + deepest.max().unwrap_or(0);
        self.adopt_nodes(recollapsed, engine, 1);
        self
    }

    /// The engine of this CPU, if a tree from a file has not the width for it.
    pub(super) fn other_engine(&self) -> Option<Engine> {
        let engine = Engine::default();
        (engine.isa() != self.isa()).then_some(engine)
    }

    /// Takes nodes of another width, of which the roots of objects come behind so many others.
    pub(super) fn adopt_nodes(&mut self, recollapsed: Recollapsed, engine: Engine, others: usize) {
        let before = self.tree.sah(&CostModel::default());
        self.file_width = Some(self.width());
        self.tree.nodes = recollapsed.nodes;
        let roots: Vec<_> = recollapsed.roots[others..]
            .iter()
            .map(|(root, _)| *root)
            .collect();
        for placed in &mut self.tree.instances {
            if let Ok(object) = self.tree.roots.binary_search(&placed.root) {
                placed.root = roots[object];
            }
        }
        self.tree.roots = roots;
        self.engine = engine;
        (self.predicted_cost, self.predicted_before) = (None, None);
        // What a refit compares with grows or shrinks as the cost does.
        let now = self.tree.sah(&CostModel::default());
        self.built_sah = self.built_sah.map(|built| built * now / before);
    }

    pub(super) fn read_tree(
        words: &mut Words<'_>,
        functions: &Functions,
    ) -> Result<(Self, Walked), Error> {
        let [width, prefetch, cutouts, dropped, transparent] = words.words()?;
        let training_rays = words.long()?;
        let [predicted_cost, predicted_before, built_sah] =
            [words.double()?, words.double()?, words.double()?];
        let width = Width::from_lanes(width as usize)
            .ok_or_else(|| words.error(format!("no node has {width} children")))?;
        let (tree, walked) = Tree::read(words, width, functions)?;
        let primitives = tree.count_primitives(&walked);
        let primitives = primitives.map_err(|broken| words.error(broken))?;
        let bvh = Self {
            tree,
            engine: Engine::best(width),
            primitives,
            cutouts: cutouts as usize,
            dropped: dropped as usize,
            transparent: transparent as usize,
            pool: Pool::default(),
            prefetch: (prefetch == 0).then_some(false),
            predicted_cost,
            predicted_before,
            training_rays,
            times: None,
            built_sah,
            masks: None,
            later: Vec::new(),
            file_width: None,
        };
        Ok((bvh, walked))
    }
}

impl Contents for Bvh {
    const KIND: Kind = Kind::Tree;

    fn tree(&self) -> &Self {
        self
    }

    fn write_words(&self, sink: &mut Sink<'_>) {
        sink.word(self.width().lanes() as u32);
        sink.word((self.prefetch != Some(false)).into());
        for count in [self.cutouts, self.dropped, self.transparent] {
            sink.word(u32::try_from(count).unwrap_or(u32::MAX));
        }
        sink.long(self.training_rays);
        for cost in [self.predicted_cost, self.predicted_before, self.built_sah] {
            sink.double(cost);
        }
        self.tree.write(sink);
    }

    fn read_words(words: &mut Words<'_>, functions: &Functions) -> Result<Self, Error> {
        Self::read_tree(words, functions).map(|(bvh, _)| bvh.of_own_width())
    }
}

/// The methods of [`Bvh`] for an object or a world.
macro_rules! impl_saved {
    ($Type:ident, $example:literal) => {
        impl $Type {
            #[doc = $example]
            ///
            /// # Errors
            /// [`Error::Io`] if writing fails.
            #[cfg(feature = "std")]
            pub fn write(&self, out: impl Write) -> Result<(), Error> {
                write(self, out)
            }

            #[doc = concat!("Reads what [`", stringify!($Type), "::write`] wrote. Files are not trusted, see [`Bvh::read`].")]
            ///
            /// # Errors
            /// As [`Bvh::read`].
            #[cfg(feature = "std")]
            pub fn read(input: impl Read) -> Result<Self, Error> {
                Functions::new().read(input)
            }

            #[doc = concat!("The bytes that [`", stringify!($Type), "::write`] writes.")]
            #[must_use]
            pub fn to_bytes(&self) -> Vec<u8> {
                to_bytes(self)
            }

            #[doc = concat!("[`", stringify!($Type), "::read`] from memory, of which nothing may be left.")]
            ///
            /// # Errors
            /// As [`Bvh::read`], but for [`Error::Io`].
            pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
                Functions::new().from_bytes(bytes)
            }
        }
    };
}

impl_saved!(
    Object,
    "Writes the object with its tree, as [`Bvh::write`]. A world places a loaded object as it places the original, bit for bit.

```
use antumbra::{Geometry, Instance, Object, Ray, Recipe, World};

let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
let leaf = Object::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
let mut file = Vec::new();
leaf.write(&mut file)?;

let loaded = Object::read(&file[..])?;
let here = Instance::new(0, [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
let world = World::new(&[loaded], &[here])?;
assert!(world.occluded(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])));
# Ok::<(), antumbra::Error>(())
```"
);

impl_saved!(
    World,
    "Writes the world: the trees of its ground and its objects, once each, its instances, and the nodes above them, as
[`Bvh::write`]. A loaded world moves like the original: instances and objects keep their numbers.

```
use antumbra::{Geometry, Instance, Object, Ray, Recipe, World};

let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
let leaf = Object::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
let place = |x| Instance::new(0, [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
let world = World::new(&[leaf], &[place(0.0)])?;
let mut file = Vec::new();
world.write(&mut file)?;

let mut loaded = World::read(&file[..])?;
let ray = Ray::new([7.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
assert!(!loaded.occluded(&ray));
loaded.set_instances(&[place(7.0)])?;
assert!(loaded.occluded(&ray));
# Ok::<(), antumbra::Error>(())
```"
);
