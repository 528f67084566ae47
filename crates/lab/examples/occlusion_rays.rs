//! Triangles and occlusion rays of scenes as plain files, for programs in other languages.
//!
//! `occlusion_rays SEED COUNT FOLDER SCENE...` writes, for each scene, `NAME.triangles` (9 floats each) and
//! `NAME.KIND.GROUP.rays` (8 floats each: origin, tnear, direction, tfar), in native byte order. KIND is `shadow`, `ao`
//! or `sun`; GROUP is `training` or `held-out`. No group shares a sample with another. Sun rays start where ambient
//! occlusion rays do, and point to a sun on an arc from east to west, which moves by half an hour for every 64 rays.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use antumbra::{Geometry, Isa, Ray, Width};
use antumbra_lab::{Lot, SampledRays};
use antumbra_load::{Options, load};
use antumbra_render::{Lowered, World};

/// Training rays of each kind.
const TRAINING: usize = 16_384;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "occlusion_rays SEED COUNT FOLDER SCENE...";
    let mut next = || arguments.next().ok_or(usage);
    let (seed, count): (u64, usize) = (next()?.parse()?, next()?.parse()?);
    let folder = PathBuf::from(next()?);
    fs::create_dir_all(&folder)?;
    for name in arguments {
        let scene = load(Path::new(&name), &Options::default())?.scene;
        if !scene.instances.is_empty() {
            return Err(format!("{name} has instances, which are no triangles").into());
        }
        let lowered = Lowered::new(&scene);
        let mut triangles = Vec::new();
        for geometry in &lowered.world {
            if let Geometry::Triangles(mesh) = geometry {
                let corners = mesh.indices.iter().flatten();
                triangles.extend(corners.flat_map(|corner| mesh.positions[*corner as usize]));
            }
        }
        let file = |ending: &str| folder.join(format!("{}.{ending}", scene.name));
        write(&file("triangles"), &triangles)?;
        let world = World::new(&scene)?;
        let isa = Isa::best();
        let bvh = world.bvh(Width::auto(isa.level()), isa);
        // As many samples as are needed for all rays, whatever the scene asks for.
        let mut samples = SampledRays::new(&world, &bvh, 16, seed);
        let training = samples.take(TRAINING, TRAINING);
        let held_out = samples.take_in_picture_order(count, count);
        for (group, rays) in [("training", training), ("held-out", held_out)] {
            let Lot { shadow, ambient, .. } = rays;
            let sun: Vec<Ray> = (ambient.iter().zip(0..)).map(|(ray, place)| to_sun(ray, place)).collect();
            for (kind, rays) in [("shadow", shadow), ("ao", ambient), ("sun", sun)] {
                let floats: Vec<f32> = rays.iter().flat_map(floats).collect();
                write(&file(&format!("{kind}.{group}.rays")), &floats)?;
            }
        }
    }
    Ok(())
}

fn to_sun(ray: &Ray, place: usize) -> Ray {
    let hour = (place / 64 % 24) as f32 / 24.0;
    let angle = (0.05 + 0.9 * hour) * std::f32::consts::PI;
    let dir = [angle.cos(), angle.sin(), 0.3];
    // On the side of the surface that ambient occlusion rays leave.
    Ray { dir, ..*ray }
}

fn floats(ray: &Ray) -> [f32; 8] {
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.org, ray.dir);
    [ox, oy, oz, ray.tnear, dx, dy, dz, ray.tfar]
}

fn write(path: &Path, floats: &[f32]) -> std::io::Result<()> {
    let bytes: Vec<u8> = floats.iter().flat_map(|float| float.to_ne_bytes()).collect();
    fs::write(path, bytes)
}
