//! The sun and the sky over a place, and what points receive of them.

pub(crate) mod clock;
pub(crate) mod epw;
pub(crate) mod exposure;
pub(crate) mod hourly;
pub(crate) mod measures;
pub(crate) mod moment;
pub(crate) mod perez;
pub(crate) mod pieces;
pub(crate) mod position;
pub(crate) mod sky;
pub(crate) mod sunlight;
pub(crate) mod surroundings;

pub use clock::Clock;
pub use epw::{BadWeather, Record, Weather};
pub use exposure::{sky_view, sun_hours};
pub use hourly::{Hourly, Receipt};
pub use measures::SunlightClass;
pub use moment::{BadMoment, Moment, is_leap_year};
pub use perez::{Irradiance, perez_sky};
pub use pieces::{LoadPiece, Pieces};
pub use position::{Place, Refraction, SunPosition, sun_positions};
pub use sky::{SkyDivision, SkyPatches};
pub use sunlight::{SunFound, SunJob, SunValues, Sunlight, Suns, TimeStep};
pub use surroundings::Surroundings;
