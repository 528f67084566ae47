//! Means over scenes: what a study comes to.

use antumbra::{Builder, Collapse, Order};

use crate::study::{By, Combination, Kind, Part, Plan, Row};

/// The measured combinations of all scenes.
pub struct Summary {
    /// How many scenes there are.
    scenes: usize,
    rows: Vec<(usize, Row)>,
    reference: (Builder, Collapse),
    widths: Vec<antumbra::Width>,
    /// The reference of all comparisons, in words.
    pub reference_words: String,
}

/// A combination and how many times fewer node tests it has.
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
        let (tree, first) = plan.base();
        let collapse = if plan.collapses.contains(&Collapse::Area) && replayed {
            Collapse::Area
        } else {
            first
        };
        let tree = if plan.trees.contains(&Builder::default()) && replayed {
            Builder::default()
        } else {
            tree
        };
        Self {
            scenes: plan.scenes.len(),
            rows: own.cloned().collect(),
            reference: (tree, collapse),
            widths: plan.widths.clone(),
            reference_words: format!("order simple on tree {tree}, collapse {collapse}"),
        }
    }

    fn tests(&self, scene: usize, kind: Kind, combination: &Combination) -> Option<f64> {
        let Combination {
            width,
            tree,
            collapse,
            order,
        } = combination;
        let mut rows = self.rows.iter();
        let found = rows.find(|(place, row)| {
            *place == scene
                && row.rays == kind
                && row.width == width.lanes()
                && row.is_on(tree.name(), collapse.name())
                && row.order == order.name()
        });
        found.and_then(|(_, row)| row.node_tests_after)
    }

    /// Times fewer node tests than the reference of the same width: geometric mean of all scenes. `None` unless
    /// all that have such rays were measured.
    pub fn gain(&self, kind: Kind, combination: &Combination) -> Option<f64> {
        let reference = Combination {
            tree: self.reference.0,
            collapse: self.reference.1,
            order: Order::Simple,
            ..*combination
        };
        let mut logs = Vec::new();
        for scene in 0..self.scenes {
            let mut rows = self.rows.iter();
            if rows.any(|(place, row)| *place == scene && row.rays == kind) {
                let simple = self.tests(scene, kind, &reference)?;
                let own = self.tests(scene, kind, combination)?;
                logs.push((simple / own).ln());
            }
        }
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        (!logs.is_empty() && mean.is_finite()).then(|| mean.exp())
    }

    /// The best combination for a kind of rays, over all widths.
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
            if let Some(gain) = self.gain(kind, &combination)
                && best.as_ref().is_none_or(|best| gain > best.gain)
            {
                best = Some(Best { combination, gain });
            }
        }
        best
    }

    /// The best combinations in words, for the top of the page.
    pub fn headline(&self) -> Vec<[String; 3]> {
        let line = |kind: Kind| {
            let Best { combination, gain } = self.best(kind)?;
            let rays = match kind {
                Kind::Shadow => "shadow rays",
                Kind::Ao => "ambient occlusion",
            };
            let Combination {
                width,
                tree,
                collapse,
                order,
            } = combination;
            Some([
                rays.to_owned(),
                format!("{gain:.2}×"),
                format!("{order} on {tree}, collapse {collapse}, {width} wide"),
            ])
        };
        Kind::ALL.into_iter().filter_map(line).collect()
    }
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
