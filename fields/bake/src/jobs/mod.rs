//! Jobs: bakes that can be kept, resumed and shared.

pub(crate) mod job;
pub(crate) mod learn;
pub(crate) mod part;
pub(crate) mod work;

pub use job::{Answers, Job, Key, Number, Numbers, Size, run};
pub use learn::{Learned, learn_when_it_pays};
pub use part::{Identity, Part};
pub use work::Work;
