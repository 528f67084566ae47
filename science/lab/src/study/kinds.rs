//! Kinds of rows: measurement, rays, question, and origin of the training rays.

use serde::{Deserialize, Serialize};

/// How a row was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum By {
    /// A picture, all of whose shadow rays were counted.
    #[default]
    Render,
    /// A sample of held-out rays, which one tree answered.
    Replay,
}

/// Kinds of occlusion rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kind {
    /// Shadow rays of the scene's integrator.
    #[default]
    Shadow,
    /// Ambient occlusion of what the camera sees.
    Ao,
}

impl Kind {
    /// Every kind there is.
    pub const ALL: [Self; 2] = [Self::Shadow, Self::Ao];

    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shadow => "shadow",
            Self::Ao => "ao",
        }
    }
}

/// Questions that a study answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Part {
    /// Which combination is best.
    #[default]
    Techniques,
    /// How many training rays are enough.
    LogSize,
    /// How much is lost by learning from other rays.
    Transfer,
}

impl Part {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Techniques => "techniques",
            Self::LogSize => "log-size",
            Self::Transfer => "transfer",
        }
    }
}

/// Origins of training rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Trained {
    /// The test camera.
    #[default]
    TestCamera,
    /// The camera chosen for training.
    TrainCamera,
    /// The test camera, looking the other way.
    TurnedCamera,
    /// Surfaces: synthetic rays, of no camera.
    Surfaces,
    /// The test camera, by the other kind of rays.
    OtherKind,
}

impl Trained {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TestCamera => "test-camera",
            Self::TrainCamera => "train-camera",
            Self::TurnedCamera => "turned-camera",
            Self::Surfaces => "surfaces",
            Self::OtherKind => "other-kind",
        }
    }
}
