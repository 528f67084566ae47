//! Corners of faces, and the meshes that they make.

use std::collections::HashMap;
use std::str::FromStr;

use antumbra_scene::{Rgb, TriangleMesh, polygon};
use glam::{DVec3, Vec2, Vec3};

use super::scan::{Mistakes, number};

/// No texture coordinate or normal at a corner.
const NONE: u32 = u32::MAX;

/// Vertices of a file.
#[derive(Default)]
pub(super) struct Lists {
    /// Where positions are measured from.
    origin: DVec3,
    positions: Vec<[f32; 3]>,
    /// Linear colours. Vertices after the first one without a colour have none.
    colors: Vec<Rgb>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
}

/// Linear value of an sRGB-encoded one (IEC 61966-2-1).
fn linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        libm::powf((encoded + 0.055) / 1.055, 2.4)
    }
}

/// First `N` numbers of a statement. Errors are columns and reasons.
fn numbers<'a, T: Copy + Default + FromStr, const N: usize>(
    column: usize,
    words: &mut impl Iterator<Item = (usize, &'a [u8])>,
) -> Result<[T; N], (usize, String)> {
    let mut values = [T::default(); N];
    for (index, value) in values.iter_mut().enumerate() {
        let few = || format!("{N} numbers are needed here, and there are {index}");
        let (place, word) = words.next().ok_or_else(|| (column, few()))?;
        let bad = || format!("`{}` is not a number", String::from_utf8_lossy(word));
        *value = number(word).ok_or_else(|| (place, bad()))?;
    }
    Ok(values)
}

impl Lists {
    pub fn new(origin: DVec3) -> Self {
        Self {
            origin,
            ..Self::default()
        }
    }

    /// Reads `v x y z`, perhaps with a weight or with a colour.
    pub fn vertex<'a>(
        &mut self,
        column: usize,
        mut words: impl Iterator<Item = (usize, &'a [u8])> + Clone,
        mistakes: &mut Mistakes,
    ) {
        let position = numbers(column, &mut words).unwrap_or_else(|(column, reason)| {
            mistakes.add(column, reason);
            [f64::NAN; 3]
        });
        let rest: Vec<f32> = words.filter_map(|(_, word)| number(word)).collect();
        if let [r, g, b, ..] = rest[..]
            && self.colors.len() == self.positions.len()
        {
            self.colors.push(Rgb::new(linear(r), linear(g), linear(b)));
        }
        let position = DVec3::from(position) - self.origin;
        self.positions.push(position.as_vec3().into());
    }

    /// Reads `vt u v`. A missing v is 0, and so is what cannot be read.
    pub fn uv<'a>(
        &mut self,
        column: usize,
        mut words: impl Iterator<Item = (usize, &'a [u8])>,
        mistakes: &mut Mistakes,
    ) {
        let [u] = numbers(column, &mut words).unwrap_or_else(|(column, reason)| {
            mistakes.warn(
                mistakes.line,
                column,
                format!("{reason}, so `vt` counts as 0"),
            );
            [0.0]
        });
        let v = words.next().and_then(|(_, word)| number(word));
        self.uvs.push(Vec2::new(u, v.unwrap_or(0.0)));
    }

    /// Reads `vn x y z`. What cannot be read is the zero vector, as if there were no normal.
    pub fn normal<'a>(
        &mut self,
        column: usize,
        mut words: impl Iterator<Item = (usize, &'a [u8])>,
        mistakes: &mut Mistakes,
    ) {
        let normal = numbers(column, &mut words).unwrap_or_else(|(column, reason)| {
            mistakes.warn(
                mistakes.line,
                column,
                format!("{reason}, so `vn` is left out"),
            );
            [0.0_f32; 3]
        });
        self.normals.push(Vec3::from(normal).normalize_or_zero());
    }

    /// Whether every vertex has a colour.
    pub fn has_colors(&self) -> bool {
        !self.colors.is_empty() && self.colors.len() == self.positions.len()
    }

    fn counts(&self) -> [i64; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()].map(|count| count as i64)
    }

    /// Mesh of the faces of one material. All their vertices must exist. A missing normal is the zero vector.
    pub fn mesh(&self, part: &Part) -> TriangleMesh {
        let corners = || part.triangles.iter().flatten();
        let has_uvs = corners().any(|corner| (corner[1] as usize) < self.uvs.len());
        let has_normals = corners().any(|corner| (corner[2] as usize) < self.normals.len());
        if part.is_all && !has_uvs && !has_normals {
            let colors = if self.has_colors() {
                self.colors.clone()
            } else {
                Vec::new()
            };
            return TriangleMesh {
                positions: self.positions.clone(),
                indices: part
                    .triangles
                    .iter()
                    .map(|t| t.map(|corner| corner[0]))
                    .collect(),
                colors,
                ..TriangleMesh::default()
            };
        }
        let mut mesh = TriangleMesh::default();
        let mut known: HashMap<[u32; 3], u32> = HashMap::new();
        for triangle in &part.triangles {
            let indices = triangle.map(|[position, uv, normal]| {
                *known.entry([position, uv, normal]).or_insert_with(|| {
                    mesh.positions.push(self.positions[position as usize]);
                    if has_uvs {
                        let uv = self.uvs.get(uv as usize).copied();
                        mesh.uvs.push(uv.unwrap_or_default());
                    }
                    if has_normals {
                        let normal = self.normals.get(normal as usize).copied();
                        mesh.normals.push(normal.unwrap_or_default());
                    }
                    if self.has_colors() {
                        mesh.colors.push(self.colors[position as usize]);
                    }
                    (mesh.positions.len() - 1) as u32
                })
            });
            mesh.indices.push(indices);
        }
        mesh
    }
}

/// Name of a material, with the place where it is used first.
pub(super) type Used = (String, usize, usize);

/// Faces of one material.
pub(super) struct Part {
    pub material: Option<Used>,
    /// Consecutive triangles of one object and one group, each a place in the list of names, and their number.
    runs: Vec<([usize; 2], usize)>,
    /// Vertex, texture coordinate and normal of every corner. The last two may not exist.
    triangles: Vec<[[u32; 3]; 3]>,
    /// First triangle and number of triangles of each polygon of more than three corners.
    polygons: Vec<(usize, usize)>,
    /// Whether these are all faces of the file.
    is_all: bool,
}

/// Faces of a file by material.
#[derive(Default)]
pub(super) struct Faces {
    parts: Vec<Part>,
    by_name: HashMap<Option<String>, usize>,
    current: Option<Used>,
    /// Names of objects and groups; the first one is empty.
    names: Vec<String>,
    /// Object and group of the faces that follow.
    owners: [usize; 2],
    /// Corners that refer to what may still follow: line, column, kind and number.
    open: Vec<(usize, usize, usize, i64)>,
    /// Number of faces of fewer than three corners, which are left out.
    pub flat: u64,
}

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Warning about corners that name a texture coordinate or a normal that does not exist.
fn lacks(kind: usize) -> String {
    let instead = ["", "0 is", "that of the face is"][kind];
    let what = KINDS[kind];
    format!("a corner names a {what} that is not in the file; {instead} used instead")
}

impl Faces {
    /// Sets the material of the faces that follow. An empty name is none.
    pub fn set_material(&mut self, used: Used) {
        self.current = Some(used).filter(|(name, _, _)| !name.is_empty());
    }

    /// Sets the object (0) or the group (1) of the faces that follow.
    pub fn set_owner(&mut self, kind: usize, name: String) {
        if self.names.is_empty() {
            self.names.push(String::new());
        }
        self.owners[kind] = match (name.is_empty(), self.names.last()) {
            (true, _) => 0,
            (false, Some(last)) if *last == name => self.names.len() - 1,
            (false, _) => {
                self.names.push(name);
                self.names.len() - 1
            }
        };
    }

    /// Reads `f`.
    pub fn face<'a>(
        &mut self,
        words: impl Iterator<Item = (usize, &'a [u8])>,
        lists: &Lists,
        mistakes: &mut Mistakes,
    ) {
        let mut corners = Vec::new();
        for (column, word) in words {
            match self.corner(column, word, lists, mistakes) {
                Some(corner) => corners.push(corner),
                None => return,
            }
        }
        if corners.len() < 3 {
            self.flat += 1;
            return;
        }
        let name = self.current.as_ref().map(|(name, _, _)| name.clone());
        let parts = &mut self.parts;
        let current = &self.current;
        let part = *self.by_name.entry(name).or_insert_with(|| {
            parts.push(Part {
                material: current.clone(),
                runs: Vec::new(),
                triangles: Vec::new(),
                polygons: Vec::new(),
                is_all: false,
            });
            parts.len() - 1
        });
        let Part {
            triangles,
            polygons,
            runs,
            ..
        } = &mut self.parts[part];
        let count = corners.len() - 2;
        if count > 1 {
            polygons.push((triangles.len(), count));
        }
        for pair in corners.windows(2).skip(1) {
            triangles.push([corners[0], pair[0], pair[1]]);
        }
        match runs.last_mut() {
            Some((owners, sum)) if *owners == self.owners => *sum += count,
            _ => runs.push((self.owners, count)),
        }
    }

    /// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`. Negative numbers count back from the last element read.
    fn corner(
        &mut self,
        column: usize,
        word: &[u8],
        lists: &Lists,
        mistakes: &mut Mistakes,
    ) -> Option<[u32; 3]> {
        let mut corner = [NONE; 3];
        let mut parts = word.split(|&byte| byte == b'/');
        for kind in 0..3 {
            let part = match parts.next() {
                Some(b"") if kind > 0 => continue,
                None if kind > 0 => break,
                part => part.unwrap_or_default(),
            };
            let Some(index) = number::<i64>(part) else {
                let word = String::from_utf8_lossy(word);
                mistakes.add(
                    column,
                    format!("`{word}` is not a corner such as 1, 1/2 or 1/2/3"),
                );
                return None;
            };
            let count = lists.counts()[kind];
            let what = KINDS[kind];
            let place = if index < 0 { count + index } else { index - 1 };
            if kind > 0 && (index == 0 || index < -count || place >= i64::from(NONE)) {
                mistakes.warn(mistakes.line, column, lacks(kind));
                continue;
            }
            if index == 0 || index < -count {
                let text = match count {
                    0 => format!("there is no {what} {index}: none stands before it"),
                    count => format!(
                        "there is no {what} {index}: {count} stand before it, where 1 is the first and -1 the last"
                    ),
                };
                mistakes.add(column, text);
                return None;
            }
            if place >= i64::from(NONE) {
                mistakes.add(column, format!("there is no {what} {index}"));
                return None;
            }
            if place >= count {
                self.open.push((mistakes.line, column, kind, index));
            }
            corner[kind] = place as u32;
        }
        if parts.next().is_some() {
            let word = String::from_utf8_lossy(word);
            mistakes.add(
                column,
                format!("`{word}` is not a corner such as 1, 1/2 or 1/2/3"),
            );
            return None;
        }
        Some(corner)
    }

    /// Reports corners that refer to what does not exist, and splits polygons with inward corners, at the end of a file.
    pub fn finish(&mut self, lists: &Lists, mistakes: &mut Mistakes) {
        for &(line, column, kind, index) in &self.open {
            let count = lists.counts()[kind];
            if index > count && kind > 0 {
                mistakes.warn(line, column, lacks(kind));
            } else if index > count {
                let what = KINDS[kind];
                mistakes.at(
                    line,
                    column,
                    format!("there is no {what} {index}: the file has {count}"),
                );
            }
        }
        if !mistakes.is_empty() {
            return;
        }
        for part in &mut self.parts {
            for &(first, count) in &part.polygons {
                let fan = &mut part.triangles[first..first + count];
                polygon::split(fan, |corner| {
                    Vec3::from(lists.positions[corner[0] as usize]).as_dvec3()
                });
            }
        }
    }

    /// Names of the triangles of each of the [parts](Self::into_parts): of objects, or of groups in a file without objects.
    pub fn names(&self) -> Vec<Vec<crate::Part>> {
        let parts = self.parts.iter().filter(|part| !part.triangles.is_empty());
        let parts = parts.collect::<Vec<_>>();
        let mut runs = parts.iter().flat_map(|part| &part.runs);
        let kind = usize::from(!runs.any(|([object, _], _)| *object > 0));
        let named = |part: &&Part| {
            let material = part.material.as_ref().map(|(name, _, _)| name.clone());
            let material = material.unwrap_or_default();
            let run = |(owners, triangles): &([usize; 2], usize)| crate::Part {
                object: self.names.get(owners[kind]).cloned().unwrap_or_default(),
                material: material.clone(),
                triangles: *triangles,
            };
            part.runs.iter().map(run).collect()
        };
        parts.iter().map(named).collect()
    }

    /// The faces by material, in the order in which materials are first used.
    pub fn into_parts(mut self) -> Vec<Part> {
        self.parts.retain(|part| !part.triangles.is_empty());
        if let [only] = &mut self.parts[..] {
            only.is_all = true;
        }
        self.parts
    }
}
