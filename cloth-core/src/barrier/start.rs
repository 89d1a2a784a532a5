//! The state in which contact begins.

use energy_dsl::Vector3;

use super::{BarrierContact, JOINING, Joined, Resistance};
use crate::collision::{Closest, CollisionMesh, Crossing, Neighbourhood, PairKind, Search, crossings};
use energy_solve::ContactCounts;

/// A start that contact cannot keep free of crossings, because it is not.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// An edge crosses a triangle.
    #[error(
        "the cloth crosses itself in {count} places at the start: the edge {}–{} goes through the triangle {}–{}–{} at \
         {:.4?} m. Move the parts apart, or set `contact = \"obstacles\"`",
        .first.edge[0], .first.edge[1], .first.triangle[0], .first.triangle[1], .first.triangle[2], .at
    )]
    Crosses {
        /// Number of edges and triangles that cross.
        count: usize,
        /// The first of them.
        first: Crossing,
        /// The middle of the edge, in m.
        at: Vector3<f64>,
    },
    /// Two features are closer than the thickness.
    #[error(
        "{count} pairs of features are closer than the thickness at the start: {} are {distance:.3e} m apart, \
         {thickness:.3e} m thick. Move them apart, or reduce the `thickness` of the fabric", named(*.pair, *.is_point)
    )]
    TooClose {
        /// Number of such pairs.
        count: usize,
        /// The vertices of the closest pair.
        pair: [usize; 4],
        /// Whether it is a point and a triangle, or two edges.
        is_point: bool,
        /// Its distance, in m.
        distance: f64,
        /// Its thickness, in m.
        thickness: f64,
    },
}

impl BarrierContact {
    /// Creates the contact of a mesh that starts at x. `radii` holds half of the thickness at each vertex, in m; pairs
    /// act within the activation gap `gap` of their thickness, in m. Pairs without a free vertex are ignored.
    ///
    /// # Errors
    /// If the mesh crosses itself at x, or a pair that can respond is closer than its thickness.
    pub fn new(
        mesh: CollisionMesh,
        x: &[Vector3<f64>],
        is_free: Vec<bool>,
        radii: Vec<f64>,
        gap: f64,
    ) -> Result<Self, ContactError> {
        let can_respond =
            |crossing: &Crossing| crossing.edge.iter().chain(&crossing.triangle).any(|&vertex| is_free[vertex]);
        let crossings: Vec<_> = crossings(&mesh, x).into_iter().filter(can_respond).collect();
        if let Some(&first) = crossings.first() {
            let [a, b] = first.edge.map(|end| x[end]);
            let at = std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
            return Err(ContactError::Crosses { count: crossings.len(), first, at });
        }
        let reach = gap + 2.0 * radii.iter().copied().fold(0.0, f64::max);
        let mut contact = Self {
            radii,
            gap,
            reach,
            slack: [0.5 * gap, gap.max(0.15 * mesh.mean_edge(x))],
            search: Search::new(&mesh, x, is_free),
            neighbourhood: Neighbourhood::new(JOINING * reach),
            strides: vec![0.0; x.len()],
            joined: Joined::default(),
            blocking: Vec::new(),
            resistance: Resistance::default(),
            counts: ContactCounts::default(),
            mesh,
        };
        contact.check_distances(x)?;
        Ok(contact)
    }

    fn check_distances(&mut self, x: &[Vector3<f64>]) -> Result<(), ContactError> {
        self.visit(x);
        let all = self.neighbourhood.pairs().iter();
        let all = all.map(|pair| (Closest::of(pair, &pair.corners(x)).distance, self.thickness(pair), pair));
        let close: Vec<_> = all.filter(|(distance, thickness, _)| distance <= thickness).collect();
        let closest = close.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        closest.map_or(Ok(()), |&(distance, thickness, pair)| {
            let (is_point, pair) = (pair.kind == PairKind::PointTriangle, pair.vertices.map(|vertex| vertex as usize));
            Err(ContactError::TooClose { count: close.len(), pair, is_point, distance, thickness })
        })
    }
}

impl ContactError {
    /// Renumbers the vertices, from the numbering of a body to `vertices[…]` of the scene.
    #[must_use]
    pub(crate) fn on_vertices(self, vertices: &[usize]) -> Self {
        match self {
            Self::Crosses { count, first: Crossing { edge, triangle }, at } => {
                let (edge, triangle) = (edge.map(|end| vertices[end]), triangle.map(|corner| vertices[corner]));
                Self::Crosses { count, first: Crossing { edge, triangle }, at }
            }
            Self::TooClose { count, pair, is_point, distance, thickness } => {
                Self::TooClose { count, pair: pair.map(|vertex| vertices[vertex]), is_point, distance, thickness }
            }
        }
    }
}

/// Names the features of a pair.
fn named([a, b, c, d]: [usize; 4], is_point: bool) -> String {
    if is_point {
        format!("vertex {a} and the triangle {b}–{c}–{d}")
    } else {
        format!("the edges {a}–{b} and {c}–{d}")
    }
}
