//! The JSON document of a benchmark, schema `antumbra.bench/1`.

use serde::Serialize;

use super::engine::{Label, Query, TreeLabel};
use super::model::Size;
use crate::machine::Machine;

/// The kinds of rays, in the order of tables.
pub const KINDS: [&str; 3] = ["primary", "shadow", "diffuse"];

/// One engine, one query, one kind of rays of one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// Size of the scene.
    #[serde(flatten)]
    pub size: Size,
    /// Kind of rays: `primary`, `shadow` or `diffuse`.
    pub rays: &'static str,
    /// Number of rays.
    pub ray_count: usize,
    /// `occluded` or `intersect`.
    pub query: &'static str,
    /// `antumbra`, or one of Embree's variants.
    pub engine: &'static str,
    /// `single` rays or `batch`.
    pub api: &'static str,
    /// Instruction set, of Embree too.
    pub level: String,
    /// Children per node; `null` for Embree, which chooses its own.
    pub width: Option<usize>,
    /// Child order; `null` for Embree.
    pub order: Option<&'static str>,
    /// Builder of the binary tree; `null` for Embree.
    pub builder: Option<&'static str>,
    /// Collapse; `null` for Embree.
    pub collapse: Option<&'static str>,
    /// Whether batches prefetch nodes and leaves; `null` for Embree, and where scenes differ.
    pub prefetch: Option<bool>,
    /// Number of threads.
    pub threads: usize,
    /// Millions of rays per second, by the median of the rounds.
    pub mrays_per_s: f64,
    /// Median over the rounds of the speed relative to Embree's single-ray call on the same rays, level and
    /// threads; `null` without Embree.
    pub ratio_to_embree: Option<f64>,
    /// Rays answered otherwise than by the watertight reference.
    pub disagreements: usize,
    /// Share of the rays that hit something.
    pub occluded: f64,
    /// Mean node tests per ray, of our occlusion queries.
    pub node_tests: Option<f64>,
    /// Mean primitive tests per ray, of our occlusion queries.
    pub prim_tests: Option<f64>,
}

/// One engine and one thing beside plain triangles, on one thread.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct KindRow {
    /// Name of the scene.
    pub scene: String,
    /// Triangles, as which the scene came.
    pub triangles: usize,
    /// `triangles` as they came; `quads`; `user` geometry; conditions on hits (`closed`, `mask`, `except`, `filter`,
    /// `visit`); `refit`, and rays with which `refitted` trees are queried; `points`.
    pub kind: &'static str,
    /// `occluded` of shadow rays, `intersect` of diffuse rays, `update` of vertices, `closest` to points.
    pub query: &'static str,
    /// `antumbra` or `embree`.
    pub engine: &'static str,
    /// `single` or `batch`.
    pub api: &'static str,
    /// Instruction set, of Embree too.
    pub level: String,
    /// Number of rays or points, or of triangles that were refitted.
    pub count: usize,
    /// Millions of these per second, by the median of the rounds.
    pub millions_per_s: f64,
    /// Median over the rounds of the speed relative to Embree's single calls; `null` where Embree has no such thing.
    pub ratio_to_embree: Option<f64>,
    /// Median over the rounds of the speed relative to plain triangles of the same engine; `null` where nothing compares.
    pub ratio_to_triangles: Option<f64>,
    /// Answers that differ from our first engine, which is compared with brute force.
    pub disagreements: usize,
}

/// Build time and size of one structure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BuildRow {
    /// Name of the scene.
    pub scene: String,
    /// Size of the scene.
    #[serde(flatten)]
    pub size: Size,
    /// `antumbra` or `embree`.
    pub engine: &'static str,
    /// Builder of the binary tree, or Embree's build quality.
    pub builder: &'static str,
    /// Collapse; `null` for Embree.
    pub collapse: Option<&'static str>,
    /// Instruction set.
    pub level: String,
    /// Children per node; `null` for Embree.
    pub width: Option<usize>,
    /// Number of threads.
    pub threads: usize,
    /// Median wall time. Ours: from slices of vertices and indices to a tree that can be queried. Embree:
    /// only `rtcCommitScene`, of all objects and of the scene, buffers being filled.
    pub seconds: f64,
    /// The fastest time.
    pub best_seconds: f64,
    /// Median times of the steps of ours; `null` for Embree.
    pub step_seconds: Option<StepSeconds>,
    /// Bytes of the finished structure. Ours: nodes, leaf blocks and instances, which hold all that queries need.
    /// Embree: what it reports to have allocated and not freed, but for the buffers.
    pub bytes: usize,
    /// Bytes of the vertex and index buffers that must be kept beside it.
    pub buffer_bytes: usize,
}

/// Seconds of the steps of a build.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepSeconds {
    /// Checking and copying the geometry.
    pub primitives: f64,
    /// Building the binary tree.
    pub tree: f64,
    /// Tracing and logging training rays.
    pub log: f64,
    /// Collapsing the binary tree to the wide one.
    pub collapse: f64,
    /// Learning the child order: a log of the wide tree, the plan, and applying it.
    pub order: f64,
}

/// Comparison of the reference with brute force.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the scene.
    pub scene: String,
    /// Kind of rays.
    pub rays: &'static str,
    /// Rays compared with brute force, closest hit and occlusion.
    pub ray_count: usize,
    /// Rays answered otherwise than by brute force.
    pub disagreements: usize,
}

/// The JSON document of a benchmark, schema `antumbra.bench/1`.
#[derive(Serialize)]
#[non_exhaustive]
pub struct Document {
    /// Name and version of the format.
    pub schema: &'static str,
    /// Where and how the benchmark was made.
    #[serde(flatten)]
    pub machine: Machine,
    /// The compiler of the program.
    pub compiler: Option<String>,
    /// The commit of the program, if known when it was built.
    pub commit: Option<String>,
    /// Version of Embree; `null` without.
    pub embree: Option<String>,
    /// Seed of all random values.
    pub seed: u64,
    /// Rounds in which every engine was timed once.
    pub repeat: usize,
    /// Training rays per scene.
    pub log_rays: usize,
    /// Whether all requested rows are there; if not, the benchmark was interrupted.
    pub complete: bool,
    /// Comparisons of the reference with brute force.
    pub checks: Vec<Check>,
    /// Build times and sizes.
    pub builds: Vec<BuildRow>,
    /// Rays per second.
    pub rows: Vec<Row>,
    /// Things beside plain triangles; empty unless requested.
    pub kinds: Vec<KindRow>,
}

impl Row {
    /// The engine and its tree.
    pub(super) fn label(&self) -> Label {
        let tree = || {
            Some(TreeLabel {
                builder: self.builder?,
                collapse: self.collapse?,
                width: self.width?,
                order: self.order?,
            })
        };
        Label {
            engine: self.engine,
            api: self.api,
            tree: tree(),
        }
    }

    /// Whether two rows differ in scene and figures only.
    fn is_like(&self, other: &Self) -> bool {
        let key = |row: &Self| (row.rays, row.query, row.threads, row.label());
        key(self) == key(other) && self.level == other.level
    }
}

impl Document {
    /// Scenes with rows, in order.
    pub fn scenes(&self) -> Vec<&str> {
        distinct(self.rows.iter().map(|row| row.scene.as_str()))
    }

    /// Rows of one kind over all scenes as one: geometric means of rates and ratios, sums of counts,
    /// arithmetic means of tests. A scene without such rays has no part in it. Empty if there is only one
    /// scene.
    pub fn means(&self) -> Vec<Row> {
        let scenes = self.scenes().len();
        let mut means: Vec<Row> = Vec::new();
        if scenes < 2 {
            return means;
        }
        for first in &self.rows {
            if means.iter().any(|mean| mean.is_like(first)) {
                continue;
            }
            let alike: Vec<&Row> = self.rows.iter().filter(|row| row.is_like(first)).collect();
            let mean = |value: fn(&Row) -> Option<f64>| {
                let values: Option<Vec<f64>> = alike.iter().map(|row| value(row)).collect();
                values.map(|values| values.iter().sum::<f64>() / values.len() as f64)
            };
            let rate = mean(|row| Some(row.mrays_per_s.ln()));
            let ratio = mean(|row| row.ratio_to_embree.map(f64::ln));
            means.push(Row {
                scene: format!("geometric mean of {scenes} scenes"),
                size: alike.iter().map(|row| row.size).sum(),
                ray_count: alike.iter().map(|row| row.ray_count).sum(),
                mrays_per_s: rate.map_or(f64::NAN, f64::exp),
                ratio_to_embree: ratio.map(f64::exp),
                disagreements: alike.iter().map(|row| row.disagreements).sum(),
                occluded: mean(|row| Some(row.occluded)).unwrap_or(f64::NAN),
                node_tests: mean(|row| row.node_tests),
                prim_tests: mean(|row| row.prim_tests),
                prefetch: first
                    .prefetch
                    .filter(|_| alike.iter().all(|row| row.prefetch == first.prefetch)),
                ..first.clone()
            });
        }
        means
    }
}

/// Rows of one scene, query, level and number of threads: a table.
pub struct Group<'a> {
    pub scene: &'a str,
    pub query: Query,
    pub level: &'a str,
    pub threads: usize,
    pub rows: Vec<&'a Row>,
}

/// Cuts rows into groups, in their order.
pub fn groups(rows: &[Row]) -> Vec<Group<'_>> {
    let key = |row: &Row| (row.scene.clone(), row.level.clone(), row.threads);
    let mut all = Vec::new();
    for (scene, level, threads) in distinct(rows.iter().map(key)) {
        for query in Query::ALL {
            let found = rows.iter().filter(|row| {
                row.query == query.name() && key(row) == (scene.clone(), level.clone(), threads)
            });
            let rows: Vec<&Row> = found.collect();
            if let Some(first) = rows.first() {
                all.push(Group {
                    scene: &first.scene,
                    query,
                    level: &first.level,
                    threads,
                    rows,
                });
            }
        }
    }
    all
}

impl Group<'_> {
    /// The engines, each with its row for every kind of rays.
    pub fn lines(&self) -> Vec<[Option<&Row>; 3]> {
        let engines = distinct(self.rows.iter().map(|row| row.label()));
        let line = |label: &Label| {
            KINDS.map(|kind| {
                let mut rows = self.rows.iter();
                rows.find(|row| row.rays == kind && row.label() == *label)
                    .copied()
            })
        };
        engines.iter().map(line).collect()
    }
}

/// Every value once, in the order of its first appearance.
pub fn distinct<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut all = Vec::new();
    for value in values {
        if !all.contains(&value) {
            all.push(value);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, rays: &'static str, engine: &'static str, rate: f64) -> Row {
        let tree = (engine == "antumbra").then_some(TreeLabel {
            builder: "binned-sah",
            collapse: "area",
            width: 8,
            order: "sort+",
        });
        Row {
            scene: scene.into(),
            rays,
            query: "occluded",
            engine,
            api: "single",
            level: "avx2".into(),
            width: tree.map(|tree| tree.width),
            order: tree.map(|tree| tree.order),
            builder: tree.map(|tree| tree.builder),
            collapse: tree.map(|tree| tree.collapse),
            threads: 1,
            mrays_per_s: rate,
            ratio_to_embree: Some(rate / 2.0),
            disagreements: 1,
            ..Row::default()
        }
    }

    fn document(rows: Vec<Row>) -> Document {
        Document {
            schema: "",
            machine: Machine::new(antumbra::Isa::best(), &Default::default()),
            compiler: None,
            commit: None,
            embree: None,
            seed: 0,
            repeat: 1,
            log_rays: 0,
            complete: true,
            checks: Vec::new(),
            builds: Vec::new(),
            rows,
            kinds: Vec::new(),
        }
    }

    #[test]
    fn means_are_geometric_and_of_what_there_is() {
        let rows = vec![
            row("a", "primary", "embree", 2.0),
            row("a", "primary", "antumbra", 4.0),
            row("a", "shadow", "antumbra", 7.0),
            row("b", "primary", "embree", 2.0),
            row("b", "primary", "antumbra", 9.0),
        ];
        let means = document(rows.clone()).means();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert_eq!(means.len(), 3);
        assert!(near(means[1].mrays_per_s, 6.0));
        assert!(
            means[1]
                .ratio_to_embree
                .is_some_and(|ratio| near(ratio, 3.0))
        );
        assert_eq!(means[1].disagreements, 2);
        assert!(
            near(means[2].mrays_per_s, 7.0),
            "only one scene has shadow rays"
        );
        assert!(document(rows[..3].to_vec()).means().is_empty());
    }

    #[test]
    fn groups_have_a_line_per_engine_and_a_column_per_kind() {
        let rows = [
            row("a", "primary", "embree", 1.0),
            row("a", "shadow", "embree", 2.0),
            row("a", "diffuse", "antumbra", 3.0),
            row("b", "primary", "embree", 4.0),
        ];
        let groups = groups(&rows);
        assert_eq!(groups.len(), 2);
        let rates = |line: &[Option<&Row>; 3]| line.map(|row| row.map(|row| row.mrays_per_s));
        let lines: Vec<_> = groups[0].lines().iter().map(rates).collect();
        assert_eq!(
            lines,
            [[Some(1.0), Some(2.0), None], [None, None, Some(3.0)]]
        );
        assert_eq!(groups[1].scene, "b");
        assert_eq!(groups[1].lines().len(), 1);
    }
}
