//! Choices of a caller that override the scene's own.

use std::str::FromStr;

use antumbra_scene::{DirectStrategy, Integrator, Light, Scene};

use crate::Error;

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
            Integrator::Path { .. } => Self::Path,
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
        Integrator::Path { .. } | Integrator::DirectLighting { .. } if new_distance.is_some() => {
            Err(Error::NoDistance {
                scene: scene.name.clone(),
            })
        }
        Integrator::Path { .. } | Integrator::DirectLighting { .. } => Ok(()),
    }
}

/// Sets how many shadow rays a point asks for: per camera ray of ambient occlusion, per light of direct lighting.
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
        Integrator::Path { .. } => {
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

#[cfg(test)]
mod tests {
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
}
