//! Trees learned from logs: the same answers as ever, lower costs, and no harm to rays of another kind
//! when the log is mixed.

use crate::support::{BUILDERS, BY_RAY, collapses, geometry, kernel_rays, ways};
use antumbra::parts::{BinaryTree, Cost, Learning, Steps, TreeLog, surface_rays};
use antumbra::recipe::{Builder, Collapse, CostModel, Engine, Order};
use antumbra::shapes::Sphere;
use antumbra::{Brute, Bvh, Geometry, Primitives, Ray, Recipe, Width};
use antumbra_testkit::sample::triples;
use antumbra_testkit::{Mesh, Rng, mesh, rays};

fn log(primitives: &Primitives, tree: &BinaryTree, kinds: &[&[Ray]]) -> TreeLog {
    let mut log = TreeLog::new(tree);
    for rays in kinds {
        log.add(primitives, tree, rays, 1000.0);
    }
    log
}

/// What occlusion queries for the rays cost in a tree, by the default model.
fn cost(bvh: &Bvh, rays: &[Ray]) -> f64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    let CostModel { node, prim, .. } = CostModel::default();
    costs
        .iter()
        .map(|cost| {
            f64::from(node) * f64::from(cost.node_tests)
                + f64::from(prim) * f64::from(cost.prim_tests)
        })
        .sum()
}

/// Every answer of every learned tree equals brute force, on every kind of geometry; all orders still
/// apply to them.
#[test]
fn learned_trees_equal_brute_force() {
    let seed = 61;
    let mut rng = Rng::new(seed);
    for generate in mesh::ALL {
        let mesh = generate(&mut rng, 300);
        let spheres = [0.2, 0.05].map(|radius| Sphere {
            center: rng.point(1.0),
            radius,
        });
        let geometries = [geometry(&mesh), Geometry::spheres(&spheres[..])];
        let primitives = Primitives::new(&geometries).expect("indices in range");
        let rays = kernel_rays(&rays::around(&mut rng, &mesh, 400));
        let brute = Brute::new(&primitives);
        let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
        let hits: Vec<_> = rays.iter().map(|ray| brute.intersect(ray)).collect();
        let expected = (occluded, hits);
        let trees = triples(rng.bits(), &BUILDERS, &collapses(), &ways());
        for (builder, (collapse, sort), engine) in trees {
            let tree = BinaryTree::build(&primitives, builder);
            let log = log(&primitives, &tree, &[&rays[..200]]);
            let learning = Learning {
                collapse,
                sort,
                ..Default::default()
            };
            let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, engine);
            let place = format!(
                "seed {seed} {} {builder} {collapse} sorted {sort} {engine:?}",
                mesh.name,
            );
            bvh.validate()
                .unwrap_or_else(|broken| panic!("{place}: {broken}"));
            let mut found = (vec![false; rays.len()], vec![None; rays.len()]);
            bvh.batch(&rays).occluded_into(&mut found.0);
            bvh.batch(&rays).intersect_into(&mut found.1);
            assert!(found == expected, "{place}");
            for order in [Order::Sato, Order::Embree, BY_RAY] {
                let plan = bvh.plan(order, None, &learning.model).expect("no log");
                let mut bvh = bvh.clone();
                bvh.apply(&plan);
                bvh.validate().expect("a valid tree");
                let mut found = vec![false; rays.len()];
                bvh.batch(&rays).occluded_into(&mut found);
                assert!(found == expected.0, "{place} {order}");
            }
        }
    }
}

/// The paper's wide logs and orders work on trees from either collapse.
#[test]
fn paper_orders_apply_to_learned_trees() {
    let mut rng = Rng::new(62);
    let scene = City::new(&mut rng);
    let primitives = &scene.primitives;
    let (training, test) = (
        scene.shadow_rays(&mut rng, 2000),
        scene.shadow_rays(&mut rng, 4000),
    );
    let tree = BinaryTree::build(primitives, Builder::default());
    let tree_log = log(primitives, &tree, &[&training]);
    let unsorted = Learning {
        sort: false,
        ..Default::default()
    };
    let built = Bvh::collapse_logged(
        primitives,
        &tree,
        &tree_log,
        &unsorted,
        Engine::best(Width::W8),
    );
    for order in [Order::SortMinus, Order::Sort, Order::SortPlus] {
        let mut bvh = built.clone();
        let mut log = bvh.new_log(order.log_kind().expect("a learned order"), 5);
        let mut occluded = vec![false; training.len()];
        let mut costs = vec![Cost::default(); training.len()];
        bvh.occluded_batch_logged(&training, &mut occluded, &mut costs, &mut log);
        let plan = bvh
            .plan(order, Some(&log), &CostModel::default())
            .expect("a log");
        bvh.apply(&plan);
        bvh.validate().expect("a valid tree");
        assert_eq!(bvh.report().predicted_cost, None);
        // Without box hits an order is a guess, which need not help everywhere.
        let limit = if order == Order::SortMinus { 1.1 } else { 1.0 };
        let (after, before) = (cost(&bvh, &test), cost(&built, &test));
        assert!(after < limit * before, "{order}: {before} became {after}");
    }
}

/// Towers on a bumpy plain, open to the sky: rays of different kinds want different trees here.
struct City {
    mesh: Mesh,
    primitives: Primitives,
}

impl City {
    fn new(rng: &mut Rng) -> Self {
        let mut mesh = mesh::bumpy_grid(rng, 4000);
        for _ in 0..60 {
            let [x, y, _] = rng.point(1.0);
            let (half, height) = (rng.range(0.02, 0.08), rng.range(0.1, 0.7));
            let tower = mesh::icosphere(2);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(
                tower
                    .positions
                    .iter()
                    .map(|p| [x + half * p[0], y + half * p[1], height * (p[2] + 0.5)]),
            );
            mesh.indices
                .extend(tower.indices.iter().map(|t| t.map(|vertex| vertex + first)));
        }
        let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
        Self { mesh, primitives }
    }

    /// A point on some triangle, lifted a little along the normal that looks up.
    fn point(&self, rng: &mut Rng) -> ([f32; 3], [f32; 3]) {
        let [a, b, c] = self.mesh.triangle(rng.below(self.mesh.indices.len()));
        let (mut u, mut v) = (rng.unit(), rng.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let edge = |to: [f32; 3]| -> [f32; 3] { core::array::from_fn(|axis| to[axis] - a[axis]) };
        let (ab, ac) = (edge(b), edge(c));
        let cross = [
            ab[1] * ac[2] - ab[2] * ac[1],
            ab[2] * ac[0] - ab[0] * ac[2],
            ab[0] * ac[1] - ab[1] * ac[0],
        ];
        let length = cross.iter().map(|x| x * x).sum::<f32>().sqrt();
        let sign = if cross[2] < 0.0 { -1.0 } else { 1.0 };
        let normal = cross.map(|x| sign * x / length);
        let point = core::array::from_fn(|axis| {
            a[axis] + u * ab[axis] + v * ac[axis] + 1e-4 * normal[axis]
        });
        (point, normal)
    }

    /// Towards a low sun.
    fn shadow_rays(&self, rng: &mut Rng, count: usize) -> Vec<Ray> {
        (0..count)
            .map(|_| Ray::new(self.point(rng).0, [0.8, 0.3, 0.25]))
            .collect()
    }

    /// Anywhere above the surface, not far.
    fn ambient_rays(&self, rng: &mut Rng, count: usize) -> Vec<Ray> {
        (0..count)
            .map(|_| {
                let (point, normal) = self.point(rng);
                let random = rng.direction();
                let dir = core::array::from_fn(|axis| normal[axis] + 0.99 * random[axis]);
                Ray {
                    tfar: 0.5,
                    ..Ray::new(point, dir)
                }
            })
            .collect()
    }
}

#[test]
fn learning_lowers_the_cost_of_the_rays_learned_from() {
    let seed = 63;
    let mut rng = Rng::new(seed);
    let scene = City::new(&mut rng);
    let primitives = &scene.primitives;
    let tree = BinaryTree::build(primitives, Builder::default());
    let kinds: [(&str, [Vec<Ray>; 2]); 2] = [
        (
            "shadow",
            [2000, 8000].map(|count| scene.shadow_rays(&mut rng, count)),
        ),
        (
            "ambient",
            [2000, 8000].map(|count| scene.ambient_rays(&mut rng, count)),
        ),
    ];
    for width in Width::ALL {
        let by_area = Bvh::collapse(primitives, &tree, Collapse::Area, Engine::best(width));
        for (kind, [training, test]) in &kinds {
            let log = log(primitives, &tree, &[training]);
            let learn = |collapse| {
                let learning = Learning {
                    collapse,
                    ..Default::default()
                };
                Bvh::collapse_logged(primitives, &tree, &log, &learning, Engine::best(width))
            };
            let [sorted, learned] =
                [Collapse::Area, Collapse::Learned].map(|collapse| cost(&learn(collapse), test));
            let place = format!("seed {seed} x{width} {kind}");
            let simple = cost(&by_area, test);
            assert!(sorted < simple, "{place}: sorted {sorted}, simple {simple}");
            assert!(
                learned < sorted,
                "{place}: learned {learned}, sorted {sorted}"
            );
        }
    }
}

/// A log of one kind of rays, mixed half and half with surface rays, leaves the other kind at 0.95 of
/// the speed it has in a tree that learned nothing, or better: open towers, and clutter in a closed
/// room, where rays to a lamp never reach the walls that all other rays end at.
#[test]
fn a_mixed_log_does_no_harm_to_other_rays() {
    let seed = 64;
    let mut rng = Rng::new(seed);
    let city = City::new(&mut rng);
    let (shadow, ambient) = (
        city.shadow_rays(&mut rng, 4000),
        city.ambient_rays(&mut rng, 4000),
    );
    let mut room = mesh::icosphere(2).map("room", |p| p.map(|x| 3.0 * x));
    let first = room.positions.len() as u32;
    let clutter = mesh::soup(&mut rng, 3000);
    room.positions.extend(&clutter.positions);
    room.indices.extend(
        clutter
            .indices
            .iter()
            .map(|t| t.map(|vertex| vertex + first)),
    );
    let room = Primitives::new(&[geometry(&room)]).expect("indices in range");
    let to_lamp: Vec<_> = (0..4000)
        .map(|_| Ray::between(rng.point(1.0), [0.3, 0.2, 1.5]))
        .collect();
    let from_walls: Vec<_> = (0..4000)
        .map(|_| Ray::new(rng.direction().map(|x| 2.5 * x), rng.direction()))
        .collect();

    let mut harmed_unmixed = 0;
    for (primitives, kinds) in [
        (&city.primitives, [&shadow, &ambient]),
        (&room, [&to_lamp, &from_walls]),
    ] {
        let tree = BinaryTree::build(primitives, Builder::default());
        let surface = surface_rays(primitives, 1000, 1);
        for width in Width::ALL {
            let by_area = Bvh::collapse(primitives, &tree, Collapse::Area, Engine::best(width));
            for (learned_from, other) in [(kinds[0], kinds[1]), (kinds[1], kinds[0])] {
                let learn = |log: TreeLog| {
                    let learning = Learning::default();
                    Bvh::collapse_logged(primitives, &tree, &log, &learning, Engine::best(width))
                };
                let mixed = learn(log(primitives, &tree, &[learned_from, &surface]));
                let pure = learn(log(primitives, &tree, &[learned_from]));
                let [before, mixed, pure] = [by_area.clone(), mixed, pure].map(|b| cost(&b, other));
                assert!(
                    mixed <= before / 0.95,
                    "seed {seed} x{width}: {mixed} after {before}"
                );
                harmed_unmixed += usize::from(pure > before / 0.95);
            }
        }
    }
    assert!(harmed_unmixed > 0, "the mixture was put to no test");
}

#[test]
fn the_default_build_is_cheaper_than_the_collapse_by_area() {
    let mut rng = Rng::new(65);
    let scene = City::new(&mut rng);
    let geometries = [geometry(&scene.mesh)];
    let rays = scene.ambient_rays(&mut rng, 4000);
    for width in Width::ALL {
        let build = |recipe: Recipe| {
            Bvh::build(&geometries, &recipe.engine(Engine::best(width))).expect("indices in range")
        };
        let unlearned = Recipe::default()
            .collapse(Collapse::Area)
            .order(Order::Simple);
        let (area, learned) = (build(unlearned), build(Recipe::default()));
        assert!(cost(&learned, &rays) < cost(&area, &rays), "x{width}");
        let (area, learned) = (area.report(), learned.report());
        assert_eq!(area.predicted_cost, None);
        let predicted = learned.predicted_cost.expect("a log");
        assert!(
            predicted > 1.0 && predicted < 100.0,
            "x{width}: {predicted}"
        );
        assert!(area.sah > 1.0 && learned.sah > 1.0);
        // The collapse costs nothing in area that the order of one tree could bring back.
        assert!(
            learned.sah < 1.2 * area.sah,
            "x{width}: {learned:?} {area:?}"
        );
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn logs_do_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::new(66);
    let scene = City::new(&mut rng);
    let rays = scene.ambient_rays(&mut rng, 3000);
    let learned = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            let primitives = &scene.primitives;
            let tree = BinaryTree::build(primitives, Builder::default());
            let surface = surface_rays(primitives, 777, 3);
            let log = log(primitives, &tree, &[&rays, &surface]);
            let learning = Learning::default();
            let engine = Engine::best(Width::W16);
            let bvh = Bvh::collapse_logged(primitives, &tree, &log, &learning, engine);
            (surface, log, bvh.to_bytes())
        })
    });
    assert!(learned[0] == learned[1] && learned[1] == learned[2]);
}

/// Nothing, one primitive, spheres alone, no rays, only rays that cannot hit: all give valid trees.
#[test]
fn little_to_learn_from_is_no_trouble() {
    let mut rng = Rng::new(67);
    let spheres: Vec<_> = (0..100)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: rng.range(0.01, 0.2),
        })
        .collect();
    let [empty, single, soup] = [
        mesh::empty(&mut rng, 1),
        mesh::single(&mut rng, 1),
        mesh::soup(&mut rng, 500),
    ];
    let scenes = [
        vec![],
        vec![geometry(&empty)],
        vec![geometry(&single)],
        vec![Geometry::spheres(&spheres[..1])],
        vec![Geometry::spheres(&spheres[..])],
        vec![geometry(&soup), Geometry::spheres(&spheres[..])],
    ];
    let improper = [
        Ray::new([f32::NAN; 3], [1.0; 3]),
        Ray::new([0.0; 3], [0.0; 3]),
        Ray::between([1.0; 3], [f32::INFINITY; 3]),
    ];
    let test: Vec<_> = (0..300)
        .map(|_| Ray::new(rng.point(1.5), rng.direction()))
        .collect();
    for geometries in &scenes {
        let primitives = Primitives::new(geometries).expect("indices in range");
        let brute = Brute::new(&primitives);
        let tree = BinaryTree::build(&primitives, Builder::default());
        let surface = surface_rays(&primitives, 100, 1);
        assert_eq!(surface.len(), if primitives.is_empty() { 0 } else { 100 });
        for rays in [&[][..], &improper, &surface, &test] {
            for weight in [0.0, 1.0] {
                let mut log = TreeLog::new(&tree);
                log.add(&primitives, &tree, rays, weight);
                if rays == &improper[..] || rays.is_empty() {
                    assert_eq!(log.rays(), 0);
                }
                for engine in Engine::all() {
                    for model in [
                        CostModel::default(),
                        CostModel::default()
                            .node(0.0)
                            .prim(0.0)
                            .entry(0.0)
                            .cutout(0.0),
                    ] {
                        let learning = Learning {
                            model,
                            ..Default::default()
                        };
                        let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, engine);
                        bvh.validate().expect("a valid tree");
                        let report = bvh.report();
                        assert!(report.predicted_cost.expect("a log").is_finite());
                        assert!(report.sah.is_finite());
                        for ray in &test {
                            assert_eq!(bvh.intersect(ray), brute.intersect(ray));
                        }
                    }
                }
            }
        }
    }
    for sample_rays in [Some(0), Some(1), Some(50), None] {
        let options = Recipe::default().surface_rays(sample_rays);
        for geometries in &scenes {
            let bvh = Bvh::build(geometries, &options).expect("indices in range");
            bvh.validate().expect("a valid tree");
        }
    }
}

#[test]
#[should_panic(expected = "nodes and primitives of the log and of the tree")]
fn a_log_of_another_tree_does_not_fit() {
    let mut rng = Rng::new(68);
    let [(a, tree_a), (_, tree_b)] = [100, 200].map(|size| {
        let mesh = mesh::soup(&mut rng, size);
        let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        (primitives, tree)
    });
    let log = TreeLog::new(&tree_b);
    let learning = Learning::default();
    Bvh::collapse_logged(&a, &tree_a, &log, &learning, Engine::default());
}

/// On a closed convex surface: of the bounces, the half on the inside hits and the half on the outside
/// does not; segments run inside and meet nothing, unless their ends are neighbours.
#[test]
fn surface_rays_of_a_sphere_go_both_ways() {
    let ball = mesh::icosphere(4);
    let sphere = [Sphere {
        center: [3.0, 0.0, 0.0],
        radius: 1.0,
    }];
    for geometries in [[geometry(&ball)], [Geometry::spheres(&sphere[..])]] {
        let primitives = Primitives::new(&geometries).expect("indices in range");
        let count = 4000;
        let rays = surface_rays(&primitives, count, 9);
        assert_eq!(
            rays,
            surface_rays(&primitives, count, 9),
            "a function of the seed"
        );
        assert_ne!(rays, surface_rays(&primitives, count, 10));
        let brute = Brute::new(&primitives);
        let occluded: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
        let count_of = |finite: bool| {
            rays.iter()
                .zip(&occluded)
                .filter(|(ray, occluded)| **occluded && (ray.tfar == 1.0) == finite)
                .count()
        };
        assert_eq!(rays.iter().filter(|ray| ray.tfar == 1.0).count(), count / 4);
        assert!(count_of(true) < 5, "{}", count_of(true));
        let hits = count_of(false) as f64 / (0.75 * count as f64);
        assert!((hits - 0.5).abs() < 0.03, "{hits}");
    }
}

/// Two far squares of areas 1 and 16: points are given half by area, half by its root.
#[test]
fn surface_points_follow_the_area_and_its_root() {
    let square = |x: f32, side: f32| {
        let corner = move |u: f32, v: f32| [x + side * u, side * v, 0.0];
        [
            corner(0.0, 0.0),
            corner(1.0, 0.0),
            corner(0.0, 1.0),
            corner(1.0, 1.0),
        ]
    };
    let positions = [square(-100.0, 1.0), square(100.0, 4.0)].concat();
    let indices = vec![[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]];
    let geometries = [Geometry::triangles(positions, indices)];
    let primitives = Primitives::new(&geometries).expect("indices in range");
    let count = 10_000;
    let rays = surface_rays(&primitives, count, 4);
    let large = rays.iter().filter(|ray| ray.org[0] > 0.0).count() as f64 / count as f64;
    let expected = 0.5 * (16.0 / 17.0 + 4.0 / 5.0);
    assert!(
        (large - expected).abs() < 1e-3,
        "{large} instead of {expected}"
    );
}

#[test]
fn collapses_are_named() {
    for collapse in Collapse::ALL {
        assert_eq!(collapse.name().parse(), Ok(collapse));
    }
    let error = "areas".parse::<Collapse>().expect_err("no such collapse");
    for collapse in Collapse::ALL {
        assert!(error.to_string().contains(collapse.name()), "{error}");
    }
}
