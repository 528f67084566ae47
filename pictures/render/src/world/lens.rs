//! Rays through a system of spherical lenses, as pbrt-v3's camera `realistic` traces them (Kolb, Mitchell and Hanrahan 1995).
//!
//! Lengths are in metres. The film is in the plane z = 0, and the scene is on the side of positive z, as in the space of other
//! cameras. Elements are numbered from the scene to the film. Rays of a film point are sent to the part of the rear element
//! through which light can pass, the exit pupil. Its bounds are computed once, for rings of the film.

use antumbra_scene::{Film, LensSystem};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::Error;

/// Metres of a millimetre.
const MILLIMETRE: f64 = 1e-3;
/// Rings of the film that have bounds of the exit pupil.
const RINGS: usize = 64;
/// Points along a side of the area that is searched for the exit pupil, first and at last.
const COARSE: i32 = 128;
const FINE: i32 = 1024;

#[derive(Clone, Copy, Debug)]
struct Element {
    /// Radius of curvature, positive if the surface bulges towards the scene. 0 is the stop.
    radius: f64,
    /// Distance to the next element towards the film.
    thickness: f64,
    /// Index of refraction behind the element.
    eta: f64,
    /// Half of the opening.
    aperture: f64,
}

/// Half line.
#[derive(Clone, Copy, Debug)]
pub struct HalfLine {
    pub org: DVec3,
    pub dir: DVec3,
}

impl HalfLine {
    fn at(&self, t: f64) -> DVec3 {
        self.org + self.dir * t
    }
}

/// A ray that leaves the lens, and its weight.
#[derive(Clone, Copy, Debug)]
pub struct Leaving {
    pub ray: HalfLine,
    pub weight: f32,
}

/// Lens system in focus, with the film behind it.
#[derive(Clone, Debug)]
pub struct Lens {
    elements: Vec<Element>,
    /// Half of the film's diagonal.
    reach: f64,
    /// Width and height of the film.
    film: DVec2,
    /// Bounds of the exit pupil, of film points on the positive x axis.
    pupils: Vec<[DVec2; 2]>,
    /// Time of exposure, or `None` for weights relative to the middle of the film.
    exposure: Option<f64>,
}

impl Lens {
    /// Focuses a system, and finds its exit pupils.
    ///
    /// # Errors
    /// [`Error::Lens`] if numbers are out of range, no light passes, or the distance is too short.
    pub fn new(system: &LensSystem, film: &Film) -> Result<Self, Error> {
        let error = |reason: &str| Error::Lens {
            reason: reason.to_owned(),
        };
        let elements = system.elements.iter().map(|element| Element {
            radius: f64::from(element.radius) * MILLIMETRE,
            thickness: f64::from(element.thickness) * MILLIMETRE,
            eta: match element.eta {
                0.0 => 1.0,
                eta => eta.into(),
            },
            aperture: 0.5 * f64::from(element.diameter) * MILLIMETRE,
        });
        let elements: Vec<Element> = elements.collect();
        let is_sound = |one: &Element| {
            let all = [one.radius, one.thickness, one.eta, one.aperture];
            all.iter().all(|number| number.is_finite()) && one.eta > 0.0 && one.aperture > 0.0
        };
        if elements.is_empty() || !elements.iter().all(is_sound) {
            return Err(error("it has no elements, or one without an opening"));
        }
        let diagonal = f64::from(system.film_diagonal) * MILLIMETRE;
        let distance = f64::from(system.focus_distance);
        if !(diagonal > 0.0 && diagonal.is_finite() && distance.is_finite()) {
            return Err(error(
                "the diagonal of the film or the distance is out of range",
            ));
        }
        let [width, height] = film.resolution.map(f64::from);
        let mut lens = Self {
            elements,
            reach: 0.5 * diagonal,
            film: DVec2::new(width, height).normalize() * diagonal,
            pupils: Vec::new(),
            exposure: system.exposure.map(f64::from),
        };
        let shift = lens
            .shift_for(distance, MILLIMETRE * diagonal)
            .map_err(error)?;
        let last = lens.elements.len() - 1;
        lens.elements[last].thickness += shift;
        if !(lens.elements[last].thickness > 0.0) {
            return Err(error("the film would be in front of the rear element"));
        }
        let ring = |index: usize| index as f64 / RINGS as f64 * lens.reach;
        let rings = (0..RINGS).into_par_iter();
        lens.pupils = rings
            .map(|index| lens.pupil([ring(index), ring(index + 1)]))
            .collect();
        Ok(lens)
    }

    fn rear(&self) -> &Element {
        &self.elements[self.elements.len() - 1]
    }

    fn rear_z(&self) -> f64 {
        self.rear().thickness
    }

    fn front_z(&self) -> f64 {
        self.elements.iter().map(|element| element.thickness).sum()
    }

    /// Index of refraction on the side of the scene of an element.
    fn eta_before(&self, index: usize) -> f64 {
        match index {
            0 => 1.0,
            index => self.elements[index - 1].eta,
        }
    }

    /// Traces light from the film to the scene. `None`: it is blocked.
    fn to_scene(&self, mut ray: HalfLine) -> Option<HalfLine> {
        let mut z = 0.0;
        for (index, element) in self.elements.iter().enumerate().rev() {
            z += element.thickness;
            ray = pass(element, z, ray, element.eta / self.eta_before(index))?;
        }
        Some(ray)
    }

    /// Traces light from the scene to the film. `None`: it is blocked.
    fn to_film(&self, mut ray: HalfLine) -> Option<HalfLine> {
        let mut z = self.front_z();
        for (index, element) in self.elements.iter().enumerate() {
            ray = pass(element, z, ray, self.eta_before(index) / element.eta)?;
            z -= element.thickness;
        }
        Some(ray)
    }

    /// Change of the distance to the film that focuses at `distance` from the film, by the approximation of a thick lens.
    /// `height` is the distance of the rays from the axis that measure the lens.
    fn shift_for(&self, distance: f64, height: f64) -> Result<f64, &'static str> {
        const BLOCKED: &str = "no light passes near its axis; its aperture may be too small";
        // Principal plane and focal point of light parallel to the axis.
        let cardinal = |entering: HalfLine, leaving: HalfLine| {
            let reaching = |x: f64| leaving.at((x - leaving.org.x) / leaving.dir.x).z;
            [reaching(entering.org.x), reaching(0.0)]
        };
        let parallel = |z: f64, dir: DVec3| HalfLine {
            org: DVec3::new(height, 0.0, z),
            dir,
        };
        let inward = parallel(self.front_z() + 1.0, -DVec3::Z);
        let [plane, focus] = cardinal(inward, self.to_film(inward).ok_or(BLOCKED)?);
        let outward = parallel(self.rear_z() - 1.0, DVec3::Z);
        let [front, _] = cardinal(outward, self.to_scene(outward).ok_or(BLOCKED)?);
        let focal_length = plane - focus;
        if !focal_length.is_finite() {
            return Err("it does not focus light");
        }
        // Object and image are both measured from their principal planes: 1 / f = 1 / object + 1 / image.
        let gap = distance - front + plane;
        let square = gap * (gap - 4.0 * focal_length);
        if !(square > 0.0) {
            return Err("the focus distance is too short");
        }
        Ok(0.5 * (distance - front - plane - square.sqrt()))
    }

    /// Bounds of the points of the rear plane through which light of a part of the film's x axis passes.
    ///
    /// The part is symmetric about y = 0. The search begins coarsely and continues at the edges.
    fn pupil(&self, [start, end]: [f64; 2]) -> [DVec2; 2] {
        let reach = 1.5 * self.rear().aperture;
        let points = [start, 0.5 * (start + end), end];
        let passes = |x: f64, y: f64| {
            points.iter().any(|&film| {
                let org = DVec3::new(film, 0.0, 0.0);
                let dir = DVec3::new(x, y, self.rear_z()) - org;
                self.to_scene(HalfLine { org, dir }).is_some()
            })
        };
        let mut low = DVec2::splat(f64::INFINITY);
        let mut high = DVec2::splat(f64::NEG_INFINITY);
        let coarse = 2.0 * reach / f64::from(COARSE);
        for column in 0..COARSE {
            let x = (f64::from(column) + 0.5) * coarse - reach;
            for row in 0..COARSE / 2 {
                let y = (f64::from(row) + 0.5) * coarse;
                if passes(x, y) {
                    low = low.min(DVec2::new(x, -y));
                    high = high.max(DVec2::new(x, y));
                }
            }
        }
        if low.x > high.x {
            return [DVec2::splat(-reach), DVec2::splat(reach)];
        }
        let fine = 2.0 * reach / f64::from(FINE);
        let steps = |from: f64, to: f64| {
            let count = ((to - from) / fine).ceil().max(0.0) as i32;
            (0..=count).map(move |step| from + f64::from(step) * fine)
        };
        let top = high.y + coarse;
        while high.x < reach && steps(0.0, top).any(|y| passes(high.x + fine, y)) {
            high.x += fine;
        }
        while low.x > -reach && steps(0.0, top).any(|y| passes(low.x - fine, y)) {
            low.x -= fine;
        }
        while high.y < reach && steps(low.x, high.x).any(|x| passes(x, high.y + fine)) {
            high.y += fine;
        }
        // Room for what the search missed, as pbrt-v3 leaves it.
        let room = DVec2::splat(2.0 * DVec2::splat(2.0 * reach).length() / f64::from(FINE));
        [DVec2::new(low.x, -high.y) - room, high + room]
    }

    /// Place on the film of a point in shares of its width and height from the top left corner. The picture is upside down.
    fn place(&self, share: [f64; 2]) -> DVec2 {
        DVec2::new(0.5 - share[0], share[1] - 0.5) * self.film
    }

    /// Ray of a film point, in shares of its sides, through a point of its exit pupil that `lens` in `[0, 1)²` chooses. `None`:
    /// the lens blocks it.
    pub fn leaving(&self, share: [f64; 2], lens: [f32; 2]) -> Option<Leaving> {
        let place = self.place(share);
        let distance = place.length();
        let ring = (distance / self.reach * RINGS as f64) as usize;
        let [low, high] = self.pupils[ring.min(RINGS - 1)];
        let lens = DVec2::from(lens.map(f64::from));
        let across = low + (high - low) * lens;
        let turn = match distance > 0.0 {
            true => place / distance,
            false => DVec2::X,
        };
        let toward = turn.rotate(across).extend(self.rear_z());
        let org = place.extend(0.0);
        let dir = toward - org;
        let ray = self.to_scene(HalfLine { org, dir })?;
        let area = |[low, high]: [DVec2; 2]| (high - low).element_product();
        let cos4 = dir.normalize().z.powi(4);
        let weight = match self.exposure {
            None => cos4 * area([low, high]) / area(self.pupils[0]),
            Some(time) => time * cos4 * area([low, high]) / (self.rear_z() * self.rear_z()),
        };
        Some(Leaving {
            ray,
            weight: weight as f32,
        })
    }

    /// Rays of film points further by these shares of the sides, through the same point of the rear plane. The film point is
    /// found by tracing a ray backward. `None`: the lens blocks one of them.
    pub fn neighbour(&self, ray: HalfLine, further: [f64; 2]) -> Option<HalfLine> {
        let back = HalfLine {
            // A little outside, so that rounding hides no element.
            org: ray.org + ray.dir * self.front_z(),
            dir: -ray.dir,
        };
        let film = self.to_film(back)?;
        let place = film.at(-film.org.z / film.dir.z);
        let rear = film.at((self.rear_z() - film.org.z) / film.dir.z);
        let moved = place.truncate() + DVec2::new(-further[0], further[1]) * self.film;
        let org = moved.extend(0.0);
        let dir = rear - org;
        self.to_scene(HalfLine { org, dir })
    }
}

/// Ray behind an element, whose vertex is at z. `ratio` is the index on the side of the ray over the index on the other side.
/// `None`: the ray misses the opening, or is reflected totally.
fn pass(element: &Element, z: f64, ray: HalfLine, ratio: f64) -> Option<HalfLine> {
    if element.radius == 0.0 {
        let t = (z - ray.org.z) / ray.dir.z;
        if !(t >= 0.0) {
            return None;
        }
        let org = ray.at(t);
        let opens = org.truncate().length_squared() <= element.aperture * element.aperture;
        return opens.then_some(HalfLine { org, ..ray });
    }
    let radius = element.radius;
    // The centre is behind the vertex, towards the film, where the radius is positive.
    let from = ray.org - DVec3::Z * (z - radius);
    let dir = ray.dir.normalize();
    let half = from.dot(dir);
    let discriminant = half * half - (from.length_squared() - radius * radius);
    if !(discriminant >= 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    // Towards the scene, a surface that bulges there is hit from inside.
    let is_near = (dir.z < 0.0) == (radius > 0.0);
    let t = if is_near { -half - root } else { -half + root };
    if t < 0.0 {
        return None;
    }
    let on_sphere = from + dir * t;
    if on_sphere.truncate().length_squared() > element.aperture * element.aperture {
        return None;
    }
    let normal = on_sphere / radius.abs();
    let normal = if normal.dot(dir) > 0.0 {
        -normal
    } else {
        normal
    };
    let cos = -normal.dot(dir);
    let sin2 = ratio * ratio * (1.0 - cos * cos).max(0.0);
    if sin2 >= 1.0 {
        return None;
    }
    Some(HalfLine {
        org: ray.org + dir * t,
        dir: dir * ratio + normal * (ratio * cos - (1.0 - sin2).sqrt()),
    })
}

#[cfg(test)]
mod tests;
