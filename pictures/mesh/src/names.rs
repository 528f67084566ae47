//! Names that a file gives its surfaces.

/// Consecutive triangles of a shape that have the same names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// Name of the object; empty if it has none.
    pub object: String,
    /// Name of the material; empty if it has none.
    pub material: String,
    /// Number of triangles.
    pub triangles: usize,
}

/// Names of the surfaces of a [`Model`](crate::Model), in lists as long as the lists of the model.
///
/// Lines `o` begin objects of OBJ, or lines `g` in a file without `o`. Nodes are objects of glTF.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Parts of each shape of the world, which have all its triangles.
    pub shapes: Vec<Vec<Part>>,
    /// Parts of each shape of each object.
    pub objects: Vec<Vec<Vec<Part>>>,
    /// Name of each instance, and the index of its object.
    pub instances: Vec<(String, usize)>,
}

impl Names {
    /// Parts of the shapes of the flattened scene: first the shapes of the world, then the shapes of every instance.
    pub fn flattened(&self) -> Vec<Vec<Part>> {
        let mut all = self.shapes.clone();
        for (name, object) in &self.instances {
            for parts in self.objects.get(*object).into_iter().flatten() {
                let named = |part: &Part| Part {
                    object: name.clone(),
                    ..part.clone()
                };
                all.push(parts.iter().map(named).collect());
            }
        }
        all
    }
}
