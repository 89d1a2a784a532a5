//! Puts a scene together: parts, seams, pins and everything that acts, on one numbering of vertices.

mod anchor;
mod builder;
mod closing_seam;
mod exclusions;
mod inflation;
mod parts;
mod pins;
mod seam;
mod soft_pin;

pub use anchor::Anchor;
pub use exclusions::ExclusionError;
pub use inflation::NotClosed;
pub use parts::{
    IslandModel, Model, ModelError, MovingPin, PairFrictionError, Part, PartKind, PinnedVertices, TermLabel,
    UnknownPart,
};
pub use pins::PinError;
pub use seam::SeamError;
