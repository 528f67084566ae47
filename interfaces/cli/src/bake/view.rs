//! Points that a camera sees, some in each pixel.

use antumbra_image::{Image, Window};
use antumbra_render::Camera;

use super::ground::Ground;
use crate::exit::Failure;

/// Points of the scene that the pixels of a picture show.
pub struct View {
    /// Size of the full picture.
    size: [usize; 2],
    /// Pixels that are wanted.
    window: Window,
    pub points: Vec<[f32; 3]>,
    /// Turned towards the camera.
    pub normals: Vec<[f32; 3]>,
    /// Pixel of each point.
    pixels: Vec<u32>,
}

impl View {
    /// Points of a pixel, in two rows of two.
    pub const POINTS: usize = 4;

    /// The view from the camera of the scene.
    pub fn new(ground: &Ground) -> Result<Self, Failure> {
        let scene = &ground.loaded.scene;
        let camera = Camera::new(&scene.camera, &scene.film)
            .map_err(|error| Failure::scene(&scene.name, error))?;
        let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(|edge| edge as i32);
        let window = Window { x0, y0, x1, y1 };
        let mut view = Self {
            size: scene.film.resolution.map(|size| size as usize),
            window,
            points: Vec::new(),
            normals: Vec::new(),
            pixels: Vec::new(),
        };
        for y in window.y0..window.y1 {
            let samples = (window.x0..window.x1).flat_map(|x| {
                [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
                    .map(|(dx, dy)| (x, [x as f32 + dx, y as f32 + dy]))
            });
            let (columns, rays): (Vec<i32>, Vec<_>) = samples
                .map(|(x, film)| (x, camera.ray(film, [0.5; 2])))
                .unzip();
            let hits = ground.bvh.batch(&rays).intersect();
            for ((ray, hit), x) in rays.iter().zip(&hits).zip(columns) {
                let Some(hit) = hit else { continue };
                let Some(normal) = ground.bvh.normal(ray, hit) else {
                    continue;
                };
                let along: f32 = normal.iter().zip(ray.dir).map(|(a, b)| a * b).sum();
                let sign = if along > 0.0 { -1.0 } else { 1.0 };
                view.points.push(ray.at(hit.t));
                view.normals.push(normal.map(|x| sign * x));
                let (row, column) = ((y - window.y0) as usize, (x - window.x0) as usize);
                view.pixels.push((row * window.width() + column) as u32);
            }
        }
        if view.points.is_empty() {
            return Err(Failure::scene(&scene.name, "the camera sees no surface"));
        }
        Ok(view)
    }

    /// Means of values, or of directions if there are any. What shows no surface is black, as in renderings.
    pub fn picture(&self, values: &[f32], directions: &[[f32; 3]]) -> Result<Image, Failure> {
        let mut sums = vec![[0.0; 3]; self.window.area()];
        for (index, &pixel) in self.pixels.iter().enumerate() {
            let value = directions.get(index).copied().unwrap_or([values[index]; 3]);
            if value.iter().all(|x| x.is_finite()) {
                let sum = &mut sums[pixel as usize];
                *sum = [0, 1, 2].map(|axis| sum[axis] + value[axis]);
            }
        }
        let points = Self::POINTS as f32;
        let pixels = sums
            .into_iter()
            .map(|sum| sum.map(|x| x / points))
            .collect();
        let [width, height] = self.size;
        Ok(Image::new(width, height, self.window, pixels)?)
    }
}
