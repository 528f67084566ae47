//! Directives for sampler, integrator and accelerator, with the parameters and defaults of pbrt-v3.
//!
//! Antumbra's own accelerators, such as `qbvh`, are accepted as well.

use antumbra_scene::{
    Accelerator, DirectStrategy, Integrator, LightStrategy, Sampler, SamplerKind,
};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::{ParamType, Params};
use crate::report::Report;
use crate::source::Span;

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

/// Handles `Sampler`.
pub(crate) fn declare_sampler(
    at: Span,
    kind: &Quoted,
    params: &Params,
    report: &mut Report,
) -> Sampler {
    let mut lookup = Lookup::new(at, format!("sampler {:?}", kind.text), params);
    let sampler_kind = match kind.text.as_str() {
        "random" => SamplerKind::Random,
        "stratified" => SamplerKind::Stratified {
            x: lookup.integer_from("xsamples", 4, 1, report),
            y: lookup.integer_from("ysamples", 4, 1, report),
            jitter: lookup.bool("jitter", true, report),
        },
        "halton" => SamplerKind::Halton,
        "sobol" => SamplerKind::Sobol,
        "02sequence" | "lowdiscrepancy" => SamplerKind::ZeroTwoSequence,
        "maxmindist" => SamplerKind::MaxMinDist,
        name => {
            report.unknown(kind.span, "sampler", name, SAMPLERS);
            return DEFAULT_SAMPLER;
        }
    };
    const MAX: u32 = Sampler::MAX_SAMPLES;
    let pixel_samples = match sampler_kind {
        SamplerKind::Stratified { x, y, .. } => {
            let product = x.checked_mul(y).filter(|&product| product <= MAX);
            product.unwrap_or_else(|| {
                let message = format!("{x} times {y} samples per pixel are more than {MAX}");
                report.error(lookup.at, message);
                1
            })
        }
        SamplerKind::Random => lookup.integer_in("pixelsamples", 4, [1, MAX], report),
        _ => lookup.integer_in("pixelsamples", 16, [1, MAX], report),
    };
    use SamplerKind as S;
    if sampler_kind == S::Halton && lookup.bool("samplepixelcenter", false, report) {
        report.unsupported(lookup.at, "sampling pixel centres only is");
    }
    if matches!(
        sampler_kind,
        S::Stratified { .. } | S::ZeroTwoSequence | S::MaxMinDist
    ) {
        let why = "it changes noise, not the picture";
        lookup.left_out("dimensions", &[ParamType::Integer], why, report);
    }
    lookup.finish(report);
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
    ("bootstrapsamples", &[ParamType::Integer]),
    ("chains", &[ParamType::Integer]),
    ("imagewritefrequency", &[ParamType::Integer]),
    ("iterations", &[ParamType::Integer]),
    ("largestepprobability", &[ParamType::Float]),
    ("mutationsperpixel", &[ParamType::Integer]),
    ("numiterations", &[ParamType::Integer]),
    ("photonsperiteration", &[ParamType::Integer]),
    ("radius", &[ParamType::Float]),
    ("sigma", &[ParamType::Float]),
    ("visualizestrategies", &[ParamType::Bool]),
    ("visualizeweights", &[ParamType::Bool]),
];

/// Handles `Integrator`.
pub(crate) fn declare_integrator(
    at: Span,
    kind: &Quoted,
    params: &Params,
    report: &mut Report,
) -> Integrator {
    let mut lookup = Lookup::new(at, format!("integrator {:?}", kind.text), params);
    lookup.unsupported("pixelbounds", &[ParamType::Integer], report);
    let taken_as = match kind.text.as_str() {
        "bdpt" | "mlt" => Some("volpath"),
        "sppm" => Some("path"),
        _ => None,
    };
    if let Some(taken_as) = taken_as {
        for (name, types) in OF_OTHER_INTEGRATORS {
            let _ = lookup.find(name, types);
        }
        let message = format!(
            "integrator {:?} is taken as {taken_as:?}: caustics of point, spot and distant lights are missing",
            kind.text
        );
        report.note(kind.span, message);
    }
    let integrator = match kind.text.as_str() {
        "path" | "sppm" => Integrator::Path {
            max_depth: lookup.integer_from("maxdepth", 5, 0, report),
            rr_threshold: lookup.float("rrthreshold", 1.0, report),
            light_strategy: light_strategy(&mut lookup, report),
        },
        "bdpt" | "mlt" | "volpath" => Integrator::VolumePath {
            max_depth: lookup.integer_from("maxdepth", 5, 0, report),
            rr_threshold: lookup.float("rrthreshold", 1.0, report),
            light_strategy: light_strategy(&mut lookup, report),
        },
        "whitted" => {
            report.note(
                kind.span,
                "integrator \"whitted\" is taken as \"directlighting\"",
            );
            Integrator::DirectLighting {
                strategy: DirectStrategy::All,
                max_depth: lookup.integer_from("maxdepth", 5, 0, report),
            }
        }
        "directlighting" => Integrator::DirectLighting {
            strategy: direct_strategy(&mut lookup, report),
            max_depth: lookup.integer_from("maxdepth", 5, 0, report),
        },
        "ambientocclusion" | "ao" => Integrator::AmbientOcclusion {
            samples: lookup.integer_in("nsamples", 64, [1, Sampler::MAX_SAMPLES], report),
            cosine_sampling: lookup.bool("cossample", true, report),
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        },
        name => {
            report.unknown(kind.span, "integrator", name, INTEGRATORS);
            lookup.ignore_all();
            Integrator::default()
        }
    };
    lookup.finish(report);
    integrator
}

fn light_strategy(lookup: &mut Lookup, report: &mut Report) -> LightStrategy {
    match lookup.string("lightsamplestrategy", report) {
        None | Some(("spatial", _)) => LightStrategy::Spatial,
        Some(("power", _)) => LightStrategy::Power,
        Some(("uniform", _)) => LightStrategy::Uniform,
        Some((unknown, span)) => {
            report.unknown(
                span,
                "light sample strategy",
                unknown,
                &["power", "spatial", "uniform"],
            );
            LightStrategy::Spatial
        }
    }
}

fn direct_strategy(lookup: &mut Lookup, report: &mut Report) -> DirectStrategy {
    match lookup.string("strategy", report) {
        None | Some(("all", _)) => DirectStrategy::All,
        Some(("one", _)) => DirectStrategy::One,
        Some((unknown, span)) => {
            report.error_help(
                span,
                format!("unknown strategy {unknown:?}"),
                "known: all, one",
            );
            DirectStrategy::All
        }
    }
}

/// Accelerators of pbrt-v3 and of Antumbra.
pub(crate) const ACCELERATORS: &[&str] = &["bvh", "hbvh", "kdtree", "obvh", "qbvh"];

/// Handles `Accelerator`. `orders` are the names that `"string order"` accepts.
///
/// Names other than Antumbra's own leave the width to the program, because no picture depends on the accelerator.
pub(crate) fn declare_accelerator(
    at: Span,
    kind: &Quoted,
    params: &Params,
    orders: &[&str],
    report: &mut Report,
) -> Accelerator {
    const INTEGER: &[ParamType] = &[ParamType::Integer];
    const FLOAT: &[ParamType] = &[ParamType::Float];
    let mut lookup = Lookup::new(at, format!("accelerator {:?}", kind.text), params);
    let mut accelerator = Accelerator::default();
    let mut left_out = |names: &[(&'static str, &'static [ParamType])]| {
        for (name, types) in names {
            let why = "the picture does not depend on it";
            lookup.left_out(name, types, why, report);
        }
    };
    match kind.text.as_str() {
        "qbvh" => accelerator.width = Some(4),
        "obvh" => accelerator.width = Some(8),
        "hbvh" => accelerator.width = Some(16),
        "bvh" => left_out(&[
            ("maxnodeprims", INTEGER),
            ("splitmethod", &[ParamType::String]),
        ]),
        "kdtree" => left_out(&[
            ("intersectcost", INTEGER),
            ("traversalcost", INTEGER),
            ("emptybonus", FLOAT),
            ("maxprims", INTEGER),
            ("maxdepth", INTEGER),
        ]),
        name => {
            report.note(
                kind.span,
                format!(
                    "unknown accelerator {name:?} is taken as auto, without its parameters; known: {}",
                    ACCELERATORS.join(", ")
                ),
            );
            lookup.ignore_all();
        }
    }
    if accelerator.width.is_some()
        && let Some((order, span)) = lookup.string("order", report)
    {
        if orders.contains(&order) {
            accelerator.order = Some(order.to_owned());
        } else {
            report.error_help(
                span,
                format!("unknown order {order:?}"),
                format!("known: {}", orders.join(", ")),
            );
        }
    }
    lookup.finish(report);
    accelerator
}
