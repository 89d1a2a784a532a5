//! Puts a scene together: parts, seams, pins and everything that acts, on one numbering of vertices.

mod builder;
mod parts;
mod pins;
mod seam;

pub use parts::{IslandModel, Model, ModelError, MovingPin, Part, PartKind, TermLabel, UnknownPart};
pub use pins::PinError;
pub use seam::SeamError;
