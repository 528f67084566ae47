//! Scenes that are baked, and points of them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use antumbra::recipe::{Builder, Engine};
use antumbra::{Bvh, Isa, LocalOrigin};
use antumbra_bake::{
    CREASE_ANGLE, Curvature, Error, Flat, Key, Mesh, Orientation, Sensors, Surface, Surfaces,
    UpAxis,
};
use antumbra_lab::count;
use antumbra_load::{Extent, Loaded, MemorySize, Up};
use antumbra_raster::Crs;
use antumbra_render::World;
use antumbra_scene::{Geometry, Scene, Shape, TriangleMesh};

use super::city::{Around, Beside, Objects, Store};
use super::parts::Parts;
use super::visible::VisibleArgs;
use crate::exit::{Failure, say, tell};
use crate::output::Files;
use crate::{input, interrupt, scenes};

/// A scene that was read for a bake, with its tree.
pub struct Ground {
    pub loaded: Loaded,
    pub world: World,
    pub bvh: Bvh,
    /// All meshes as one, measured from `local`.
    pub mesh: Mesh,
    /// What touches the scene, of a city that it is in.
    beside: Option<Beside>,
    /// `mesh`, turned, and then what touches it, if anything does.
    whole: Option<Mesh>,
    /// Names of the triangles of `mesh`.
    pub parts: Parts,
    /// Kinds of its triangles, once these have been [turned](Ground::face).
    pub surfaces: Option<Surfaces>,
    /// Origin of all positions.
    pub local: LocalOrigin,
    /// How the scene is bent, if it is.
    pub curvature: Option<Curvature>,
    /// The city that the scene is in.
    pub around: Option<Around>,
    pub build_seconds: f64,
}

impl Ground {
    /// Reads a scene and builds its tree, perhaps in the city of an index. Flags of `visible` with `--curvature` bend it.
    pub fn load(
        names: &[PathBuf],
        (isa, memory): (Isa, MemorySize),
        files: &mut Files,
        (bent, city): (Option<&VisibleArgs>, Option<Arc<Store>>),
    ) -> Result<Self, Failure> {
        let origin = city.as_ref().map(|store| store.city.origin.into());
        let mut loaded = scenes::load_one(names, memory, origin)?;
        files.reads_all(&loaded.inputs)?;
        let flat = loaded.scene.flattened();
        let flat = flat.map_err(|error| Failure::scene(&loaded.scene.name, error))?;
        loaded.scene = flat.into_owned();
        let curvature = bent.map(|args| bend(args, &mut loaded)).transpose()?;
        let (mesh, _) = mesh(&loaded.scene, false)?;
        let mut parts = Parts::new(&loaded.scene, &loaded.names);
        let local = LocalOrigin {
            origin: loaded.scene.origin.into(),
        };
        let around = city.map(|store| Around::new(store, (&names[0], &mesh)));
        let (around, beside) = around.transpose()?.unzip();
        // One file may look as if another axis were up.
        if let Some(up) = around.as_ref().and_then(Around::up) {
            loaded.up = up;
        }
        if let Some(Beside { objects, .. }) = &beside {
            parts.push_unnamed(objects.numbers.len());
        }
        interrupt::check()?;
        let start = Instant::now();
        let own = loaded.scene.shapes.len();
        loaded
            .scene
            .shapes
            .extend(beside.as_ref().map(Beside::shape));
        let world = scenes::world(&loaded.scene, Builder::default())?;
        loaded.scene.shapes.truncate(own);
        let bvh = world.bvh(Engine::of(isa));
        Ok(Self {
            loaded,
            world,
            bvh,
            mesh,
            parts,
            surfaces: None,
            local,
            beside,
            whole: None,
            curvature,
            around,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// The box of the scene in the world, or of the city that it is in.
    pub fn extent(&self) -> Option<Extent> {
        match &self.around {
            Some(around) => around.extent(),
            None => extent(&self.loaded.scene),
        }
    }

    /// Splits the vertices of meshes without normals at creases, so that each wall at a corner has its own normal. Says how
    /// many there are more.
    pub fn split_at_creases(&mut self) -> Result<(), Failure> {
        let (mesh, copies) = mesh(&self.loaded.scene, true)?;
        self.mesh = mesh;
        if copies > 0 {
            tell(format_args!(
                "{}: {} vertices more, since vertices without normals are split at creases of more than {CREASE_ANGLE} degrees",
                self.loaded.scene.name,
                count(copies as u64),
            ));
        }
        Ok(())
    }

    /// Turns surfaces to the side that people mean, and says how many.
    pub fn face(&mut self, plan: &Orientation) {
        let own = [self.mesh.positions.len(), self.mesh.indices.len()];
        let numbers = self.parts.objects(&self.mesh).numbers();
        let mesh = std::mem::take(&mut self.mesh);
        let Objects { mut mesh, numbers } = self.with_beside(Objects { mesh, numbers });
        let flat = |ids| self.parts.flat(ids);
        let surfaces = Surfaces::new(&mut mesh, &numbers, (&self.bvh, &flat), plan);
        self.tell_turned(surfaces.turned, surfaces.faced);
        if self.beside.is_some() {
            self.whole = Some(mesh.clone());
            mesh.positions.truncate(own[0]);
            mesh.normals.truncate(own[0]);
            mesh.uvs.truncate(own[0]);
            mesh.indices.truncate(own[1]);
        }
        self.mesh = mesh;
        self.surfaces = Some(surfaces);
    }

    /// Finds kinds of surfaces that face as the file winds them.
    pub fn keep_sides(&mut self, plan: &Orientation) {
        let objects = self.parts.objects(&self.mesh).numbers();
        let tree: (_, Flat<'_>) = (&self.bvh, &|ids| self.parts.flat(ids));
        self.surfaces = Some(Surfaces::as_wound(&self.mesh, &objects, tree, plan));
    }

    fn tell_turned(&self, closed: usize, open: usize) {
        let bodies = |number: usize| match number {
            1 => "1 body".to_owned(),
            more => format!("{} bodies", count(more as u64)),
        };
        let closed = (closed > 0).then(|| format!("{} that faced inwards", bodies(closed)));
        let open = (open > 0).then(|| format!("{} that faced away from the sky", bodies(open)));
        let turned: Vec<String> = closed.into_iter().chain(open).collect();
        if !turned.is_empty() {
            let scene = &self.loaded.scene.name;
            tell(format_args!("{scene}: turned {}", turned.join(" and ")));
        }
    }

    /// Which of some points are inside of bodies.
    pub fn inside(
        &self,
        points: &[[f32; 3]],
        some: impl Iterator<Item = usize>,
        plan: &Orientation,
    ) -> Vec<usize> {
        let numbers = self.parts.objects(&self.mesh).numbers();
        let mesh = self.mesh.clone();
        let Objects { mut mesh, numbers } = self.with_beside(Objects { mesh, numbers });
        let tree: (_, Flat<'_>) = (&self.bvh, &|ids| self.parts.flat(ids));
        let surfaces = Surfaces::new(&mut mesh, &numbers, tree, plan);
        some.filter(|&index| surfaces.is_inside(tree, &mesh, points[index]))
            .collect()
    }

    /// The scene with what touches it.
    fn with_beside(&self, mut own: Objects) -> Objects {
        let beside = self.beside.iter();
        beside.for_each(|beside| own.push(&beside.objects));
        own
    }

    /// The mesh that [`surfaces`](Self::surfaces) are of: of the scene, and then of what touches it.
    pub fn whole(&self) -> &Mesh {
        self.whole.as_ref().unwrap_or(&self.mesh)
    }

    /// Kinds of the triangles, after [`Ground::face`].
    pub fn kinds(&self) -> &[Surface] {
        self.surfaces
            .as_ref()
            .map_or(&[], |surfaces| &surfaces.kinds[..self.mesh.indices.len()])
    }

    /// Adds the geometry to the key of a job.
    pub fn identify(&self, key: &mut Key) {
        if self.local != LocalOrigin::default() {
            key.text(&format!("{:?}", self.local.origin));
        }
        for shape in &self.loaded.scene.shapes {
            match &shape.geometry {
                Geometry::Mesh(mesh) => key.mesh(&mesh.positions, &mesh.indices),
                Geometry::Sphere(sphere) => key.text(&format!("{sphere:?}")),
                Geometry::Curves(curves) => {
                    let points = curves.points.as_flattened().iter();
                    key.numbers(&points.map(|&x| x.into()).collect::<Vec<_>>());
                    let first = curves.first.iter();
                    key.numbers(&first.map(|&i| i.into()).collect::<Vec<_>>());
                }
            }
        }
    }

    /// The up axis: of the command line, or else of the scene. Prints what was read.
    ///
    /// # Errors
    /// It is neither y nor z.
    pub fn up(&self, asked: Option<UpAxis>) -> Result<UpAxis, Failure> {
        let told = asked.map(|axis| match axis {
            UpAxis::Y => Up::Y,
            UpAxis::Z => Up::Z,
        });
        if asked.is_none() && self.around.as_ref().is_some_and(|city| city.up().is_none()) {
            let reason = "--city: its files differ in which way is up; choose y or z with --up";
            return Err(Failure::usage(reason));
        }
        scenes::tell_read(&self.loaded, told);
        match (asked, self.loaded.up.axis) {
            (Some(axis), _) => Ok(axis),
            (None, Up::Y) => Ok(UpAxis::Y),
            (None, Up::Z) => Ok(UpAxis::Z),
            (None, axis) => {
                let reason = self.loaded.up.reason;
                Err(Failure::Usage(format!(
                    "{axis} is up, {reason}; choose y or z with --up"
                )))
            }
        }
    }

    /// Prints what was read. `counts` are further counts, printed before the number of triangles.
    pub fn tell(&self, counts: &str) {
        tell(format_args!(
            "{}: {counts}{} triangles, loaded in {:.2} s, tree built in {:.2} s",
            self.loaded.scene.name,
            count(self.mesh.indices.len() as u64),
            self.loaded.seconds,
            self.build_seconds,
        ));
    }

    /// Sensors on a grid.
    pub fn grid(&self, spacing: f64, plan: &Orientation) -> Result<Sensors, Failure> {
        self.grid_of((&self.bvh, &|ids| self.parts.flat(ids)), spacing, plan)
    }

    /// Sensors on a grid that sees the surfaces of a tree, which are some of the scene.
    pub fn grid_of(
        &self,
        tree: (&Bvh, Flat<'_>),
        spacing: f64,
        plan: &Orientation,
    ) -> Result<Sensors, Failure> {
        let sensors = Sensors::on_grid(tree, spacing, plan);
        if let Ok(sensors) = &sensors {
            let offsets = sensors
                .points
                .iter()
                .map(|point| self.bvh.origin_offset(*point));
            let offset = offsets.fold(0.0, f32::max);
            if f64::from(offset) > 1e-2 * spacing {
                say(format_args!(
                    "warning: rays begin up to {offset:.2e} above surfaces, more than a hundredth of the {spacing} between \
                     sensors: the scene is large for such a grid"
                ));
            }
        }
        sensors.map_err(|error| match error {
            Error::NothingBelow => Failure::Usage(format!("--grid: {error}; is --up right?")),
            _ => Failure::Usage(format!("--grid {spacing}: that makes {error}")),
        })
    }
}

/// The box of a scene in the world.
pub fn extent(scene: &Scene) -> Option<Extent> {
    Extent::of(scene).map(|own| Extent {
        low: scene.origin + own.low,
        high: scene.origin + own.high,
    })
}

/// Bends all meshes, so that lines of sight over a round earth are straight.
fn bend(args: &VisibleArgs, loaded: &mut Loaded) -> Result<Curvature, Failure> {
    let raster = loaded.raster.as_ref();
    let own = raster.and_then(|raster| raster.grid.crs.as_ref());
    let crs = args.raster.crs.as_ref().or(own);
    if let Some(metres) = crs.and_then(Crs::metres) {
        args.units.settle(metres);
    }
    let scene = &mut loaded.scene;
    let up = match (args.up, loaded.up.axis) {
        (Some(up), _) => up,
        (None, Up::Y) => UpAxis::Y,
        (None, _) => UpAxis::Z,
    };
    let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
    let extent = Extent::of(scene);
    let centre = extent.map_or([0.0; 3], |extent| {
        extent.low.midpoint(extent.high).to_array()
    });
    let curvature = Curvature::new(
        args.earth_radius / args.units.metres(),
        args.refraction,
        centre,
        plan,
    );
    let curvature = curvature.map_err(Failure::usage)?;
    for shape in &mut scene.shapes {
        let Geometry::Mesh(mesh) = &mut shape.geometry else {
            let reason = "--curvature: it has spheres or curves, which cannot be bent";
            return Err(Failure::scene(&scene.name, reason));
        };
        let mesh = Arc::make_mut(mesh);
        for (normal, &point) in mesh.normals.iter_mut().zip(&mesh.positions) {
            *normal = curvature.bend_normal(point, normal.to_array()).into();
        }
        for point in &mut mesh.positions {
            *point = curvature.bend(*point);
        }
    }
    Ok(curvature)
}

/// All meshes of a scene without instances, perhaps with creases, and how many vertices these add.
///
/// # Errors
/// The scene has no mesh, or more vertices than a PLY file can hold.
pub fn mesh(scene: &Scene, creases: bool) -> Result<(Mesh, usize), Failure> {
    let mut all = Mesh::default();
    let (mut spheres, mut curves, mut copies) = (0, 0, 0);
    for shape in &scene.shapes {
        match &shape.geometry {
            Geometry::Mesh(mesh) => copies += push(&mut all, shape, mesh, creases),
            Geometry::Sphere(_) => spheres += 1,
            Geometry::Curves(found) => curves += found.first.len(),
        }
    }
    // Indices of PLY files are signed.
    if all.positions.len() > i32::MAX as usize {
        return Err(Failure::scene(
            &scene.name,
            "it has more vertices than a PLY file can hold",
        ));
    }
    if all.positions.is_empty() {
        return Err(Failure::scene(
            &scene.name,
            "it has no mesh, so no vertices",
        ));
    }
    // Said once, where the scene is read.
    for (number, kind) in [(spheres, "spheres"), (curves, "curves")] {
        if number > 0 && !creases {
            tell(format_args!(
                "note: {number} {kind} occlude, but have no vertices to write"
            ));
        }
    }
    Ok((all, copies))
}

/// Adds the mesh of a shape, with its normals and triangles turned as the shape says. Returns the number of vertices that
/// creases add.
fn push(all: &mut Mesh, shape: &Shape, mesh: &TriangleMesh, creases: bool) -> usize {
    let has_normals = !mesh.normals.is_empty();
    let is_turned = shape.reverse_orientation != (!has_normals && shape.transform_swaps_handedness);
    let normals: Vec<[f32; 3]> = mesh.normals.iter().map(|n| n.to_array()).collect();
    let uvs: Vec<[f32; 2]> = mesh.uvs.iter().map(|uv| uv.to_array()).collect();
    let triangles = (&mesh.positions[..], &mesh.indices[..]);
    let first = all.indices.len();
    let copies = match creases && !has_normals {
        true => all.push_creased(triangles, &uvs, is_turned),
        false => {
            all.push(triangles, &normals, &uvs, is_turned);
            0
        }
    };
    // Corners run anticlockwise as seen from the side that a surface faces.
    if shape.reverse_orientation != shape.transform_swaps_handedness {
        for corners in &mut all.indices[first..] {
            corners.swap(1, 2);
        }
    }
    copies
}

/// Sensors of a file, measured from the origin of a scene, and bent with it. Those without a height are put on the surface.
pub fn sensors(path: &Path, ground: &Ground, plan: &Orientation) -> Result<Sensors, Failure> {
    let name = path.display();
    let bad = |line: usize, reason: &str| Failure::Data(format!("{name}:{line}: {reason}"));
    let sensors = Sensors::from_table(&input::text(path)?, &ground.local);
    let mut sensors = sensors.map_err(|error| bad(error.line, &error.reason))?;
    // Of a table, one axis is missing in all points or in none.
    let missing = |axis: usize| {
        sensors
            .points
            .first()
            .is_some_and(|point| point[axis].is_nan())
    };
    let is_up = |axis: usize| plan.up[axis].abs() == 1.0;
    if let Some(axis) = (0..3).find(|&axis| missing(axis) && !is_up(axis)) {
        let name = ["x", "y", "z"][axis];
        return Err(bad(1, &format!("found no column {name}, which is not up")));
    }
    if let Some(curvature) = &ground.curvature {
        for point in &mut sensors.points {
            if !point.iter().any(|x| x.is_nan()) {
                *point = curvature.bend(*point);
            }
        }
    }
    let draped = sensors.drape(&ground.bvh, plan);
    draped.map_err(|error| Failure::Data(format!("{name}: {error}")))?;
    Ok(sensors)
}
