//! Geometry of collisions: an exact test for crossings, pairs of features that may come in contact, and a certificate
//! that a straight move keeps them apart.
//!
//! A surface is a [`CollisionMesh`] of points, edges and triangles. Two kinds of pairs suffice: a point and a
//! triangle, and two edges. If no such pair touches while all vertices move, no edge ever crosses a triangle: the first
//! contact of an edge with a triangle is either an end of the edge on the triangle, or the edge on a side of the
//! triangle. Features that share a vertex, or whose vertices are sewn together, never count as a pair.
//!
//! Obstacles join the mesh with the cores of their solids. The vertices of cores follow those of the cloth, and move as
//! prescribed.

mod candidates;
mod certificate;
mod closest;
mod crossing;
mod displacement;
mod exclusions;
mod found;
mod measured;
mod mesh;
mod moving_balls;
mod neighbourhood;
mod pair;
mod plane;
mod rectangle;
mod safe_pairs;
mod search;
mod separations;
mod sheet;
mod smooth;
mod solid_core;
mod tiling;
mod trees;

pub use candidates::Candidates;
pub use certificate::{Clearance, Move};
pub use closest::Closest;
pub use crossing::{Crossing, crossings};
pub use exclusions::{Exclusions, Members};
pub use measured::{Measured, MeasuredPart};
pub use mesh::{CollisionMesh, EDGES_PER_HEIGHT};
pub use moving_balls::MovingBalls;
pub use neighbourhood::Neighbourhood;
pub use pair::{Pair, PairKind};
pub use search::{Rules, Search};
pub use separations::{Near, PART, Separations};
pub use solid_core::Core;

#[cfg(test)]
mod smooth_tests;
#[cfg(test)]
mod tests;
