//! Loading: from a name to a scene, by its extension.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use antumbra::recipe::Order;
use antumbra_mesh::{Names, Warning, load_gltf, load_obj, load_stl, plain_material};
use antumbra_pbrt::{Diagnostic, Times};
use antumbra_raster::{RasterCells, Tiles, is_raster};
use antumbra_scene::material::Matte;
use antumbra_scene::{Geometry, Material, Param, Scene, Shape, Texture, TriangleMesh, builtin};

use glam::{DVec3, Vec3};

use crate::Error;
use crate::estimate;
use crate::extent::Extent;
use crate::memory::MemorySize;
use crate::stage::{self, OwnStage, Stage, Up};
use crate::terrain;
use crate::up::Upright;

/// Marks the name of a built-in scene.
const BUILTIN: &str = "builtin:";

/// Choices of a caller about loading.
#[derive(Clone, Debug)]
pub struct Options {
    /// Memory that the scene may take, its trees included. A larger scene is refused.
    pub max_memory: MemorySize,
    /// Whether warnings about a file, such as missing materials and images of a mesh, are errors.
    pub strict: bool,
    /// Whether materials, textures and images of mesh files are read, and warnings and notes about looks are given. Bakes use
    /// none.
    pub looks: bool,
    /// Whether features of `.pbrt` files that are not supported are left out with warnings. Otherwise they are errors.
    pub skip_unsupported: bool,
    /// Names of child orders that a `.pbrt` file may request.
    pub orders: Vec<&'static str>,
    /// Where positions of files are measured from, such as one place for all files of a city. If absent: a place near each scene that
    /// lies far from zero, or zero.
    pub origin: Option<DVec3>,
}

impl Default for Options {
    /// All memory of the machine, and warnings that are no errors.
    fn default() -> Self {
        Self {
            max_memory: MemorySize::of_machine(),
            strict: false,
            looks: true,
            skip_unsupported: false,
            orders: Order::ALL.map(Order::name).to_vec(),
            origin: None,
        }
    }
}

/// A scene, and how it was loaded.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Time to read or generate the scene.
    pub seconds: f64,
    /// Parts of that time; `None` for what is no `.pbrt` file.
    pub times: Option<Times>,
    /// Warnings and notes of the reader of .pbrt files, with places: what is left out or taken as something else.
    pub notes: Vec<Diagnostic>,
    /// Features of a mesh file that are left out or mapped to something else, each named once.
    pub left_out: Vec<String>,
    /// Things missing in a mesh file, or that the mesh is invisible. The scene is complete, but looks different.
    pub warnings: Vec<Warning>,
    /// Whether every surface of a mesh file is wholly transparent. A warning says so.
    pub is_invisible: bool,
    /// Camera and lights that a mesh file has. `None` for scenes that bring all themselves.
    pub stage: Option<OwnStage>,
    /// Which way is up, and why.
    pub up: Upright,
    /// The `.pbrt` files that the scene was read from, without links and dots; empty for other formats.
    pub files: Vec<PathBuf>,
    /// Names of objects and materials, of the shapes and instances of a mesh file.
    pub names: Names,
    /// Cells of a height raster, which are the vertices of its mesh; `None` for other files.
    pub raster: Option<Arc<RasterCells>>,
    /// What there is to say about several files that are one raster.
    pub tiles: Option<Tiles>,
    /// Every file that was read: scenes, meshes, images, spectra and buffers.
    pub inputs: Vec<PathBuf>,
}

impl Loaded {
    /// A scene that was not read from .pbrt files.
    pub(crate) fn plain(scene: Scene) -> Self {
        Self {
            scene,
            seconds: 0.0,
            times: None,
            notes: Vec::new(),
            left_out: Vec::new(),
            warnings: Vec::new(),
            is_invisible: false,
            stage: None,
            up: Upright::DEFAULT,
            files: Vec::new(),
            names: Names::default(),
            raster: None,
            tiles: None,
            inputs: Vec::new(),
        }
    }
}

/// Reads or generates a scene: a file, by its extension, a folder of height rasters, or `builtin:NAME[:TRIANGLES]`.
///
/// # Errors
/// The name is unknown, the file has mistakes, or the scene takes more memory than allowed. With [`Options::strict`],
/// warnings are errors, too.
pub fn load(name: &Path, options: &Options) -> Result<Loaded, Error> {
    load_all(&[name.to_path_buf()], options)
}

/// Reads several height rasters as one scene; one name as [`load`] does.
///
/// # Errors
/// As [`load`]. Several files that are no rasters, or not one raster.
pub fn load_all(names: &[PathBuf], options: &Options) -> Result<Loaded, Error> {
    let start = Instant::now();
    let name = names.first().map_or(Path::new(""), PathBuf::as_path);
    let mut loaded = match name.to_str().and_then(|name| name.strip_prefix(BUILTIN)) {
        _ if names.len() > 1 => {
            from_origin(options, |origin| mesh((name, names), options, origin))?
        }
        Some(name) => Loaded::plain(built_in(name)?),
        None if extension(name) == "pbrt" => from_origin(options, |origin| {
            let mut loaded = antumbra_pbrt::load(name, &pbrt_options(options, origin))?;
            loaded.scene.name = stem(name);
            Ok(of_pbrt(loaded))
        })?,
        None => from_origin(options, |origin| mesh((name, names), options, origin))?,
    };
    if options.strict && !loaded.warnings.is_empty() {
        return Err(Error::Strict(loaded.warnings));
    }
    estimate::check(&loaded.scene, options.max_memory)?;
    loaded.up = Upright::of(name, &loaded.scene, loaded.stage.is_none());
    loaded.seconds = start.elapsed().as_secs_f64();
    if let Some(own) = loaded.stage.filter(|_| loaded.up.axis != Up::default()) {
        let up = loaded.up.axis;
        stage::set_stage(
            &mut loaded.scene,
            own,
            &Stage {
                up,
                ..Stage::default()
            },
        );
    }
    Ok(loaded)
}

/// Reads a scene as it is, and once more if it lies far away: then its positions are measured from an origin of its own
/// before they are rounded.
fn from_origin(
    options: &Options,
    read: impl Fn(DVec3) -> Result<Loaded, Error>,
) -> Result<Loaded, Error> {
    let loaded = read(options.origin.unwrap_or_default())?;
    let extent = Extent::of(&loaded.scene).filter(|_| options.origin.is_none());
    let origin = extent.map_or(DVec3::ZERO, |extent| extent.local_origin());
    if origin == DVec3::ZERO {
        return Ok(loaded);
    }
    drop(loaded);
    read(origin)
}

/// Reads a scene from the text of a `.pbrt` file. Relative paths start at the current folder, and messages name the
/// text as `stdin`.
///
/// # Errors
/// As [`load`].
pub fn load_text(text: Vec<u8>, options: &Options) -> Result<Loaded, Error> {
    let start = Instant::now();
    let name = Path::new("stdin");
    let mut loaded = from_origin(options, |origin| {
        let options = pbrt_options(options, origin);
        Ok(of_pbrt(antumbra_pbrt::parse(text.clone(), name, &options)?))
    })?;
    estimate::check(&loaded.scene, options.max_memory)?;
    loaded.up = Upright::of(name, &loaded.scene, true);
    loaded.seconds = start.elapsed().as_secs_f64();
    Ok(loaded)
}

fn built_in(name: &str) -> Result<Scene, Error> {
    builtin::by_name(name).ok_or_else(|| Error::UnknownBuiltin {
        name: name.to_owned(),
    })
}

/// Path of a file without the `.gz` of a compressed one.
fn decompressed(path: &Path) -> PathBuf {
    match path.extension() {
        Some(last) if last.eq_ignore_ascii_case("gz") => path.with_extension(""),
        _ => path.to_path_buf(),
    }
}

/// Extension of a file in small letters, which names its format.
fn extension(path: &Path) -> String {
    let path = decompressed(path);
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Reads a mesh, or all rasters that are one scene, of which `path` is the first.
fn mesh(
    (path, all): (&Path, &[PathBuf]),
    options: &Options,
    origin: DVec3,
) -> Result<Loaded, Error> {
    let limit = options.max_memory.bytes();
    let extension = extension(path);
    let owned = || path.to_path_buf();
    let mut loaded = match extension.as_str() {
        _ if is_raster(path) || all.len() > 1 => terrain::load(all, limit, origin)?,
        // The readers of other formats take files as they are.
        "stl" | "obj" | "gltf" | "glb" | "tif" | "tiff" | "asc" | "npy"
            if decompressed(path) != path =>
        {
            return Err(Error::Compressed { path: owned() });
        }
        "ply" => {
            let ply = antumbra_pbrt::load_colored_ply_within(path, limit, origin)?;
            let mut loaded = plain_mesh(path, (ply.mesh, ply.note));
            loaded.warnings.extend(ply.warning.map(|warning| Warning {
                place: path.display().to_string(),
                text: warning.located(),
            }));
            loaded
        }
        "stl" => plain_mesh(path, load_stl(path, limit, origin)?),
        "obj" => of_model(path, load_obj(path, limit, origin, options.looks)?),
        "gltf" | "glb" => of_model(path, load_gltf(path, limit, origin, options.looks)?),
        _ => {
            return Err(Error::UnknownFormat {
                path: owned(),
                extension,
            });
        }
    };
    let is_empty = loaded
        .scene
        .stored_shapes()
        .all(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => mesh.indices.is_empty(),
            Geometry::Sphere(_) => false,
            Geometry::Curves(curves) => curves.first.is_empty(),
        });
    if is_empty {
        return Err(Error::EmptyMesh { path: owned() });
    }
    fill_normals(&mut loaded.scene);
    if options.looks && loaded.scene.stored_shapes().all(is_invisible) {
        loaded.is_invisible = true;
        loaded.warnings.push(Warning {
            place: path.display().to_string(),
            text: "every material is wholly transparent, so nothing can be seen".to_owned(),
        });
    }
    if loaded.raster.is_none() {
        loaded.inputs.push(path.to_path_buf());
    }
    loaded.scene.origin = origin;
    Ok(loaded)
}

/// Gives corners without a normal the normal of their face, where other corners have one.
fn fill_normals(scene: &mut Scene) {
    let objects = scene.objects.iter_mut();
    let of_objects = objects.flat_map(|object| &mut object.shapes);
    for shape in scene.shapes.iter_mut().chain(of_objects) {
        if let Geometry::Mesh(mesh) = &mut shape.geometry
            && mesh.normals.contains(&Vec3::ZERO)
        {
            Arc::make_mut(mesh).fill_normals();
        }
    }
}

/// Whether the alpha mask of a shape is 0 everywhere.
fn is_invisible(shape: &Shape) -> bool {
    let mut alpha = shape.alpha.as_ref();
    while let Some(param) = alpha {
        match param {
            Param::Constant(value) => return *value <= 0.0,
            Param::Texture(texture) => match &**texture {
                Texture::Dither(value) => alpha = Some(value),
                _ => return false,
            },
        }
    }
    false
}

/// A mesh without a material of its own, in the colours of its vertices if it has any.
fn plain_mesh(path: &Path, (mesh, note): (TriangleMesh, Option<String>)) -> Loaded {
    let material = if mesh.colors.is_empty() {
        plain_material()
    } else {
        Material::Matte(Matte {
            kd: Param::Texture(Arc::new(Texture::VertexColor)),
            sigma: 0.0.into(),
        })
    };
    Loaded {
        stage: Some(OwnStage::default()),
        left_out: note.into_iter().collect(),
        ..Loaded::plain(stage::scene_of_mesh(stem(path), mesh, material))
    }
}

fn of_model(path: &Path, mut model: antumbra_mesh::Model) -> Loaded {
    let left_out = std::mem::take(&mut model.notes);
    let warnings = std::mem::take(&mut model.warnings);
    let inputs = std::mem::take(&mut model.files);
    let names = std::mem::take(&mut model.names);
    let (scene, own) = stage::scene_of_model(stem(path), model);
    Loaded {
        stage: Some(own),
        left_out,
        warnings,
        names,
        inputs,
        ..Loaded::plain(scene)
    }
}

fn pbrt_options(options: &Options, origin: DVec3) -> antumbra_pbrt::Options<'_> {
    antumbra_pbrt::Options {
        orders: &options.orders,
        max_memory: Some(options.max_memory.bytes()),
        origin,
        skip_unsupported: options.skip_unsupported,
        only_geometry: !options.looks,
        strict: options.strict,
    }
}

fn of_pbrt(loaded: antumbra_pbrt::Loaded) -> Loaded {
    let inputs = loaded.files.iter().chain(&loaded.resources);
    Loaded {
        inputs: inputs.cloned().collect(),
        times: Some(loaded.times),
        notes: loaded.notes,
        files: loaded.files,
        ..Loaded::plain(loaded.scene)
    }
}

fn stem(path: &Path) -> String {
    let path = decompressed(path);
    let stem = path.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// Name of the scene of some rasters: the first file's, and how many there are more.
pub fn raster_name(paths: &[PathBuf]) -> String {
    let first = paths.first().map_or(Path::new(""), PathBuf::as_path);
    // A folder such as `.` has its name elsewhere.
    let named = first
        .canonicalize()
        .ok()
        .filter(|_| first.file_stem().is_none());
    let name = stem(named.as_deref().unwrap_or(first));
    match paths.len() {
        0 | 1 => name,
        number => format!("{name} and {} more", number - 1),
    }
}

/// A scene's name as part of a file's name: without `builtin:`, and with `-` for every character that may mean
/// something to a file system or a shell.
pub fn file_stem(scene: &str) -> String {
    let name = scene.strip_prefix(BUILTIN).unwrap_or(scene);
    let safe = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | '+');
    let stem: String = name
        .chars()
        .map(|c| if safe(c) { c } else { '-' })
        .collect();
    match stem.trim_start_matches('.') {
        "" => "scene".to_owned(),
        stem => stem.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_are_plain_file_names() {
        let known = [
            ("builtin:city", "city"),
            ("sponza", "sponza"),
            ("a b/c", "a-b-c"),
            ("..", "scene"),
            ("", "scene"),
        ];
        for (name, stem) in known {
            assert_eq!(file_stem(name), stem);
        }
    }
}
