//! Trees in files.

use alloc::format;
use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::io::{Read, Write};

use antumbra_simd::Isa;

use super::bvh::Bvh;
use crate::error::Error;
use crate::geometry::leaf_block::LeafBlock;
use crate::trace::memory::Pool;
use crate::tree::any::{Tree, on_tree};
use crate::tree::wide::WideTree;
use crate::tree::words::{self, Kind, Sink, Words};

impl Bvh {
    /// Writes the tree: geometry, nodes and child order. [`Bvh::read`] makes a tree of it that gives the same answers at the
    /// same cost, on any machine and instruction set.
    ///
    /// The times of the [report](Bvh::report) are not written. Give a buffered writer or any other; the tree is written in
    /// large pieces.
    ///
    /// # Errors
    /// [`Error::HasFilters`] if the tree has partly transparent triangles, [`Error::HasUserGeometry`] if it has user geometry:
    /// both have functions, which no file can hold. [`Error::Io`] if writing fails.
    #[cfg(feature = "std")]
    pub fn write(&self, out: impl Write) -> Result<(), Error> {
        self.can_be_saved()?;
        words::write(Kind::Tree, out, |sink| self.write_words(sink))
    }

    /// Reads a tree that [`Bvh::write`] wrote, for the best instruction set of this CPU. Takes no byte behind its end.
    ///
    /// Files are not trusted. A wrong checksum is an error, and so is a file with a right one that breaks any promise that
    /// [`Bvh::validate`] checks. Memory is at most 32 times the bytes that were read.
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong, [`Error::Io`] if reading fails.
    #[cfg(feature = "std")]
    pub fn read(input: impl Read) -> Result<Self, Error> {
        Self::read_words(&words::read(Kind::Tree, input)?)
    }

    /// The bytes that [`Bvh::write`] writes.
    ///
    /// # Errors
    /// [`Error::HasFilters`] and [`Error::HasUserGeometry`], as [`Bvh::write`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        self.can_be_saved()?;
        Ok(words::to_bytes(Kind::Tree, |sink| self.write_words(sink)))
    }

    /// [`Bvh::read`] from memory, of which nothing may be left.
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        Self::read_words(words::contents(Kind::Tree, bytes)?)
    }

    fn can_be_saved(&self) -> Result<(), Error> {
        let cutouts = self.cutouts;
        if cutouts > 0 {
            return Err(Error::HasFilters { cutouts });
        }
        let primitives =
            on_tree!(&self.tree, tree => tree.blocks.users.iter().map(LeafBlock::count).sum());
        if primitives > 0 {
            return Err(Error::HasUserGeometry { primitives });
        }
        Ok(())
    }

    fn write_words(&self, sink: &mut dyn Sink) {
        sink.word(self.width().lanes() as u32);
        sink.word(self.prefetch.into());
        for count in [self.dropped, self.transparent] {
            sink.long(count as u64);
        }
        sink.long(self.training_rays);
        for cost in [self.predicted_cost, self.predicted_before] {
            // No cost is NaN.
            sink.long(cost.unwrap_or(f64::NAN).to_bits());
        }
        on_tree!(&self.tree, tree => tree.write(sink));
    }

    fn read_words(contents: &[u8]) -> Result<Self, Error> {
        let words = &mut Words::new(Kind::Tree, contents);
        let width = words.word()?;
        let prefetch = words.word()? != 0;
        let [dropped, transparent] = [words.long()? as usize, words.long()? as usize];
        let training_rays = words.long()?;
        let [predicted_cost, predicted_before] = [words.long()?, words.long()?]
            .map(|bits| Some(f64::from_bits(bits)).filter(|cost| !cost.is_nan()));
        let tree = match width {
            4 => Tree::W4(WideTree::read(words)?),
            8 => Tree::W8(WideTree::read(words)?),
            16 => Tree::W16(WideTree::read(words)?),
            _ => return Err(words.error(format!("no node has {width} children"))),
        };
        words.end()?;
        let primitives = on_tree!(&tree, tree => tree.validate());
        Ok(Self {
            primitives: primitives.map_err(|broken| words.error(broken))?,
            tree,
            isa: Isa::best(),
            cutouts: 0,
            dropped,
            transparent,
            pool: Pool::default(),
            prefetch,
            predicted_cost,
            predicted_before,
            training_rays,
            times: None,
            built_sah: None,
            masks: None,
        })
    }
}
