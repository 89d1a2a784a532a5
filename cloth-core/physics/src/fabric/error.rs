use energy_dsl::RestError;
use energy_solve::ListError;

use super::declared::DeclaredError;
use super::plate::{PlateError, RigidityError, ThreadError};
use super::yarns::YarnError;

/// A fabric that does not fit a mesh.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum FabricError {
    /// A triangle is rejected as a rest shape.
    #[error("triangle {triangle}: {source}")]
    Rest { triangle: usize, source: RestError },
    /// A hinge is rejected as a rest shape.
    #[error("the hinge on vertices {vertices:?}: {source}")]
    RestHinge { vertices: [usize; 4], source: RestError },
    /// The bending plate is invalid.
    #[error("bending: {0}")]
    Plate(#[from] PlateError),
    /// The stiffnesses of woven cloth contradict each other.
    #[error("material.orthotropic-stvk: {0}")]
    Woven(#[from] RigidityError),
    /// The numbers of a tester contradict each other.
    #[error("material.yarns.{0}")]
    Yarns(#[from] YarnError),
    /// A triangle has no warp direction.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// Elements declared in a file are invalid.
    #[error(transparent)]
    Declared(#[from] DeclaredError),
    /// The strain limit acts at rest.
    #[error("strain_limit.stretch: expected a number greater than 1, the rest length; got {stretch}")]
    Limit {
        /// The limit given.
        stretch: f64,
    },
    /// Springs have no rest lengths.
    #[error(
        "material.mass-spring: springs take their lengths from vertices at rest, which a garment with `rest` or \
         `rest_scale` does not have; use a material of triangles, such as `stvk`"
    )]
    SpringsOfPatterns,
    /// The membrane has no rest shape that could flow.
    #[error("plasticity.stretch: this material cannot yield; expected one of triangles, such as `stvk`")]
    CannotStretch,
    /// The bending model has no rest angles that could flow.
    #[error("plasticity.curvature: this bending model cannot yield; expected `plate` or `bridson`")]
    CannotFold,
    /// Segments are too long for a curl.
    #[error("curl: a segment would turn by {turn:.0}°, at most 90° are possible; give at least {least} segments")]
    CurlTooTight {
        /// The turn of a segment, in degrees.
        turn: f64,
        /// Segments that would do.
        least: f64,
    },
    /// The axis of a curl is along the strand.
    #[error("curl.axis: {axis:?} is along the strand; give an axis across it")]
    CurlAxis {
        /// The axis given.
        axis: [f64; 3],
    },
    /// Elements and stencils do not match.
    #[error(transparent)]
    List(#[from] ListError),
}
