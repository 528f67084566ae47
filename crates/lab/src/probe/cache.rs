//! The cache of occluders, on trees in the order `joint`.

use antumbra::lab::{Cost, OccluderCache};
use antumbra::{Bvh, Order, Ray};

use super::row::{Row, counted};
use super::turns::in_turns;
use super::{BATCH, Part, Subject, check_equal};
use crate::Error;
use crate::study::Kind;

/// Caches: entries as a power of two, cells of space, facets of directions.
const CACHES: [(u32, u16, u8); 4] = [(12, 32, 3), (16, 64, 4), (16, 32, 3), (16, 16, 2)];

/// Everything about caches on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    subject.on_all_trees(|kind, recipe| {
        let trained = subject.trained(kind, recipe);
        let bvh = trained.collapse(recipe).order(Order::Joint)?.bvh;
        on_tree(subject, kind, bvh)
    })
}

fn on_tree(subject: &Subject<'_>, kind: Kind, bvh: Bvh) -> Result<Vec<Row>, Error> {
    let lots = subject.lots;
    let (train, warm, test) = (lots.train(kind), lots.warm(kind), lots.test(kind));
    let prim = f64::from(subject.recipe.costs.prim);
    let (expected, costs) = counted(&bvh, test);
    let mut plain = Row::new(subject, Part::Cache, kind, "none");
    plain.count(&costs, &expected, prim);
    let mut rows = vec![plain];
    let mut variants: Vec<(String, Bvh, OccluderCache)> = Vec::new();
    for (size, cells, facets) in CACHES {
        let mut cache = OccluderCache::new(train, size, cells, facets);
        let mut answers = vec![false; warm.len()];
        for (rays, answers) in warm.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
            cache.occluded_batch(&bvh, rays, answers);
        }
        variants.push((
            format!("cache 2^{size}, {cells}/{facets}"),
            bvh.clone(),
            cache,
        ));
    }
    // The order of the rays that the larger cache leaves over.
    if let Some((_, tree, cache)) = variants.get(2).cloned() {
        let mut guessing = cache.clone();
        let mut answers = vec![false; train.len()];
        let rest = guessing.guess(&tree, train, &mut answers);
        let rest: Vec<Ray> = rest.iter().map(|ray| train[*ray as usize]).collect();
        let mut tree = tree;
        tree.relearn(&rest, &subject.recipe.costs);
        variants.push(("cache, order of the rest".to_owned(), tree, cache));
    }
    for (technique, tree, cache) in &variants {
        let mut row = Row::new(subject, Part::Cache, kind, technique.clone());
        let mut cache = cache.clone();
        cache.reset_counts();
        let (mut answers, mut costs) = (Vec::new(), Vec::new());
        for rays in test.chunks(BATCH) {
            let mut own = vec![false; rays.len()];
            let rest = cache.guess(tree, rays, &mut own).to_vec();
            cache.count_prims(tree);
            let left: Vec<Ray> = rest.iter().map(|ray| rays[*ray as usize]).collect();
            let (found, left_costs) = counted(tree, &left);
            let mut own_costs = vec![Cost::default(); rays.len()];
            for ((ray, occluded), cost) in rest.iter().zip(found).zip(left_costs) {
                own[*ray as usize] = occluded;
                own_costs[*ray as usize] = cost;
            }
            cache.teach(tree, rays);
            answers.extend(own);
            costs.extend(own_costs);
        }
        check_equal(&subject.scene.name, technique, &answers, &expected)?;
        row.count(&costs, &answers, prim);
        let counts = cache.counts();
        let per_ray = |count: u64| count as f64 / counts.rays.max(1) as f64;
        row.prim_tests += per_ray(counts.prim_tests);
        row.cost += prim * per_ray(counts.prim_tests);
        row.guessed_share = Some(per_ray(counts.guesses));
        row.answered_share = Some(per_ray(counts.right));
        rows.push(row);
    }
    if subject.options.rounds > 0 {
        for batch in [true, false] {
            let speeds = speeds(subject, &bvh, &variants, test, batch, &expected);
            for (row, speed) in rows.iter_mut().zip(speeds) {
                row.time(speed, batch);
            }
        }
    }
    Ok(rows)
}

fn speeds(
    subject: &Subject<'_>,
    bvh: &Bvh,
    variants: &[(String, Bvh, OccluderCache)],
    test: &[Ray],
    batch: bool,
    expected: &[bool],
) -> Vec<super::turns::Speed> {
    let mut plain = vec![false; test.len()];
    let mut works: Vec<Box<dyn FnMut() + '_>> = vec![Box::new(move || {
        if batch {
            for (rays, answers) in test.chunks(BATCH).zip(plain.chunks_mut(BATCH)) {
                bvh.batch(rays).on_this_thread().occluded(answers);
            }
        } else {
            for (ray, answer) in test.iter().zip(&mut plain) {
                *answer = bvh.occluded(ray);
            }
        }
    })];
    for (_, tree, cache) in variants {
        let mut cache = cache.clone();
        let mut answers = vec![false; test.len()];
        works.push(Box::new(move || {
            if batch {
                for (rays, answers) in test.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
                    cache.occluded_batch(tree, rays, answers);
                }
            } else {
                for (ray, answer) in test.iter().zip(&mut answers) {
                    *answer = cache.occluded(tree, ray);
                }
            }
            assert_eq!(answers, expected, "a cache changes no answer");
        }));
    }
    in_turns(subject.options.rounds, &mut works)
}
