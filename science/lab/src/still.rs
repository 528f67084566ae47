//! Scenes whose rays need no time.

use antumbra::recipe::Builder;
use antumbra_render::World;
use antumbra_scene::Scene;

use crate::Error;

/// World of a scene in which no instance moves. Experiments trace their rays without times.
///
/// # Errors
/// [`Error::Scene`].
pub fn still_world(scene: &Scene, builder: Builder) -> Result<World, Error> {
    let refuse = Error::scene(&scene.name);
    if scene.instances.iter().any(|one| one.end.is_some()) {
        return Err(refuse(antumbra_render::Error::Moves));
    }
    World::with_builder(scene, builder).map_err(refuse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::{Instance, Object, builtin};
    use glam::{Affine3, Vec3};

    #[test]
    fn scenes_that_move_are_refused() {
        let mut scene = builtin::by_name("city:1000").expect("a scene");
        assert!(still_world(&scene, Builder::BinnedSah).is_ok());
        scene.instances.push(Instance {
            object: scene.objects.len(),
            world_from_object: Affine3::IDENTITY,
            end: Some(Affine3::from_translation(Vec3::X)),
        });
        scene.objects.push(Object::default());
        let Err(error) = still_world(&scene, Builder::BinnedSah) else {
            panic!("the instance moves");
        };
        let text = error.to_string();
        assert!(text.contains("moves while the shutter is open"), "{text}");
    }
}
