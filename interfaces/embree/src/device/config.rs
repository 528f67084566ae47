//! What a device is configured with, and what it says of itself.

use std::ffi::c_int;

use antumbra::Isa;
use antumbra::recipe::Level;

use super::failure::{Failure, Outcome};

/// Settings of a configuration string.
#[derive(Debug, Default)]
pub struct Settings {
    pub threads: usize,
    pub isa: Option<Isa>,
}

impl Settings {
    /// Settings of speed and of details inside Embree mean nothing here; names that Embree does not have are refused.
    pub fn parse(config: &str) -> Outcome<Self> {
        const INSIDE: &str = "\
            user_threads set_affinity affinity start_threads hugepages verbose frequency_level \
            enable_selockmemoryprivilege alloc_main_block_size alloc_num_main_slots \
            alloc_thread_block_size alloc_single_thread_alloc tessellation_cache_size \
            max_spatial_split_replications max_triangles_per_leaf tri_accel tri_builder \
            tri_traverser quad_accel quad_builder quad_traverser object_accel object_builder \
            grid_accel hair_accel subdiv_accel ignore_config_files";
        let mut settings = Self::default();
        let parts = config.split([',', ';']).map(str::trim);
        for part in parts.filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let (key, value) = (key.trim().to_ascii_lowercase(), value.trim());
            match key.as_str() {
                "threads" => {
                    settings.threads = value.parse().map_err(|_| {
                        Failure::argument(format!("threads={value}: not a number of threads"))
                    })?;
                }
                "isa" | "max_isa" => settings.isa = Some(isa(value)?),
                key if INSIDE
                    .split(' ')
                    .any(|inside| inside == key.trim_end_matches("_mb")) => {}
                _ => return Err(Failure::argument(format!("unknown setting `{key}`"))),
            }
        }
        Ok(settings)
    }
}

/// The instruction set of this name, or the best one below it that the machine has. Answers are the same on each.
fn isa(name: &str) -> Outcome<Isa> {
    let level = match name.to_ascii_lowercase().as_str() {
        "sse" | "sse2" | "sse3" | "ssse3" | "sse41" | "sse4.1" | "sse42" | "sse4.2" | "avx"
        | "avxi" => Level::Scalar,
        "avx2" => Level::Avx2,
        "avx512" | "avx512skx" | "avx512knl" => Level::Avx512,
        "neon" | "neon2x" => return Ok(Isa::best()),
        _ => return Err(Failure::argument(format!("unknown isa `{name}`"))),
    };
    Ok(Isa::new(level).unwrap_or_else(|_| Isa::best()))
}

/// `RTCDeviceProperty`.
pub fn property(property: c_int) -> Outcome<isize> {
    Ok(match property {
        // Version 4.4.0.
        0 => 40400,
        1 | 2 => 4,
        3 => 0,
        // Packets of 4, 8 and 16 rays are traced in packets and streams.
        32..=34 => 1,
        // Culling of back faces is off, also of spheres and curves; invalid rays are ignored; meshes are not compact.
        62 | 63 | 65 | 68 => 0,
        // Masks, filters, ignored invalid rays.
        64 | 66 | 67 => 1,
        // Triangles, quads, user geometry, points (spheres).
        96 | 97 | 100 | 101 => 1,
        // Subdivision surfaces, curves.
        98 | 99 => 0,
        // Tasks run in a system of the library; commits can be joined, and may run at once.
        128 => 0,
        129 | 130 => 1,
        140 => 1,
        141 => 0,
        _ => return Err(Failure::argument("unknown readable property")),
    })
}
