//! The most deformed element of a state, for messages about failed steps.

use std::fmt;

use energy_dsl::Vector3;

use crate::geometry::{norm, subtract};
use crate::integrator::StepError;
use crate::model::{Part, PartKind};

/// The most stretched triangle or segment of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct MostDeformed {
    /// The name of its garment or hair.
    pub part: String,
    /// Its index within the part.
    pub index: usize,
    /// Its vertices, numbered through the whole scene.
    pub vertices: Vec<usize>,
    /// The length of its longest edge over the rest length.
    pub stretch: f64,
}

impl fmt::Display for MostDeformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { part, index, vertices, stretch } = self;
        let kind = if vertices.len() == 3 { "triangle" } else { "segment" };
        write!(f, "{kind} {index} of {part} (vertices {vertices:?}) was stretched to {stretch:.3} of its rest length")
    }
}

/// Returns the most stretched triangle or segment at the positions. If the error names vertices, only elements that
/// touch them count. `None` if no element does.
pub(super) fn most_deformed(parts: &[Part], x: &[Vector3<f64>], error: &StepError) -> Option<MostDeformed> {
    let named = error.vertices();
    let counts = |vertices: &[usize]| named.is_empty() || vertices.iter().any(|vertex| named.contains(vertex));
    let elements = parts.iter().flat_map(|part| elements(part, x)).filter(|element| counts(&element.vertices));
    elements.max_by(|a, b| a.stretch.total_cmp(&b.stretch))
}

fn elements(part: &Part, x: &[Vector3<f64>]) -> Vec<MostDeformed> {
    let first = part.vertices.start;
    let length = |a: usize, b: usize| norm(subtract(x[first + a], x[first + b]));
    let element = |(index, local, stretch): (usize, Vec<usize>, f64)| {
        let vertices = local.into_iter().map(|vertex| first + vertex).collect();
        MostDeformed { part: part.name.clone(), index, vertices, stretch }
    };
    match &part.kind {
        PartKind::Cloth(mesh) => {
            let triangle = |(index, corners): (usize, &[usize; 3])| {
                let rest = mesh.corners(index);
                let stretch =
                    |from: usize, to: usize| length(corners[from], corners[to]) / norm(subtract(rest[from], rest[to]));
                let stretches = [stretch(0, 1), stretch(1, 2), stretch(2, 0)];
                (index, corners.to_vec(), stretches.into_iter().fold(0.0, f64::max))
            };
            mesh.triangles().iter().enumerate().map(triangle).map(element).collect()
        }
        PartKind::Hair { joints, segment, .. } => {
            let ends = (1..part.vertices.len()).filter(|end| end % joints != 0).enumerate();
            ends.map(|(index, end)| (index, vec![end - 1, end], length(end - 1, end) / segment)).map(element).collect()
        }
    }
}
