//! The rendering or geometry that a file belongs to, so that it is not used for another.

use antumbra_scene::Scene;
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3;

use crate::options::Options;

/// Version of the program. Another version may make other bits of a scene.
const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// Identity of a picture: all that decides its bits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    program: String,
    scene: String,
    contents: u128,
    resolution: [u32; 2],
    pixel_bounds: [u32; 4],
    spp: u32,
    texture_spp: Option<u32>,
    seed: u64,
    standard_error: bool,
    is_light: bool,
}

/// Geometry in which training rays were traced.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    program: String,
    scene: String,
    geometry: u128,
}

impl Identity {
    /// Identity of a rendering of a scene. Takes some time for large scenes, since every byte is hashed.
    pub fn new(scene: &Scene, options: &Options) -> Self {
        let film = &scene.film;
        let contents = hash(&(
            geometry(scene),
            (&scene.materials, &scene.lights, &scene.camera, &scene.media),
            (film.crop_window, film.filter, film.scale),
            film.max_sample_luminance,
            (scene.sampler.kind, scene.integrator),
        ));
        Self {
            program: PROGRAM.into(),
            scene: scene.name.clone(),
            contents,
            resolution: film.resolution,
            pixel_bounds: film.pixel_bounds(),
            spp: options.spp.unwrap_or(scene.sampler.pixel_samples),
            texture_spp: options.texture_spp,
            seed: options.seed,
            standard_error: options.standard_error,
            is_light: scene.integrator.is_light(),
        }
    }

    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    /// Samples per pixel.
    pub fn spp(&self) -> u32 {
        self.spp
    }

    /// Whether the values of the picture are light.
    pub fn is_light(&self) -> bool {
        self.is_light
    }

    /// Identity of the picture with another number of samples per pixel.
    pub fn with_spp(&self, spp: u32) -> Self {
        Self {
            spp,
            ..self.clone()
        }
    }

    /// Seed of all random values.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Difference from the `wanted` identity, as part of a sentence. `None` if there is none.
    pub fn difference(&self, wanted: &Self) -> Option<String> {
        let mut reasons = Vec::new();
        let mut compare = |what: &str, found: String, wanted: String| {
            if found != wanted {
                reasons.push(format!("{what} {found}, not {wanted}"));
            }
        };
        let size = |[x, y]: [u32; 2]| format!("{x}x{y}");
        let errors = |kept| if kept { "with" } else { "without" }.to_owned();
        compare("version", self.program.clone(), wanted.program.clone());
        compare("scene", self.scene.clone(), wanted.scene.clone());
        compare("resolution", size(self.resolution), size(wanted.resolution));
        let bounds = [self.pixel_bounds, wanted.pixel_bounds].map(|b| format!("{b:?}"));
        let [found, expected] = bounds;
        compare("pixel bounds", found, expected);
        compare(
            "samples per pixel",
            self.spp.to_string(),
            wanted.spp.to_string(),
        );
        let textures = |spp: Option<u32>| match spp {
            Some(spp) => format!("for {spp} samples per pixel"),
            None => "for the samples that there are".to_owned(),
        };
        compare(
            "textures",
            textures(self.texture_spp),
            textures(wanted.texture_spp),
        );
        compare("seed", self.seed.to_string(), wanted.seed.to_string());
        compare(
            "standard errors:",
            errors(self.standard_error),
            errors(wanted.standard_error),
        );
        if reasons.is_empty() && self.contents != wanted.contents {
            let scene = &self.scene;
            reasons.push(format!(
                "what is in scene {scene}, or how it is computed, differs"
            ));
        }
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }
}

impl Place {
    /// Place of a scene. Takes some time for large scenes, since every byte of the geometry is hashed.
    pub fn new(scene: &Scene) -> Self {
        Self {
            program: PROGRAM.into(),
            scene: scene.name.clone(),
            geometry: geometry(scene),
        }
    }

    /// Difference from the `wanted` place, as part of a sentence. `None` if there is none.
    ///
    /// Names do not matter: scenes that differ in camera, lights or materials may share training rays.
    pub fn difference(&self, wanted: &Self) -> Option<String> {
        if self.program != wanted.program {
            let (found, wanted) = (&self.program, &wanted.program);
            return Some(format!("version {found}, not {wanted}"));
        }
        (self.geometry != wanted.geometry).then(|| {
            let (found, wanted) = (&self.scene, &wanted.scene);
            format!("learned in the geometry of scene {found}, which is not that of {wanted}")
        })
    }
}

fn geometry(scene: &Scene) -> u128 {
    hash(&(&scene.shapes, &scene.objects, &scene.instances))
}

/// Hash of all that is serialized.
fn hash(value: &impl Serialize) -> u128 {
    // Neither hashing nor the scene's `Serialize` fails.
    postcard::serialize_with_flavor(value, Hashing(Box::new(Xxh3::new()))).unwrap_or_default()
}

struct Hashing(Box<Xxh3>);

impl Flavor for Hashing {
    type Output = u128;

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.0.update(bytes);
        Ok(())
    }

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn finalize(self) -> postcard::Result<u128> {
        Ok(self.0.digest128())
    }
}
