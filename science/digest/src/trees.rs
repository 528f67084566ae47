//! All trees of a scene: how they are made, what they count, and the bytes that are saved. All calls of builds are here.

use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Builder, Level, Preset};
use antumbra::{Build, Bvh, Instance, Isa, Masks, Object, Primitives, Ray, Recipe, Width, World};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS, engine};
use xxhash_rust::xxh3::xxh3_64;

use crate::scenes::{Moving, Scene};

const SOUND: &str = "the scene is sound";

/// Names of the levels, and whether this machine has them.
pub fn levels() -> impl Iterator<Item = (&'static str, Option<Isa>)> {
    Level::ALL
        .into_iter()
        .map(|level| (level.name(), Isa::new(level).ok()))
}

/// What a scene is built over.
pub fn primitives(scene: &Scene) -> Primitives {
    Primitives::with_instances(&scene.world, &scene.objects, &scene.instances).expect(SOUND)
}

/// Rays that trees learn from: every third.
pub fn training(rays: &[Ray]) -> Vec<Ray> {
    rays.iter().copied().step_by(3).collect()
}

/// A recipe whose tree is the same on every machine: boxes are hit a little differently by levels that round products, and a
/// log of rays says so.
fn learned(recipe: Recipe, width: Width) -> Recipe {
    let scalar = Isa::new(Level::Scalar).expect("every machine has it");
    recipe.engine(engine(scalar, width))
}

/// A tree of every preset and width, by recipe and width.
pub fn by_presets(primitives: &Primitives, rays: &[Ray]) -> Vec<(&'static str, Width, Bvh)> {
    let mut trees = Vec::new();
    for preset in Preset::ALL {
        for width in Width::ALL {
            let recipe = learned(preset.recipe(), width);
            let bvh = Bvh::learn(primitives, rays, &recipe).expect(SOUND);
            trees.push((preset.name(), width, bvh));
        }
    }
    trees
}

/// A tree of every order, collapse, builder and width, by list and name.
pub fn by_choices(primitives: &Primitives, rays: &[Ray]) -> Vec<(&'static str, String, Bvh)> {
    let mut trees = Vec::new();
    let fast = Recipe::fast().seed(7);
    for builder in BUILDERS {
        let recipe = learned(fast.builder(builder), Width::W8);
        let stage = Build::new(primitives)
            .recipe(&recipe)
            .rays(rays)
            .stage()
            .expect(SOUND);
        for width in Width::ALL {
            let mut add = |list, name: &str, recipe: &Recipe| {
                let recipe = learned(*recipe, width);
                let bvh = stage.learn(rays, &recipe, &()).expect(SOUND);
                trees.push((list, format!("{name} w{width}"), bvh));
            };
            add("builder", builder.name(), &recipe);
            if builder != Builder::BinnedSah {
                continue;
            }
            for order in ORDERS {
                add("order", order.name(), &recipe.order(order));
            }
            for collapse in COLLAPSES {
                add("collapse", collapse.name(), &recipe.collapse(collapse));
            }
        }
    }
    trees
}

/// A world of the same contents that can move, and one of its objects.
fn world(scene: &Scene, width: Width) -> (World, Object) {
    let recipe = learned(Recipe::default(), width);
    let object = |geometries| Object::build(geometries, &recipe).expect(SOUND);
    let mut objects: Vec<_> = scene.objects.iter().map(object).collect();
    let world = World::on_ground(object(&scene.world), &objects, &scene.instances);
    (world.expect(SOUND), objects.swap_remove(0))
}

/// Trees that have masks: the given one, and where there are instances the tree of a world that can move.
pub fn masked(scene: &Scene, width: Width, mut bvh: Bvh) -> Vec<(&'static str, Bvh)> {
    let list = |count: usize, by: usize| (0..count).map(|i| [1, 2, 3, 0, 5][i * by % 5]).collect();
    let masks = Masks::new()
        .world(list(scene.world.len(), 1))
        .objects(
            (1..=scene.objects.len())
                .map(|object| list(1, object))
                .collect(),
        )
        .instances(list(scene.instances.len(), 2));
    bvh.set_masks(masks.clone());
    let mut trees = vec![("fixed", bvh)];
    if !scene.instances.is_empty() {
        let (mut world, _) = world(scene, width);
        world.set_masks(masks);
        trees.push(("world", Bvh::clone(&world)));
    }
    trees
}

/// What is saved after changes: other rays, and other vertices or instances.
pub fn changed(scene: &Scene, width: Width, mut bvh: Bvh) -> Vec<(&'static str, Vec<u8>)> {
    let recipe = learned(Recipe::default(), width);
    let order = bvh.relearn(&scene.rays[..scene.rays.len() / 4], &recipe);
    let mut all = vec![("relearned", bvh.to_bytes())];
    let other = &scene.rays[scene.rays.len() / 2..];
    bvh.relearn(other, &recipe);
    bvh.adopt(&order);
    all.push(("adopted", bvh.to_bytes()));
    if scene.instances.is_empty() {
        bvh.refit(&scene.moved()).expect(SOUND);
        all.push(("refitted", bvh.to_bytes()));
        return all;
    }
    let (mut world, object) = world(scene, width);
    all.extend([("world", world.to_bytes()), ("object", object.to_bytes())]);
    world.relearn(other, &recipe);
    all.push(("world-relearned", world.to_bytes()));
    let moved = |&Instance {
                     object, transform, ..
                 }: &Instance| {
        Instance::new(object, transform.map(|[a, b, c, d]| [a, b, c, 0.5 * d]))
    };
    let instances: Vec<_> = scene.instances.iter().skip(2).map(moved).collect();
    world.set_instances(&instances).expect(SOUND);
    all.push(("world-moved", world.to_bytes()));
    all
}

/// Trees of a moving scene: wholes, and one for each span of time.
pub fn moving(moving: &Moving, width: Width) -> ([(&'static str, Bvh); 2], Vec<Bvh>) {
    let rays = &moving.scene.rays;
    let primitives = primitives(&moving.scene);
    let recipe = learned(Recipe::default(), width);
    let build = Build::new(&primitives).recipe(&recipe);
    let plain = build.bvh().expect(SOUND);
    let whole = build.rays(rays).times(&moving.times);
    let learned = whole.bvh().expect(SOUND);
    let span = |span| {
        let primitives = primitives.middle(span);
        Bvh::learn(&primitives, &training(rays), &recipe).expect(SOUND)
    };
    (
        [("plain", plain), ("learned", learned)],
        (0..primitives.spans()).map(span).collect(),
    )
}

/// What occlusion queries cost in a tree, and what it was predicted to.
pub fn counted(bvh: &Bvh, rays: &[Ray]) -> String {
    let (mut occluded, mut costs) = (vec![false; rays.len()], vec![Cost::default(); rays.len()]);
    bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
    let mut sums = [0u64; 3];
    for cost in costs {
        let own = [cost.node_tests, cost.top_node_tests, cost.prim_tests];
        sums = std::array::from_fn(|i| sums[i] + u64::from(own[i]));
    }
    let [nodes, top, prims] = sums;
    let predicted = bvh.report().predicted_cost;
    let predicted = predicted.map_or("nothing".to_owned(), |cost| cost.to_string());
    format!("nodes {nodes} top {top} primitives {prims} predicted {predicted}")
}

/// Hash and length of what is saved.
pub fn hashed(bytes: &[u8]) -> String {
    format!("{:016x} bytes {}", xxh3_64(bytes), bytes.len())
}

/// Hash of a saved tree, and its figures.
pub fn saved(bvh: &Bvh) -> String {
    let report = bvh.report();
    format!(
        "{} nodes {} leaves {} depth {} primitives {} dropped {} transparent {}",
        hashed(&bvh.to_bytes()),
        report.nodes,
        report.leaves,
        report.depth,
        report.primitives,
        report.dropped,
        report.transparent
    )
}
