//! State of the module: memory for numbers of the script, scenes by number, the text of the last error.

use antumbra::recipe::Preset;
use antumbra::{Bvh, Geometry, Hit, INVALID_ID, Ray};

/// Answers of closest hits, a column each.
#[derive(Default)]
pub struct Hits {
    /// Distances in multiples of the direction, infinity after a miss.
    pub t: Vec<f32>,
    /// Barycentric weights of the second and the third corner, 2 numbers per ray.
    pub uv: Vec<f32>,
    /// Triangles, -1 after a miss.
    pub triangle: Vec<i32>,
    /// Meshes, -1 after a miss.
    pub mesh: Vec<i32>,
}

/// Positions and indices of triangles.
pub type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Meshes and trees that the module holds between calls of the script.
#[derive(Default)]
pub struct Module {
    /// Vertices of the next mesh.
    pub positions: Vec<[f32; 3]>,
    /// Vertices of the triangles of the next mesh.
    pub indices: Vec<[u32; 3]>,
    /// Rays of the next call.
    pub rays: Vec<Ray>,
    /// Answers of the last [`Module::occluded`], 0 or 1 per ray.
    pub occluded: Vec<u8>,
    /// Answers of the last [`Module::intersect`].
    pub hits: Hits,
    /// Why the last call failed.
    pub error: String,
    /// Meshes that [`Module::add_mesh`] has kept.
    pub meshes: Vec<Mesh>,
    /// Scenes by number.
    pub scenes: Vec<Option<Bvh>>,
}

/// Makes a list of `count` equal items; `None` if the memory is full.
pub fn reserve<T: Clone>(list: &mut Vec<T>, count: usize, item: T) -> Option<()> {
    // What the list held is not copied.
    list.clear();
    list.try_reserve_exact(count).ok()?;
    list.resize(count, item);
    Some(())
}

impl Module {
    /// Keeps the mesh in `positions` and `indices` for the next [`Module::build`].
    pub fn add_mesh(&mut self) {
        let positions = std::mem::take(&mut self.positions);
        let indices = std::mem::take(&mut self.indices);
        self.meshes.push((positions, indices));
    }

    /// Forgets the meshes that were added, after a mistake of the caller.
    pub fn drop_meshes(&mut self) {
        self.meshes.clear();
    }

    /// Builds a scene over the meshes added, learned from `rays` as well if there are any. Returns the number of the scene.
    ///
    /// # Errors
    /// The text of the kernel's error: a triangle that names a vertex that is not there, too many primitives.
    pub fn build(&mut self, preset: Preset) -> Result<usize, String> {
        let meshes = std::mem::take(&mut self.meshes);
        let rays = std::mem::take(&mut self.rays);
        let geometries: Vec<_> = meshes
            .iter()
            .map(|(positions, indices)| Geometry::triangles(&positions[..], &indices[..]))
            .collect();
        let bvh =
            Bvh::learn(&geometries, &rays, &preset.recipe()).map_err(|error| error.to_string())?;
        let free = self.scenes.iter().position(Option::is_none);
        let number = free.unwrap_or(self.scenes.len());
        if free.is_none() {
            self.scenes.push(None);
        }
        self.scenes[number] = Some(bvh);
        Ok(number)
    }

    /// Returns a scene.
    ///
    /// # Errors
    /// There is no scene of this number.
    pub fn scene(&mut self, number: usize) -> Result<&mut Bvh, String> {
        let scene = self.scenes.get_mut(number).and_then(Option::as_mut);
        scene.ok_or_else(|| String::from("the scene has been freed"))
    }

    /// Frees a scene. Numbers of no scene are fine.
    pub fn free(&mut self, number: usize) {
        if let Some(scene) = self.scenes.get_mut(number) {
            *scene = None;
        }
    }

    /// Puts children of a scene in the order that suits `rays`.
    ///
    /// # Errors
    /// There is no scene of this number.
    pub fn relearn(&mut self, number: usize) -> Result<(), String> {
        let rays = std::mem::take(&mut self.rays);
        self.scene(number)?
            .relearn(&rays, &Preset::Default.recipe());
        Ok(())
    }

    /// Answers `rays` in `occluded`.
    ///
    /// # Errors
    /// There is no scene of this number.
    pub fn occluded(&mut self, number: usize) -> Result<(), String> {
        let rays = std::mem::take(&mut self.rays);
        let answers = self.scene(number)?.batch(&rays).occluded();
        self.occluded.clear();
        self.occluded.extend(answers.into_iter().map(u8::from));
        // The next call finds the memory again.
        self.rays = rays;
        Ok(())
    }

    /// Answers `rays` in `hits`.
    ///
    /// # Errors
    /// There is no scene of this number.
    pub fn intersect(&mut self, number: usize) -> Result<(), String> {
        let rays = std::mem::take(&mut self.rays);
        let answers = self.scene(number)?.batch(&rays).intersect();
        let Hits {
            t,
            uv,
            triangle,
            mesh,
        } = &mut self.hits;
        t.clear();
        uv.clear();
        triangle.clear();
        mesh.clear();
        for answer in answers {
            let hit = answer.unwrap_or(MISS);
            t.push(hit.t);
            uv.extend([hit.u, hit.v]);
            // Ids of primitives are below 2^31, and INVALID_ID becomes -1.
            triangle.push(hit.prim_id.cast_signed());
            mesh.push(hit.geom_id.cast_signed());
        }
        self.rays = rays;
        Ok(())
    }
}

/// Answer of a ray that hits nothing.
const MISS: Hit = Hit {
    t: f32::INFINITY,
    u: 0.0,
    v: 0.0,
    prim_id: INVALID_ID,
    geom_id: INVALID_ID,
    inst_id: INVALID_ID,
};
