//! Every query of a tree, by every call that there is for it: all calls of queries are here.
//!
//! Names of questions are words of the digest, and stay when what they call is renamed.

use antumbra::inputs::Column;
use antumbra::{
    Batch, Bvh, ClosestPoint, Directions, Hit, Isa, PrimId, Ray, RayColumns, RayOrder, RayQuery,
    Surface, Visit,
};
use antumbra_trees::engine;
use xxhash_rust::xxh3::Xxh3Default;

use crate::scenes::Moving;

/// What a question in one way got as answers.
pub struct Answer {
    pub query: &'static str,
    pub condition: &'static str,
    pub way: &'static str,
    /// Hash of hit or not, and of what was hit.
    pub who: u64,
    /// Hash of distances and coordinates, where the question has any.
    pub place: Option<u64>,
}

/// Which hits count: every condition by itself, and all together.
pub const CONDITIONS: [&str; 7] = ["none", "mask", "masks", "except", "filter", "closed", "all"];

/// Rays, points and what conditions need to know.
pub struct Questions<'a> {
    rays: &'a [Ray],
    points: &'a [[f32; 3]],
    masks: Vec<u32>,
    excluded: Vec<PrimId>,
    columns: [Vec<f32>; 4],
    directions: Directions,
}

/// Whether a hit counts: by its names only, so that rounding of distances never changes who is hit.
fn counts(ray: usize, hit: &Hit) -> bool {
    !(ray as u32 + 3 * hit.prim_id + 5 * hit.geom_id + hit.inst_id % 97).is_multiple_of(3)
}

/// A visit of hits that ends in each of the ways there are.
fn visited(hits: &mut Vec<Hit>, hit: Hit) -> Visit {
    hits.push(hit);
    match (hits.len(), hit.prim_id % 7) {
        (3.., 0) => Visit::Stop,
        (2.., 1) => Visit::Accept,
        _ => Visit::Reject,
    }
}

/// A query or a batch under the condition of this name; `all` is every one but `mask`, which is one mask for all rays.
macro_rules! under {
    ($condition:expr, $query:expr; $masks:ident($own:expr), except($excluded:expr), filter($filter:expr)) => {{
        let has = |what| [what, "all"].contains(&$condition);
        let mut query = $query;
        if $condition == "mask" {
            query = query.mask(1);
        }
        if has("masks") {
            query = query.$masks($own);
        }
        if has("except") {
            query = query.except($excluded);
        }
        if has("filter") {
            query = query.filter($filter);
        }
        if has("closed") {
            query = query.closed();
        }
        query
    }};
}

impl<'a> Questions<'a> {
    /// Leaves out the primitive that each ray hits first, for two of three rays.
    pub fn new(bvh: &Bvh, rays: &'a [Ray], points: &'a [[f32; 3]]) -> Self {
        let first = |(index, ray): (usize, &Ray)| match bvh.intersect(ray) {
            Some(hit) if !index.is_multiple_of(3) => PrimId::from(hit),
            _ => PrimId::NONE,
        };
        let sky = |i: u32| {
            let [x, y] = [i * 7 % 13, i * 5 % 11].map(|x| x as f32 / 6.0 - 0.9);
            [x, y, 1.1 - x * x]
        };
        Self {
            masks: (0..rays.len())
                .map(|ray| [1, 2, 3, 4, u32::MAX, 0][ray % 6])
                .collect(),
            excluded: rays.iter().enumerate().map(first).collect(),
            columns: [
                rays.iter().flat_map(|ray| ray.org).collect(),
                rays.iter().flat_map(|ray| ray.dir).collect(),
                rays.iter().map(|ray| ray.tnear).collect(),
                rays.iter().map(|ray| ray.tfar).collect(),
            ],
            directions: Directions::new(&(0..143).map(sky).collect::<Vec<_>>()),
            rays,
            points,
        }
    }

    /// Everything about rays, points and groups, for some conditions.
    pub fn all(&self, bvh: &Bvh, conditions: &[&'static str]) -> Vec<Answer> {
        let mut answers = Vec::new();
        for &condition in conditions {
            self.single(bvh, condition, &mut answers);
            self.batches(bvh, condition, &mut answers);
        }
        self.plain(bvh, &mut answers);
        self.points(bvh, &mut answers);
        self.groups(bvh, &mut answers);
        answers
    }

    /// Which occluders are found first: each tree and level may find others.
    pub fn first_occluders(&self, bvh: &Bvh) -> String {
        let mut sums = Sums::default();
        for found in bvh.batch(self.rays).occluders() {
            let id = found.unwrap_or(PrimId::NONE);
            sums.ids([id.inst_id, id.geom_id, id.prim_id]);
        }
        format!("{:016x}", sums.who.digest())
    }

    /// The two questions that matter most, of all rays so many times over: threads share batches that are long enough.
    pub fn briefly(&self, bvh: &Bvh, times: usize) -> Vec<Answer> {
        let mut bvh = bvh.clone();
        engine(Isa::best(), bvh.width())
            .run(&mut bvh)
            .expect("its width");
        let rays = self.rays.repeat(times);
        let (occluded, hits) = (bvh.batch(&rays).occluded(), bvh.batch(&rays).intersect());
        let mut answers = Vec::new();
        for (occluded, hits) in (occluded.chunks(self.rays.len())).zip(hits.chunks(self.rays.len()))
        {
            answers.push(Sums::flags(occluded).answer("occluded", ("none", "long")));
            answers.push(Sums::hits(hits).answer("closest", ("none", "long")));
        }
        answers
    }

    /// One ray after the other, with conditions.
    fn single(&self, bvh: &Bvh, condition: &'static str, answers: &mut Vec<Answer>) {
        let name = (condition, "single");
        let rays = 0..self.rays.len();
        let mut all = Sums::default();
        let (mut found, mut met, mut count) = (Vec::new(), Vec::new(), Vec::new());
        let (mut hits, mut visits) = (Vec::new(), Sums::default());
        for ray in rays {
            self.one(bvh, condition, ray, |query| {
                found.push(query.occluded());
                met.push(query.occluder().is_some());
                hits.push(query.intersect());
                all.list(&query.all_hits());
                count.push(query.count_hits() as u32);
                let mut seen = Vec::new();
                query.visit_hits(|hit| visited(&mut seen, hit));
                visits.list(&seen);
            });
        }
        answers.extend([
            Sums::flags(&found).answer("occluded", name),
            Sums::flags(&met).answer("occluder", name),
            Sums::hits(&hits).answer("closest", name),
            all.answer("all", name),
            Sums::numbers(&count).answer("count", name),
            visits.answer("visits", name),
        ]);
    }

    /// A query about one ray.
    fn one(&self, bvh: &Bvh, condition: &'static str, ray: usize, ask: impl FnOnce(RayQuery<'_>)) {
        let filter = |hit: &Hit| counts(ray, hit);
        let query = under!(condition, bvh.query(&self.rays[ray]); mask(self.masks[ray]), except(self.excluded[ray]), filter(&filter));
        ask(query);
    }

    /// Many rays at once, with conditions: in every order, among threads and on one, from lists and columns.
    fn batches(&self, bvh: &Bvh, condition: &'static str, answers: &mut Vec<Answer>) {
        let many = self.many(bvh.batch(self.rays), condition);
        let mut ways = vec![("batch", many)];
        if ["none", "all"].contains(&condition) {
            let [org, dir, near, far] = &self.columns;
            let columns =
                RayColumns::new(self.rays.len(), Column::new(org, 3), Column::new(dir, 3));
            let columns = columns.and_then(|rays| rays.near(near));
            let columns = columns.and_then(|rays| rays.far(far));
            let columns = columns.expect("one number for each ray");
            ways.push(("here", many.on_this_thread()));
            ways.push(("sorted", many.order(RayOrder::Sorted)));
            ways.push(("alike", many.order(RayOrder::Alike)));
            ways.push(("columns", self.many(bvh.batch(columns), condition)));
        }
        for (way, batch) in ways {
            let name = (condition, way);
            let occluders = batch.occluders();
            let occluders: Vec<_> = occluders.iter().map(Option::is_some).collect();
            answers.extend([
                Sums::flags(&batch.occluded()).answer("occluded", name),
                Sums::flags(&occluders).answer("occluder", name),
                Sums::hits(&batch.intersect()).answer("closest", name),
            ]);
            let mut sums = Sums::default();
            for surface in batch.surfaces() {
                sums.surface(surface);
            }
            answers.push(sums.answer("surface", name));
            // Visits have no orders.
            if !["batch", "here", "columns"].contains(&way) {
                continue;
            }
            let (lists, mut sums) = (batch.all_hits(), Sums::default());
            (0..lists.len()).for_each(|ray| sums.list(lists.of(ray)));
            answers.push(sums.answer("all", name));
            answers.push(Sums::numbers(&batch.count_hits()).answer("count", name));
            let (mut visits, mut sums) = (vec![Vec::new(); self.rays.len()], Sums::default());
            batch.visit_hits(&mut visits, visited);
            visits.iter().for_each(|hits| sums.list(hits));
            answers.push(sums.answer("visits", name));
        }
        let mut words = vec![0; self.rays.len().div_ceil(64)];
        many.occluded_bits_into(&mut words);
        let bits = (0..self.rays.len()).map(|ray| words[ray / 64] >> (ray % 64) & 1 == 1);
        let bits = Sums::flags(&bits.collect::<Vec<_>>());
        answers.push(bits.answer("occluded", (condition, "bits")));
    }

    fn many<'b>(&'b self, batch: Batch<'b>, condition: &'static str) -> Batch<'b> {
        under!(condition, batch; masks(&self.masks), except(&self.excluded), filter(&counts))
    }

    /// Rays without conditions: one by one, few at a time, and the queries about a hit.
    fn plain(&self, bvh: &Bvh, answers: &mut Vec<Answer>) {
        let name = ("none", "plain");
        let found: Vec<_> = self.rays.iter().map(|ray| bvh.occluded(ray)).collect();
        let hits: Vec<_> = self.rays.iter().map(|ray| bvh.intersect(ray)).collect();
        let (mut surfaces, mut normals) = (Sums::default(), Sums::default());
        for (ray, hit) in self.rays.iter().zip(&hits) {
            surfaces.surface(bvh.surface(ray));
            let normal = hit.and_then(|hit| bvh.normal(ray, &hit));
            normals.word(u32::from(normal.is_some()));
            normal.iter().for_each(|normal| normals.at(normal));
        }
        answers.extend([
            Sums::flags(&found).answer("occluded", name),
            Sums::hits(&hits).answer("closest", name),
            surfaces.answer("surface", name),
            normals.answer("normal", name),
        ]);
        let (mut found, mut hits) = (vec![false; self.rays.len()], vec![None; self.rays.len()]);
        let few = self.rays.chunks(21);
        for ((few, found), hits) in few.zip(found.chunks_mut(21)).zip(hits.chunks_mut(21)) {
            bvh.batch(few).occluded_into(found);
            bvh.batch(few).intersect_into(hits);
        }
        answers.push(Sums::flags(&found).answer("occluded", ("none", "few")));
        answers.push(Sums::hits(&hits).answer("closest", ("none", "few")));
        let closed = self.rays.iter().map(|ray| bvh.intersect(&ray.closed()));
        let closed = Sums::hits(&closed.collect::<Vec<_>>());
        answers.push(closed.answer("closest", ("closed", "plain")));
    }

    /// What is near points, and around them.
    fn points(&self, bvh: &Bvh, answers: &mut Vec<Answer>) {
        const REACH: f32 = 0.3;
        let points = self.points;
        let mut nearest = vec![None; points.len()];
        let mut within = vec![Vec::new(); points.len()];
        let mut inside = vec![false; points.len()];
        let mut signed = vec![0.0; points.len()];
        for way in ["batch", "single"] {
            if way == "batch" {
                bvh.points(points).closest_into(&mut nearest);
                within = bvh.points(points).within(REACH).all();
                bvh.points(points).inside_into(&mut inside);
                bvh.points(points).signed_distances_into(&mut signed);
            } else {
                for (index, point) in points.iter().enumerate() {
                    nearest[index] = bvh.closest(*point, f32::INFINITY);
                    within[index] = bvh.within(*point, REACH);
                    inside[index] = bvh.contains(*point);
                    signed[index] = bvh.signed_distance(*point);
                }
            }
            let [mut near, mut around, mut distance] = [(); 3].map(|()| Sums::default());
            for (index, found) in nearest.iter().enumerate() {
                near.word(u32::from(found.is_some()));
                found.iter().for_each(|found| near.point(found));
                around.word(within[index].len() as u32);
                within[index].iter().for_each(|found| around.point(found));
                distance.word(u32::from(signed[index] < 0.0));
                distance.at(&[signed[index]]);
            }
            let name = ("none", way);
            answers.extend([
                near.answer("nearest", name),
                around.answer("within", name),
                distance.answer("signed", name),
                Sums::flags(&inside).answer("inside", name),
            ]);
        }
        let winding = points.iter().map(|point| bvh.winding_number(*point) as u32);
        let winding = Sums::numbers(&winding.collect::<Vec<_>>());
        answers.push(winding.answer("winding", ("none", "single")));
    }

    /// Points and directions: free, above surfaces, and in intervals.
    fn groups(&self, bvh: &Bvh, answers: &mut Vec<Answer>) {
        let normals: Vec<_> = self
            .points
            .iter()
            .map(|&[x, y, z]| [z, x, y + 0.1])
            .collect();
        let near: Vec<_> = self
            .points
            .iter()
            .map(|at| 0.05 * at[0].abs().fract())
            .collect();
        let group = bvh.group(self.points, &self.directions);
        let mut open = vec![0; self.points.len() * group.words_per_row()];
        for (condition, group) in [
            ("none", group),
            ("above", group.above(&normals)),
            ("interval", group.above(&normals).near(&near).far(0.8)),
        ] {
            for (way, group) in [("threads", group), ("here", group.on_this_thread())] {
                group.open_into(&mut open);
                let mut sums = Sums::default();
                open.iter()
                    .for_each(|word| sums.who.update(&word.to_le_bytes()));
                answers.push(sums.answer("group", (condition, way)));
            }
        }
    }
}

/// Everything about rays at times.
pub fn at_times(bvh: &Bvh, moving: &Moving) -> Vec<Answer> {
    let (rays, times) = (&moving.scene.rays, &moving.times);
    let (mut found, mut hits) = (vec![false; rays.len()], vec![None; rays.len()]);
    let mut answers = Vec::new();
    for (way, len) in [("batch", rays.len()), ("few", 13), ("single", 1)] {
        for (piece, rays) in rays.chunks(len).enumerate() {
            let range = piece * len..piece * len + rays.len();
            let (times, found, hits) = (
                &times[range.clone()],
                &mut found[range.clone()],
                &mut hits[range],
            );
            if way == "single" {
                let query = bvh.query(&rays[0]).at(times[0]);
                (found[0], hits[0]) = (query.occluded(), query.intersect());
            } else {
                bvh.batch(rays).at(times).occluded_into(found);
                bvh.batch(rays).at(times).intersect_into(hits);
            }
        }
        answers.push(Sums::flags(&found).answer("occluded", ("none", way)));
        answers.push(Sums::hits(&hits).answer("closest", ("none", way)));
    }
    answers
}

/// Hashes of who and where.
#[derive(Default)]
struct Sums {
    who: Xxh3Default,
    place: Xxh3Default,
    has_place: bool,
}

impl Sums {
    fn flags(flags: &[bool]) -> Self {
        let mut sums = Self::default();
        flags
            .iter()
            .for_each(|flag| sums.who.update(&[u8::from(*flag)]));
        sums
    }

    fn numbers(numbers: &[u32]) -> Self {
        let mut sums = Self::default();
        numbers.iter().for_each(|number| sums.word(*number));
        sums
    }

    fn hits(hits: &[Option<Hit>]) -> Self {
        let mut sums = Self::default();
        hits.iter().for_each(|hit| sums.hit(hit.as_ref()));
        sums
    }

    fn word(&mut self, word: u32) {
        self.who.update(&word.to_le_bytes());
    }

    fn ids(&mut self, ids: [u32; 3]) {
        ids.iter().for_each(|id| self.word(*id));
    }

    fn at(&mut self, numbers: &[f32]) {
        self.has_place = true;
        for number in numbers {
            self.place.update(&number.to_bits().to_le_bytes());
        }
    }

    fn hit(&mut self, hit: Option<&Hit>) {
        self.has_place = true;
        self.who.update(&[u8::from(hit.is_some())]);
        if let Some(hit) = hit {
            self.ids([hit.inst_id, hit.geom_id, hit.prim_id]);
            self.at(&[hit.t, hit.u, hit.v]);
        }
    }

    fn surface(&mut self, found: Option<Surface>) {
        self.hit(found.as_ref().map(|found| &found.hit));
        if let Some(Surface {
            position, normal, ..
        }) = found
        {
            self.at(&position);
            self.at(&normal);
        }
    }

    fn list(&mut self, hits: &[Hit]) {
        self.has_place = true;
        self.word(hits.len() as u32);
        hits.iter().for_each(|hit| self.hit(Some(hit)));
    }

    fn point(&mut self, found: &ClosestPoint) {
        self.ids([found.inst_id, found.geom_id, found.prim_id]);
        self.at(&[found.distance, found.u, found.v]);
        self.at(&found.position);
    }

    fn answer(self, query: &'static str, (condition, way): (&'static str, &'static str)) -> Answer {
        Answer {
            query,
            condition,
            way,
            who: self.who.digest(),
            place: self.has_place.then(|| self.place.digest()),
        }
    }
}
