//! Stages for meshes that come without a camera or lights: framed to fill the picture, under sun and sky.
//!
//! Directions belong to a stage that looks along -z with y up. [`Up`] turns the stage to the up axis of the mesh.

use std::str::FromStr;
use std::sync::Arc;

use antumbra_mesh::{Model, View};
use antumbra_scene::material::Matte;
use antumbra_scene::{
    Camera, Environment, EnvironmentMapping, Film, Geometry, Image, Integrator, Light, Material,
    Param, Rgb, Sampler, SamplerKind, Scene, Shape, TriangleMesh,
};
use glam::{DVec3, Mat3, Mat4, Vec3};

use crate::clear_sky;
use crate::extent::{Extent, for_each_point};

/// Direction from the mesh to the camera. Low enough for the horizon to be in the picture.
const TO_CAMERA: Vec3 = Vec3::new(0.55, 0.27, 1.0);
/// Azimuth to the right of the camera's direction -z, and elevation of the sun, in degrees.
const SUN: [f32; 2] = [121.0, 48.8];
const SUN_COLOR: Rgb = Rgb::new(3.0, 2.75, 2.35);
/// Reflectance of the ground.
const GROUND_COLOR: Rgb = Rgb::new(0.35, 0.34, 0.33);
/// Half the side of the ground, in diagonals of the model: its edge is close to the horizon.
const GROUND_SIDE: f32 = 100.0;
/// Gap below the model, in its diagonals, so that the model's own floor is not in the same plane.
const GROUND_GAP: f32 = 1e-4;
/// Full angle of view over the shorter side, in degrees.
const FOV: f32 = 35.0;
/// Part of the picture's half width that stays free on either side.
const MARGIN: f32 = 0.05;
/// Steps to the middle of the picture. The outermost vertices rarely change after the second.
const CENTRING_STEPS: usize = 6;

/// Axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Up {
    X,
    #[default]
    Y,
    Z,
    MinusX,
    MinusY,
    MinusZ,
}

impl Up {
    /// Every axis, by name.
    pub const ALL: [(&'static str, Self); 6] = [
        ("x", Self::X),
        ("y", Self::Y),
        ("z", Self::Z),
        ("-x", Self::MinusX),
        ("-y", Self::MinusY),
        ("-z", Self::MinusZ),
    ];

    /// From the stage to the world. z up has the front at -y, as modellers have it.
    fn matrix(self) -> Mat3 {
        let (right, up) = match self {
            Self::X => (Vec3::Y, Vec3::X),
            Self::Y => (Vec3::X, Vec3::Y),
            Self::Z => (Vec3::X, Vec3::Z),
            Self::MinusX => (Vec3::Y, Vec3::NEG_X),
            Self::MinusY => (Vec3::X, Vec3::NEG_Y),
            Self::MinusZ => (Vec3::X, Vec3::NEG_Z),
        };
        Mat3::from_cols(right, up, right.cross(up))
    }
}

impl FromStr for Up {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.strip_prefix('+').unwrap_or(text).to_ascii_lowercase();
        let found = Self::ALL.iter().find(|(known, _)| *known == name);
        let found = found.map(|(_, up)| *up);
        found.ok_or_else(|| format!("`{text}` is not one of x, y, z, -x, -y and -z"))
    }
}

/// Sun over a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sun {
    /// No sun.
    None,
    /// Direction of the sun in degrees: azimuth to the right of where the camera looks by default, and elevation.
    At {
        /// Azimuth. 0 is behind the mesh, 180 behind the camera.
        azimuth: f32,
        /// Elevation above the horizon.
        elevation: f32,
        /// Factor of the strength.
        strength: f32,
    },
}

impl FromStr for Sun {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None);
        }
        let numbers: Option<Vec<f32>> = text
            .split(',')
            .map(|part| part.trim().parse().ok())
            .collect();
        match numbers.as_deref() {
            Some(&[azimuth, elevation, ref rest @ ..])
                if rest.len() < 2
                    && azimuth.is_finite()
                    && (-90.0..=90.0).contains(&elevation)
                    && rest
                        .iter()
                        .all(|strength| strength.is_finite() && *strength >= 0.0) =>
            {
                Ok(Self::At {
                    azimuth,
                    elevation,
                    strength: rest.first().copied().unwrap_or(1.0),
                })
            }
            _ => Err(format!(
                "`{text}` is neither none nor azimuth and elevation in degrees such as 120,45, perhaps with a strength"
            )),
        }
    }
}

/// Radiance from outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Sky {
    /// Darkness.
    None,
    /// An image by longitude and latitude: its top is up, its middle is where the camera looks by default.
    Image(Arc<Image>),
}

impl std::fmt::Display for Up {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = Self::ALL.iter().find(|(_, up)| up == self);
        f.write_str(name.map_or("y", |(name, _)| name))
    }
}

/// Choices for the stage. `None` and the default are the program's choices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Axis that points up.
    pub up: Up,
    /// Full angle of view over the shorter side, in degrees.
    pub fov: Option<f32>,
    /// The sun. Absent, a warm sun from behind the camera, unless there is an image of the sky.
    pub sun: Option<Sun>,
    /// The sky. Absent, a clear one above a dull ground.
    pub sky: Option<Sky>,
}

/// Parts of the stage that a file of meshes brings itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OwnStage {
    /// Whether the file has a camera.
    pub camera: bool,
    /// Whether the file has lights, surfaces that emit light apart.
    pub lights: bool,
}

/// A scene that shows one mesh without looks, as large as fits the picture, under sun and sky.
///
/// Vertices that are not finite are ignored. A mesh without finite vertices is framed like a cube of size 1 around
/// the origin.
pub fn scene_of_mesh(name: String, mesh: TriangleMesh, material: Material) -> Scene {
    let model = Model {
        shapes: vec![Shape::new(Geometry::Mesh(Arc::new(mesh)), 0)],
        materials: vec![material],
        ..Model::default()
    };
    scene_of_model(name, model).0
}

/// A scene that shows a model with its own camera and lights, or else on the default stage.
pub fn scene_of_model(name: String, model: Model) -> (Scene, OwnStage) {
    let own = OwnStage {
        camera: model.camera.is_some(),
        lights: !model.lights.is_empty(),
    };
    let mut film = Film::default();
    let camera = match model.camera {
        Some(View {
            camera,
            aspect_ratio,
        }) => {
            if let Some(aspect) = aspect_ratio {
                let width = (film.resolution[1] as f32 * aspect).round();
                film.resolution[0] = width.clamp(1.0, 8192.0) as u32;
            }
            camera
        }
        None => Camera::default(),
    };
    let mut scene = Scene {
        name,
        shapes: model.shapes,
        objects: model.objects,
        instances: model.instances,
        materials: model.materials,
        media: Vec::new(),
        lights: model.lights,
        camera,
        film,
        sampler: Sampler {
            kind: SamplerKind::ZeroTwoSequence,
            pixel_samples: 16,
        },
        integrator: Integrator::default(),
        accelerator: Default::default(),
        origin: Default::default(),
    };
    set_stage(&mut scene, own, &Stage::default());
    (scene, own)
}

/// Sets up the stage of a scene made from a model: the camera unless the file has its own, and sun and sky unless the file
/// has its own lights and nothing is requested.
pub fn set_stage(scene: &mut Scene, own: OwnStage, stage: &Stage) {
    let world_from_stage = stage.up.matrix();
    if !own.camera {
        let fov = stage.fov.unwrap_or(FOV);
        frame(scene, world_from_stage, fov);
    }
    if own.lights && stage.sun.is_none() && stage.sky.is_none() {
        return;
    }
    if !own.lights {
        scene.lights.clear();
    }
    let sun = match (stage.sun, &stage.sky) {
        (Some(sun), _) => sun,
        (None, Some(_)) => Sun::None,
        (None, None) => Sun::At {
            azimuth: SUN[0],
            elevation: SUN[1],
            strength: 1.0,
        },
    };
    if let Sun::At {
        azimuth,
        elevation,
        strength,
    } = sun
    {
        let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
        let flat = libm::cosf(elevation);
        let to_sun = Vec3::new(
            flat * libm::sinf(azimuth),
            libm::sinf(elevation),
            -flat * libm::cosf(azimuth),
        );
        scene.lights.push(Light::Distant {
            to_light: (world_from_stage * to_sun).normalize(),
            radiance: SUN_COLOR * strength,
        });
    }
    let image = match &stage.sky {
        Some(Sky::None) => return,
        Some(Sky::Image(image)) => Arc::clone(image),
        None => clear_sky::image(),
    };
    scene.lights.push(Light::Infinite {
        radiance: Rgb::ONE,
        environment: Some(Environment {
            mapping: EnvironmentMapping::LongitudeLatitude,
            image,
            // The middle column is where the camera looks. Columns to the right turn to the right.
            world_from_light: world_from_stage * Mat3::from_cols(Vec3::Z, Vec3::NEG_X, Vec3::Y),
        }),
        samples: 1,
    });
}

/// Place of a camera across its direction, at which opposite margins of the picture are equal.
///
/// Margins depend on the distance of the outermost vertices, and which ones these are depends on the place: it is found
/// step by step, exactly as soon as the vertices stay the same.
fn centred(
    scene: &Scene,
    sides: [Vec3; 2],
    forward: Vec3,
    depth: f32,
    start: [f32; 2],
) -> [f32; 2] {
    let mut at = start;
    for _ in 0..CENTRING_STEPS {
        // Slope, place and distance of the outermost vertices, right and left, above and below.
        let mut outer = [[[f32::NEG_INFINITY, 0.0, 1.0]; 2]; 2];
        for_each_point(scene, &mut |point| {
            if !point.is_finite() {
                return;
            }
            let z = point.dot(forward) - depth;
            for axis in 0..2 {
                let x = point.dot(sides[axis]);
                let slope = (x - at[axis]) / z;
                for (slope, outer) in [slope, -slope].into_iter().zip(&mut outer[axis]) {
                    if slope > outer[0] {
                        *outer = [slope, x, z];
                    }
                }
            }
        });
        let next = outer.map(|[[_, a, near], [_, b, far]]| (a * far + b * near) / (near + far));
        if next == at || !next.iter().all(|place| place.is_finite()) {
            break;
        }
        at = next;
    }
    at
}

/// Adds a wide matt plane just below the lowest point of a scene.
///
/// Cameras are to be framed before: the plane is far larger than the scene.
pub fn set_ground(scene: &mut Scene, up: Up) {
    let world_from_stage = up.matrix();
    let Some(extent) = Extent::of(scene) else {
        return;
    };
    let seen = |corner: DVec3| world_from_stage.transpose() * corner.as_vec3();
    let [one, other] = [extent.low, extent.high].map(seen);
    let (low, high) = (one.min(other), one.max(other));
    let size = (high - low).length();
    if !(size.is_finite() && size > 0.0) {
        return;
    }
    let middle = (low.midpoint(high)).with_y(low.y - GROUND_GAP * size);
    let side = GROUND_SIDE * size;
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    let corner = |(x, z)| world_from_stage * (middle + side * Vec3::new(x, 0.0, z));
    let mesh = TriangleMesh {
        positions: corners.map(|at| corner(at).into()).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let (geometry, material) = (Geometry::Mesh(Arc::new(mesh)), scene.materials.len());
    scene.shapes.push(Shape::new(geometry, material));
    scene.materials.push(Material::Matte(Matte {
        kd: Param::Constant(GROUND_COLOR),
        sigma: 0.0.into(),
    }));
}

/// Moves the camera so that all vertices just fit the picture.
fn frame(scene: &mut Scene, world_from_stage: Mat3, fov: f32) {
    let forward = (world_from_stage * -TO_CAMERA).normalize();
    let right = forward.cross(world_from_stage.y_axis).normalize();
    let up = right.cross(forward);
    let [width, height] = scene.film.resolution.map(|side| side as f32);
    let shorter = width.min(height);
    let slope = libm::tanf(0.5 * fov.to_radians()) * (1.0 - MARGIN);
    let slopes = [slope * width / shorter, slope * height / shorter];

    // A vertex at (x, y, z) along right, up and forward is inside if |x - eye.x| <= slope (z - eye.z).
    let mut sides = [[f32::NEG_INFINITY; 2]; 2];
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let mut add = |point: Vec3| {
        if !point.is_finite() {
            return;
        }
        (low, high) = (low.min(point), high.max(point));
        let z = point.dot(forward);
        for ((along, slope), side) in [right, up].into_iter().zip(slopes).zip(&mut sides) {
            let x = point.dot(along);
            side[0] = side[0].max(x - slope * z);
            side[1] = side[1].max(-x - slope * z);
        }
    };
    let mut found = false;
    for_each_point(scene, &mut |point| {
        found |= point.is_finite();
        add(point);
    });
    if !found {
        for corner in 0..8_u32 {
            let side = |axis: u32| ((corner >> axis) & 1) as f32 - 0.5;
            add(Vec3::new(side(0), side(1), side(2)));
        }
    }
    // Halved first: the difference of two large coordinates may overflow.
    let size = (0.5 * high - 0.5 * low).length();
    let [x, y] = [0, 1].map(|axis| 0.5 * sides[axis][0] - 0.5 * sides[axis][1]);
    let depth = |axis: usize| (-0.5 * sides[axis][0] - 0.5 * sides[axis][1]) / slopes[axis];
    let nearest = depth(0).min(depth(1));
    // A flat or single point would have the camera inside of it.
    let least = if size > 0.0 { 1e-3 * size } else { 1.0 };
    let depth = nearest - least;
    let [x, y] = centred(scene, [right, up], forward, depth, [x, y]);
    let eye = right * x + up * y + forward * depth;
    let eye = if eye.is_finite() { eye } else { Vec3::ZERO };
    scene.camera = Camera {
        world_from_camera: Mat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            forward.extend(0.0),
            eye.extend(1.0),
        ),
        fov,
        ..Camera::default()
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: Vec<[f32; 3]>) -> Scene {
        let mesh = TriangleMesh {
            indices: (0..positions.len() as u32)
                .map(|vertex| [vertex; 3])
                .collect(),
            positions,
            ..Default::default()
        };
        scene_of_mesh("mesh".into(), mesh, antumbra_mesh::plain_material())
    }

    /// Largest of |x| and |y| of the vertices on the screen, where 1 is the border of the picture.
    fn extents(scene: &Scene, positions: &[[f32; 3]]) -> [f32; 2] {
        let camera_from_world = scene.camera.world_from_camera.inverse();
        let slope = (0.5 * scene.camera.fov).to_radians().tan();
        let [width, height] = scene.film.resolution.map(|side| side as f32);
        let shorter = width.min(height);
        let mut most = [0.0_f32; 2];
        for point in positions {
            let seen = camera_from_world.transform_point3(Vec3::from(*point));
            assert!(seen.z > 0.0);
            most[0] = most[0].max(seen.x.abs() / (seen.z * slope * width / shorter));
            most[1] = most[1].max(seen.y.abs() / (seen.z * slope * height / shorter));
        }
        most
    }

    #[test]
    fn every_vertex_is_in_view_and_the_picture_is_filled() {
        for scale in [1e-3, 1.0, 1e6] {
            for (up, resolution) in [
                (Up::Y, [1280, 720]),
                (Up::Z, [300, 900]),
                (Up::MinusX, [64, 64]),
            ] {
                let corner = |i: u32| {
                    std::array::from_fn(|axis| {
                        scale * (((i >> axis) & 1) as f32 * (1 + axis) as f32 + 7.0)
                    })
                };
                let mut positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
                positions.push([f32::NAN, 0.0, f32::INFINITY]);
                let mut scene = mesh(positions.clone());
                scene.film.resolution = resolution;
                let stage = Stage {
                    up,
                    ..Stage::default()
                };
                set_stage(&mut scene, OwnStage::default(), &stage);
                let [x, y] = extents(&scene, &positions[..8]);
                let most = x.max(y);
                assert!(
                    (0.9..=0.96).contains(&most),
                    "{up:?} {resolution:?}: {x} {y}"
                );
            }
        }
    }

    /// A flat mesh is far wider than high in the picture, and its near edge looks lower than its far edge looks high.
    #[test]
    fn flat_meshes_are_in_the_middle_of_the_picture() {
        let corners = [(0.0, 0.0), (0.0, 8.0), (5.0, 8.0), (5.0, 0.0), (2.0, 3.0)];
        let positions = corners.map(|(x, z)| [x, 0.1 * x, z]).to_vec();
        let scene = mesh(positions.clone());
        let camera_from_world = scene.camera.world_from_camera.inverse();
        let mut edges = [[f32::INFINITY, f32::NEG_INFINITY]; 2];
        for point in positions {
            let seen = camera_from_world.transform_point3(Vec3::from(point));
            for (axis, edges) in edges.iter_mut().enumerate() {
                let slope = seen[axis] / seen.z;
                *edges = [edges[0].min(slope), edges[1].max(slope)];
            }
        }
        for [low, high] in edges {
            assert!((low + high).abs() < 1e-4, "{edges:?}");
        }
    }

    #[test]
    fn meshes_without_size_have_a_camera_too() {
        for positions in [vec![], vec![[1.0; 3]], vec![[f32::NAN; 3]]] {
            let camera = mesh(positions).camera;
            assert!(camera.world_from_camera.is_finite());
        }
    }

    #[test]
    fn the_ground_is_just_below_the_model() {
        for (name, up) in Up::ALL {
            let mut scene = mesh(vec![[1.0, 2.0, 3.0], [2.0, 4.0, 7.0], [f32::NAN; 3]]);
            let (before, upwards) = (scene.camera.clone(), up.matrix().y_axis);
            let lowest = upwards
                .dot(Vec3::new(1.0, 2.0, 3.0))
                .min(upwards.dot(Vec3::new(2.0, 4.0, 7.0)));
            set_ground(&mut scene, up);
            assert_eq!(scene.camera, before);
            let Geometry::Mesh(ground) = &scene.shapes[1].geometry else {
                panic!("no mesh");
            };
            for corner in &ground.positions {
                let gap = lowest - Vec3::from(*corner).dot(upwards);
                assert!((1e-4..1e-3).contains(&gap), "{name}: {gap}");
            }
            let [a, b, c] = [0, 1, 2].map(|i| Vec3::from(ground.positions[i]));
            assert!(
                (b - a).cross(c - a).normalize().dot(upwards) > 0.999,
                "{name}"
            );
            assert!((c - a).length() > 100.0);
        }
        let mut scene = mesh(vec![[f32::NAN; 3]]);
        set_ground(&mut scene, Up::Y);
        assert_eq!(scene.shapes.len(), 1);
    }

    #[test]
    fn names_of_axes_and_suns() {
        for (name, up) in Up::ALL {
            assert_eq!(name.parse(), Ok(up));
            let matrix = up.matrix();
            assert!((matrix.determinant() - 1.0).abs() < 1e-6, "{name}");
        }
        assert_eq!("+Z".parse(), Ok(Up::Z));
        assert!("w".parse::<Up>().is_err());
        assert_eq!("none".parse(), Ok(Sun::None));
        for (text, strength) in [("90,30", 1.0), ("90, 30, 2", 2.0)] {
            let sun = Sun::At {
                azimuth: 90.0,
                elevation: 30.0,
                strength,
            };
            assert_eq!(text.parse(), Ok(sun));
        }
        for bad in ["", "90", "90,91", "a,b", "1,2,3,4", "1,2,-1"] {
            assert!(bad.parse::<Sun>().is_err(), "{bad}");
        }
    }

    /// The sun of the default stage has not moved, and a sun at azimuth 90 is on the right.
    #[test]
    fn suns_and_skies_follow_the_stage() {
        let of = |up, sun: Sun| {
            let mut scene = mesh(vec![[0.0; 3], [1.0; 3]]);
            let stage = Stage {
                up,
                sun: Some(sun),
                ..Stage::default()
            };
            set_stage(&mut scene, OwnStage::default(), &stage);
            match scene.lights[0] {
                Light::Distant { to_light, .. } => to_light,
                _ => panic!("no sun"),
            }
        };
        let low = |azimuth| Sun::At {
            azimuth,
            elevation: 0.0,
            strength: 1.0,
        };
        assert!((of(Up::Y, low(90.0)) - Vec3::X).length() < 1e-6);
        assert!((of(Up::Y, low(180.0)) - Vec3::Z).length() < 1e-6);
        assert!((of(Up::Z, low(180.0)) - Vec3::NEG_Y).length() < 1e-6);
        let Light::Distant { to_light, .. } = mesh(vec![[0.0; 3]]).lights[0] else {
            panic!("no sun");
        };
        assert!((to_light - Vec3::new(0.75, 1.0, 0.45).normalize()).length() < 0.02);
    }
}
