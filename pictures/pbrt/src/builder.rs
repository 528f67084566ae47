//! Builder: turns directives into a scene.
//!
//! - this file: the state of a builder, its beginning and its end, and which method handles which directive
//! - `blocks`: sections of the file and blocks;  `transforms`: current transformations and the camera
//! - `shapes`: shapes with their materials;  `textures`: textures and their images;  `lights`: lights;  `media`: media by name
//! - `objects`: objects and their instances;  `later`: names that pbrt-v4 looks up when a file ends

mod blocks;
mod later;
mod lights;
mod media;
mod objects;
mod shapes;
mod textures;
mod transforms;

use std::collections::HashMap;
use std::sync::Arc;

use antumbra_scene::{
    Accelerator, Camera, Film, Filter, Instance, Integrator, Light, LightStrategy, Material,
    Medium, Object, Sampler, Scene, Shape,
};
use glam::{DMat4, DVec3};

use crate::arguments::Matrix;
use crate::budget::Budget;
use crate::directive::{Directive, Handler, Phase};
use crate::lookup::read;
use crate::mesh_file::PendingMeshes;
use crate::report::Report;
use crate::source::Span;
use crate::state::{BlockKind, State};
use crate::texture::Images;
use crate::version4;
use crate::{Options, Times, film, light, material, parts, settings, texture};

/// Message for a singular transformation. [`SINGULAR_HELP`] names the most frequent reason.
const SINGULAR: &str = "the current transformation cannot be inverted";
const SINGULAR_HELP: &str = "no factor of a Scale may be 0";

/// Scene under construction, and the graphics state.
pub(crate) struct Builder<'o> {
    options: &'o Options<'o>,
    phase: Phase,
    state: State,
    coordinate_systems: HashMap<String, [DMat4; 2]>,
    objects: Vec<Object>,
    /// Current object of each name.
    object_indices: HashMap<String, usize>,
    instances: Vec<Instance>,
    /// Number of open blocks that were refused as too many. As many block ends are ignored.
    refused_blocks: usize,
    camera: Camera,
    film: Film,
    /// Diagonal of the film in millimetres, if it is given, and its place.
    film_diagonal: Option<(f32, Span)>,
    filter: Filter,
    sampler: Sampler,
    integrator: Integrator,
    accelerator: Accelerator,
    shapes: Vec<Shape>,
    materials: Vec<Material>,
    material_indices: HashMap<Vec<parts::Word>, usize>,
    media: Vec<Medium>,
    /// Current medium of each name.
    media_indices: HashMap<String, u32>,
    lights: Vec<Light>,
    /// Textures whose images are not read yet. Images of consecutive textures are read together.
    pending_textures: Vec<texture::Declaration>,
    images: Images,
    /// Meshes in files that are not read yet.
    pending_meshes: PendingMeshes,
    budget: Budget,
    /// Whether directives are of pbrt-v4, not of pbrt-v3.
    is_version4: bool,
    /// Time during which the shutter is open, of pbrt-v4.
    exposure: f32,
    /// Times of the transformations at the start and at the end.
    times: [f64; 2],
    /// Materials that pbrt-v4 defines after their use: places in the scene's list, and of the first uses.
    later_materials: HashMap<String, (usize, Span)>,
}

impl<'o> Builder<'o> {
    /// Translates directives of pbrt-v4, and takes its default filter and integrator.
    pub fn set_version4(&mut self) {
        self.is_version4 = true;
        self.state.names_stay = true;
        self.integrator = Integrator::VolumePath {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        };
        self.filter = Filter::Gaussian {
            radius: [1.5, 1.5],
            alpha: 2.0,
        };
    }

    /// Makes a builder with the defaults of pbrt-v3.
    pub fn new(options: &'o Options<'o>) -> Self {
        Self {
            options,
            phase: Phase::Options,
            state: State::default(),
            coordinate_systems: HashMap::new(),
            objects: Vec::new(),
            object_indices: HashMap::new(),
            instances: Vec::new(),
            refused_blocks: 0,
            camera: Camera::default(),
            film: Film::default(),
            film_diagonal: None,
            filter: Filter::default(),
            sampler: settings::DEFAULT_SAMPLER,
            integrator: Integrator::default(),
            accelerator: Accelerator::default(),
            shapes: Vec::new(),
            materials: Vec::new(),
            material_indices: HashMap::new(),
            media: Vec::new(),
            media_indices: HashMap::new(),
            lights: Vec::new(),
            pending_textures: Vec::new(),
            images: Images::default(),
            pending_meshes: PendingMeshes::default(),
            budget: Budget::new(options.max_memory),
            is_version4: false,
            exposure: 1.0,
            times: [0.0, 1.0],
            later_materials: HashMap::new(),
        }
    }

    /// Finishes the scene, which is complete if no mistake was reported. `end` is the end of the main file.
    pub fn finish(mut self, name: String, end: Span, report: &mut Report) -> (Scene, Times) {
        if !report.is_over() {
            self.define_textures(report);
        }
        self.end(end, report);
        self.drop_unused_objects();
        for path in self.images.paths() {
            report.sources.note(path.clone());
        }
        if self.is_version4 {
            self.finish_version4(report);
        }
        self.check_media(end, report);
        self.fit_lenses(end, report);
        let meshes = self.pending_meshes;
        let times = Times {
            meshes: meshes.read(
                &mut self.shapes,
                &mut self.objects,
                &mut self.budget,
                report,
            ),
            images: self.images.time,
            ..Times::default()
        };
        self.film.filter = self.filter;
        let [start, end_time] = self.times;
        let share = |time: f32| {
            let share = (f64::from(time) - start) / (end_time - start);
            // Differences must be finite in single precision.
            share.clamp(-1e30, 1e30) as f32
        };
        self.camera.shutter = self.camera.shutter.map(share);
        let scene = Scene {
            name,
            shapes: self.shapes,
            objects: self.objects,
            instances: self.instances,
            materials: self.materials,
            media: self.media,
            lights: self.lights,
            camera: self.camera,
            film: self.film,
            sampler: self.sampler,
            integrator: self.integrator,
            accelerator: self.accelerator,
            origin: self.options.origin,
        };
        if scene.moves() {
            let message = "the scene moves while the shutter is open: pictures are blurred, and bakes refuse \
                           instances that move";
            report.note(end, message);
        }
        (scene, times)
    }
}

impl Builder<'_> {
    /// Ends the world, or reports that the file ends too early.
    fn end(&mut self, end: Span, report: &mut Report) {
        match self.phase {
            // The rest of the file was not read.
            _ if report.is_over() => {}
            Phase::Options => report.error_help(
                end,
                "the file has no WorldBegin",
                "shapes and lights stand between WorldBegin and WorldEnd",
            ),
            // Version 4 has no such directive.
            Phase::World if self.is_version4 => self.world_end(report),
            Phase::World => {
                report.error(end, "the file ends without WorldEnd");
                self.report_open_blocks(report);
            }
            Phase::Done => {}
        }
    }

    /// Takes what is set once for a picture, beside the camera.
    fn setting(&mut self, at: Span, directive: Directive, report: &mut Report) {
        use Directive as D;
        match directive {
            D::Film(kind, params) => {
                (self.film, self.film_diagonal) =
                    read("film", at, (&kind, &params), report, film::film);
            }
            D::PixelFilter(kind, params) => {
                self.filter = read("pixel filter", at, (&kind, &params), report, film::filter);
            }
            D::Sampler(kind, params) => {
                self.sampler = read("sampler", at, (&kind, &params), report, settings::sampler);
            }
            D::Integrator(kind, params) => {
                self.integrator = read(
                    "integrator",
                    at,
                    (&kind, &params),
                    report,
                    settings::integrator,
                );
            }
            D::Accelerator(kind, params) => {
                let orders = self.options.orders;
                self.accelerator = read("accelerator", at, (&kind, &params), report, |lookup| {
                    settings::accelerator(lookup, orders)
                });
            }
            _ => {}
        }
    }

    /// Translates a directive of pbrt-v4, and defines the textures before it. False: it is not allowed here, which was
    /// reported.
    fn prepare(&mut self, at: Span, directive: &mut Directive, report: &mut Report) -> bool {
        if self.is_version4 {
            version4::fill(directive, &self.state);
            if let Directive::Camera(_, params) = directive {
                self.exposure = version4::exposure(params, at, report);
            }
            version4::translate(directive, report);
        }
        if !self.check_phase(at, directive, report) {
            return false;
        }
        if !matches!(directive, Directive::Texture(..)) {
            self.define_textures(report);
        }
        true
    }
}

impl Handler for Builder<'_> {
    fn directive(&mut self, at: Span, mut directive: Directive, report: &mut Report) {
        use Directive as D;
        if !self.prepare(at, &mut directive, report) {
            return;
        }
        match directive {
            D::Identity() => self.transforms().change(|_| DMat4::IDENTITY),
            D::Translate(by) => self.concat(DMat4::from_translation(by.into())),
            D::Scale(by) => self.concat(DMat4::from_scale(DVec3::from(by))),
            D::Rotate(by) => self.rotate(at, by, report),
            D::LookAt(numbers) => self.look_at(at, numbers, report),
            D::Transform(Matrix(m)) => self.transforms().change(|_| DMat4::from_cols_array(&m)),
            D::ConcatTransform(Matrix(m)) => self.concat(DMat4::from_cols_array(&m)),
            D::CoordinateSystem(name) => self.coordinate_system(name),
            D::CoordSysTransform(name) => self.coord_sys_transform(&name, report),
            D::ActiveTransform(active) => self.transforms().active = active,
            D::TransformTimes(times) => self.transform_times(at, times, report),
            D::Camera(kind, params) => self.camera(at, &kind, &params, report),
            D::Film(..)
            | D::PixelFilter(..)
            | D::Sampler(..)
            | D::Integrator(..)
            | D::Accelerator(..) => self.setting(at, directive, report),
            D::WorldBegin() => self.world_begin(),
            D::WorldEnd() => self.world_end(report),
            D::AttributeBegin() => self.begin_block(BlockKind::Attribute, at, report),
            D::AttributeEnd() => self.end_block(BlockKind::Attribute, at, report),
            D::TransformBegin() => self.begin_block(BlockKind::Transform, at, report),
            D::TransformEnd() => self.end_block(BlockKind::Transform, at, report),
            D::ObjectBegin(name) => self.object_begin(at, name, report),
            D::ObjectEnd() => self.end_block(BlockKind::Object, at, report),
            D::ObjectInstance(name) => self.object_instance(at, &name, report),
            D::MakeNamedMedium(name, params) => self.named_medium(at, name, &params, report),
            D::MediumInterface(inside, outside) => self.medium_interface(inside, outside),
            D::Texture(name, value_type, class, params) => {
                self.texture(at, [name, value_type, class], params, report);
            }
            D::Attribute(group, params) => {
                version4::attribute(group, params, &mut self.state, report);
            }
            D::ColorSpace(name) => {
                self.state.now.color_space = version4::color_space(&name, report);
                report.color_space = self.state.now.color_space;
            }
            D::Option(params) => version4::option(&params, report),
            D::Material(kind, mut params) => {
                self.define_normal_map(at, &mut params, report);
                self.state.now.later_material = None;
                let spec = material::declare(at, kind, params, &self.state, report);
                self.state.now.material = Some(Arc::new(spec));
            }
            D::MakeNamedMaterial(name, mut params) => {
                self.define_normal_map(at, &mut params, report);
                let spec = material::declare_named(at, &name, params, &self.state, report);
                self.state.named_materials.define(name.text, Arc::new(spec));
            }
            D::NamedMaterial(name) => self.named_material(&name, report),
            D::LightSource(kind, params) => self.light(at, &kind, &params, report),
            D::AreaLightSource(kind, params) => {
                self.state.now.area_light =
                    read("area light", at, (&kind, &params), report, light::area);
            }
            D::Shape(kind, params) => self.shape(at, &kind, &params, report),
            D::ReverseOrientation() => self.state.now.reverse_orientation ^= true,
            // The parser follows them.
            D::Include(_) | D::Import(_) => {}
        }
    }
}
