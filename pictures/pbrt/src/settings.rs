//! Directives for sampler, integrator and accelerator, with the parameters and defaults of pbrt-v3.
//!
//! Antumbra's own accelerators, such as `qbvh`, are accepted as well.

use antumbra_scene::{
    Accelerator, DirectStrategy, Integrator, LightStrategy, Sampler, SamplerKind,
};

use crate::lookup::{FLOAT, INTEGER, Lookup, STRING};
use crate::params::ParamType;

/// Default sampler of pbrt.
pub(crate) const DEFAULT_SAMPLER: Sampler = Sampler {
    kind: SamplerKind::Halton,
    pixel_samples: 16,
};

/// Samplers. All samplers of pbrt-v3 are supported; "lowdiscrepancy" is an older name of "02sequence".
pub(crate) const SAMPLERS: &[&str] = &[
    "02sequence",
    "halton",
    "lowdiscrepancy",
    "maxmindist",
    "random",
    "sobol",
    "stratified",
];

/// Reads a `Sampler`.
pub(crate) fn sampler(lookup: &mut Lookup) -> Sampler {
    let sampler_kind = match lookup.kind.text.as_str() {
        "random" => SamplerKind::Random,
        "stratified" => SamplerKind::Stratified {
            x: lookup.integer_from("xsamples", 4, 1),
            y: lookup.integer_from("ysamples", 4, 1),
            jitter: lookup.bool("jitter", true),
        },
        "halton" => SamplerKind::Halton,
        "sobol" => SamplerKind::Sobol,
        "02sequence" | "lowdiscrepancy" => SamplerKind::ZeroTwoSequence,
        "maxmindist" => SamplerKind::MaxMinDist,
        _ => {
            lookup.unknown(SAMPLERS);
            return DEFAULT_SAMPLER;
        }
    };
    const MAX: u32 = Sampler::MAX_SAMPLES;
    let pixel_samples = match sampler_kind {
        SamplerKind::Stratified { x, y, .. } => {
            let product = x.checked_mul(y).filter(|&product| product <= MAX);
            product.unwrap_or_else(|| {
                lookup.error(format!(
                    "{x} times {y} samples per pixel are more than {MAX}"
                ));
                1
            })
        }
        SamplerKind::Random => lookup.integer_in("pixelsamples", 4, [1, MAX]),
        _ => lookup.integer_in("pixelsamples", 16, [1, MAX]),
    };
    use SamplerKind as S;
    if sampler_kind == S::Halton && lookup.bool("samplepixelcenter", false) {
        lookup.unsupported("sampling pixel centres only is");
    }
    if matches!(
        sampler_kind,
        S::Stratified { .. } | S::ZeroTwoSequence | S::MaxMinDist
    ) {
        let why = "it changes noise, not the picture";
        lookup.left_out("dimensions", INTEGER, why);
    }
    Sampler {
        kind: sampler_kind,
        pixel_samples,
    }
}

/// Supported integrators; "ao" is another name of "ambientocclusion".
pub(crate) const INTEGRATORS: &[&str] = &[
    "ambientocclusion",
    "ao",
    "bdpt",
    "directlighting",
    "mlt",
    "path",
    "sppm",
    "volpath",
    "whitted",
];

/// Parameters of integrators that are taken as `path` or `volpath`, which change only noise and time.
const OF_OTHER_INTEGRATORS: &[(&str, &[ParamType])] = &[
    ("bootstrapsamples", INTEGER),
    ("chains", INTEGER),
    ("imagewritefrequency", INTEGER),
    ("iterations", INTEGER),
    ("largestepprobability", FLOAT),
    ("mutationsperpixel", INTEGER),
    ("numiterations", INTEGER),
    ("photonsperiteration", INTEGER),
    ("radius", FLOAT),
    ("sigma", FLOAT),
    ("visualizestrategies", &[ParamType::Bool]),
    ("visualizeweights", &[ParamType::Bool]),
];

/// Reads an `Integrator`.
pub(crate) fn integrator(lookup: &mut Lookup) -> Integrator {
    lookup.refuse_param("pixelbounds", INTEGER);
    let taken_as = match lookup.kind.text.as_str() {
        "bdpt" | "mlt" => Some("volpath"),
        "sppm" => Some("path"),
        _ => None,
    };
    if let Some(taken_as) = taken_as {
        for (name, types) in OF_OTHER_INTEGRATORS {
            let _ = lookup.find(name, types);
        }
        let message = format!(
            "{} is taken as {taken_as:?}: caustics of point, spot and distant lights are missing",
            lookup.what()
        );
        lookup.report.note(lookup.kind.span, message);
    }
    match lookup.kind.text.as_str() {
        "path" | "sppm" => Integrator::Path {
            max_depth: lookup.integer_from("maxdepth", 5, 0),
            rr_threshold: lookup.float("rrthreshold", 1.0),
            light_strategy: light_strategy(lookup),
        },
        "bdpt" | "mlt" | "volpath" => Integrator::VolumePath {
            max_depth: lookup.integer_from("maxdepth", 5, 0),
            rr_threshold: lookup.float("rrthreshold", 1.0),
            light_strategy: light_strategy(lookup),
        },
        "whitted" => {
            let message = "integrator \"whitted\" is taken as \"directlighting\"";
            lookup.report.note(lookup.kind.span, message);
            Integrator::DirectLighting {
                strategy: DirectStrategy::All,
                max_depth: lookup.integer_from("maxdepth", 5, 0),
            }
        }
        "directlighting" => Integrator::DirectLighting {
            strategy: direct_strategy(lookup),
            max_depth: lookup.integer_from("maxdepth", 5, 0),
        },
        "ambientocclusion" | "ao" => Integrator::AmbientOcclusion {
            samples: lookup.integer_in("nsamples", 64, [1, Sampler::MAX_SAMPLES]),
            cosine_sampling: lookup.bool("cossample", true),
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        },
        _ => {
            lookup.unknown(INTEGRATORS);
            Integrator::default()
        }
    }
}

fn light_strategy(lookup: &mut Lookup) -> LightStrategy {
    match lookup.string("lightsamplestrategy") {
        None | Some(("spatial", _)) => LightStrategy::Spatial,
        Some(("power", _)) => LightStrategy::Power,
        Some(("uniform", _)) => LightStrategy::Uniform,
        Some((unknown, span)) => {
            let known = ["power", "spatial", "uniform"];
            (lookup.report).unknown(span, "light sample strategy", unknown, &known);
            LightStrategy::Spatial
        }
    }
}

fn direct_strategy(lookup: &mut Lookup) -> DirectStrategy {
    match lookup.string("strategy") {
        None | Some(("all", _)) => DirectStrategy::All,
        Some(("one", _)) => DirectStrategy::One,
        Some((unknown, span)) => {
            let message = format!("unknown strategy {unknown:?}");
            (lookup.report).error_help(span, message, "known: all, one");
            DirectStrategy::All
        }
    }
}

/// Accelerators of pbrt-v3 and of Antumbra.
pub(crate) const ACCELERATORS: &[&str] = &["bvh", "hbvh", "kdtree", "obvh", "qbvh"];

/// Reads an `Accelerator`. `orders` are the names that `"string order"` accepts.
///
/// Names other than Antumbra's own leave the width to the program, because no picture depends on the accelerator.
pub(crate) fn accelerator(lookup: &mut Lookup, orders: &[&str]) -> Accelerator {
    let mut accelerator = Accelerator::default();
    let left_out: &[(&str, _)] = match lookup.kind.text.as_str() {
        "bvh" => &[("maxnodeprims", INTEGER), ("splitmethod", STRING)],
        "kdtree" => &[
            ("intersectcost", INTEGER),
            ("traversalcost", INTEGER),
            ("emptybonus", FLOAT),
            ("maxprims", INTEGER),
            ("maxdepth", INTEGER),
        ],
        _ => &[],
    };
    for (name, types) in left_out {
        lookup.left_out(name, types, "the picture does not depend on it");
    }
    match lookup.kind.text.as_str() {
        "qbvh" => accelerator.width = Some(4),
        "obvh" => accelerator.width = Some(8),
        "hbvh" => accelerator.width = Some(16),
        "bvh" | "kdtree" => {}
        name => {
            let message = format!(
                "unknown accelerator {name:?} is taken as auto, without its parameters; known: {}",
                ACCELERATORS.join(", ")
            );
            lookup.report.note(lookup.kind.span, message);
            lookup.ignore_all();
        }
    }
    if accelerator.width.is_some()
        && let Some((order, span)) = lookup.string("order")
    {
        if orders.contains(&order) {
            accelerator.order = Some(order.to_owned());
        } else {
            let help = format!("known: {}", orders.join(", "));
            (lookup.report).error_help(span, format!("unknown order {order:?}"), help);
        }
    }
    accelerator
}
