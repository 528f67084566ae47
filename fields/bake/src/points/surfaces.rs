//! Kinds of surfaces as people name them, which way they face, and which of their places are covered.

use antumbra::{Bvh, Hit, Ray};
use rayon::prelude::*;

use crate::vector::{above, dot, unit};
use crate::{Bodies, Mesh, Orientation, SkyDivision};

/// Kind of a surface, by its slope and by what it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Surface {
    /// Faces up, within 60 degrees, and belongs to a building: a closed body, or an open one that ends with its walls, as a
    /// house without a floor does. A sheet that hangs above something else is a roof, too.
    Roof,
    /// Faces up, within 60 degrees, and belongs to no building: terrain and streets.
    Ground,
    /// Faces sideways: more than 60 degrees from up and from down.
    Facade,
    /// Faces down, within 60 degrees.
    Underside,
    /// A place of any surface inside of a body, or close below another surface: see [`Surfaces::covered`].
    Covered,
}

impl Surface {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::Roof,
        Self::Ground,
        Self::Facade,
        Self::Underside,
        Self::Covered,
    ];

    /// Name in tables and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Roof => "roof",
            Self::Ground => "ground",
            Self::Facade => "facade",
            Self::Underside => "underside",
            Self::Covered => "covered",
        }
    }
}

/// Cosine of 60 degrees.
const STEEP: f64 = 0.5;

/// Most triangles of a body at which it is decided which way the body faces, and what is below it.
const SAMPLES: usize = 16;

/// The side of an open surface that sees more sky is the front if it sees so many times as much as the other one. A free
/// wall sees about the same from both sides, and keeps its own.
const MORE_SKY: f64 = 1.5;

/// A sheet above another one is a roof only if the other one is so many times as large: terrain is measured in layers, too.
const LAYERS: f64 = 2.0;

/// Number of the triangle in a mesh that a tree knows by its geometry and its number there; `None` for what is no triangle.
pub type Flat<'a> = &'a (dyn Fn([u32; 2]) -> Option<u32> + Sync);

/// Which way the surfaces of a mesh face, and of which kind they are.
pub struct Surfaces {
    /// Kind of each triangle, `[m]`. Never [`Surface::Covered`], which is a matter of places.
    pub kinds: Vec<Surface>,
    /// Number of closed bodies that were turned, at least in part.
    pub turned: usize,
    /// Number of open bodies that were turned to the sky.
    pub faced: usize,
    up: [f64; 3],
    /// 577 directions to the sky.
    sky: Vec<[f64; 3]>,
}

impl Surfaces {
    /// Turns the triangles of a mesh to face as they should, and finds their kinds. `bvh` is the tree of the scene, of which
    /// `flat` says what triangles of the mesh are; `objects` has the number of the object of each triangle.
    ///
    /// Closed bodies face outwards, as [`Mesh::orient`] turns them. Open ones face to the side that sees more sky, by rays from
    /// some of their triangles to 36 directions, if it sees at least half as much again as the other side.
    pub fn new(
        mesh: &mut Mesh,
        objects: &[u32],
        (bvh, flat): (&Bvh, Flat<'_>),
        orientation: &Orientation,
    ) -> Self {
        let bodies = mesh.orient(objects);
        let mut surfaces = Self::empty(orientation);
        let members = Members::new(&bodies);
        let hidden: Vec<bool> = (0..bodies.is_closed.len())
            .into_par_iter()
            .map(|body| {
                !bodies.is_closed[body] && surfaces.sees_from_behind(bvh, mesh, members.of(body))
            })
            .collect();
        let of_triangle = bodies.of_triangle.iter();
        let is_hidden: Vec<bool> = of_triangle.map(|&body| hidden[body as usize]).collect();
        mesh.turn(&is_hidden);
        surfaces.turned = bodies.turned;
        surfaces.faced = hidden.iter().filter(|&&is_hidden| is_hidden).count();
        surfaces.find_kinds((bvh, flat), mesh, &bodies, &members);
        surfaces
    }

    /// Kinds of the triangles as they are wound: of rooms that are seen from inside, for example.
    pub fn as_wound(
        mesh: &Mesh,
        objects: &[u32],
        tree: (&Bvh, Flat<'_>),
        orientation: &Orientation,
    ) -> Self {
        let bodies = mesh.clone().orient(objects);
        let mut surfaces = Self::empty(orientation);
        surfaces.find_kinds(tree, mesh, &bodies, &Members::new(&bodies));
        surfaces
    }

    fn empty(orientation: &Orientation) -> Self {
        let sky = SkyDivision::Reinhart(2).patches();
        let sky = sky.map(|patches| patches.directions(orientation));
        let sky = sky.unwrap_or_default().into_iter();
        Self {
            kinds: Vec::new(),
            turned: 0,
            faced: 0,
            up: orientation.up,
            sky: sky.map(|direction| direction.map(f64::from)).collect(),
        }
    }

    /// Kind of a triangle by its slope, where roofs are ground as well.
    fn slope(&self, mesh: &Mesh, corners: [u32; 3]) -> Surface {
        let steepness = unit(mesh.twice_of(corners)).map_or(0.0, |normal| dot(normal, self.up));
        match steepness {
            _ if steepness.abs() < STEEP => Surface::Facade,
            _ if steepness < 0.0 => Surface::Underside,
            _ => Surface::Ground,
        }
    }

    /// Whether the back of an open body sees more sky than its front.
    fn sees_from_behind(&self, bvh: &Bvh, mesh: &Mesh, triangles: &[u32]) -> bool {
        let mut seen = [0_u32; 2];
        for (point, normal) in samples(mesh, triangles) {
            let starts = [1.0, -1.0].map(|side| start(bvh, point, normal.map(|x| x * side)));
            // The zenith is the last direction.
            for direction in self.sky.iter().rev().step_by(16) {
                let cosine = dot(*direction, normal);
                let side = usize::from(cosine < 0.0);
                seen[side] += u32::from(!bvh.occluded(&ray(starts[side], *direction)));
            }
        }
        f64::from(seen[1]) > MORE_SKY * f64::from(seen[0])
    }

    /// Finds the kinds by slopes, and makes roofs of what faces up and belongs to a building.
    fn find_kinds(
        &mut self,
        (bvh, flat): (&Bvh, Flat<'_>),
        mesh: &Mesh,
        bodies: &Bodies,
        members: &Members,
    ) {
        let corners = mesh.indices.iter();
        self.kinds = corners.map(|&corners| self.slope(mesh, corners)).collect();
        let count = bodies.is_closed.len();
        // Edges where the body ends, at walls and elsewhere; and its area seen from above.
        let (mut rims, mut areas) = (vec![[0_u32; 2]; count], vec![0.0; count]);
        for (triangle, &body) in bodies.of_triangle.iter().enumerate() {
            let is_wall = self.kinds[triangle] == Surface::Facade;
            rims[body as usize][usize::from(is_wall)] += u32::from(bodies.rims[triangle]);
            if self.kinds[triangle] == Surface::Ground {
                areas[body as usize] += dot(mesh.twice(triangle as u32), self.up);
            }
        }
        let is_sheet = |body: usize| !bodies.is_closed[body] && rims[body][1] < rims[body][0];
        let is_roof: Vec<bool> = (0..count)
            .into_par_iter()
            .map(|body| {
                if !is_sheet(body) {
                    return true;
                }
                let is_up = |triangle: &&u32| self.kinds[**triangle as usize] == Surface::Ground;
                let triangles: Vec<u32> = members.of(body).iter().filter(is_up).copied().collect();
                let places = samples(mesh, &triangles);
                let is_above = |(point, normal): &&([f64; 3], [f64; 3])| {
                    let start = start(bvh, *point, normal.map(|x| -x));
                    let ray = ray(start, self.up.map(|x| -x));
                    let Some(hit) = bvh.intersect(&ray) else {
                        return false;
                    };
                    let triangle = flat([hit.geom_id, hit.prim_id]);
                    triangle.is_none_or(|triangle| {
                        let below = bodies.of_triangle[triangle as usize] as usize;
                        let is_layer = is_sheet(below) && areas[below] < LAYERS * areas[body];
                        match below == body {
                            true => self.kinds[triangle as usize] == Surface::Underside,
                            false => !is_layer,
                        }
                    })
                };
                2 * places.iter().filter(is_above).count() > places.len()
            })
            .collect();
        for (kind, &body) in self.kinds.iter_mut().zip(&bodies.of_triangle) {
            if *kind == Surface::Ground && is_roof[body as usize] {
                *kind = Surface::Roof;
            }
        }
    }

    /// Which places of a mesh's triangles are covered: places on its surface, with the triangle that they are on.
    ///
    /// A place is covered if none of 577 directions to the sky is open, and if
    /// - the first surface above or in front is nearer than `distance`, such as the floor of a house on the terrain, or the next house; or
    /// - more than half of what it sees are backs of surfaces, as inside of a house, whether that is closed or has gaps that no
    ///   ray finds.
    ///
    /// Places below bridges, in arcades and under trees see fronts, and are only shaded. What faces down looks down instead of
    /// up in all of this.
    pub fn covered(
        &self,
        (bvh, flat): (&Bvh, Flat<'_>),
        mesh: &Mesh,
        places: &[([f64; 3], u32)],
        distance: f64,
    ) -> Vec<bool> {
        let is_covered = |&(point, triangle): &([f64; 3], u32)| {
            let Some(normal) = mesh.front(triangle) else {
                return false;
            };
            let is_down = self.kinds[triangle as usize] == Surface::Underside;
            let sign = if is_down { -1.0 } else { 1.0 };
            let start = start(bvh, point, normal);
            let above = |direction: [f64; 3]| ray(start, direction);
            let sky = self
                .sky
                .iter()
                .map(|direction| direction.map(|x| sign * x))
                .filter(|direction| dot(*direction, normal) > 0.0)
                .map(above);
            let is_near = |direction: [f64; 3]| {
                let hit = bvh.intersect(&above(direction));
                hit.is_some_and(|hit| f64::from(hit.t) < distance)
            };
            let up = self.up.map(|x| sign * x);
            closed_in(bvh, sky).is_some_and(|rays| {
                is_near(up) || is_near(normal) || sees_backs((bvh, flat), mesh, &rays)
            })
        };
        places.par_iter().map(is_covered).collect()
    }

    /// Whether a point, perhaps in free space, is inside of a body: none of 577 directions to the sky is open, and more than half
    /// of what it sees are backs of surfaces.
    pub fn is_inside(&self, (bvh, flat): (&Bvh, Flat<'_>), mesh: &Mesh, point: [f32; 3]) -> bool {
        let sky = self.sky.iter();
        let sky = sky.map(|direction| Ray::new(point, direction.map(|x| x as f32)));
        closed_in(bvh, sky).is_some_and(|rays| sees_backs((bvh, flat), mesh, &rays))
    }
}

/// Step by which directions are taken to find out what a place sees that sees no sky.
const SOME: usize = 4;

/// Step by which directions are tried first.
const FEW: usize = 32;

/// Some rays, if none of them is open. Most places see the sky, and a few of the last rays, the steepest ones, find that out.
fn closed_in(bvh: &Bvh, rays: impl DoubleEndedIterator<Item = Ray> + Clone) -> Option<Vec<Ray>> {
    let mut few = rays.clone().rev().step_by(FEW);
    if !few.all(|ray| bvh.occluded(&ray)) {
        return None;
    }
    let rays: Vec<Ray> = rays.collect();
    let occluded = bvh.batch(&rays).on_this_thread().occluded();
    (!occluded.contains(&false)).then_some(rays)
}

/// Whether more than half of some rays hit backs of surfaces.
fn sees_backs((bvh, flat): (&Bvh, Flat<'_>), mesh: &Mesh, rays: &[Ray]) -> bool {
    let some: Vec<Ray> = rays.iter().step_by(SOME).copied().collect();
    let is_back = |(ray, hit): &(&Ray, Option<Hit>)| {
        let triangle = hit.and_then(|hit| flat([hit.geom_id, hit.prim_id]));
        triangle.is_some_and(|triangle| {
            let normal = mesh.twice(triangle);
            dot(normal, ray.dir.map(f64::from)) > 0.0
        })
    };
    let hits = bvh.batch(&some).on_this_thread().intersect();
    2 * some.iter().zip(hits).filter(is_back).count() > some.len()
}

/// Where rays from a point of a surface begin.
fn start(bvh: &Bvh, point: [f64; 3], normal: [f64; 3]) -> [f32; 3] {
    above(bvh, &point.map(|x| x as f32), normal)
}

fn ray(start: [f32; 3], direction: [f64; 3]) -> Ray {
    Ray::new(start, direction.map(|x| x as f32))
}

/// Triangles by their bodies.
struct Members {
    triangles: Vec<u32>,
    /// First triangle of each body in that list, and its length.
    starts: Vec<usize>,
}

impl Members {
    fn new(bodies: &Bodies) -> Self {
        let mut starts = vec![0; bodies.is_closed.len() + 1];
        for &body in &bodies.of_triangle {
            starts[body as usize + 1] += 1;
        }
        for body in 1..starts.len() {
            starts[body] += starts[body - 1];
        }
        let mut triangles: Vec<u32> = (0..bodies.of_triangle.len() as u32).collect();
        triangles.sort_by_key(|&triangle| bodies.of_triangle[triangle as usize]);
        Self { triangles, starts }
    }

    fn of(&self, body: usize) -> &[u32] {
        &self.triangles[self.starts[body]..self.starts[body + 1]]
    }
}

/// Middles and normals of some triangles, one in each of equal shares of their area.
fn samples(mesh: &Mesh, triangles: &[u32]) -> Vec<([f64; 3], [f64; 3])> {
    let normals: Vec<[f64; 3]> = triangles.iter().map(|&i| mesh.twice(i)).collect();
    let areas: Vec<f64> = normals
        .iter()
        .map(|normal| dot(*normal, *normal).sqrt())
        .collect();
    let share = areas.iter().sum::<f64>() / SAMPLES as f64;
    let (mut sum, mut taken) = (0.0, 0);
    let mut places = Vec::new();
    for (index, &triangle) in triangles.iter().enumerate() {
        sum += areas[index];
        // The middle of the next share lies in this triangle.
        if sum <= (f64::from(taken) + 0.5) * share {
            continue;
        }
        taken = (sum / share - 0.5).ceil() as u32;
        if let Some(normal) = unit(normals[index]) {
            let corners = mesh.corners(triangle);
            let middle = [0, 1, 2].map(|axis| corners.iter().map(|p| p[axis]).sum::<f64>() / 3.0);
            places.push((middle, normal));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;
    use crate::{Placement, Sensors};

    /// A point and its normal.
    type Place = ([f32; 3], [f32; 3]);

    /// A scene of boxes and level sheets.
    #[derive(Clone, Default)]
    struct Town(Mesh);

    impl Town {
        fn with_quad(mut self, corners: [[f32; 3]; 4]) -> Self {
            self.0
                .push((&corners, &[[0, 1, 2], [0, 2, 3]]), &[], &[], false);
            self
        }

        /// A sheet that faces up.
        fn with_sheet(self, [x, y]: [f32; 2], [u, v]: [f32; 2], z: f32) -> Self {
            self.with_quad([[x, y, z], [u, y, z], [u, v, z], [x, v, z]])
        }

        /// A box of quads that share no vertices, with a floor or without.
        fn with_box(mut self, [x, y, z]: [f32; 3], [u, v, w]: [f32; 3], has_floor: bool) -> Self {
            let corners = [[x, y], [u, y], [u, v], [x, v]];
            for side in 0..4 {
                let ([a, b], [c, d]) = (corners[side], corners[(side + 1) % 4]);
                self = self.with_quad([[a, b, z], [c, d, z], [c, d, w], [a, b, w]]);
            }
            self = self.with_sheet([x, y], [u, v], w);
            match has_floor {
                true => self.with_quad([[x, y, z], [x, v, z], [u, v, z], [u, y, z]]),
                false => self,
            }
        }

        /// Numbers of sensors of each kind, a square metre each; and their points and normals.
        fn sensors(&self) -> ([usize; 5], Vec<Place>, Surfaces) {
            let mut mesh = self.0.clone();
            let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
            let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
            let (flat, plan) = (
                |[_, triangle]: [u32; 2]| Some(triangle),
                Orientation::default(),
            );
            let objects = mesh.bodies();
            let surfaces = Surfaces::new(&mut mesh, &objects, (&bvh, &flat), &plan);
            let placement = Placement {
                spacing: 1.0,
                kinds: Surface::ALL.to_vec(),
                offset: 0.0,
                storey: None,
                covered: 0.5,
            };
            let all = 0..mesh.indices.len() as u32;
            let found =
                Sensors::on_surfaces(&bvh, &flat, (&mesh, &surfaces), all, &placement, &plan)
                    .expect("sensors");
            let names = &found.labels[0].values;
            let count = |kind: Surface| names.iter().filter(|name| *name == kind.name()).count();
            let mut places: Vec<Place> = found.points.into_iter().zip(found.normals).collect();
            places.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
            (Surface::ALL.map(count), places, surfaces)
        }

        fn counts(&self) -> [usize; 5] {
            self.sensors().0
        }
    }

    #[test]
    fn places_under_houses_are_covered_and_nothing_else() {
        // Roof, ground, facade, underside, covered.
        let ground = Town::default().with_sheet([0.0, 0.0], [50.0, 50.0], 0.0);
        assert_eq!(ground.counts(), [0, 2500, 0, 0, 0]);
        let ([low, high], far) = ([[10.0, 10.0], [20.0, 20.0]], 6.0);
        let house = |from: f32, has_floor| {
            let (low, high) = ([low[0], low[1], from], [high[0], high[1], far]);
            ground.clone().with_box(low, high, has_floor)
        };
        // Its floor lies on the ground, just below or just above it, or is not there. Beside a gap of 5 cm, the outermost places see
        // a few directions of the sky.
        for (from, has_floor, seeing) in [
            (0.0, true, 0),
            (-0.05, true, 0),
            (0.05, true, 36),
            (0.0, false, 0),
        ] {
            let [roof, open, _, underside, covered] = house(from, has_floor).counts();
            assert_eq!([roof, open], [100, 2400 + seeing], "{from} {has_floor}");
            let floor = if has_floor { 100 } else { 0 };
            assert_eq!(
                underside + covered + seeing,
                100 + floor,
                "{from} {has_floor}"
            );
        }
        // A bridge, and a table so low that it covers.
        let under = |from: f32| {
            ground
                .clone()
                .with_box([10.0, 10.0, from], [40.0, 40.0, from + 0.2], true)
                .counts()
        };
        assert_eq!(under(4.0), [900, 2500, 0, 900, 0]);
        let [roof, open, facade, underside, covered] = under(0.3);
        assert_eq!([roof, facade], [900, 0]);
        assert!(
            open < 2300 && open + covered + underside == 3400,
            "{open} {covered}"
        );
    }

    #[test]
    fn a_wall_against_a_house_is_covered_as_far_as_it_touches() {
        let town = Town::default().with_box([0.0, 0.0, 0.0], [10.0, 10.0, 10.0], true);
        let town = town.with_box([10.0, 0.0, 0.0], [20.0, 10.0, 20.0], true);
        let (counts, places, _) = town.sensors();
        // 4 x 100 + 4 x 200 of walls, of which two times 100 touch.
        assert_eq!(counts, [200, 0, 1000, 200, 200]);
        let between = places
            .iter()
            .filter(|(point, _)| (point[0] - 10.0).abs() < 1e-4 && point[2] < 10.0);
        assert_eq!(between.count(), 200);
    }

    #[test]
    fn surfaces_face_outwards_however_they_were_wound() {
        let ground = Town::default().with_sheet([-20.0, -20.0], [40.0, 40.0], 0.0);
        let town = ground.with_box([0.0, 0.0, 0.0], [10.0, 10.0, 5.0], true);
        let town = town.with_box([20.0, 20.0, 0.0], [30.0, 30.0, 8.0], false);
        let (counts, places, surfaces) = town.sensors();
        assert_eq!((surfaces.turned, surfaces.faced), (0, 0));
        // The floor on the ground looks down from it.
        assert_eq!(counts, [200, 3400, 4 * 50 + 4 * 80, 100, 200]);
        let mut turned = town.clone();
        let count = turned.0.indices.len();
        turned.0.turn(&vec![true; count]);
        let (same, others, surfaces) = turned.sensors();
        assert_eq!((same, surfaces.turned, surfaces.faced), (counts, 1, 2));
        assert_eq!(others, places);
    }

    #[test]
    fn roofs_belong_to_buildings() {
        // Without terrain and without floors; roofs that hang over their walls.
        let houses = Town::default().with_box([0.0; 3], [10.0, 10.0, 5.0], false);
        assert_eq!(houses.counts(), [100, 0, 200, 0, 0]);
        let terrain = Town::default().with_sheet([-20.0, -20.0], [40.0, 40.0], 0.0);
        let roof = terrain.clone().with_sheet([0.0, 0.0], [10.0, 10.0], 5.0);
        assert_eq!(roof.counts(), [100, 3600, 0, 0, 0]);
        // A second layer of terrain is none.
        let layers = terrain.with_sheet([-20.0, -20.0], [40.0, 40.0], -3.0);
        assert_eq!(layers.counts(), [0, 7200, 0, 0, 0]);
    }
}
