//! The state of a rendering, to be resumed or joined with other parts. The picture has the bits of an uninterrupted
//! rendering.

use std::io::{self, Write};

use antumbra_image::Image;
use serde::{Deserialize, Serialize};

use super::archive::{self, Kind};
use super::sums::Effort;
use super::{Identity, Sums, TileWork};
use crate::Error;
use crate::film::{Film, Rules, Shard, Tiles, batch_depth};
use crate::integrator::Counts;
use crate::sampler::Method;
use crate::training::Lesson;
use crate::world::World;

/// State of a rendering: samples, as exact as while rendering, and training rays.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Snapshot {
    pub(crate) shard: Shard,
    pub(crate) spp: u32,
    /// As in [`Options`](crate::Options::texture_spp).
    pub(crate) texture_spp: Option<u32>,
    pub(crate) resolution: [u32; 2],
    pub(crate) sums: Sums,
    pub(crate) lesson: Option<Lesson>,
    pub(crate) earlier: Earlier,
}

/// Effort of earlier runs that is not in the sums.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Earlier {
    /// Rays of the pre-passes.
    pub prepass: Counts,
    /// Wall-clock seconds of all runs.
    pub seconds: f64,
}

impl Snapshot {
    /// Part of the picture.
    pub fn shard(&self) -> Shard {
        self.shard
    }

    /// Samples per pixel of the finished picture.
    pub fn spp(&self) -> u32 {
        self.spp
    }

    /// Whether the state keeps what [`Self::extend`] needs.
    pub fn is_extendable(&self) -> bool {
        self.is_complete() && self.sums.film.is_apart() && self.sums.costs.is_none()
    }

    /// Makes of a finished picture the state of an unfinished one with more samples, which gets the bits that it has
    /// without this state.
    ///
    /// A tile whose samples are no whole batches begins from scratch. Full tiles have batches of 16 samples per pixel, smaller
    /// tiles at the edges more.
    ///
    /// # Errors
    /// [`Error::Extend`] if `spp` is not more, if the tiles were not kept apart, or if samples depend on their number:
    /// with the sampler `maxmindist`, and with textures, which are averaged over the distance between samples unless
    /// [`texture_spp`](crate::Options::texture_spp) is given.
    pub fn extend(self, world: &World, spp: u32) -> Result<Self, Error> {
        let refuse = |reason: &'static str| Err(Error::Extend { reason });
        let kind = world.sampler.kind;
        if spp <= self.spp {
            return refuse("it has as many samples per pixel");
        }
        if Method::of(kind, self.spp) != Method::of(kind, spp) {
            return refuse("the sampler places samples by their number");
        }
        if world.has_textures() && self.texture_spp.is_none() {
            return refuse("textures are averaged over the distance between samples");
        }
        if !self.is_extendable() {
            return refuse("its tiles were not kept apart");
        }
        let rules = self.rules();
        let tiles = Tiles::new(rules.sampled());
        let mut sums = Sums::new(Film::apart(rules), false);
        sums.effort = self.sums.effort;
        for (index, film) in self.sums.film.into_tiles().unwrap_or_default() {
            let window = tiles.window(index);
            if self.spp.is_multiple_of(batch_depth(window)) {
                let tile = TileWork {
                    film,
                    done: self.spp,
                    ..TileWork::new(rules, window, false)
                };
                sums.begun.insert(index, tile);
            }
        }
        Ok(Self { spp, sums, ..self })
    }

    /// Training rays, if there are any.
    pub fn lesson(&self) -> Option<&Lesson> {
        self.lesson.as_ref()
    }

    /// Number of finished tiles and number of tiles, both of the shard.
    pub fn finished(&self) -> [usize; 2] {
        let all = Tiles::new(self.rules().sampled()).count();
        let (index, count) = (self.shard.index() as usize, self.shard.count() as usize);
        let of_shard = all.saturating_sub(index).div_ceil(count);
        [self.sums.film.finished(), of_shard]
    }

    /// Whether all tiles of the shard are finished.
    pub fn is_complete(&self) -> bool {
        let [finished, all] = self.finished();
        finished == all
    }

    /// Rules of the film.
    pub(crate) fn rules(&self) -> Rules {
        self.sums.film.rules()
    }

    /// Joins complete shards of one picture. Each has a name for errors, and the identity of its rendering.
    ///
    /// # Errors
    /// [`Error::Join`] if a part is of another picture than the first or not complete, if two parts are the same
    /// shard, or if shards are missing.
    pub fn join(parts: Vec<(String, Identity, Self)>) -> Result<Self, Error> {
        let Some((_, _, model)) = parts.first() else {
            return refuse("there are no parts".into());
        };
        let count = model.shard.count();
        let (spp, texture_spp) = (model.spp, model.texture_spp);
        let (resolution, rules) = (model.resolution, model.rules());
        check_parts(&parts)?;
        let (mut earlier, mut efforts) = (Earlier::default(), Vec::new());
        let mut films = Vec::new();
        for (_, _, part) in parts {
            earlier.prepass.add(&part.earlier.prepass);
            earlier.seconds += part.earlier.seconds;
            efforts.push(part.sums.effort);
            films.push(part.sums.film);
        }
        let film = if count == 1 {
            films.remove(0)
        } else {
            Film::join(rules, films)
        };
        let mut sums = Sums::new(film, false);
        efforts.iter().for_each(|effort| sums.effort.add(effort));
        Ok(Self {
            shard: Shard::WHOLE,
            spp,
            texture_spp,
            resolution,
            sums,
            lesson: None,
            earlier,
        })
    }

    /// Picture so far.
    ///
    /// # Errors
    /// [`Error::Image`] for an empty window.
    pub fn image(&self) -> Result<Image, Error> {
        self.sums.film.image(self.resolution)
    }

    /// Standard errors so far, if requested.
    ///
    /// # Errors
    /// As [`Self::image`].
    pub fn standard_error(&self) -> Result<Option<Image>, Error> {
        self.sums.film.standard_error(self.resolution)
    }

    /// Number of samples that were negative or not finite.
    pub fn dropped_samples(&self) -> u64 {
        self.sums.film.dropped()
    }

    /// Pixel of the first dropped sample.
    pub fn dropped_at(&self) -> Option<[i32; 2]> {
        self.sums.film.dropped_at()
    }

    /// Numbers of closest-hit rays and of shadow rays so far.
    pub fn rays(&self) -> [u64; 2] {
        let mut counts = self.sums.effort.counts;
        counts.add(&self.earlier.prepass);
        [counts.closest_rays, counts.shadow_rays]
    }

    /// Wall-clock seconds of rendering so far, summed over machines.
    pub fn seconds(&self) -> f64 {
        self.earlier.seconds
    }

    /// The same state without its effort, which is another for each run.
    #[must_use]
    pub fn without_effort(mut self) -> Self {
        self.earlier = Earlier::default();
        let begun = self.sums.begun.values_mut();
        let all = begun.map(|tile| &mut tile.effort);
        all.chain([&mut self.sums.effort])
            .for_each(|effort| *effort = Effort::default());
        self
    }

    /// Writes the bytes of a file. Equal snapshots have equal bytes.
    ///
    /// # Errors
    /// Errors of `file`.
    pub fn write(&self, identity: &Identity, file: &mut dyn Write) -> io::Result<()> {
        archive::write(Kind::Snapshot, &(identity, self), file)
    }

    /// Reads the bytes of a file. Damaged and forged files are refused, and take no more memory than a small multiple
    /// of their length.
    ///
    /// # Errors
    /// [`Error::NotAnArchive`], [`Error::ArchiveKind`], [`Error::ArchiveFormat`], [`Error::DamagedArchive`].
    pub fn from_bytes(bytes: &[u8]) -> Result<(Identity, Self), Error> {
        let (identity, snapshot): (Identity, Self) = archive::decode(Kind::Snapshot, bytes)?;
        if snapshot.is_valid() {
            Ok((identity, snapshot))
        } else {
            Err(Error::DamagedArchive)
        }
    }

    /// Whether all parts have the sizes that they must have.
    fn is_valid(&self) -> bool {
        let rules = self.rules();
        if !self.shard.is_valid() || self.spp == 0 || !rules.are_valid() {
            return false;
        }
        let [width, height] = self.resolution;
        let limit = i32::MAX as u32 / 2;
        if width.max(height) > limit {
            return false;
        }
        let picture = antumbra_image::Window::full(width as usize, height as usize);
        let window = rules.window;
        let tiles = Tiles::new(rules.sampled());
        let Sums {
            film, costs, begun, ..
        } = &self.sums;
        window.x1 <= picture.x1
            && window.y1 <= picture.y1
            && film.fits(&tiles, self.shard)
            && costs
                .as_ref()
                .is_none_or(|costs| costs.len() == window.area())
            && begun.iter().all(|(&index, tile)| {
                if index >= tiles.count() || !self.shard.holds(index) || film.has(index) {
                    return false;
                }
                let window = tiles.window(index);
                let area = costs.as_ref().map(|_| window.area());
                tile.film.fits(&rules, window)
                    && tile.done <= self.spp
                    && (tile.done == self.spp || tile.done % batch_depth(window) == 0)
                    && tile.costs.as_ref().map(Vec::len) == area
            })
    }

    /// Whether two snapshots have films of equal size and rules, and equal numbers of samples.
    fn layout_equals(&self, other: &Self) -> bool {
        self.rules().equals(&other.rules())
            && self.resolution == other.resolution
            && self.spp == other.spp
    }
}

fn refuse<T>(reason: String) -> Result<T, Error> {
    Err(Error::Join { reason })
}

/// Checks that parts go together, are complete and different, and that none is missing.
fn check_parts(parts: &[(String, Identity, Snapshot)]) -> Result<(), Error> {
    let Some((first, identity, model)) = parts.first() else {
        return Ok(());
    };
    let count = model.shard.count();
    let mut names = std::collections::BTreeMap::new();
    for (name, other, part) in parts {
        if let Some(reason) = other.difference(identity) {
            return refuse(format!("{name} does not go with {first}: {reason}"));
        }
        if part.shard.count() != count {
            let found = part.shard.count();
            let reason = format!("one of {found} parts, the other of {count}");
            return refuse(format!("{name} does not go with {first}: {reason}"));
        }
        if !part.layout_equals(model) {
            return refuse(format!("{name} does not go with {first}: the films differ"));
        }
        if !part.is_complete() {
            let [finished, all] = part.finished();
            return refuse(format!("{name} is not complete: {finished} of {all} tiles"));
        }
        if let Some(other) = names.insert(part.shard.index(), name) {
            let shard = part.shard;
            return refuse(format!("{other} and {name} are both part {shard}"));
        }
    }
    let missing = (0..count).filter(|index| !names.contains_key(index));
    // Very many may be missing, so only the first are named.
    let shown: Vec<_> = missing
        .take(8)
        .map(|index| format!("{index}/{count}"))
        .collect();
    if shown.is_empty() {
        return Ok(());
    }
    let more = match count as usize - names.len() - shown.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    refuse(format!("parts are missing: {}{more}", shown.join(", ")))
}
