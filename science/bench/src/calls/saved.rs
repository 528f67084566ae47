//! Saving and loading trees, objects and worlds, beside a copy of them in memory: `clone`, of the same value.

use std::hint::black_box;

use antumbra::recipe::Engine;
use antumbra::{Bvh, Instance, Object, Recipe, Width, World};
use antumbra_lab::harness::{Bench, Case, Mesh};
use antumbra_testkit::Rng;

use crate::Outcome;

/// Boxes along each side of the city.
const BOXES: usize = 360;

pub fn run(bench: &mut Bench) -> Outcome {
    let mesh = city((BOXES / bench.part).max(1));
    for width in Width::ALL {
        let geometry = [mesh.geometry()];
        let recipe = Recipe::fast()
            .surface_rays(Some(0))
            .engine(Engine::best(width));
        let (bvh, object) = (
            Bvh::build(&geometry, &recipe)?,
            Object::build(&geometry, &recipe)?,
        );
        let place = |x| {
            Instance::new(
                0,
                [
                    [1.0, 0.0, 0.0, x],
                    [0.0, 1.0, 0.0, 0.0],
                    [0.0, 0.0, 1.0, 0.0],
                ],
            )
        };
        let world = World::new(&[&object], &[place(0.0), place(BOXES as f32)])?;
        let [tree, of_object, of_world] = &[bvh.to_bytes(), object.to_bytes(), world.to_bytes()];
        let what = "a file that was just written";
        let mut case = Case::new(format!("saved, {width} children"), 1);
        // Memory comes from the system anew each time, so pages are part of all times.
        macro_rules! works {
            ($(($add:ident, $name:literal, $value:expr);)*) => {
                $(case.$add($name, Vec::<bool>::new(), |_| drop(black_box($value)));)*
            };
        }
        works! {
            (base, "Bvh::clone", bvh.clone());
            (add, "Bvh::to_bytes", bvh.to_bytes());
            (add, "Bvh::write", {
                let mut bytes = Vec::with_capacity(tree.len());
                bvh.write(&mut bytes).expect("a vector takes anything");
                bytes
            });
            (add, "Bvh::from_bytes", Bvh::from_bytes(tree).expect(what));
            (add, "Bvh::read", Bvh::read(&tree[..]).expect(what));
            (base, "Object::clone", object.clone());
            (add, "Object::to_bytes", object.to_bytes());
            (add, "Object::read", Object::read(&of_object[..]).expect(what));
            (base, "World::clone", world.clone());
            (add, "World::to_bytes", world.to_bytes());
            (add, "World::read", World::read(&of_world[..]).expect(what));
        }
        case.run(bench, [0.0; 2])?;
    }
    Ok(())
}

/// A square of boxes of all heights.
fn city(side: usize) -> Mesh {
    const FACES: [[usize; 4]; 6] = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let (mut mesh, mut rng) = (Mesh::default(), Rng::new(1));
    for place in 0..side * side {
        let low = [(place % side) as f32, (place / side) as f32, 0.0];
        let size = [
            rng.range(0.4, 0.9),
            rng.range(0.4, 0.9),
            rng.range(0.2, 3.2),
        ];
        let corner = |corner: usize| {
            [0, 1, 2].map(|axis| {
                low[axis]
                    + if corner >> axis & 1 == 1 {
                        size[axis]
                    } else {
                        0.0
                    }
            })
        };
        for face in FACES {
            mesh.push_quad(face.map(corner));
        }
    }
    mesh
}
