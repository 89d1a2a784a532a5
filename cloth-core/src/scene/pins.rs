use energy_dsl::Vector3;
use serde::Deserialize;

use super::numbers::finite_triple;
use crate::mesh::{norm, subtract};

/// Vertices to pin, chosen at the start.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Pin {
    /// The vertex of this number, from 0.
    Vertex(usize),
    /// Every vertex in an axis-aligned box.
    Box {
        /// The corner with the smallest coordinates, in m.
        #[serde(deserialize_with = "finite_triple")]
        min: Vector3<f64>,
        /// The corner with the largest coordinates, in m.
        #[serde(deserialize_with = "finite_triple")]
        max: Vector3<f64>,
    },
    /// The vertex nearest to a point, in m.
    #[serde(deserialize_with = "finite_triple")]
    Nearest(Vector3<f64>),
}

/// A pin that holds nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PinError {
    /// No such vertex.
    #[error("pins[{pin}]: there is no vertex {vertex}; the mesh has {vertices} (0 to {})", .vertices - 1)]
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
}

/// Whether each vertex is pinned.
///
/// # Errors
/// When a pin chooses no vertex.
pub fn pinned_vertices(pins: &[Pin], vertices: &[Vector3<f64>]) -> Result<Vec<bool>, PinError> {
    let mut pinned = vec![false; vertices.len()];
    for (pin, choice) in pins.iter().enumerate() {
        match *choice {
            Pin::Vertex(vertex) => {
                let no_such = PinError::NoSuchVertex { pin, vertex, vertices: vertices.len() };
                *pinned.get_mut(vertex).ok_or(no_such)? = true;
            }
            Pin::Box { min, max } => {
                let inside = |p: &Vector3<f64>| (0..3).all(|axis| (min[axis]..=max[axis]).contains(&p[axis]));
                let chosen: Vec<usize> = (0..vertices.len()).filter(|&vertex| inside(&vertices[vertex])).collect();
                if chosen.is_empty() {
                    return Err(PinError::EmptyBox { pin, min, max });
                }
                chosen.into_iter().for_each(|vertex| pinned[vertex] = true);
            }
            Pin::Nearest(point) => {
                let distance = |vertex: &usize| norm(subtract(vertices[*vertex], point));
                let nearest = (0..vertices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.into_iter().for_each(|vertex| pinned[vertex] = true);
            }
        }
    }
    Ok(pinned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_choose_vertices_or_say_why_not() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let all = [Pin::Nearest([0.9, 0.2, 0.0]), Pin::Box { min: [-0.1, 0.5, -0.1], max: [0.1, 1.5, 0.1] }];
        assert_eq!(pinned_vertices(&all, &vertices).unwrap(), [false, true, true]);
        let error = pinned_vertices(&[Pin::Vertex(0), Pin::Vertex(3)], &vertices).unwrap_err();
        assert_eq!(error.to_string(), "pins[1]: there is no vertex 3; the mesh has 3 (0 to 2)");
        let empty = Pin::Box { min: [5.0; 3], max: [6.0; 3] };
        assert!(matches!(pinned_vertices(&[empty], &vertices), Err(PinError::EmptyBox { pin: 0, .. })));
    }
}
