//! A choice among many lights that looks closely at near lights only.
//!
//! Lights are in a binary tree, each half of a node's lights together in space. Nodes that look small from a point
//! count as one source, other nodes are opened (Barnes and Hut 1986, *A hierarchical O(N log N) force-calculation
//! algorithm*; for lights: Walter et al. 2005, *Lightcuts*). One source of this cut is chosen by irradiance, and in
//! the source a light by strength, since its lights are about equally far away.

use std::ops::Range;

use glam::Vec3;

use super::source::Source;

/// Largest number of lights in a leaf. Lights of an opened leaf count one by one.
const LEAF: usize = 4;

/// Lights in a tree.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Nodes, each before its descendants.
    nodes: Vec<Node>,
    /// Lights and their sources in the order of leaves.
    lights: Vec<u32>,
    sources: Vec<Source>,
    /// Cumulative strengths: sum of all sources before each place, and of all.
    strengths: Vec<f64>,
    /// Place of every light in that order.
    places: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Node {
    whole: Source,
    /// Places of the node's lights.
    range: Range<u32>,
    /// First node after all descendants.
    next: u32,
    is_leaf: bool,
}

/// Lights that count as one source: their places, and the irradiance.
type Part = (Range<u32>, f32);

impl Tree {
    /// A tree over one source for every light.
    pub fn new(sources: &[Source]) -> Self {
        let mut lights: Vec<u32> = (0..sources.len() as u32).collect();
        // Lights infinitely far away come first, since they have no place to be split by.
        lights.sort_by_key(|&light| sources[light as usize].center().is_some());
        let mut nodes = Vec::new();
        grow(&mut nodes, &mut lights, 0, sources);
        let mut places = vec![0; lights.len()];
        for (place, &light) in lights.iter().enumerate() {
            places[light as usize] = place as u32;
        }
        let sources: Vec<Source> = lights.iter().map(|&l| sources[l as usize]).collect();
        let mut sum = 0.0;
        let mut strengths = vec![0.0];
        strengths.extend(sources.iter().map(|source| {
            sum += f64::from(source.strength());
            sum
        }));
        Self {
            nodes,
            lights,
            sources,
            strengths,
            places,
        }
    }

    /// Light for the point `at` by `u` in `[0, 1)`, and its probability.
    pub fn choose(&self, at: Vec3, u: f32) -> (usize, f32) {
        let count = self.lights.len();
        let total = self.total(at);
        if !is_usable(total) {
            let light = ((u * count as f32) as usize).min(count - 1);
            return (light, 1.0 / count as f32);
        }
        let target = u * total;
        let (mut sum, mut chosen, mut inside) = (0.0, 0..0, 0.0);
        let mut irradiance = 0.0;
        self.cut(at, |(range, part)| {
            // If rounding leaves the target at the end, the last part that can be chosen is.
            if part > 0.0 && sum <= target {
                inside = (target - sum) / part;
                (chosen, irradiance) = (range, part);
            }
            sum += part;
        });
        let place = self.choose_by_strength(chosen.clone(), inside);
        let probability = irradiance / total * self.share(&chosen, place);
        (self.lights[place as usize] as usize, probability)
    }

    /// Probability with which [`Self::choose`] returns `light`.
    pub fn probability(&self, at: Vec3, light: usize) -> f32 {
        let place = self.places[light];
        let (mut total, mut own) = (0.0, 0.0);
        self.cut(at, |(range, part)| {
            if part > 0.0 && range.contains(&place) {
                own = part * self.share(&range, place);
            }
            total += part;
        });
        if is_usable(total) {
            own / total
        } else {
            1.0 / self.lights.len() as f32
        }
    }

    fn total(&self, at: Vec3) -> f32 {
        let mut total = 0.0;
        self.cut(at, |(_, part)| total += part);
        total
    }

    /// All lights as the point sees them, always in one order.
    #[inline]
    fn cut(&self, at: Vec3, mut visit: impl FnMut(Part)) {
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            if node.whole.is_small_from(at) {
                visit((node.range.clone(), node.whole.irradiance(at)));
            } else if node.is_leaf {
                for place in node.range.clone() {
                    let part = self.sources[place as usize].irradiance(at);
                    visit((place..place + 1, part));
                }
            } else {
                index += 1;
                continue;
            }
            index = node.next as usize;
        }
    }

    /// Place in a range by strength, for `u` in `[0, 1)`.
    fn choose_by_strength(&self, range: Range<u32>, u: f32) -> u32 {
        let (first, last) = (range.start as usize, range.end as usize);
        let (start, end) = (self.strengths[first], self.strengths[last]);
        let target = start + f64::from(u) * (end - start);
        let sums = &self.strengths[first + 1..last];
        (first + sums.partition_point(|&sum| sum <= target)) as u32
    }

    /// Share of a place in the strength of a range.
    fn share(&self, range: &Range<u32>, place: u32) -> f32 {
        let strength = |range: Range<u32>| {
            self.strengths[range.end as usize] - self.strengths[range.start as usize]
        };
        (strength(place..place + 1) / strength(range.clone())) as f32
    }
}

/// Whether numbers in proportion to `total` add up to one.
fn is_usable(total: f32) -> bool {
    total > 0.0 && total.is_finite()
}

/// Adds the node of `lights`, which begin at place `first`, and its descendants. May reorder `lights`.
fn grow(nodes: &mut Vec<Node>, lights: &mut [u32], first: u32, sources: &[Source]) {
    let index = nodes.len();
    let parts: Vec<Source> = lights.iter().map(|&l| sources[l as usize]).collect();
    let is_leaf = lights.len() <= LEAF;
    nodes.push(Node {
        whole: Source::sum(&parts),
        range: first..first + lights.len() as u32,
        next: 0,
        is_leaf,
    });
    if !is_leaf {
        let middle = split(lights, sources);
        let (left, right) = lights.split_at_mut(middle);
        grow(nodes, left, first, sources);
        grow(nodes, right, first + middle as u32, sources);
    }
    nodes[index].next = nodes.len() as u32;
}

/// Puts lights of one half of space before the lights of the other. Returns where the second half begins.
///
/// Lights infinitely far away, which come first, are a half of their own.
fn split(lights: &mut [u32], sources: &[Source]) -> usize {
    let center = |&light: &u32| sources[light as usize].center();
    let far = lights.partition_point(|light| center(light).is_none());
    if far == lights.len() {
        return far / 2;
    }
    if far > 0 {
        return far;
    }
    let centers = || lights.iter().filter_map(center);
    let low = centers().fold(Vec3::INFINITY, Vec3::min);
    let high = centers().fold(Vec3::NEG_INFINITY, Vec3::max);
    let axis = (high - low).max_position();
    let middle = lights.len() / 2;
    lights.select_nth_unstable_by(middle, |a, b| {
        let [a, b] = [a, b].map(|light| (center(light).map_or(0.0, |c| c[axis]), *light));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    });
    middle
}
