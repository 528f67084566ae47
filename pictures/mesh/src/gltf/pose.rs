//! Meshes at rest: morph targets with their default weights, and skins.

use std::collections::HashSet;

use glam::{DMat3, DMat4, DVec3, DVec4, Mat4, Vec3};
use gltf::accessor::Dimensions;
use gltf::{Document, Primitive, Semantic, Skin};

use super::accessors::Numbers;
use super::reader::Reader;

/// Shape of a mesh in one place, beside what its node's transformation does.
#[derive(Clone, Default)]
pub(super) struct Pose<'a> {
    /// Weights of the morph targets, if the node has its own.
    pub weights: Option<&'a [f32]>,
    /// Matrices of the joints from the mesh to the world; empty without a skin.
    pub joints: Vec<DMat4>,
}

/// Indices of the nodes without a parent.
pub(super) fn roots(document: &Document) -> Vec<usize> {
    let nodes = &document.as_json().nodes;
    let children = nodes.iter().flat_map(|node| node.children.iter().flatten());
    let children: HashSet<usize> = children.map(|child| child.value()).collect();
    (0..nodes.len())
        .filter(|index| !children.contains(index))
        .collect()
}

/// Transformations of all nodes to a world in which `root` places those without a parent, whether the shown scene has them or
/// not. A node that is its own ancestor stays there.
pub(super) fn worlds(document: &Document, root: DMat4) -> Vec<DMat4> {
    let mut worlds = vec![None; document.nodes().len()];
    let mut open: Vec<_> = roots(document)
        .into_iter()
        .map(|node| (node, root))
        .collect();
    while let Some((index, to_parent)) = open.pop() {
        if let (Some(slot @ None), Some(node)) =
            (worlds.get_mut(index), document.nodes().nth(index))
        {
            let own = Mat4::from_cols_array_2d(&node.transform().matrix());
            let to_world = *slot.insert(to_parent * own.as_dmat4());
            let children = document.as_json().nodes[index].children.iter().flatten();
            open.extend(children.map(|child| (child.value(), to_world)));
        }
    }
    worlds
        .into_iter()
        .map(|to_world| to_world.unwrap_or(root))
        .collect()
}

impl Reader<'_> {
    /// Matrices of the joints of a skin, from its mesh to the world.
    pub fn joints(&mut self, skin: &Skin, worlds: &[DMat4]) -> Result<Vec<DMat4>, String> {
        let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        let inverse = match skin.inverse_bind_matrices() {
            Some(accessor) => {
                self.elements(&accessor, Dimensions::Mat4, Numbers::Floats, |columns| {
                    DMat4::from_cols_array(&columns)
                })?
            }
            None => vec![DMat4::IDENTITY; joints.len()],
        };
        if inverse.len() < joints.len() {
            return Err(format!(
                "there are {} inverse bind matrices for {} joints",
                inverse.len(),
                joints.len()
            ));
        }
        let matrices = joints.into_iter().zip(inverse);
        Ok(matrices
            .map(|(joint, inverse)| worlds[joint] * inverse)
            .collect())
    }

    /// Adds the morph targets of a primitive, as far as their weights are not 0.
    pub fn morph(
        &mut self,
        primitive: &Primitive,
        weights: &[f32],
        positions: &mut [DVec3],
        normals: &mut [Vec3],
    ) -> Result<(), String> {
        for (target, &weight) in primitive.morph_targets().zip(weights) {
            if weight == 0.0 {
                continue;
            }
            let quantized = Numbers::Quantized;
            if let Some(accessor) = target.positions() {
                let moves = self.elements(&accessor, Dimensions::Vec3, quantized, DVec3::from)?;
                for (position, by) in positions.iter_mut().zip(moves) {
                    *position += f64::from(weight) * by;
                }
            }
            if let Some(accessor) = target.normals() {
                let moves = self.elements(&accessor, Dimensions::Vec3, quantized, DVec3::from)?;
                for (normal, by) in normals.iter_mut().zip(moves) {
                    *normal += weight * by.as_vec3();
                }
            }
        }
        Ok(())
    }

    /// Moves the vertices of a primitive to the world by the joints of a skin. `false`: they name no joints.
    pub fn skin(
        &mut self,
        primitive: &Primitive,
        joints: &[DMat4],
        positions: &mut [DVec3],
        normals: &mut [Vec3],
    ) -> Result<bool, String> {
        let has = |name| primitive.get(&name).is_some();
        if !(has(Semantic::Joints(0)) && has(Semantic::Weights(0))) {
            return Ok(false);
        }
        let mut sums = vec![(0.0, DMat4::ZERO); positions.len()];
        for set in 0.. {
            let pair = [Semantic::Joints(set), Semantic::Weights(set)];
            let [Some(of), Some(by)] = pair.map(|name| primitive.get(&name)) else {
                break;
            };
            let of = self.elements(&of, Dimensions::Vec4, Numbers::Whole, |index: [f64; 4]| {
                index
            })?;
            let by = self.elements(
                &by,
                Dimensions::Vec4,
                Numbers::Fractions,
                |weight: [f64; 4]| weight,
            )?;
            for (sum, pairs) in sums.iter_mut().zip(of.into_iter().zip(by)) {
                for (joint, weight) in pairs.0.into_iter().zip(pairs.1) {
                    if weight == 0.0 {
                        continue;
                    }
                    let matrix = joints.get(joint as usize).ok_or_else(|| {
                        format!(
                            "joint {joint} is used, but the skin has only {}",
                            joints.len()
                        )
                    })?;
                    sum.0 += weight;
                    sum.1 += *matrix * weight;
                }
            }
        }
        // Weights have the sum 1, up to rounding. Without any, the first joint moves a vertex.
        let matrices = sums.into_iter().map(|(sum, matrix)| match sum > 0.0 {
            true => matrix * (1.0 / sum),
            false => joints[0],
        });
        let mut normals = normals.iter_mut();
        for (position, matrix) in positions.iter_mut().zip(matrices) {
            *position = (matrix * DVec4::from((*position, 1.0))).truncate();
            if let Some(normal) = normals.next() {
                *normal = (cofactors(&matrix) * normal.as_dvec3())
                    .normalize_or_zero()
                    .as_vec3();
            }
        }
        Ok(true)
    }
}

/// The inverse transpose of the linear part, up to a factor: also of singular matrices.
fn cofactors(matrix: &DMat4) -> DMat3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec4::truncate);
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}
