//! Builder: turns directives into a scene.
//!
//! - `objects`: objects and their instances;  `media`: media by name
//! - `later`: names that pbrt-v4 looks up when a file ends

mod later;
mod media;
mod objects;

use std::collections::HashMap;
use std::sync::Arc;

use antumbra_scene::{
    Accelerator, Camera, Film, Filter, Geometry, Instance, Integrator, Light, LightStrategy,
    Material, Medium, Object, Param, Sampler, Scene, Shape,
};
use glam::{DMat4, DVec3};

use antumbra_image::Allowance;

use crate::budget::Budget;
use crate::directive::{Directive, Handler, Quoted};
use crate::lookup::Lookup;
use crate::material_key::MaterialKey;
use crate::mesh_file::PendingMeshes;
use crate::params::Params;
use crate::report::Report;
use crate::shape::Source;
use crate::source::Span;
use crate::state::{BlockKind, State, Transforms};
use crate::texture::{Images, TextureSpace, Textured};
use crate::version4;
use crate::{
    Options, Times, camera, film, light, material, settings, shape, suggest, texture, transform,
};

/// Section of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Before `WorldBegin`.
    Options,
    /// Between `WorldBegin` and `WorldEnd`.
    World,
    /// After `WorldEnd`.
    Done,
}

/// Largest depth of nested blocks. Each open block takes some hundred bytes.
const MAX_BLOCKS: usize = 10_000;

/// Message for a singular transformation. [`SINGULAR_HELP`] names the most frequent reason.
const SINGULAR: &str = "the current transformation cannot be inverted";
const SINGULAR_HELP: &str = "no factor of a Scale may be 0";

/// Feature name for [`Report::unsupported`]: an instance that would turn a sphere into an ellipsoid.
const ELLIPSOID: &str =
    "an instance of a sphere under a scale that differs by axis (an ellipsoid) is";

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
    filter: Filter,
    sampler: Sampler,
    integrator: Integrator,
    accelerator: Accelerator,
    shapes: Vec<Shape>,
    materials: Vec<Material>,
    material_indices: HashMap<MaterialKey, usize>,
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
        self.drop_unused_objects();
        for path in self.images.paths() {
            report.sources.note(path.clone());
        }
        if self.is_version4 {
            self.finish_version4(report);
        }
        self.check_media(end, report);
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
        let share = |time: f32| ((f64::from(time) - start) / (end_time - start)) as f32;
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
            let message = "something moves while the shutter is open: pictures are blurred, everything else takes its beginning";
            report.note(end, message);
        }
        (scene, times)
    }

    /// Says where the integrator does not know media. They are left out then, as in pbrt-v3.
    fn check_media(&self, end: Span, report: &mut Report) {
        let mut shapes = self.shapes.iter();
        let has_media = self.camera.medium.is_some() || shapes.any(|shape| shape.media.is_some());
        if has_media && !matches!(self.integrator, Integrator::VolumePath { .. }) {
            let message = "participating media are left out: only volpath, bdpt and mlt know them";
            report.note(end, message);
        }
    }

    /// Removes the shapes of objects without instances.
    fn drop_unused_objects(&mut self) {
        let mut is_used = vec![false; self.objects.len()];
        for instance in &self.instances {
            is_used[instance.object] = true;
        }
        for (object, is_used) in self.objects.iter_mut().zip(is_used) {
            if !is_used {
                object.shapes = Vec::new();
            }
        }
    }

    /// Returns true if a directive is allowed in the current section. Otherwise reports it.
    fn check_phase(&self, at: Span, directive: &Directive, report: &mut Report) -> bool {
        use Directive as D;
        let wanted = match directive {
            D::Accelerator(..)
            | D::Camera(..)
            | D::Film(..)
            | D::Integrator(..)
            | D::PixelFilter(..)
            | D::Sampler(..)
            | D::Option(..)
            | D::TransformTimes(..)
            | D::WorldBegin => Some(Phase::Options),
            D::AreaLightSource(..)
            | D::AttributeBegin
            | D::AttributeEnd
            | D::LightSource(..)
            | D::MakeNamedMaterial(..)
            | D::Material(..)
            | D::NamedMaterial(..)
            | D::ObjectBegin(..)
            | D::ObjectEnd
            | D::ObjectInstance(..)
            | D::ReverseOrientation
            | D::Shape(..)
            | D::Texture { .. }
            | D::TransformBegin
            | D::TransformEnd
            | D::WorldEnd => Some(Phase::World),
            _ => None,
        };
        if self.phase == Phase::Done {
            let message = "directives after WorldEnd (several pictures in one file) are";
            report.unsupported(at, message);
            return false;
        }
        if wanted.is_none_or(|phase| phase == self.phase) {
            return true;
        }
        let name = String::from_utf8_lossy(report.sources.slice(at)).into_owned();
        match (directive, self.phase) {
            (D::WorldBegin, _) => report.error(at, "WorldBegin within a world block"),
            (D::WorldEnd, _) => report.error(at, "WorldEnd without WorldBegin"),
            (_, Phase::Options) => {
                let message = format!("{name} belongs between WorldBegin and WorldEnd");
                report.error_once(at, message, None);
            }
            _ => report.error_once(at, format!("{name} belongs before WorldBegin"), None),
        }
        false
    }

    /// A transformation to the world of the file as one to the scene, which is measured from its origin.
    fn to_origin(&self, mut to_world: DMat4) -> DMat4 {
        to_world.w_axis -= self.options.origin.extend(0.0) * to_world.w_axis.w;
        to_world
    }

    fn transforms(&mut self) -> &mut Transforms {
        &mut self.state.now.transforms
    }

    fn concat(&mut self, matrix: DMat4) {
        self.transforms().change(|current| current * matrix);
    }

    fn world_begin(&mut self) {
        self.phase = Phase::World;
        *self.transforms() = Transforms::default();
        self.coordinate_systems
            .insert("world".into(), [DMat4::IDENTITY; 2]);
    }

    fn world_end(&mut self, report: &mut Report) {
        self.report_open_blocks(report);
        self.phase = Phase::Done;
        if !self.is_version4 {
            // As in pbrt-v3, where the camera is made when the world ends.
            self.camera.medium = self.medium(1, report);
        }
    }

    fn report_open_blocks(&mut self, report: &mut Report) {
        for block in self.state.blocks() {
            let [begin, end] = block.kind.names();
            report.error(
                block.begun_at,
                format!("the {begin} has no {end} before the world ends"),
            );
        }
        while !self.state.blocks().is_empty() {
            self.state.pop();
        }
    }

    fn begin_block(&mut self, kind: BlockKind, at: Span, report: &mut Report) {
        if self.state.blocks().len() == MAX_BLOCKS {
            self.refused_blocks += 1;
            let message = format!("blocks are nested more than {MAX_BLOCKS} deep");
            report.error_once(at, message, None);
            return;
        }
        self.state.push(kind, at);
    }

    /// Ends a block. Inner blocks that are still open are reported and ended too.
    fn end_block(&mut self, kind: BlockKind, at: Span, report: &mut Report) {
        if self.refused_blocks > 0 {
            self.refused_blocks -= 1;
            return;
        }
        let [begin, end] = kind.names();
        let blocks = self.state.blocks();
        let Some(depth) = blocks.iter().rposition(|block| block.kind == kind) else {
            report.error(at, format!("{end} without {begin}"));
            return;
        };
        for block in &blocks[depth + 1..] {
            let [inner_begin, inner_end] = block.kind.names();
            report.error_help(
                at,
                format!(
                    "{end} comes before the {inner_end} of the {inner_begin} in line {}",
                    block.begun_at.line
                ),
                format!("add {inner_end} before it"),
            );
        }
        while self.state.blocks().len() > depth {
            self.state.pop();
        }
        report.color_space = self.state.now.color_space;
    }

    fn transform_times(&mut self, at: Span, times: [f64; 2], report: &mut Report) {
        let [start, end] = times;
        // Also when one is NaN.
        if !(start < end && (end - start).is_finite()) {
            let message = format!("the transform times {start} and {end} do not ascend");
            report.error_help(at, message, "the start must be before the end");
            return;
        }
        self.times = times;
    }

    fn coord_sys_transform(&mut self, name: &Quoted, report: &mut Report) {
        match self.coordinate_systems.get(&name.text) {
            Some(system) => {
                let system = *system;
                self.transforms().set(system);
            }
            None => {
                if report.is_counted_only() {
                    return;
                }
                let mut known: Vec<&str> =
                    self.coordinate_systems.keys().map(String::as_str).collect();
                known.sort_unstable();
                report.error_help(
                    name.span,
                    format!("no coordinate system is named {:?}", name.text),
                    suggest::help(&name.text, &known),
                );
            }
        }
    }

    fn camera(&mut self, at: Span, kind: &Quoted, params: &Params, report: &mut Report) {
        let transforms = self.state.now.transforms;
        let origin = self.options.origin;
        let (camera, world_from_camera) =
            camera::declare(at, kind, params, (&transforms, origin), report);
        self.camera = camera;
        if self.is_version4 {
            self.camera.medium = self.medium(1, report);
        }
        self.coordinate_systems
            .insert("camera".into(), [world_from_camera; 2]);
    }

    fn named_material(&mut self, name: &Quoted, report: &mut Report) {
        self.state.now.later_material = None;
        match self.state.named_materials.get(&name.text) {
            Some(spec) => self.state.now.material = Some(Arc::clone(spec)),
            // Looked up when the file ends.
            None if self.is_version4 => {
                self.state.now.later_material = Some(Arc::new(name.clone()));
            }
            None => report.tolerated(
                name.span,
                format!("no material is named {:?} here", name.text),
                "the material before it stays",
                || suggest::help(&name.text, &self.state.named_materials.names()),
            ),
        }
    }

    fn shape(&mut self, at: Span, kind: &Quoted, params: &Params, report: &mut Report) {
        let transforms = self.state.now.transforms;
        let is_of_object = self.state.now.object.is_some();
        if transforms.is_animated() && is_of_object {
            report.unsupported(at, "moving shapes within objects are");
        }
        // A shape that moves is an object of its own with one instance.
        let moves = transforms.is_animated() && !is_of_object;
        // Objects come to the origin by their instances.
        let is_near = is_of_object || moves || self.options.origin == DVec3::ZERO;
        let to_world = match is_of_object {
            true => transforms.start,
            false if moves => DMat4::IDENTITY,
            false => self.to_origin(transforms.start),
        };
        if !transform::is_invertible(&to_world) {
            report.error_once(at, SINGULAR, Some(SINGULAR_HELP));
            return;
        }
        // The shape's lookup may fall back on parameters of the material, which must live as long.
        let current = self.state.now.material.clone();
        let mut lookup = Lookup::new(at, format!("shape {:?}", kind.text), params);
        let mut values = Textured {
            lookup: &mut lookup,
            state: &self.state,
            report,
        };
        // Where the origin of the scene is for the shape.
        let middle = match is_near {
            true => DVec3::ZERO,
            false => to_world.inverse().transform_point3(DVec3::ZERO),
        };
        let read = shape::read(kind, &mut values, &to_world, middle);
        let material = material::of_shape(current.as_deref(), &mut lookup, &self.state, report);
        if material::hair::is_hair(&material) {
            let curve_type = lookup.string("type", report).map(|(name, _)| name);
            if kind.text != "curve" || curve_type == Some("ribbon") {
                report.unsupported(
                    at,
                    "hair on other shapes than flat and cylindrical curves is",
                );
            }
        }
        lookup.finish(report);
        let Some((source, cutouts)) = read else {
            return;
        };
        let area_light = self.state.now.area_light.clone();
        if moves && area_light.is_some() {
            report.note(
                at,
                "area lights of shapes that move are left out, as in pbrt-v3",
            );
        }
        if is_of_object && area_light.is_some() {
            report.note(
                at,
                "area lights of objects are left out: in pbrt-v3 they light nothing",
            );
        }
        let (geometry, mesh_file) = match source {
            Source::Here(geometry) => (geometry, None),
            // The mesh of the file replaces the empty one later.
            Source::File(file) => (Geometry::Mesh(Arc::default()), Some(file)),
        };
        let of_mesh = match &geometry {
            Geometry::Mesh(mesh) => mesh.bytes(),
            Geometry::Sphere(_) => 0,
        };
        let media = self.media(report);
        let bytes = size_of::<Shape>() as u64 + of_mesh;
        if !self.budget.take(bytes, at, report) {
            return;
        }
        let material = match self.state.now.later_material.clone() {
            Some(name) => self.later_material(&name),
            None => self.material_index(material),
        };
        let shape = Shape {
            geometry,
            material,
            area_light: area_light.filter(|_| !is_of_object && !moves),
            media,
            alpha: cutouts.alpha,
            shadow_alpha: cutouts.shadow_alpha,
            reverse_orientation: self.state.now.reverse_orientation,
            transform_swaps_handedness: transform::swaps_handedness(&to_world),
        };
        if shape.area_light.is_some() && matches!(shape.alpha, Some(Param::Constant(_))) {
            report.unsupported(at, "an invisible light (\"alpha\" 0) is");
        }
        if moves {
            let is_sphere = matches!(shape.geometry, Geometry::Sphere(_));
            let Some(instance) = self.instance(at, self.objects.len(), is_sphere, report) else {
                return;
            };
            self.objects.push(Object::default());
            self.instances.push(instance);
        }
        // Objects are never nested, so the last one is the open one.
        let object = (is_of_object || moves).then(|| self.objects.len() - 1);
        let shapes = match object {
            Some(object) => &mut self.objects[object].shapes,
            None => &mut self.shapes,
        };
        if let Some(file) = mesh_file {
            self.pending_meshes.push(object, shapes.len(), file);
        }
        shapes.push(shape);
    }

    /// Index of a material in the scene. New materials are added.
    fn material_index(&mut self, material: Material) -> usize {
        *self
            .material_indices
            .entry(MaterialKey::new(&material))
            .or_insert_with(|| {
                self.materials.push(material);
                self.materials.len() - 1
            })
    }

    fn texture_space(&self) -> TextureSpace {
        TextureSpace {
            world_from_texture: self.state.now.transforms.start,
            origin: self.options.origin,
        }
    }

    /// Memory that images may take.
    fn allowance(&self, report: &Report) -> Allowance {
        Allowance::new(self.budget.left(report))
    }

    /// Defines the pending textures, after reading all their images together.
    fn define_textures(&mut self, report: &mut Report) {
        let pending = std::mem::take(&mut self.pending_textures);
        let names: Vec<&str> = pending.iter().filter_map(|t| t.image_name()).collect();
        if !names.is_empty() {
            let allowance = self.allowance(report);
            self.images
                .read_ahead(&report.sources.folder, &names, &allowance);
        }
        for declaration in pending {
            let at = declaration.at;
            self.images.allowed = self.budget.left(report);
            texture::define(&mut self.state, declaration, &mut self.images, report);
            self.budget.take(self.images.newly_used(), at, report);
        }
    }
}

impl Handler for Builder<'_> {
    fn directive(&mut self, at: Span, mut directive: Directive, report: &mut Report) {
        use Directive as D;
        if self.is_version4 {
            version4::fill(&mut directive, &self.state);
            if let D::Camera(_, params) = &directive {
                self.exposure = version4::exposure(params, at, report);
            }
            version4::translate(&mut directive, report);
        }
        if !self.check_phase(at, &directive, report) {
            return;
        }
        if !matches!(directive, D::Texture { .. }) {
            self.define_textures(report);
        }
        match directive {
            D::Identity => self.transforms().change(|_| DMat4::IDENTITY),
            D::Translate(by) => self.concat(DMat4::from_translation(by.into())),
            D::Scale(by) => self.concat(DMat4::from_scale(DVec3::from(by))),
            D::Rotate(by) => match transform::rotate(by) {
                Some(matrix) => self.concat(matrix),
                None => report.error(at, "the axis of the rotation has no length"),
            },
            D::LookAt(numbers) => match transform::look_at(numbers) {
                Some(matrix) => self.concat(matrix),
                None => report.error_help(
                    at,
                    "the LookAt has no direction",
                    "eye and target must differ, and up must not point along the view",
                ),
            },
            D::Transform(m) => self.transforms().change(|_| DMat4::from_cols_array(&m)),
            D::ConcatTransform(m) => self.concat(DMat4::from_cols_array(&m)),
            D::CoordinateSystem(name) => {
                let Transforms { start, end, .. } = self.state.now.transforms;
                self.coordinate_systems.insert(name.text, [start, end]);
            }
            D::CoordSysTransform(name) => self.coord_sys_transform(&name, report),
            D::ActiveTransform(active) => self.transforms().active = active,
            D::TransformTimes(times) => self.transform_times(at, times, report),
            D::Camera(kind, params) => self.camera(at, &kind, &params, report),
            D::Film(kind, params) => self.film = film::declare(at, &kind, &params, report),
            D::PixelFilter(kind, params) => {
                self.filter = film::declare_filter(at, &kind, &params, report);
            }
            D::Sampler(kind, params) => {
                self.sampler = settings::declare_sampler(at, &kind, &params, report);
            }
            D::Integrator(kind, params) => {
                self.integrator = settings::declare_integrator(at, &kind, &params, report);
            }
            D::Accelerator(kind, params) => {
                let orders = self.options.orders;
                self.accelerator =
                    settings::declare_accelerator(at, &kind, &params, orders, report);
            }
            D::WorldBegin => self.world_begin(),
            D::WorldEnd => self.world_end(report),
            D::AttributeBegin => self.begin_block(BlockKind::Attribute, at, report),
            D::AttributeEnd => self.end_block(BlockKind::Attribute, at, report),
            D::TransformBegin => self.begin_block(BlockKind::Transform, at, report),
            D::TransformEnd => self.end_block(BlockKind::Transform, at, report),
            D::ObjectBegin(name) => self.object_begin(at, name, report),
            D::ObjectEnd => self.end_block(BlockKind::Object, at, report),
            D::ObjectInstance(name) => self.object_instance(at, &name, report),
            D::MakeNamedMedium(name, params) => self.named_medium(at, name, &params, report),
            D::MediumInterface { inside, outside } => {
                self.state.now.media =
                    [inside, outside].map(|name| (!name.text.is_empty()).then(|| Arc::new(name)));
            }
            D::Texture {
                name,
                value_type,
                class,
                params,
            } => {
                if self.transforms().is_animated() {
                    report.note(
                        at,
                        "textures do not move: the start of the transformation is theirs",
                    );
                }
                self.pending_textures.push(texture::Declaration {
                    at,
                    name,
                    value_type,
                    class,
                    params,
                    space: self.texture_space(),
                });
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
            D::LightSource(kind, params) => {
                let mut transforms = self.state.now.transforms;
                let Transforms { start, end, .. } = transforms;
                transforms.set([start, end].map(|matrix| self.to_origin(matrix)));
                self.images.allowed = self.budget.left(report);
                let images = &mut self.images;
                let light = light::declare(at, &kind, &params, &transforms, images, report);
                let bytes = size_of::<Light>() as u64 + self.images.newly_used();
                if self.budget.take(bytes, at, report) {
                    self.lights.extend(light);
                }
            }
            D::AreaLightSource(kind, params) => {
                self.state.now.area_light = light::declare_area(at, &kind, &params, report);
            }
            D::Shape(kind, params) => self.shape(at, &kind, &params, report),
            D::ReverseOrientation => self.state.now.reverse_orientation ^= true,
        }
    }
}
