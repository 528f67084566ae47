//! Child orders and training logs in files.

use alloc::format;
use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::io::{Read, Write};

use crate::error::Error;
use crate::geometry::BLOCK;
use crate::learn::ray_log::{LoggedRay, RayLog, Visit};
use crate::learn::{Log, LogKind};
use crate::shape::Shape;
use crate::tree::rule::Rule;
use crate::tree::slot_order::SlotOrder;
use crate::tree::words::{self, Kind, Sink, Words};

impl SlotOrder {
    /// Writes the order, to be applied to a tree of the same shape later.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails.
    #[cfg(feature = "std")]
    pub fn write(&self, out: impl Write) -> Result<(), Error> {
        words::write(Kind::Order, out, |sink| self.write_words(sink))
    }

    /// Reads an order that [`SlotOrder::write`] wrote. Files are not trusted, as in [`Bvh::read`](crate::Bvh::read).
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong, [`Error::Io`] if reading fails.
    #[cfg(feature = "std")]
    pub fn read(input: impl Read) -> Result<Self, Error> {
        words::read(Kind::Order, input, Self::read_words)
    }

    /// The bytes that [`SlotOrder::write`] writes.
    pub fn to_bytes(&self) -> Vec<u8> {
        words::to_bytes(Kind::Order, 0, |sink| self.write_words(sink))
    }

    /// [`SlotOrder::read`] from memory, of which nothing may be left.
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        words::from_bytes(Kind::Order, bytes, Self::read_words)
    }
}

impl Log {
    /// Writes the log: whoever has the same tree can plan an order from it, with rays that they never saw.
    ///
    /// # Errors
    /// [`Error::Io`] if writing fails.
    #[cfg(feature = "std")]
    pub fn write(&self, out: impl Write) -> Result<(), Error> {
        words::write(Kind::Log, out, |sink| self.write_words(sink))
    }

    /// Reads a log that [`Log::write`] wrote. Files are not trusted, as in [`Bvh::read`](crate::Bvh::read): counters
    /// that no ray could have left make an order that saves nothing, and no answer wrong.
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong, [`Error::Io`] if reading fails.
    #[cfg(feature = "std")]
    pub fn read(input: impl Read) -> Result<Self, Error> {
        words::read(Kind::Log, input, Self::read_words)
    }

    /// The bytes that [`Log::write`] writes.
    pub fn to_bytes(&self) -> Vec<u8> {
        words::to_bytes(Kind::Log, 0, |sink| self.write_words(sink))
    }

    /// [`Log::read`] from memory, of which nothing may be left.
    ///
    /// # Errors
    /// [`Error::Unreadable`] with what is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        words::from_bytes(Kind::Log, bytes, Self::read_words)
    }
}

impl Shape {
    pub(crate) fn write(&self, sink: &mut Sink<'_>) {
        let Self {
            width,
            nodes,
            leaves,
            instances,
            objects,
        } = *self;
        for count in [width, nodes, leaves, instances, objects] {
            sink.word(count as u32);
        }
    }

    pub(crate) fn read(words: &mut Words<'_>) -> Result<Self, Error> {
        let [width, nodes, leaves, instances, objects] = words.words()?.map(|count| count as usize);
        let shape = Self {
            width,
            nodes,
            leaves,
            instances,
            objects,
        };
        if ![4, 8, 16].contains(&shape.width) {
            return Err(words.error(format!("no node has {} children", shape.width)));
        }
        Ok(shape)
    }
}

impl SlotOrder {
    /// Writes shape and permutations.
    pub(crate) fn write_words(&self, sink: &mut Sink<'_>) {
        self.shape.write(sink);
        sink.word(self.slots.len() as u32);
        sink.bytes(&self.slots);
        sink.word(self.lanes.len() as u32);
        sink.bytes(self.lanes.as_flattened());
        self.pick.write(sink);
    }

    /// An order as [`SlotOrder::write_words`] wrote it: everything is a permutation.
    pub(crate) fn read_words(words: &mut Words<'_>) -> Result<Self, Error> {
        let shape = Shape::read(words)?;
        let Shape {
            width,
            nodes,
            leaves,
            ..
        } = shape;
        let slots = words.count()?;
        let slots = words.bytes(slots)?;
        let lanes = (words.word()? as usize).saturating_mul(BLOCK);
        let lanes = words.bytes(lanes)?.as_chunks().0.to_vec();
        let fits = |len: usize, all: usize| len == 0 || len == all;
        if !fits(slots.len(), nodes.saturating_mul(width)) || !fits(lanes.len(), leaves) {
            return Err(words.error("it is not as long as its tree"));
        }
        let is_permutations = slots.chunks(width).all(is_permutation)
            && lanes.iter().all(|lanes| is_permutation(lanes));
        if !is_permutations {
            return Err(words.error("a node or leaf is not permuted"));
        }
        Ok(Self {
            shape,
            slots,
            lanes,
            pick: Rule::read(words)?,
        })
    }
}

impl Log {
    /// Writes kind, shape and counters.
    pub(crate) fn write_words(&self, sink: &mut Sink<'_>) {
        let LogKind {
            boxes,
            shuffled,
            masks,
        } = self.kind;
        sink.word(u32::from(boxes) | u32::from(shuffled) << 1 | u32::from(masks) << 2);
        self.shape.write(sink);
        for long in [self.seed, self.rays, self.occluded] {
            sink.long(long);
        }
        for counters in [
            &self.node_entered[..],
            &self.lane_hits,
            &self.leaf_entered,
            self.prim_hits.as_flattened(),
        ] {
            sink.word(counters.len() as u32);
            counters.iter().for_each(|counter| sink.word(*counter));
        }
        if let Some(masks) = &self.masks {
            masks.write(sink);
        }
    }

    /// A log as [`Log::write_words`] wrote it: of a length that suits its shape.
    pub(crate) fn read_words(words: &mut Words<'_>) -> Result<Self, Error> {
        let bits = words.word()?;
        if bits > 7 {
            return Err(words.error(format!("no log is of kind {bits}")));
        }
        let kind = LogKind {
            boxes: bits & 1 != 0,
            shuffled: bits & 2 != 0,
            masks: bits & 4 != 0,
        };
        let shape = Shape::read(words)?;
        let (seed, rays, occluded) = (words.long()?, words.long()?, words.long()?);
        let ends = shape.leaves.saturating_add(shape.instances);
        let if_boxes = |count: usize| if kind.boxes { count } else { 0 };
        let lanes = shape.nodes.saturating_mul(shape.width);
        let node_entered = read_counters(words, if_boxes(shape.nodes))?;
        let lane_hits = read_counters(words, if_boxes(lanes))?;
        let leaf_entered = read_counters(words, if_boxes(ends))?;
        let prim_hits = read_counters(words, ends.saturating_mul(BLOCK))?;
        Ok(Self {
            kind,
            seed,
            shape,
            rays,
            occluded,
            node_entered,
            lane_hits,
            leaf_entered,
            prim_hits: prim_hits.as_chunks().0.to_vec(),
            masks: (kind.masks)
                .then(|| RayLog::read(words, &shape))
                .transpose()?,
        })
    }
}

/// Reads this many counters.
fn read_counters(words: &mut Words<'_>, expected: usize) -> Result<Vec<u32>, Error> {
    let found = words.count()?;
    if found != expected {
        return Err(words.error("it is not as long as its tree"));
    }
    words.list([], found, Words::word)
}

impl RayLog {
    /// Writes the visits of each ray.
    pub(crate) fn write(&self, sink: &mut Sink<'_>) {
        sink.word(self.rays.len() as u32);
        sink.word(self.visits.len() as u32);
        for (ray, range) in self.rays.iter().zip(self.ranges()) {
            sink.long(ray.key);
            sink.word(range.len() as u32);
        }
        for visit in &self.visits {
            sink.word(visit.node);
            sink.word(visit.len);
            sink.word(u32::from(visit.hit) | u32::from(visit.occluding) << 16);
            sink.word(visit.followed.into());
        }
    }

    /// Visits as [`RayLog::write`] wrote them: of nodes that a tree of this shape has, each with those below it, one for each
    /// child that is followed.
    pub(crate) fn read(words: &mut Words<'_>, shape: &Shape) -> Result<Self, Error> {
        let (rays, visits) = (words.count()?, words.count()?);
        let mut end = 0_usize;
        let rays = words.list([], rays, |words| {
            let key = words.long()?;
            end = end.saturating_add(words.count()?);
            Ok(LoggedRay { key, end })
        })?;
        if end != visits {
            return Err(words.error("it counts other visits than it holds"));
        }
        let visits = words.list([], visits, |words| {
            // Files of older versions have the octant of the ray above `followed`.
            let [node, len, boxes, followed] = words.words()?;
            let visit = Visit {
                node,
                len,
                hit: boxes as u16,
                occluding: (boxes >> 16) as u16,
                followed: followed as u16,
            };
            let slots = visit.hit | visit.occluding | visit.followed;
            let is_sound = (node as usize) < shape.nodes
                && u32::from(slots) >> shape.width == 0
                && (visit.occluding | visit.followed) & !visit.hit == 0;
            if is_sound {
                Ok(visit)
            } else {
                Err(words.error("a ray is where no node is"))
            }
        })?;
        let log = Self { rays, visits };
        if log.ranges().all(|range| is_nested(&log.visits[range])) {
            Ok(log)
        } else {
            Err(words.error("the nodes of a ray do not lie one below the other"))
        }
    }
}

/// Whether each visit says how many are below it, and how many children are followed.
fn is_nested(visits: &[Visit]) -> bool {
    // For each visit that is not over: where it ends and how many of its children are still to come.
    let mut open: Vec<(usize, u32)> = Vec::new();
    for (place, visit) in visits.iter().enumerate() {
        while open.last() == Some(&(place, 0)) {
            open.pop();
        }
        let end = place.saturating_add(visit.len as usize);
        let outer = match open.last_mut() {
            Some((_, 0)) => return false,
            Some((outer, children)) => {
                *children -= 1;
                *outer
            }
            None if place > 0 => return false,
            None => visits.len(),
        };
        if visit.len == 0 || end > outer || (place == 0 && end != outer) {
            return false;
        }
        open.push((end, visit.followed.count_ones()));
    }
    open.iter().all(|open| *open == (visits.len(), 0))
}

/// Whether every number below the count is there.
fn is_permutation(numbers: &[u8]) -> bool {
    let found = numbers.iter().fold(0u32, |found, number| {
        found | 1u32.checked_shl((*number).into()).unwrap_or(0)
    });
    found == (1 << numbers.len()) - 1
}
