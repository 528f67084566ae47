//! Choices of a caller that override the scene's own.

use std::str::FromStr;

use antumbra_scene::{DirectStrategy, Filter, Integrator, Light, SamplerKind, Scene};
use glam::{DMat4, DVec3, Mat4};

use crate::{Crop, Error};

/// Kinds of integrators, by the names that pbrt has for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum IntegratorKind {
    /// Paths with next-event estimation.
    Path,
    /// Direct light and specular reflection.
    DirectLighting,
    /// The visible share of the hemisphere.
    AmbientOcclusion,
}

impl IntegratorKind {
    /// Every kind there is.
    pub const ALL: [Self; 3] = [Self::Path, Self::DirectLighting, Self::AmbientOcclusion];

    /// The kind of a scene's integrator.
    pub fn of(integrator: &Integrator) -> Self {
        match integrator {
            Integrator::Path { .. } | Integrator::VolumePath { .. } => Self::Path,
            Integrator::DirectLighting { .. } => Self::DirectLighting,
            Integrator::AmbientOcclusion { .. } => Self::AmbientOcclusion,
        }
    }

    /// The name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::DirectLighting => "directlighting",
            Self::AmbientOcclusion => "ambientocclusion",
        }
    }
}

impl FromStr for IntegratorKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut all = Self::ALL.into_iter();
        all.find(|kind| kind.name() == text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("unknown integrator `{text}`; known are {known}")
        })
    }
}

/// Gives the scene an integrator of this kind: its own if it is one, otherwise one with the settings that pbrt-v3
/// has by default.
pub fn choose_integrator(scene: &mut Scene, kind: IntegratorKind) {
    if kind == IntegratorKind::of(&scene.integrator) {
        return;
    }
    scene.integrator = match kind {
        IntegratorKind::Path => Integrator::default(),
        IntegratorKind::DirectLighting => Integrator::DirectLighting {
            strategy: DirectStrategy::All,
            max_depth: 5,
        },
        IntegratorKind::AmbientOcclusion => Integrator::AmbientOcclusion {
            samples: 64,
            cosine_sampling: true,
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        },
    };
}

/// Sets the distance up to which surfaces occlude, and the value of an open hemisphere, each if it is given.
///
/// # Errors
/// [`Error::NoDistance`] if the integrator is another one than ambient occlusion and a distance is given.
pub fn set_ambient(
    scene: &mut Scene,
    new_distance: Option<f32>,
    new_open: Option<f32>,
) -> Result<(), Error> {
    match &mut scene.integrator {
        Integrator::AmbientOcclusion { distance, open, .. } => {
            *distance = new_distance.unwrap_or(*distance);
            *open = new_open.unwrap_or(*open);
            Ok(())
        }
        _ if new_distance.is_some() => Err(Error::NoDistance {
            scene: scene.name.clone(),
        }),
        _ => Ok(()),
    }
}

/// Sets the number of shadow rays of a point: per camera ray of ambient occlusion, per light of direct lighting.
///
/// # Errors
/// [`Error::NoSampleCount`] for path tracing.
pub fn set_samples(scene: &mut Scene, number: u32) -> Result<(), Error> {
    match &mut scene.integrator {
        Integrator::AmbientOcclusion { samples, .. } => *samples = number,
        Integrator::DirectLighting { strategy, .. } => {
            *strategy = DirectStrategy::All;
            for shape in &mut scene.shapes {
                if let Some(light) = &mut shape.area_light {
                    light.samples = number;
                }
            }
            for light in &mut scene.lights {
                if let Light::Infinite { samples, .. } = light {
                    *samples = number;
                }
            }
        }
        Integrator::Path { .. } | Integrator::VolumePath { .. } => {
            return Err(Error::NoSampleCount {
                scene: scene.name.clone(),
            });
        }
    }
    Ok(())
}

/// Sets the size of the full picture in pixels.
///
/// # Errors
/// [`Error::EmptyCrop`] if the crop window of the scene holds no pixel then.
pub fn set_resolution(scene: &mut Scene, [width, height]: [u32; 2]) -> Result<(), Error> {
    scene.film.resolution = [width, height];
    if scene.film.is_empty() {
        return Err(Error::EmptyCrop {
            scene: scene.name.clone(),
            width,
            height,
            crop: scene.film.crop_window,
        });
    }
    Ok(())
}

/// Place of a camera: eye, point looked at and up vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookAt(pub [DVec3; 3]);

impl FromStr for LookAt {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.trim().strip_prefix("LookAt").unwrap_or(text);
        let parts = numbers.split([',', ' ']).filter(|part| !part.is_empty());
        let numbers: Option<Vec<f64>> = parts.map(|part| part.parse().ok()).collect();
        let numbers = numbers.and_then(|numbers| <[f64; 9]>::try_from(numbers).ok());
        match numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())) {
            Some([a, b, c, d, e, f, g, h, i]) => Ok(Self([
                DVec3::new(a, b, c),
                DVec3::new(d, e, f),
                DVec3::new(g, h, i),
            ])),
            None => Err(format!(
                "`{text}` is not nine finite numbers such as \"LookAt 0 1 5  0 0 0  0 1 0\""
            )),
        }
    }
}

impl LookAt {
    /// From the camera to a scene measured from `origin`. `None` if the eye is where it looks, or up is where it looks.
    fn matrix(&self, origin: DVec3) -> Option<Mat4> {
        let [eye, at, up] = self.0;
        let forward = (at - eye).try_normalize()?;
        // Left-handed, as in pbrt.
        let right = up.try_normalize()?.cross(forward).try_normalize()?;
        let matrix = DMat4::from_cols(
            right.extend(0.0),
            forward.cross(right).extend(0.0),
            forward.extend(0.0),
            (eye - origin).extend(1.0),
        );
        Some(matrix.as_mat4())
    }
}

/// Moves the camera, and keeps its angle of view and its lens.
///
/// # Errors
/// [`Error::Camera`] if the eye is where it looks, or up is where it looks.
pub fn set_camera(scene: &mut Scene, look: &LookAt) -> Result<(), Error> {
    let mut matrix = look.matrix(scene.origin).ok_or(Error::Camera)?;
    // Meshes live in a right-handed world, and so do mirrored pbrt scenes: their cameras reflect.
    if scene.camera.world_from_camera.determinant() < 0.0 {
        matrix.x_axis = -matrix.x_axis;
    }
    scene.camera.world_from_camera = matrix;
    // The file's camera may move; this one does not.
    scene.camera.end = None;
    Ok(())
}

/// Crops the picture to a rectangle of pixels.
///
/// # Errors
/// [`Error::Crop`] if the rectangle reaches beyond the picture.
pub fn set_crop(scene: &mut Scene, crop: Crop) -> Result<(), Error> {
    let film = &mut scene.film;
    let outside = || Error::Crop {
        crop,
        resolution: film.resolution,
    };
    let mut window = [0.0; 4];
    for axis in 0..2 {
        let (start, side) = (crop.corner[axis], film.resolution[axis]);
        let end = start
            .checked_add(crop.size[axis])
            .filter(|&end| end <= side);
        let end = end.ok_or_else(outside)?;
        // Bounds are rounded up, so fractions of half a pixel less are safe.
        window[2 * axis] = ((f64::from(start) - 0.5) / f64::from(side)).max(0.0) as f32;
        window[2 * axis + 1] = ((f64::from(end) - 0.5) / f64::from(side)) as f32;
    }
    film.crop_window = window;
    Ok(())
}

/// Sets how often light is scattered at most.
///
/// # Errors
/// [`Error::NoDepth`] for ambient occlusion.
pub fn set_max_depth(scene: &mut Scene, depth: u32) -> Result<(), Error> {
    match &mut scene.integrator {
        Integrator::Path { max_depth, .. }
        | Integrator::VolumePath { max_depth, .. }
        | Integrator::DirectLighting { max_depth, .. } => {
            *max_depth = depth;
            Ok(())
        }
        Integrator::AmbientOcclusion { .. } => Err(Error::NoDepth {
            scene: scene.name.clone(),
        }),
    }
}

/// Kinds of reconstruction filters, by the names that pbrt has for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum FilterKind {
    Box,
    Triangle,
    Gaussian,
    Mitchell,
    Sinc,
}

impl FilterKind {
    /// Every kind.
    pub const ALL: [Self; 5] = [
        Self::Box,
        Self::Triangle,
        Self::Gaussian,
        Self::Mitchell,
        Self::Sinc,
    ];

    /// The name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Triangle => "triangle",
            Self::Gaussian => "gaussian",
            Self::Mitchell => "mitchell",
            Self::Sinc => "sinc",
        }
    }

    /// Filter with the constants that pbrt-v3 has by default.
    pub fn filter(self) -> Filter {
        let radius = [2.0, 2.0];
        match self {
            Self::Box => Filter::default(),
            Self::Triangle => Filter::Triangle { radius },
            Self::Gaussian => Filter::Gaussian { radius, alpha: 2.0 },
            Self::Mitchell => Filter::Mitchell {
                radius,
                b: 1.0 / 3.0,
                c: 1.0 / 3.0,
            },
            Self::Sinc => Filter::LanczosSinc {
                radius: [4.0, 4.0],
                tau: 3.0,
            },
        }
    }
}

impl FromStr for FilterKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        named(text, "filter", &Self::ALL, |kind| kind.name())
    }
}

/// Samplers that take any number of samples, by the names that pbrt has for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerName(SamplerKind);

impl SamplerName {
    /// Every sampler but `stratified`, which needs the sides of a grid.
    pub const ALL: [Self; 5] = [
        Self(SamplerKind::ZeroTwoSequence),
        Self(SamplerKind::Sobol),
        Self(SamplerKind::Halton),
        Self(SamplerKind::MaxMinDist),
        Self(SamplerKind::Random),
    ];

    /// The name.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// The sampler.
    pub fn kind(self) -> SamplerKind {
        self.0
    }
}

impl FromStr for SamplerName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        named(text, "sampler", &Self::ALL, |name| name.name())
    }
}

/// The item of a name, or a sentence that lists all names.
fn named<T: Copy>(
    text: &str,
    what: &str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<T, String> {
    let found = all.iter().find(|item| name(**item) == text);
    found.copied().ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|item| name(*item)).collect();
        format!("unknown {what} `{text}`; known are {}", known.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use antumbra_scene::builtin;

    #[test]
    fn integrators_have_the_names_of_pbrt() {
        let mut scene = builtin::by_name("city:1000").expect("a scene");
        for kind in IntegratorKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
            choose_integrator(&mut scene, kind);
            assert_eq!(IntegratorKind::of(&scene.integrator), kind);
            assert_eq!(
                set_samples(&mut scene, 3).is_ok(),
                kind != IntegratorKind::Path
            );
        }
        assert!("ao".parse::<IntegratorKind>().is_err());
    }

    #[test]
    fn a_crop_window_without_pixels_is_refused() {
        let mut scene = builtin::by_name("city:1000").expect("a scene");
        scene.film.crop_window = [0.4, 0.5, 0.0, 1.0];
        assert!(set_resolution(&mut scene, [100, 100]).is_ok());
        let error = set_resolution(&mut scene, [1, 1]).expect_err("no pixel");
        assert!(error.to_string().contains("1x1 pixels"), "{error}");
    }

    #[test]
    fn crops_are_the_pixels_asked_for() {
        let mut scene = builtin::by_name("city:1000").expect("a scene");
        for (width, height) in [(640, 360), (1000, 1), (1279, 719), (8191, 4097)] {
            scene.film.resolution = [width, height];
            for (x, w) in [(0, 1), (0, width), (width / 3, width / 2), (width - 1, 1)] {
                let crop = format!("{x},0,{w}x{height}").parse().expect("a crop");
                set_crop(&mut scene, crop).expect("inside");
                assert_eq!(scene.film.pixel_bounds(), [x, x + w, 0, height]);
            }
        }
        let crop = "8000,0,200x10".parse().expect("a crop");
        let error = set_crop(&mut scene, crop).expect_err("beyond").to_string();
        assert!(error.contains("8191x4097"), "{error}");
        for bad in ["", "1,2", "1,2,3", "1,2,0x5", "-1,2,3x4", "1,2,3x4x5"] {
            assert!(bad.parse::<Crop>().is_err(), "{bad}");
        }
    }

    #[test]
    fn cameras_look_where_they_are_told() {
        let mut scene = builtin::by_name("city:1000").expect("a scene");
        for (text, side) in [
            ("LookAt 1 2 3 1 2 -4 0 1 0", Vec3::NEG_X),
            ("1,2,3 1,2,-4 0,1,0", Vec3::X),
        ] {
            scene.camera.world_from_camera = Mat4::from_scale(Vec3::new(-side.x, 1.0, 1.0));
            let look = text.parse().expect("a camera");
            set_camera(&mut scene, &look).expect("a camera");
            let matrix = scene.camera.world_from_camera;
            assert_eq!(matrix.transform_vector3(Vec3::Z), Vec3::NEG_Z);
            // Looking along -z with y up, right is -x in the left-handed world of pbrt, and x in a right-handed one.
            assert_eq!(matrix.transform_vector3(Vec3::X), side);
            assert_eq!(
                matrix.transform_point3(Vec3::ZERO),
                Vec3::new(1.0, 2.0, 3.0)
            );
        }
        for bad in ["1 2 3 1 2 3 0 1 0", "0 0 0 0 1 0 0 1 0"] {
            assert!(set_camera(&mut scene, &bad.parse().expect("numbers")).is_err());
        }
        assert!("LookAt 1 2".parse::<LookAt>().is_err());
    }

    #[test]
    fn filters_and_samplers_have_the_names_of_pbrt() {
        for kind in FilterKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        for name in SamplerName::ALL {
            assert_eq!(name.name().parse(), Ok(name));
        }
        assert!("stratified".parse::<SamplerName>().is_err());
    }
}
