//! Tests of the renderer through its public interface.
//!
//! - `closed_form`, `environments`, `materials`: pictures whose radiance is known on paper
//! - `closed`: closed dark bodies are black inside
//! - `media`: participating media
//! - `hair`: fibres
//! - `motion`: what moves while the shutter is open
//! - `references`: pictures of the shared scenes against pbrt-v3, where they are present
//! - `samplers`: every sampler has the same mean
//! - `same_bits`: choices that change no bit, and choices that do
//! - `resume`: interrupted, continued and joined renderings
//! - `live`: pictures that are looked at while they are traced, or grow in rounds
//! - `scales`: tiny, huge and distant scenes
//! - `refused`: bad scenes and options, and monitors that stop a rendering
//! - `figures`: counts, predictions, cost maps and standard errors
//! - `subsurface`: bodies in which light is scattered
//! - `support`: small scenes that these share

mod closed;
mod closed_form;
mod environments;
mod figures;
mod hair;
mod kinds;
mod live;
mod materials;
mod media;
mod motion;
mod references;
mod refused;
mod resume;
mod same_bits;
mod samplers;
mod scales;
mod subsurface;
mod support;
