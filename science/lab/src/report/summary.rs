//! Means over scenes: what a study comes to.

use antumbra::recipe::{Builder, Collapse, CostModel, Order};
use antumbra_trees::{LEARNED_UNSORTED, RTSAH};

use super::blocks::{Measured, words};
use crate::study::{By, Combination, Kind, Part, Plan, Row};

/// The measured combinations of all scenes.
pub struct Summary {
    /// How many scenes there are.
    scenes: usize,
    costs: CostModel,
    rows: Vec<(usize, Row)>,
    /// The trees that were compared on pictures, of all scenes.
    pictures: Vec<(usize, Row)>,
    reference: (Builder, Collapse),
    widths: Vec<antumbra::Width>,
    /// The reference of all comparisons, in words.
    pub reference_words: String,
}

/// A combination and how many times less it costs.
pub struct Best {
    pub combination: Combination,
    pub gain: f64,
}

impl Summary {
    /// Sums up the replays if there are any, otherwise the renderings.
    pub fn new(plan: &Plan, rows: &[(usize, Row)]) -> Self {
        let replayed = rows.iter().any(|(_, row)| row.by == By::Replay);
        let by = if replayed { By::Replay } else { By::Render };
        let own = rows
            .iter()
            .filter(|(_, row)| row.by == by && row.part == Part::Techniques);
        let pictures = rows.iter().filter(|(_, row)| row.by == By::Render);
        let (tree, first) = plan.base();
        let collapse = if plan.collapses.contains(&Collapse::Area) && replayed {
            Collapse::Area
        } else {
            first
        };
        let tree = if plan.trees.contains(&Builder::BinnedSah) && replayed {
            Builder::BinnedSah
        } else {
            tree
        };
        Self {
            scenes: plan.scenes.len(),
            costs: plan.costs,
            rows: own.cloned().collect(),
            pictures: pictures.cloned().collect(),
            reference: (tree, collapse),
            widths: plan.widths.clone(),
            reference_words: format!("order simple on tree {tree}, collapse {collapse}"),
        }
    }

    /// Rows of a combination in all scenes that have such rays; `None` unless all were measured.
    fn measured(&self, kind: Kind, combination: &Combination) -> Option<Vec<&Row>> {
        let of_scene = |scene| {
            let rows = (self.rows.iter()).filter(move |(place, _)| *place == scene);
            rows.map(|(_, row)| row).filter(move |row| row.rays == kind)
        };
        let scenes = (0..self.scenes).filter(|scene| of_scene(*scene).next().is_some());
        scenes
            .map(|scene| of_scene(scene).find(|row| row.is_of(combination)))
            .collect()
    }

    /// How many times as long whole pictures take on the paper's trees, unsorted, as by default: geometric mean, least
    /// and most over the scenes. `None` unless both were rendered apart in all of them.
    fn whole_pictures(&self, width: antumbra::Width) -> Option<[f64; 3]> {
        let seconds = |scene, combination: &Combination| {
            let mut rows = self.pictures.iter();
            let found = rows.find(|(place, row)| *place == scene && row.is_of(combination));
            found?.1.measured_seconds
        };
        let [paper, default] = ends(width);
        let ratios =
            (0..self.scenes).map(|scene| Some(seconds(scene, &paper)? / seconds(scene, &default)?));
        mean_and_range(&ratios.collect::<Option<Vec<_>>>()?)
    }

    /// Times fewer node tests than the reference of the same width: geometric mean of all scenes. `None` unless
    /// all that have such rays were measured.
    pub fn gain(&self, kind: Kind, combination: &Combination) -> Option<f64> {
        let reference = self.reference_of(combination);
        self.mean_ratio(kind, [&reference, combination], |row| row.node_tests_after)
    }

    /// [`Summary::gain`] in cost, primitive tests included.
    pub fn cost_gain(&self, kind: Kind, combination: &Combination) -> Option<f64> {
        let reference = self.reference_of(combination);
        self.mean_ratio(kind, [&reference, combination], |row| row.cost(&self.costs))
    }

    /// The combination of the same width that others are compared with.
    fn reference_of(&self, combination: &Combination) -> Combination {
        Combination {
            tree: self.reference.0,
            collapse: self.reference.1,
            order: Order::Simple,
            ..*combination
        }
    }

    /// A figure of one combination over the same figure of another: geometric mean, least and most of all scenes that have
    /// such rays. `None` unless all were measured.
    fn ratio(
        &self,
        kind: Kind,
        [reference, combination]: [&Combination; 2],
        figure: impl Fn(&Row) -> Option<f64>,
    ) -> Option<[f64; 3]> {
        let base = self.measured(kind, reference)?.into_iter();
        let pairs = base.zip(self.measured(kind, combination)?);
        let ratios = pairs.map(|(base, own)| Some(figure(base)? / figure(own)?));
        mean_and_range(&ratios.collect::<Option<Vec<_>>>()?)
    }

    /// The mean of [`Summary::ratio`].
    fn mean_ratio(
        &self,
        kind: Kind,
        pair: [&Combination; 2],
        figure: impl Fn(&Row) -> Option<f64>,
    ) -> Option<f64> {
        self.ratio(kind, pair, figure).map(|[mean, ..]| mean)
    }

    /// All measured combinations that learn by the plan's cost of a primitive test.
    fn combinations(&self) -> Vec<Combination> {
        let mut seen: Vec<Combination> = Vec::new();
        for (_, row) in &self.rows {
            let parsed = || {
                let mut widths = self.widths.iter();
                let width = *widths.find(|width| width.lanes() == row.width)?;
                let tree = antumbra_trees::builder(&row.tree).ok()?;
                let collapse = antumbra_trees::collapse(&row.collapse).ok()?;
                let order = antumbra_trees::order(&row.order).ok()?;
                Some(Combination::new(width, (tree, collapse), order))
            };
            if let Some(found) = parsed().filter(|found| !seen.contains(found)) {
                seen.push(found);
            }
        }
        seen
    }

    /// The combination of least cost for a kind of rays, over all widths.
    pub fn best(&self, kind: Kind) -> Option<Best> {
        let with_gain = |combination| {
            let gain = self.cost_gain(kind, &combination)?;
            Some(Best { combination, gain })
        };
        let all = self.combinations().into_iter().filter_map(with_gain);
        all.reduce(|a, b| if b.gain > a.gain { b } else { a })
    }

    /// Measured rate of a combination relative to the reference of its kind of rows, with least and most of the rounds:
    /// geometric means of the scenes. The speed of replays, or else one over the composed times of pictures. `None`
    /// unless there are several rounds in all scenes that have such rays.
    fn rate(&self, kind: Kind, combination: &Combination) -> Option<Measured> {
        let rates = |row: &Row| {
            let composed = || {
                let [least, most] = row.render_seconds_range?;
                let several = row.timed_renderings > 1;
                several.then_some([1.0 / row.render_seconds?, 1.0 / most, 1.0 / least])
            };
            let replayed = || {
                let [least, most] = row.speed_range?;
                Some([row.speed?, least, most])
            };
            replayed().or_else(composed)
        };
        let rows = self.measured(kind, combination)?;
        let all: Vec<_> = rows.into_iter().map(rates).collect::<Option<_>>()?;
        let [value, least, most] =
            [0, 1, 2].map(|place| geometric_mean(all.iter().map(|rates| rates[place])));
        let range = [least?, most?];
        value.map(|value| Measured { value, range })
    }

    /// Figures for the top of the page: what a user gets, and the cheapest of all that was measured. Each has a label, a
    /// figure, what the figure counts, and which tree it is of.
    pub fn headline(&self) -> Vec<[String; 4]> {
        let mut lines = Vec::new();
        for kind in Kind::ALL {
            let words = words(kind);
            for &width in &self.widths {
                let [paper, default] = ends(width);
                let rates = self.ratio(kind, [&default, &paper], |row| row.mrays_per_s);
                if let Some([faster, low, high]) = rates {
                    lines.push([
                        format!("{words}, default against the trees of the paper, unsorted"),
                        format!("{faster:.2}×"),
                        format!("rate in batches{}", self.by_scene([low, high])),
                        named(&default),
                    ]);
                }
            }
            if let Some(Best { combination, gain }) = self.best(kind) {
                lines.push([
                    format!("{words}, least cost"),
                    format!("{gain:.2}×"),
                    format!("less cost than {}", self.reference_words),
                    named(&combination),
                ]);
            }
        }
        for &width in &self.widths {
            if let Some([faster, low, high]) = self.whole_pictures(width) {
                let [_, default] = ends(width);
                lines.push([
                    "whole pictures, default against the trees of the paper, unsorted".to_owned(),
                    format!("{faster:.2}×"),
                    format!("measured time, median{}", self.by_scene([low, high])),
                    named(&default),
                ]);
            }
        }
        lines
    }

    /// The range of the scenes in words, if there are several.
    fn by_scene(&self, [low, high]: [f64; 2]) -> String {
        match self.scenes {
            0 | 1 => String::new(),
            _ => format!("; by scene {low:.2} to {high:.2}"),
        }
    }

    /// Factors of builder, collapse and order between the trees of the paper and the default, one changed at a time:
    /// name, and times fewer node tests, less cost and higher rate. Empty unless all of them were measured.
    pub fn ablation(&self, kind: Kind, width: antumbra::Width) -> Vec<(String, [Option<f64>; 3])> {
        let [paper, default] = ends(width);
        let built = Combination {
            tree: default.tree,
            ..paper
        };
        let unsorted = Combination {
            collapse: LEARNED_UNSORTED,
            ..built
        };
        let collapsed = Combination {
            collapse: default.collapse,
            ..built
        };
        let steps = [
            (format!("builder {}", default.tree), paper, built),
            ("learned collapse, nodes alone".to_owned(), built, unsorted),
            (
                "learned collapse, its order of children".to_owned(),
                unsorted,
                collapsed,
            ),
            (format!("order {}", default.order), collapsed, default),
            ("all".to_owned(), paper, default),
        ];
        let line = |(name, from, to): (String, Combination, Combination)| {
            let nodes = self.mean_ratio(kind, [&from, &to], |row| row.node_tests_after);
            let cost = self.mean_ratio(kind, [&from, &to], |row| row.cost(&self.costs));
            let rate = self.mean_ratio(kind, [&to, &from], |row| row.mrays_per_s);
            (name, [nodes, cost, rate])
        };
        let lines: Vec<_> = steps.into_iter().map(line).collect();
        let whole = lines.iter().all(|(_, figures)| figures[0].is_some());
        if whole { lines } else { Vec::new() }
    }

    /// Advice to a reader: by measured rate where rates were measured in several rounds, by cost otherwise, and which of
    /// both.
    pub fn advice(&self) -> Option<String> {
        let kind = Kind::ALL
            .into_iter()
            .find(|kind| self.best(*kind).is_some())?;
        let advice = self.by_rate(kind).or_else(|| self.by_cost(kind))?;
        let sentences = [Some(advice), self.over_free_orders()];
        Some(
            sentences
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(" "),
        )
    }

    /// The advice by measured rate. The default is recommended unless something beats it beyond the spread of both.
    fn by_rate(&self, kind: Kind) -> Option<String> {
        let with_rate = |c: Combination| Some((c, self.rate(kind, &c)?));
        let all: Vec<_> = self
            .combinations()
            .into_iter()
            .filter_map(with_rate)
            .collect();
        let (best, rate) =
            (all.iter().copied()).reduce(|a, b| if b.1.value > a.1.value { b } else { a })?;
        if all.len() < 2 {
            return None;
        }
        let [_, default] = ends(best.width);
        let own = all.iter().find(|(combination, _)| *combination == default);
        let what = match self.rows.iter().any(|(_, row)| row.by == By::Replay) {
            true => format!("rate of {}", words(kind)),
            false => "time of whole pictures, composed".to_owned(),
        };
        let ratio = |of: &Measured| rate.value / of.value;
        let tied = |of: &Measured| !rate.beats(of, true);
        Some(match own {
            Some((_, own)) if tied(own) => format!(
                "Use the default: by measured {what}, nothing here is faster beyond the spread of the rounds."
            ),
            Some((_, own)) => format!(
                "Use {}: by measured {what} it is {:.2} times as fast as the default, which is beyond the spread of the rounds.",
                named(&best),
                ratio(own)
            ),
            // Of equals, the first of those that learn nothing.
            None => {
                let equals = || all.iter().filter(|(_, rate)| tied(rate));
                let plain = equals().find(|(c, _)| !c.order.learns() && !c.collapse.needs_log());
                let count = equals().count();
                let chosen = plain.map_or(best, |(combination, _)| *combination);
                match count {
                    1 => format!(
                        "Use {}: the fastest of {} by measured {what}, beyond the spread of the rounds.",
                        named(&chosen),
                        all.len()
                    ),
                    _ => format!(
                        "Use {}: by measured {what}, {count} of {} are equally fast within the spread of the rounds, and this is one of the simplest.",
                        named(&chosen),
                        all.len()
                    ),
                }
            }
        })
    }

    /// The advice by cost.
    fn by_cost(&self, kind: Kind) -> Option<String> {
        let Best { combination, gain } = self.best(kind)?;
        let [_, default] = ends(combination.width);
        let own = self.cost_gain(kind, &default);
        let words = words(kind);
        let unmeasured = "No rates were measured in several rounds.";
        Some(match own {
            Some(own) if gain < 1.01 * own => {
                format!(
                    "By cost, use the default: nothing counted here costs {words} less. {unmeasured}"
                )
            }
            Some(own) if gain < 1.03 * own => format!(
                "By cost, use the default: the best of all counted here costs {words} {:.0} % less. {unmeasured}",
                100.0 * (1.0 - own / gain)
            ),
            _ if combination.order.picks_by_ray() => format!(
                "By cost, {} is the least for {words}, but it decides for each ray, which costs time that is not counted. {unmeasured}",
                named(&combination)
            ),
            _ => format!(
                "By cost, use {}: nothing counted here costs {words} less. {unmeasured}",
                named(&combination)
            ),
        })
    }

    /// Gain of learning an order over the best static order that needs no rays, on trees that learned nothing: in cost,
    /// as geometric mean of the scenes. `None` unless both were measured.
    pub fn over_free_orders(&self) -> Option<String> {
        let kind = Kind::ALL
            .into_iter()
            .find(|kind| self.best(*kind).is_some())?;
        let base = |c: &Combination| {
            (c.tree, c.collapse) == self.reference
                && !c.tree.needs_rays()
                && !c.collapse.needs_log()
        };
        let least = |wanted: fn(Order) -> bool| {
            let all = self.combinations().into_iter();
            let own = all.filter(|c| base(c) && wanted(c.order) && !c.order.picks_by_ray());
            let with_gain = own.filter_map(|c| Some((c.order, self.cost_gain(kind, &c)?)));
            with_gain.reduce(|a, b| if b.1 > a.1 { b } else { a })
        };
        let (free, of_free) = least(|order| FREE_ORDERS.contains(&order))?;
        let (learned, of_learned) = least(Order::learns)?;
        Some(format!(
            "Of the orders without rays, {free} costs {} least; learning ({learned}) costs {:.2} times less than that.",
            words(kind),
            of_learned / of_free
        ))
    }
}

/// Static orders that need no rays, and are more than an arbitrary beginning.
const FREE_ORDERS: [Order; 3] = [Order::Embree, Order::Sato, RTSAH];

/// A combination in words.
fn named(combination: &Combination) -> String {
    let Combination { width, tree, .. } = combination;
    let (collapse, order) = (combination.collapse, combination.order);
    format!("order {order} on builder {tree}, collapse {collapse}, {width} wide")
}

/// The trees of the paper, unsorted, and the default.
fn ends(width: antumbra::Width) -> [Combination; 2] {
    [
        Combination::of_the_paper(width),
        Combination::default_of(width),
    ]
}

/// Geometric mean, least and most of ratios; `None` of none, and if they have no finite mean.
fn mean_and_range(ratios: &[f64]) -> Option<[f64; 3]> {
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios.iter().copied().fold(0.0, f64::max);
    geometric_mean(ratios.iter().copied()).map(|mean| [mean, least, most])
}

fn geometric_mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.map(f64::ln).sum::<f64>() / count;
    mean.is_finite().then(|| mean.exp())
}

/// Means of both values, and sums of the products of their distances from the means: of x and y, of x, and of y.
fn moments(points: &[(f64, f64)]) -> ([f64; 2], [f64; 3]) {
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let mut sums = [0.0; 3];
    for point in points {
        let (dx, dy) = (point.0 - x, point.1 - y);
        sums[0] += dx * dy;
        sums[1] += dx * dx;
        sums[2] += dy * dy;
    }
    ([x, y], sums)
}

/// Offset and slope of the line of least squares; `None` if there is no such line.
pub fn line(points: &[(f64, f64)]) -> Option<[f64; 2]> {
    let ([x, y], [across, along, _]) = moments(points);
    let slope = across / along;
    slope.is_finite().then_some([y - slope * x, slope])
}

/// Pearson's correlation coefficient; `None` of fewer than three points, or if either value is always the same.
pub fn correlation(points: &[(f64, f64)]) -> Option<f64> {
    let (_, [both, x, y]) = moments(points);
    let spread = (x * y).sqrt();
    (points.len() > 2 && spread > 0.0 && spread.is_finite()).then(|| both / spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study;
    use antumbra::Width;
    use antumbra_scene::builtin;

    const WIDTH: Width = Width::W8;

    fn plan(scenes: usize) -> Plan {
        let mut city = builtin::by_name("city:1000").expect("a scene");
        city.film.resolution = [8, 8];
        let scenes = study::subjects(vec![city; scenes], None).expect("no camera to refuse");
        Plan {
            scenes,
            orders: vec![Order::Simple, Order::default()],
            widths: vec![WIDTH],
            trees: vec![Builder::default(), Builder::BinnedSah],
            collapses: vec![Collapse::default(), Collapse::Area],
            spp: Some(1),
            ..Plan::default()
        }
    }

    /// Rows of a study, with other measured times: of the paper's trees, then of the default.
    fn timed(plan: &Plan, seconds: &[[f64; 2]]) -> Vec<(usize, Row)> {
        let results = study::run(plan, &()).expect("rows");
        let mut rows = results.placed;
        for (scene, row) in &mut rows {
            for (end, seconds) in ends(WIDTH).iter().zip(seconds[*scene]) {
                if row.is_of(end) {
                    row.measured_seconds = Some(seconds);
                }
            }
            // Composed times are another thing.
            row.render_seconds = Some(1.0);
        }
        rows
    }

    /// The card of whole pictures: geometric mean, and the range if there are several scenes.
    #[test]
    fn the_gain_in_whole_pictures_is_that_of_measured_times() {
        let card = |summary: &Summary| {
            let cards = summary.headline().into_iter();
            let mut cards = cards.filter(|[label, ..]| label.starts_with("whole pictures"));
            let card = cards.next();
            assert!(cards.next().is_none(), "one card for one width");
            card
        };
        let two = plan(2);
        let mut rows = timed(&two, &[[6.0, 4.0], [8.0, 3.0]]);
        let [_, gain, what, which] = card(&Summary::new(&two, &rows)).expect("a card");
        // The root of 6/4 * 8/3.
        assert_eq!(gain, "2.00×");
        assert_eq!(what, "measured time, median; by scene 1.50 to 2.67");
        assert_eq!(which, named(&Combination::default_of(WIDTH)));
        // A slower default is told as such, and there is no range of one scene.
        let one = plan(1);
        let [_, gain, what, _] =
            card(&Summary::new(&one, &timed(&one, &[[2.0, 2.5]]))).expect("a card");
        assert_eq!((&*gain, &*what), ("0.80×", "measured time, median"));
        // No mean of fewer scenes than there are.
        let default = Combination::default_of(WIDTH);
        let last = rows.iter_mut().rfind(|(_, row)| row.is_of(&default));
        last.expect("a row").1.measured_seconds = None;
        assert_eq!(card(&Summary::new(&two, &rows)), None);
    }

    /// Rows of replays: cost of node tests only, and speeds with their range.
    fn replayed(plan: &Plan, figures: &[(Combination, f64, [f64; 3])]) -> Vec<(usize, Row)> {
        let first = study::run(plan, &()).expect("rows").placed.remove(0).1;
        let row = |(combination, nodes, [speed, least, most]): &(Combination, f64, [f64; 3])| Row {
            by: By::Replay,
            tree: combination.tree.to_string(),
            collapse: combination.collapse.to_string(),
            order: combination.order.to_string(),
            node_tests_after: Some(*nodes),
            prim_tests_after: Some(0.0),
            speed: Some(*speed),
            speed_range: Some([*least, *most]),
            ..first.clone()
        };
        figures.iter().map(|figures| (0, row(figures))).collect()
    }

    /// The cheapest combination may be the slowest one: an order that decides for each ray. By cost it would be
    /// recommended.
    #[test]
    fn advice_is_by_rate_and_not_by_cost() {
        let plan = plan(1);
        let [paper, default] = ends(WIDTH);
        let by_ray = Combination {
            order: antumbra_trees::FTOB,
            ..default
        };
        let mut figures = vec![
            (paper, 9.0, [0.9, 0.88, 0.93]),
            (default, 6.0, [1.04, 1.0, 1.08]),
            (by_ray, 4.0, [0.45, 0.44, 0.47]),
        ];
        let advice = |figures: &[_]| {
            let rows = replayed(&plan, figures);
            Summary::new(&plan, &rows).advice().expect("advice")
        };
        let found = advice(&figures);
        assert!(
            found.starts_with("Use the default: by measured rate of shadow rays"),
            "{found}"
        );
        // A faster median within the spread is no reason to leave the default; beyond it is.
        let embree = Combination {
            order: Order::Embree,
            ..paper
        };
        figures.push((embree, 7.0, [1.07, 1.03, 1.1]));
        let found = advice(&figures);
        assert!(found.starts_with("Use the default"), "{found}");
        figures[3].2 = [1.3, 1.2, 1.4];
        let found = advice(&figures);
        let wanted = format!(
            "Use {}: by measured rate of shadow rays it is 1.25 times",
            named(&embree)
        );
        assert!(found.starts_with(&wanted), "{found}");
        // Without the default, an order that learns nothing is preferred among equals.
        figures.remove(1);
        figures[2].2 = [0.92, 0.9, 0.95];
        let found = advice(&figures);
        let wanted = format!(
            "Use {}: by measured rate of shadow rays, 2 of 3 are equally",
            named(&paper)
        );
        assert!(found.starts_with(&wanted), "{found}");
        // Rows without rounds: by cost, and it says so.
        let mut rows = replayed(&plan, &figures);
        for (_, row) in &mut rows {
            (row.speed, row.speed_range) = (None, None);
        }
        let found = Summary::new(&plan, &rows).advice().expect("advice");
        assert!(
            found.starts_with("By cost, ") && found.contains("decides for each ray"),
            "{found}"
        );
        assert!(found.contains("No rates were measured"), "{found}");
    }

    /// The gain of learning is relative to the best of the free orders, not to the arbitrary one.
    #[test]
    fn learning_is_compared_with_the_best_order_without_rays() {
        let plan = plan(1);
        let [paper, _] = ends(WIDTH);
        let of = |order| Combination { order, ..paper };
        let still = [1.0, 1.0, 1.0];
        let rows = replayed(
            &plan,
            &[
                (of(Order::Simple), 12.0, still),
                (of(Order::Embree), 9.0, still),
                (of(Order::Sato), 10.0, still),
                (of(Order::Joint), 7.5, still),
            ],
        );
        let found = Summary::new(&plan, &rows).over_free_orders().expect("both");
        assert!(found.contains("embree costs shadow rays least"), "{found}");
        assert!(found.contains("(joint) costs 1.20 times less"), "{found}");
        assert_eq!(Summary::new(&plan, &rows[2..3]).over_free_orders(), None);
    }

    #[test]
    fn correlations_by_hand() {
        let line = [(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)];
        assert!((correlation(&line).expect("three points") - 1.0).abs() < 1e-12);
        let [offset, slope] = super::line(&line).expect("a line");
        assert!((offset - 1.0).abs() < 1e-12 && (slope - 2.0).abs() < 1e-12);
        assert_eq!(super::line(&[(1.0, 2.0); 5]), None);
        let falling = line.map(|(x, y)| (x, -y));
        assert!((correlation(&falling).expect("three points") + 1.0).abs() < 1e-12);
        // (0, 0), (1, 1), (2, 0): no trend.
        let bend = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)];
        assert!(correlation(&bend).expect("three points").abs() < 1e-12);
        assert_eq!(correlation(&line[..2]), None);
        assert_eq!(correlation(&[(1.0, 2.0); 5]), None);
    }
}
