//! A scene lowered for rendering: made once, rendered many times.
//!
//! - [`World`]: everything that a rendering needs of a scene
//! - `check.rs`: scenes that are refused
//! - `geometry.rs`: shapes and instances for the kernel
//! - `camera.rs`: camera rays, through the lenses of `lens.rs` where it has some

mod camera;
mod check;
mod geometry;
mod lens;

use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::{Build, BuildMonitor, Bvh, Primitives, Recipe, Stage};
use antumbra_scene::Scene;

use crate::Error;
use crate::clock::clock;
use crate::light::{EmitterTree, Lights};
use crate::material::Material;
use crate::medium::Medium;
use crate::surface::Shapes;
use crate::texture::Textures;
pub use camera::Camera;
use check::{check, check_film};
pub use geometry::Lowered;
pub(crate) use geometry::{of_instance, rows};

/// A scene ready to be rendered: kernel geometry with a binary tree, lights, materials, camera.
///
/// A world owns its data, but shares meshes with the scene. Rendering does not change it. A tree of another builder
/// is built when a rendering first needs it, and kept. Copies share everything but camera and film.
#[derive(Clone, Debug)]
pub struct World {
    contents: Arc<Contents>,
    pub(crate) camera: Camera,
    pub(crate) film: antumbra_scene::Film,
}

/// Everything in a world but camera and film.
#[derive(Debug)]
pub struct Contents {
    pub(crate) shapes: Shapes,
    pub(crate) materials: Vec<Material>,
    has_bodies: bool,
    pub(crate) media: Vec<Medium>,
    pub(crate) lights: Lights,
    pub(crate) emitters: EmitterTree,
    /// Whether an occlusion query decides which light the last ray of a path hits. False if closest hits and
    /// occlusion differ: surfaces without a material, masks for shadows only.
    pub(crate) ends_by_occlusion: bool,
    pub(crate) sampler: antumbra_scene::Sampler,
    pub(crate) integrator: antumbra_scene::Integrator,
    /// Where something moves, primitives half way.
    pub(crate) primitives: Arc<Primitives>,
    /// The primitives that move, where something does.
    moving: Option<Primitives>,
    builder: Builder,
    /// Binary trees by their builders, built on first use.
    stages: Mutex<Vec<(Builder, Arc<Stage>)>>,
    triangles: usize,
    lower_time: Duration,
}

impl World {
    /// Lowers a scene, and builds its binary tree with the builder of the default [`Recipe`], in the current rayon
    /// pool.
    ///
    /// Objects are lowered once, however many instances they have. Errors name shapes by their position in
    /// [`Scene::stored_shapes`].
    ///
    /// # Errors
    /// [`Error`] for a scene that cannot be rendered. Degenerate triangles and NaN vertices are no error: the kernel
    /// drops them, and counts them in the build report.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Self::with_builder(scene, Recipe::default().builder)
    }

    /// Lowers a scene, and builds its binary tree with this builder, for surface rays if the builder needs rays.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn with_builder(scene: &Scene, builder: Builder) -> Result<Self, Error> {
        Self::with_builder_monitored(scene, builder, &())
    }

    /// [`World::with_builder`] with a monitor of the binary tree, which may stop the build.
    ///
    /// # Errors
    /// As [`World::new`]; [`Error::Cancelled`] if the monitor stopped the build.
    pub fn with_builder_monitored(
        scene: &Scene,
        builder: Builder,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let start = Instant::now();
        check(scene)?;
        let mut textures = Textures::default();
        let (lowered, curve_parts) = Lowered::with(scene, &mut textures);
        let primitives = lowered.primitives().map_err(Error::Geometry)?;
        let bounds = primitives.bounds();
        // Trees are built where things are half way.
        let (primitives, moving) = match primitives.moves() {
            false => (primitives, None),
            true => (primitives.middle(0), Some(primitives)),
        };
        let lights = Lights::new(scene, &bounds, &mut textures);
        let emitters = EmitterTree::new(&lowered.world, |shape| lights.emitter(shape).is_some())?;
        let camera = Camera::new(&scene.camera, &scene.film)?.with_time(moving.is_some());
        let materials = scene.materials.iter();
        let materials: Vec<Material> = materials
            .map(|material| Material::new(material, &mut textures))
            .collect();
        let has_surface = |material: &antumbra_scene::Material| {
            !matches!(material, antumbra_scene::Material::None)
        };
        let ends_by_occlusion = scene.materials.iter().all(has_surface)
            && scene
                .stored_shapes()
                .all(|shape| shape.shadow_alpha.is_none());
        let contents = Contents {
            shapes: Shapes::new(scene, &bounds, curve_parts),
            materials,
            has_bodies: scene.materials.iter().any(check::is_body),
            media: scene.media.iter().map(Medium::new).collect(),
            lights,
            emitters,
            ends_by_occlusion,
            sampler: scene.sampler,
            integrator: scene.integrator,
            primitives: Arc::new(primitives),
            moving,
            builder,
            stages: Mutex::default(),
            triangles: scene.triangle_count(),
            lower_time: start.elapsed(),
        };
        let world = Self {
            contents: Arc::new(contents),
            camera,
            film: scene.film.clone(),
        };
        world.stage_monitored(builder, monitor)?;
        Ok(world)
    }

    /// World of the same scene, seen by another camera onto another film. Everything else is shared, so the call takes no time.
    ///
    /// # Errors
    /// [`Error::FieldOfView`], [`Error::CameraMatrix`], [`Error::NoMedium`], [`Error::EmptyPicture`] or [`Error::FilterRadius`].
    pub fn look(
        &self,
        camera: &antumbra_scene::Camera,
        film: &antumbra_scene::Film,
    ) -> Result<Self, Error> {
        check_film(film)?;
        let media = self.media.len();
        if let Some(index) = camera.medium.filter(|&index| index as usize >= media) {
            return Err(Error::NoMedium { index, media });
        }
        Ok(Self {
            contents: Arc::clone(&self.contents),
            camera: Camera::new(camera, film)?.with_time(self.moving.is_some()),
            film: film.clone(),
        })
    }

    /// A wide tree over the scene, collapsed by area, in the child order of the builder.
    pub fn bvh(&self, engine: Engine) -> Bvh {
        let recipe = Recipe::default().engine(engine);
        let bvh = (self.stage(self.builder)).collapse(&[], &recipe.collapse(Collapse::Area), &());
        bvh.expect("nobody stops it")
    }

    /// A tree of the world, built over [`World::primitives`], with the motion of instances; `None` where none moves.
    ///
    /// # Errors
    /// [`Error::Geometry`].
    pub(crate) fn moving(&self, bvh: &Bvh) -> Result<Option<Bvh>, Error> {
        let moving = self.moving.as_ref();
        let moving = moving.map(|primitives| Bvh::moving(primitives, vec![bvh.clone()]));
        moving.transpose().map_err(Error::Geometry)
    }

    /// Whether the camera or an instance moves while the shutter is open.
    pub fn moves(&self) -> bool {
        self.moving.is_some() || self.camera.moves()
    }

    /// Geometry of the kernel, for trees of one's own. Instances that move are half way.
    pub fn primitives(&self) -> &Arc<Primitives> {
        &self.primitives
    }

    /// Binary tree of a builder, for surface rays if the builder needs rays. Built on first use, in the current
    /// rayon pool, and kept.
    pub(crate) fn stage(&self, builder: Builder) -> Arc<Stage> {
        self.stage_monitored(builder, &()).expect("nobody stops it")
    }

    /// [`World::stage`] with a monitor. Nothing is kept of a build that was stopped.
    pub(crate) fn stage_monitored(
        &self,
        builder: Builder,
        monitor: &dyn BuildMonitor,
    ) -> Result<Arc<Stage>, Error> {
        let kept = |add: Option<Arc<Stage>>| {
            let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
            let found = stages.iter().find(|(other, _)| *other == builder);
            let found = found.map(|(_, stage)| Arc::clone(stage)).or(add)?;
            if !stages.iter().any(|(other, _)| *other == builder) {
                stages.push((builder, Arc::clone(&found)));
            }
            Some(found)
        };
        if let Some(stage) = kept(None) {
            return Ok(stage);
        }
        let recipe = Recipe::default().builder(builder).clock(Some(clock));
        // Built while the list is locked, the tree could wait for itself: its thread may take up another task of the
        // pool in the meantime.
        let build = Build::new(&self.primitives)
            .recipe(&recipe)
            .monitor(monitor);
        let stage = build.stage().map_err(Error::of_build)?;
        let stage = Arc::new(stage);
        Ok(kept(Some(Arc::clone(&stage))).unwrap_or(stage))
    }

    /// Triangles of all meshes, light shapes included, and of objects once for every instance.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Seconds of turning the scene into kernel geometry and lights.
    pub fn lower_seconds(&self) -> f64 {
        self.lower_time.as_secs_f64()
    }

    /// Seconds of building the binary tree of the world's own builder.
    pub fn tree_seconds(&self) -> f64 {
        self.stage(self.builder).time().as_secs_f64()
    }

    /// Whether any material varies over its surface.
    pub(crate) fn has_textures(&self) -> bool {
        let varies = |material: &Material| matches!(material, Material::Varying(_));
        self.materials.iter().any(varies)
    }

    /// Whether light goes on inside of bodies.
    pub(crate) fn has_bodies(&self) -> bool {
        self.has_bodies
    }

    /// Whether a path must look for media, or goes through surfaces without a material.
    pub(crate) fn has_volumes(&self) -> bool {
        let is_none = |material: &Material| matches!(material, Material::None);
        !self.media.is_empty() || self.has_bodies || self.materials.iter().any(is_none)
    }

    /// Material of a shape.
    #[inline]
    pub(crate) fn material(&self, shape: usize) -> &Material {
        &self.materials[self.shapes[shape].material]
    }
}

impl Deref for World {
    type Target = Contents;

    fn deref(&self) -> &Contents {
        &self.contents
    }
}
