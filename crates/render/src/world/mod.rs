//! A scene lowered to what rendering needs; made once, rendered many times.

pub mod camera;
mod geometry;

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use antumbra::{AnyBvh, Builder, Collapse, Isa, Primitives, Width};
use antumbra_scene::{Geometry, Scene};

use crate::Error;
use crate::film::filter;
use crate::light::choice::Lights;
use crate::light::emitter_tree::Emitters;
use crate::material::Material;
use crate::options::Options;
use crate::surface::shapes::Shapes;
use crate::texture::{self, Textures};
use crate::training::trees::BuiltTree;
use camera::Camera;
pub use geometry::Lowered;

/// A scene ready to be rendered: kernel geometry with a binary tree, lights, materials, camera.
///
/// It owns all it needs (meshes are shared with the scene) and does not change while rendering. A tree of another
/// builder is made when a rendering first asks for it, and kept.
#[derive(Debug)]
pub struct World {
    pub(crate) shapes: Shapes,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Lights,
    pub(crate) emitters: Emitters,
    /// Whether an occlusion query tells what a path's last ray sees: not where it would pass through surfaces
    /// that cast a shadow, or be stopped by surfaces that cast none.
    pub(crate) ends_by_occlusion: bool,
    pub(crate) camera: Camera,
    pub(crate) film: antumbra_scene::Film,
    pub(crate) sampler: antumbra_scene::Sampler,
    pub(crate) integrator: antumbra_scene::Integrator,
    pub(crate) primitives: Primitives,
    builder: Builder,
    /// As [`Builder::ALL`], those that were asked for.
    trees: [OnceLock<BuiltTree>; Builder::ALL.len()],
    triangles: usize,
    lower_time: Duration,
}

impl World {
    /// Lowers a scene and builds the binary tree over it with the builder of the default [`Options`], in the
    /// current rayon pool.
    ///
    /// Objects are lowered once, however often they stand in the world. Positions of shapes in errors are those
    /// of [`Scene::stored_shapes`].
    ///
    /// # Errors
    /// Everything a scene may contain that cannot be rendered; see [`Error`]. Degenerate triangles and NaN
    /// vertices are no error: the kernel drops them and says so in the build report.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Self::with_builder(scene, Options::default().builder)
    }

    /// The same with a builder of choice; for surface rays, if it needs rays.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn with_builder(scene: &Scene, builder: Builder) -> Result<Self, Error> {
        let start = Instant::now();
        check(scene)?;
        let mut textures = Textures::default();
        let lowered = Lowered::with(scene, &mut textures);
        let primitives = lowered.primitives().map_err(Error::Geometry)?;
        let bounds = primitives.bounds();
        let lights = Lights::new(scene, &bounds);
        let emitters = Emitters::new(&lowered.world, |shape| lights.emitter(shape).is_some())?;
        let camera = Camera::new(&scene.camera, &scene.film)?;
        let materials = scene.materials.iter();
        let materials = materials
            .map(|material| Material::new(material, &mut textures))
            .collect();
        let has_surface = |material: &antumbra_scene::Material| {
            !matches!(material, antumbra_scene::Material::None)
        };
        let ends_by_occlusion = scene.materials.iter().all(has_surface)
            && scene
                .stored_shapes()
                .all(|shape| shape.shadow_alpha.is_none());
        let world = Self {
            shapes: Shapes::new(scene, &bounds),
            materials,
            lights,
            emitters,
            ends_by_occlusion,
            camera,
            film: scene.film.clone(),
            sampler: scene.sampler,
            integrator: scene.integrator,
            primitives,
            builder,
            trees: Default::default(),
            triangles: scene.triangle_count(),
            lower_time: start.elapsed(),
        };
        world.tree(builder);
        Ok(world)
    }

    /// A wide tree over the scene, collapsed by area, its children as the builder left them.
    pub fn bvh(&self, width: Width, isa: Isa) -> AnyBvh {
        let tree = self.tree(self.builder);
        tree.unlogged(&self.primitives, Collapse::Area, width, isa)
    }

    /// The kernel's geometry, for those who build trees of their own over it.
    pub fn primitives(&self) -> &Primitives {
        &self.primitives
    }

    /// The binary tree of a builder, for surface rays if it needs rays. Built on first use, in the current rayon
    /// pool, and kept.
    pub(crate) fn tree(&self, builder: Builder) -> &BuiltTree {
        let place = Builder::ALL.iter().position(|other| *other == builder);
        let kept = &self.trees[place.expect("`ALL` has them all")];
        if let Some(tree) = kept.get() {
            return tree;
        }
        // Whoever comes first, as in [`BuiltTree::surface_log`].
        let tree = BuiltTree::new(&self.primitives, builder);
        kept.get_or_init(|| tree)
    }

    /// Triangles of all meshes, those of light shapes included, those of an object once for every instance.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Seconds spent on turning the scene into kernel geometry and lights.
    pub fn lower_seconds(&self) -> f64 {
        self.lower_time.as_secs_f64()
    }

    /// Seconds spent on building the binary tree of the builder that the world was made with.
    pub fn tree_seconds(&self) -> f64 {
        self.tree(self.builder).time().as_secs_f64()
    }

    /// The material of a shape.
    #[inline]
    pub(crate) fn material(&self, shape: usize) -> &Material {
        &self.materials[self.shapes[shape].material]
    }
}

/// Refuses what would panic or make no picture later on.
fn check(scene: &Scene) -> Result<(), Error> {
    let materials = scene.materials.len();
    for (index, shape) in scene.stored_shapes().enumerate() {
        if shape.material >= materials {
            return Err(Error::Material {
                shape: index,
                material: shape.material,
                materials,
            });
        }
        if let Geometry::Mesh(mesh) = &shape.geometry {
            let positions = mesh.positions.len();
            for (attribute, found) in [
                ("normals", mesh.normals.len()),
                ("texture coordinates", mesh.uvs.len()),
            ] {
                if found != 0 && found != positions {
                    return Err(Error::VertexAttribute {
                        shape: index,
                        attribute,
                        found,
                        positions,
                    });
                }
            }
        }
    }
    texture::check(scene)?;
    let [width, height] = scene.film.resolution;
    let [x0, x1, y0, y1] = scene.film.pixel_bounds();
    let limit = i32::MAX as u32 / 2;
    if x1 <= x0 || y1 <= y0 || width > limit || height > limit {
        return Err(Error::EmptyPicture {
            width,
            height,
            crop: scene.film.crop_window,
        });
    }
    let radius = filter::radius(&scene.film.filter);
    if !radius.iter().all(|&r| r > 0.0 && r <= 64.0) {
        return Err(Error::FilterRadius { radius });
    }
    if scene.sampler.pixel_samples == 0 {
        return Err(Error::NoSamples {
            what: "samples per pixel",
        });
    }
    match scene.integrator {
        antumbra_scene::Integrator::AmbientOcclusion { samples: 0, .. } => Err(Error::NoSamples {
            what: "ambient occlusion samples",
        }),
        _ => Ok(()),
    }
}
