//! Several trees that answer the queries of one thread, counted and timed, interleaved.
//!
//! Paths go on with the answers of one tree. Its queries are kept until there are many. Then every tree answers them,
//! so that none has to fetch its nodes again for a few rays. All answers must agree.

use antumbra::parts::{Cost, Steps};
use antumbra::{Bvh, Hit, Ray};
use antumbra_render::{PathBatch, Queries};

use super::comparison::Comparison;
use crate::counted::sum;
use crate::thread_seconds as seconds;

/// Number of kept rays at which all trees answer them.
const ENOUGH: usize = 1 << 17;

/// Sums of one tree.
#[derive(Clone, Debug, Default)]
pub struct TreeSums {
    /// Node tests, primitive tests, and node tests outside of instances.
    pub tests: [u64; 3],
    /// Seconds in timed shadow queries, round by round.
    pub shadow: Vec<f64>,
    /// Seconds in timed closest-hit queries.
    pub closest: f64,
    /// Whether an answer differed from the tree in which the paths were traced.
    pub differs: bool,
}

impl TreeSums {
    /// Sums of a tree whose shadow queries are timed in so many rounds.
    pub fn new(rounds: usize) -> Self {
        Self {
            shadow: vec![0.0; rounds],
            ..Self::default()
        }
    }
}

/// Sums that all trees share.
#[derive(Clone, Debug, Default)]
pub struct SharedSums {
    /// Shadow rays, and those that are timed.
    pub shadow_rays: [u64; 2],
    /// Closest-hit rays, and those that are timed.
    pub closest_rays: [u64; 2],
    /// Seconds outside of queries.
    pub shading: f64,
    /// Seconds of adding samples to the film.
    pub film: f64,
}

/// Queries with their answers, in the order of the calls.
#[derive(Debug)]
struct Kept<A> {
    rays: Vec<Ray>,
    answers: Vec<A>,
    /// End of every query.
    ends: Vec<usize>,
    /// Pixel of every ray, where tests are mapped.
    pixels: Vec<u32>,
}

impl<A: Copy> Kept<A> {
    fn new() -> Self {
        Self {
            rays: Vec::new(),
            answers: Vec::new(),
            ends: Vec::new(),
            pixels: Vec::new(),
        }
    }

    fn keep(&mut self, rays: &[Ray], answers: &[A]) {
        self.rays.extend_from_slice(rays);
        self.answers.extend_from_slice(answers);
        self.ends.push(self.rays.len());
    }

    /// Answers all queries again, one by one. Returns whether an answer differs.
    fn again(&self, answers: &mut Vec<A>, none: A, mut answer: impl FnMut(&[Ray], &mut [A])) -> bool
    where
        A: PartialEq,
    {
        answers.clear();
        answers.resize(self.rays.len(), none);
        let mut begin = 0;
        for &end in &self.ends {
            answer(&self.rays[begin..end], &mut answers[begin..end]);
            begin = end;
        }
        *answers != self.answers
    }

    fn clear(&mut self) {
        self.rays.clear();
        self.answers.clear();
        self.ends.clear();
        self.pixels.clear();
    }
}

/// Batch of paths under way.
#[derive(Debug, Default)]
struct Paths {
    /// Whether its shadow rays are timed, and its closest hits.
    timed: [bool; 2],
    /// Pixel of every sample, where tests are mapped.
    pixels: Vec<u32>,
    /// When its work began, and seconds of queries since.
    begun: f64,
    queries: f64,
}

/// The trees of one thread, with their sums.
pub struct Thread<'b> {
    comparison: &'b Comparison<'b>,
    stop: &'b dyn Fn() -> bool,
    /// Whether some kept rays were not answered by all trees because the thread was stopped.
    incomplete: bool,
    sums: Vec<TreeSums>,
    shared: SharedSums,
    paths: Paths,
    /// Shadow rays: those that are only counted, and those that are timed as well.
    shadow: [Kept<bool>; 2],
    closest: Kept<Option<Hit>>,
    /// Tree that answers first.
    turn: usize,
    answers: Vec<bool>,
    hits: Vec<Option<Hit>>,
    costs: Vec<Cost>,
}

impl<'b> Thread<'b> {
    /// Trees that have answered nothing yet. Nothing more is answered once `stop` is true.
    pub fn new(comparison: &'b Comparison<'b>, stop: &'b dyn Fn() -> bool) -> Self {
        let trees = &comparison.trees;
        Self {
            comparison,
            stop,
            incomplete: false,
            sums: vec![TreeSums::new(comparison.rounds); trees.len()],
            shared: SharedSums::default(),
            paths: Paths::default(),
            shadow: [Kept::new(), Kept::new()],
            closest: Kept::new(),
            turn: 0,
            answers: Vec::new(),
            hits: Vec::new(),
            costs: Vec::new(),
        }
    }

    /// Has all trees answer what is left. Returns the sums; `None` if the thread was stopped before.
    fn into_sums(mut self) -> Option<(Vec<TreeSums>, SharedSums)> {
        self.answer_shadow(0);
        self.answer_shadow(1);
        self.answer_closest();
        (!self.incomplete).then_some((self.sums, self.shared))
    }

    /// Has all trees answer the kept shadow rays.
    fn answer_shadow(&mut self, which: usize) {
        let kept = &self.shadow[which];
        for (place, tree) in self.comparison.trees.iter().enumerate() {
            if (self.stop)() && !kept.rays.is_empty() {
                self.incomplete = true;
                break;
            }
            self.answers.clear();
            self.answers.resize(kept.rays.len(), false);
            self.costs.clear();
            self.costs.resize(kept.rays.len(), Cost::default());
            let (answers, costs) = (&mut self.answers, &mut self.costs);
            tree.bvh.occluded_batch_counted(&kept.rays, answers, costs);
            let sums = &mut self.sums[place];
            sums.differs |= *answers != kept.answers;
            for (all, tests) in sums.tests.iter_mut().zip(sum(costs)) {
                *all += tests;
            }
            if tree.timed {
                self.comparison.map(place, &kept.pixels, costs);
            }
        }
        if which == 1 && !self.incomplete {
            for round in 0..self.comparison.rounds {
                for place in in_turn(&mut self.turn, self.sums.len()) {
                    let (tree, sums) = (self.comparison.trees[place], &mut self.sums[place]);
                    if tree.timed {
                        let start = seconds();
                        sums.differs |= kept.again(&mut self.answers, false, |rays, answers| {
                            tree.bvh.batch(rays).on_this_thread().occluded_into(answers);
                        });
                        sums.shadow[round] += seconds() - start;
                    }
                }
            }
        }
        self.shadow[which].clear();
    }

    /// Has all trees answer the kept closest-hit rays.
    fn answer_closest(&mut self) {
        for place in in_turn(&mut self.turn, self.sums.len()) {
            if (self.stop)() && !self.closest.rays.is_empty() {
                self.incomplete = true;
                break;
            }
            let (tree, sums) = (self.comparison.trees[place], &mut self.sums[place]);
            if tree.timed {
                let start = seconds();
                sums.differs |= self.closest.again(&mut self.hits, None, |rays, hits| {
                    tree.bvh.batch(rays).on_this_thread().intersect_into(hits);
                });
                sums.closest += seconds() - start;
            }
        }
        self.closest.clear();
    }
}

impl Queries for Thread<'_> {
    fn begin(&mut self, paths: &PathBatch<'_>) {
        self.paths.timed = self.comparison.times(paths);
        self.paths.pixels.clear();
        if self.comparison.maps() {
            let pixels = paths.pixels.iter();
            let pixels = pixels.map(|&pixel| self.comparison.pixel(pixel));
            self.paths.pixels.extend(pixels);
        }
        self.paths.queries = 0.0;
        self.paths.begun = seconds();
    }

    fn intersect(&mut self, bvh: &Bvh, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let start = seconds();
        bvh.batch(rays).on_this_thread().intersect_into(hits);
        self.shared.closest_rays[0] += rays.len() as u64;
        if self.paths.timed[1] {
            self.shared.closest_rays[1] += rays.len() as u64;
            self.closest.keep(rays, hits);
        }
        self.paths.queries += seconds() - start;
    }

    fn occluded(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) {
        let start = seconds();
        bvh.batch(rays).on_this_thread().occluded_into(occluded);
        let timed = self.paths.timed[0];
        self.shared.shadow_rays[0] += rays.len() as u64;
        self.shared.shadow_rays[1] += if timed { rays.len() as u64 } else { 0 };
        self.shadow[usize::from(timed)].keep(rays, occluded);
        self.paths.queries += seconds() - start;
    }

    fn attribute(&mut self, paths: &mut dyn Iterator<Item = u32>) {
        let pixels = &self.paths.pixels;
        if pixels.is_empty() {
            return;
        }
        let kept = &mut self.shadow[usize::from(self.paths.timed[0])];
        kept.pixels.extend(paths.map(|path| pixels[path as usize]));
    }

    fn traced(&mut self) {
        let now = seconds();
        self.shared.shading += (now - self.paths.begun - self.paths.queries).max(0.0);
        self.paths.begun = now;
    }

    fn filmed(&mut self) {
        self.shared.film += seconds() - self.paths.begun;
        for place in 0..2 {
            if self.shadow[place].rays.len() >= ENOUGH {
                self.answer_shadow(place);
            }
        }
        if self.closest.rays.len() >= ENOUGH {
            self.answer_closest();
        }
    }

    fn end(self: Box<Self>) {
        let comparison = self.comparison;
        comparison.add(self.into_sums());
    }
}

/// All places, beginning with another one each time: nobody always comes first.
fn in_turn(turn: &mut usize, count: usize) -> impl Iterator<Item = usize> + use<> {
    let first = *turn;
    *turn = (*turn + 1) % count.max(1);
    (first..count).chain(0..first)
}

#[cfg(test)]
mod tests {
    use super::super::comparison::Candidate;
    use super::*;
    use antumbra::{Bvh, Geometry, Recipe};
    use antumbra_image::Window;

    fn tree(depth: f32) -> Bvh {
        let corners = [[0.0, 0.0, depth], [1.0, 0.0, depth], [0.0, 1.0, depth]];
        let geometry = [Geometry::triangles(&corners[..], vec![[0, 1, 2]])];
        Bvh::build(&geometry, &Recipe::default()).expect("a tree")
    }

    fn sums(trees: &[&Bvh], stop: bool) -> Option<(Vec<TreeSums>, SharedSums)> {
        let first = trees[0];
        let trees = trees.iter().map(|bvh| Candidate { bvh, timed: true });
        let comparison = Comparison::new(trees.collect(), 2, Window::full(1, 1), 1, false);
        let stop = || stop;
        let mut thread = Thread::new(&comparison, &stop);
        let rays = [Ray {
            tfar: 2.0,
            ..Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0])
        }; 3];
        let mut occluded = [false; 3];
        for timed in [false, true] {
            thread.begin(&PathBatch {
                tile: 0,
                first: 0,
                pixels: &[],
            });
            thread.paths.timed = [timed, false];
            thread.occluded(first, &rays, &mut occluded);
            thread.traced();
            thread.filmed();
        }
        assert_eq!(occluded, [true; 3]);
        thread.into_sums()
    }

    #[test]
    fn other_answers_are_noticed() {
        let (near, far) = (tree(1.0), tree(3.0));
        let (trees, shared) = sums(&[&near, &near, &far], false).expect("nobody stops");
        assert_eq!(shared.shadow_rays, [6, 3]);
        assert_eq!(
            trees.iter().map(|tree| tree.differs).collect::<Vec<_>>(),
            [false, false, true]
        );
        assert_eq!(trees[0].tests, trees[1].tests);
        // The root, and the one primitive in it.
        assert_eq!(trees[0].tests[..2], [6, 6]);
    }

    #[test]
    fn sums_of_less_than_all_rays_are_none() {
        let near = tree(1.0);
        assert!(sums(&[&near], true).is_none());
    }
}
