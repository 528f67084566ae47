//! Means over scenes: what a study comes to.

use antumbra::recipe::{Builder, Collapse, CostModel, Order};

use super::blocks::words;
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

    fn row(&self, scene: usize, kind: Kind, combination: &Combination) -> Option<&Row> {
        let mut rows = self.rows.iter();
        let found = rows
            .find(|(place, row)| *place == scene && row.rays == kind && is_of(row, combination));
        found.map(|(_, row)| row)
    }

    /// How many times as long whole pictures take on the paper's trees, unsorted, as by default: geometric mean, least
    /// and most over the scenes. `None` unless both were rendered apart in all of them.
    fn whole_pictures(&self, width: antumbra::Width) -> Option<[f64; 3]> {
        let seconds = |scene, combination: &Combination| {
            let mut rows = self.pictures.iter();
            let found = rows.find(|(place, row)| *place == scene && is_of(row, combination));
            found?.1.measured_seconds
        };
        let [paper, default] = ends(width);
        let ratios: Option<Vec<f64>> = (0..self.scenes)
            .map(|scene| Some(seconds(scene, &paper)? / seconds(scene, &default)?))
            .collect();
        let ratios = ratios.filter(|ratios| !ratios.is_empty())?;
        let mean = ratios.iter().map(|x| x.ln()).sum::<f64>() / ratios.len() as f64;
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let most = ratios.iter().copied().fold(0.0, f64::max);
        Some([mean.exp(), least, most])
    }

    /// Times fewer node tests than the reference of the same width: geometric mean of all scenes. `None` unless
    /// all that have such rays were measured.
    pub fn gain(&self, kind: Kind, combination: &Combination) -> Option<f64> {
        let reference = self.reference_of(combination);
        self.ratio(kind, &reference, combination, |row| row.node_tests_after)
    }

    /// [`Summary::gain`] in cost, primitive tests included.
    pub fn cost_gain(&self, kind: Kind, combination: &Combination) -> Option<f64> {
        let reference = self.reference_of(combination);
        self.ratio(kind, &reference, combination, |row| row.cost(&self.costs))
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

    /// A figure of one combination over that of another: geometric mean of all scenes that have such rays. `None`
    /// unless all were measured.
    pub fn ratio(
        &self,
        kind: Kind,
        reference: &Combination,
        combination: &Combination,
        figure: impl Fn(&Row) -> Option<f64>,
    ) -> Option<f64> {
        let mut logs = Vec::new();
        for scene in 0..self.scenes {
            let mut rows = self.rows.iter();
            if rows.any(|(place, row)| *place == scene && row.rays == kind) {
                let simple = figure(self.row(scene, kind, reference)?)?;
                let own = figure(self.row(scene, kind, combination)?)?;
                logs.push((simple / own).ln());
            }
        }
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        (!logs.is_empty() && mean.is_finite()).then(|| mean.exp())
    }

    /// The combination of least cost for a kind of rays, over all widths.
    pub fn best(&self, kind: Kind) -> Option<Best> {
        let mut seen: Vec<Combination> = Vec::new();
        let mut best: Option<Best> = None;
        for (_, row) in &self.rows {
            let parsed = || {
                let mut widths = self.widths.iter();
                Some(Combination {
                    width: *widths.find(|width| width.lanes() == row.width)?,
                    tree: row.tree.parse().ok()?,
                    collapse: row.collapse.parse().ok()?,
                    order: row.order.parse().ok()?,
                })
            };
            let Some(combination) = parsed().filter(|c| !seen.contains(c)) else {
                continue;
            };
            seen.push(combination);
            if let Some(gain) = self.cost_gain(kind, &combination)
                && best.as_ref().is_none_or(|best| gain > best.gain)
            {
                best = Some(Best { combination, gain });
            }
        }
        best
    }

    /// Figures for the top of the page: what a user gets, and the cheapest of all that was measured. Each has a label, a
    /// figure, what the figure counts, and which tree it is of.
    pub fn headline(&self) -> Vec<[String; 4]> {
        let mut lines = Vec::new();
        for kind in Kind::ALL {
            let words = words(kind);
            for &width in &self.widths {
                let [paper, default] = ends(width);
                let faster = self.ratio(kind, &default, &paper, |row| row.mrays_per_s);
                let times = self.range(kind, &default, &paper, |row| row.mrays_per_s);
                if let (Some(faster), Some([low, high])) = (faster, times) {
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

    /// Least and largest of what [`Summary::ratio`] is the mean of.
    fn range(
        &self,
        kind: Kind,
        reference: &Combination,
        combination: &Combination,
        figure: impl Fn(&Row) -> Option<f64>,
    ) -> Option<[f64; 2]> {
        let of = |scene| {
            let base = figure(self.row(scene, kind, reference)?)?;
            Some(base / figure(self.row(scene, kind, combination)?)?)
        };
        let found: Vec<f64> = (0..self.scenes).filter_map(of).collect();
        let least = found.iter().copied().reduce(f64::min);
        let most = found.iter().copied().reduce(f64::max);
        least.zip(most).map(|(least, most)| [least, most])
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
            collapse: Collapse::LearnedUnsorted,
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
            let nodes = self.ratio(kind, &from, &to, |row| row.node_tests_after);
            let cost = self.ratio(kind, &from, &to, |row| row.cost(&self.costs));
            let rate = self.ratio(kind, &to, &from, |row| row.mrays_per_s);
            (name, [nodes, cost, rate])
        };
        let lines: Vec<_> = steps.into_iter().map(line).collect();
        let whole = lines.iter().all(|(_, figures)| figures[0].is_some());
        if whole { lines } else { Vec::new() }
    }

    /// What a reader should use, in one sentence.
    pub fn advice(&self) -> Option<String> {
        let Best { combination, gain } = self.best(Kind::Shadow).or_else(|| self.best(Kind::Ao))?;
        let [_, default] = ends(combination.width);
        let own = self.cost_gain(Kind::Shadow, &default);
        Some(match own {
            Some(own) if gain < 1.01 * own => {
                "Use the default: nothing measured here costs shadow rays less.".to_owned()
            }
            Some(own) if gain < 1.03 * own => format!(
                "Use the default: the best of all measured here costs shadow rays {:.0} % less.",
                100.0 * (1.0 - own / gain)
            ),
            _ => format!(
                "Use order {} on builder {} with collapse {}: no combination measured here costs shadow rays less.",
                combination.order, combination.tree, combination.collapse
            ),
        })
    }
}

/// A combination in words.
fn named(combination: &Combination) -> String {
    let Combination {
        width,
        tree,
        collapse,
        order,
    } = combination;
    format!("{order} on {tree}, collapse {collapse}, {width} wide")
}

/// Whether a row is of a combination.
fn is_of(row: &Row, combination: &Combination) -> bool {
    let Combination {
        width,
        tree,
        collapse,
        order,
    } = combination;
    row.width == width.lanes()
        && row.is_on(tree.name(), collapse.name())
        && row.order == order.name()
}

/// The trees of the paper, unsorted, and the default.
fn ends(width: antumbra::Width) -> [Combination; 2] {
    [
        Combination::of_the_paper(width),
        Combination::default_of(width),
    ]
}

/// Offset and slope of the line of least squares; `None` if there is no such line.
pub fn line(points: &[(f64, f64)]) -> Option<[f64; 2]> {
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let across: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let along: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    let slope = across / along;
    slope.is_finite().then_some([y - slope * x, slope])
}

/// Pearson's correlation coefficient; `None` of fewer than three points, or if either value is always the same.
pub fn correlation(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 3 {
        return None;
    }
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
    let spread = (sums[1] * sums[2]).sqrt();
    (spread > 0.0 && spread.is_finite()).then(|| sums[0] / spread)
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
                if is_of(row, end) {
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
        let last = rows.iter_mut().rfind(|(_, row)| is_of(row, &default));
        last.expect("a row").1.measured_seconds = None;
        assert_eq!(card(&Summary::new(&two, &rows)), None);
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
