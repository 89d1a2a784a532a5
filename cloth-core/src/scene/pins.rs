use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::numbers::finite_triple;
use crate::mesh::{norm, subtract};
use crate::motion::Motion;

/// Vertices that do not move, or move as they are told.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct Pin {
    /// Which vertices, chosen at the start.
    pub choice: PinChoice,
    /// The garment or hair that they are chosen from; `None` for all.
    pub of: Option<String>,
    /// How they move.
    pub motion: Option<Motion>,
}

/// Which vertices are pinned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PinChoice {
    /// The vertex of this number, from 0.
    Vertex(usize),
    /// Every vertex in an axis-aligned box.
    Box(PinBox),
    /// The vertex nearest to a point, in m.
    Nearest(Vector3<f64>),
    /// Every vertex on the edge of the cloth.
    Boundary,
    /// Every vertex.
    All,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinBox {
    /// The corner with the smallest coordinates, in m.
    #[serde(deserialize_with = "finite_triple")]
    pub min: Vector3<f64>,
    /// The corner with the largest coordinates, in m.
    #[serde(deserialize_with = "finite_triple")]
    pub max: Vector3<f64>,
}

/// What a scene file says: exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// The vertex of this number, from 0, within `of`.
    vertex: Option<usize>,
    /// Every vertex in an axis-aligned box.
    #[serde(rename = "box")]
    inside: Option<PinBox>,
    /// The vertex nearest to a point, in m.
    nearest: Option<Point>,
    /// `true`: every vertex on the edge of the cloth.
    #[serde(default)]
    boundary: bool,
    /// `true`: every vertex.
    #[serde(default)]
    all: bool,
    /// The name of the garment or hair that the vertices are chosen from. Default all.
    of: Option<String>,
    /// How they move. Default not at all.
    motion: Option<Motion>,
}

/// A point, in m.
#[derive(Deserialize, JsonSchema)]
#[serde(transparent)]
struct Point(#[serde(deserialize_with = "finite_triple")] Vector3<f64>);

impl TryFrom<Keys> for Pin {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { vertex, inside, nearest, boundary, all, of, motion } = keys;
        let choices = [
            vertex.map(PinChoice::Vertex),
            inside.map(PinChoice::Box),
            nearest.map(|Point(point)| PinChoice::Nearest(point)),
            boundary.then_some(PinChoice::Boundary),
            all.then_some(PinChoice::All),
        ];
        let given: Vec<PinChoice> = choices.into_iter().flatten().collect();
        match given[..] {
            [choice] => Ok(Self { choice, of, motion }),
            _ => Err("a pin is exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`".to_owned()),
        }
    }
}

/// A pin that holds nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PinError {
    /// No such part.
    #[error("pins[{pin}]: {0}", .error)]
    Name {
        /// Which pin, from 0.
        pin: usize,
        /// What is wrong.
        error: super::UnknownPart,
    },
    /// No such vertex.
    #[error("pins[{pin}]: there is no vertex {vertex}; the mesh has {vertices} (0 to {})", .vertices.saturating_sub(1))]
    NoSuchVertex {
        /// Which pin, from 0.
        pin: usize,
        /// The vertex it names.
        vertex: usize,
        /// The number of vertices.
        vertices: usize,
    },
    /// An empty box.
    #[error("pins[{pin}]: no vertex lies in the box {min:?} to {max:?} (in m)")]
    EmptyBox {
        /// Which pin, from 0.
        pin: usize,
        /// Its smallest corner.
        min: Vector3<f64>,
        /// Its largest corner.
        max: Vector3<f64>,
    },
    /// Nothing with an edge.
    #[error("pins[{pin}]: what it chooses from has no edge")]
    NoBoundary {
        /// Which pin, from 0.
        pin: usize,
    },
    /// Two pins that want different things.
    #[error("pins[{pin}]: vertex {vertex} is held by another pin already, which moves it otherwise")]
    Twice {
        /// Which pin, from 0.
        pin: usize,
        /// The vertex, counted through all garments.
        vertex: usize,
    },
}

impl Pin {
    /// A pin that does not move, on vertices of all parts.
    #[must_use]
    pub fn fixed(choice: PinChoice) -> Self {
        Self { choice, of: None, motion: None }
    }

    /// The vertices it holds, of those at the start; `edge` are those on the edge of the cloth. `pin` is its number, for messages.
    ///
    /// # Errors
    /// When it chooses no vertex.
    pub fn chosen(&self, pin: usize, start: &[Vector3<f64>], edge: &[usize]) -> Result<Vec<usize>, PinError> {
        match self.choice {
            PinChoice::Vertex(vertex) if vertex < start.len() => Ok(vec![vertex]),
            PinChoice::Vertex(vertex) => Err(PinError::NoSuchVertex { pin, vertex, vertices: start.len() }),
            PinChoice::Box(PinBox { min, max }) => {
                let inside = |p: &Vector3<f64>| (0..3).all(|axis| (min[axis]..=max[axis]).contains(&p[axis]));
                let chosen: Vec<usize> = (0..start.len()).filter(|&vertex| inside(&start[vertex])).collect();
                if chosen.is_empty() { Err(PinError::EmptyBox { pin, min, max }) } else { Ok(chosen) }
            }
            PinChoice::Nearest(point) => {
                let distance = |vertex: &usize| norm(subtract(start[*vertex], point));
                Ok((0..start.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).into_iter().collect())
            }
            PinChoice::Boundary if edge.is_empty() => Err(PinError::NoBoundary { pin }),
            PinChoice::Boundary => Ok(edge.to_vec()),
            PinChoice::All => Ok((0..start.len()).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_choose_vertices_or_say_why_not() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let chosen = |choice| Pin::fixed(choice).chosen(1, &vertices, &[0, 2]);
        assert_eq!(chosen(PinChoice::Nearest([0.9, 0.2, 0.0])).unwrap(), [1]);
        let inside = PinBox { min: [-0.1, 0.5, -0.1], max: [0.1, 1.5, 0.1] };
        assert_eq!(chosen(PinChoice::Box(inside)).unwrap(), [2]);
        assert_eq!(chosen(PinChoice::Boundary).unwrap(), [0, 2]);
        assert_eq!(chosen(PinChoice::All).unwrap(), [0, 1, 2]);
        let error = chosen(PinChoice::Vertex(3)).unwrap_err();
        assert_eq!(error.to_string(), "pins[1]: there is no vertex 3; the mesh has 3 (0 to 2)");
        let empty = PinBox { min: [5.0; 3], max: [6.0; 3] };
        assert!(matches!(chosen(PinChoice::Box(empty)), Err(PinError::EmptyBox { pin: 1, .. })));
    }
}
