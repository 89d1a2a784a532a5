use std::collections::BTreeMap;

use energy_dsl::Vector3;

use super::UnknownPart;
use crate::geometry::{norm, subtract};
use crate::scene::{Pin, PinBox, PinChoice};

/// A pin that is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum PinError {
    /// `of` refers to an unknown part.
    #[error("pins[{pin}]: {0}", .error)]
    Name {
        /// Index of the pin, from 0.
        pin: usize,
        error: UnknownPart,
    },
    /// The vertex does not exist.
    #[error("pins[{pin}]: there is no vertex {vertex}; the mesh has {vertices} (0 to {})", .vertices.saturating_sub(1))]
    NoSuchVertex {
        /// Index of the pin, from 0.
        pin: usize,
        vertex: usize,
        vertices: usize,
    },
    /// No vertex lies in the box.
    #[error("pins[{pin}]: no vertex lies in the box {min:?} to {max:?} (in m)")]
    EmptyBox {
        /// Index of the pin, from 0.
        pin: usize,
        /// Its smallest corner.
        min: Vector3<f64>,
        /// Its largest corner.
        max: Vector3<f64>,
    },
    /// No garment has the group.
    #[error(
        "pins[{pin}]: there is no group `{name}` in the chosen garments; {}",
        if .known.is_empty() { "they have no groups".to_owned() } else { format!("there are {}", .known.join(", ")) }
    )]
    NoSuchGroup {
        /// Index of the pin, from 0.
        pin: usize,
        name: String,
        /// The groups of the chosen garments.
        known: Vec<String>,
    },
    /// Springs cannot follow an obstacle that deforms.
    #[error("pins[{pin}]: a spring cannot follow {name}, which deforms; leave out `stiffness` or `obstacle`")]
    SoftOnDeforming {
        /// Index of the pin, from 0.
        pin: usize,
        /// Name of the obstacle.
        name: String,
    },
    /// The scene has no such obstacle.
    #[error(
        "pins[{pin}]: there is no obstacle called `{name}`; {}",
        if .known.is_empty() { "there are none".to_owned() } else { format!("there are {}", .known.join(", ")) }
    )]
    NoSuchObstacle {
        /// Index of the pin, from 0.
        pin: usize,
        name: String,
        /// The names of the obstacles.
        known: Vec<String>,
    },
    /// The part has no boundary.
    #[error("pins[{pin}]: the chosen part has no boundary")]
    NoBoundary {
        /// Index of the pin, from 0.
        pin: usize,
    },
    /// Two pins give a vertex different motions.
    #[error("pins[{pin}]: vertex {vertex} already belongs to a pin with a different motion")]
    Twice {
        /// Index of the pin, from 0.
        pin: usize,
        /// The vertex, numbered through the whole scene.
        vertex: usize,
    },
}

/// Returns the vertices that a pin chooses, given initial positions and boundary vertices. `pin` is its index, for
/// messages.
///
/// # Errors
/// Returns an error if the pin chooses no vertex.
pub(super) fn chosen(
    description: &Pin,
    pin: usize,
    start: &[Vector3<f64>],
    edge: &[usize],
    groups: &BTreeMap<String, Vec<usize>>,
) -> Result<Vec<usize>, PinError> {
    match &description.choice {
        &PinChoice::Vertex(vertex) if vertex < start.len() => Ok(vec![vertex]),
        &PinChoice::Vertex(vertex) => Err(PinError::NoSuchVertex { pin, vertex, vertices: start.len() }),
        PinChoice::Vertices(vertices) => match vertices.iter().find(|&&vertex| vertex >= start.len()) {
            Some(&vertex) => Err(PinError::NoSuchVertex { pin, vertex, vertices: start.len() }),
            None => Ok(vertices.clone()),
        },
        &PinChoice::Box(PinBox { min, max }) => {
            let inside = |p: &Vector3<f64>| (0..3).all(|axis| (min[axis]..=max[axis]).contains(&p[axis]));
            let chosen: Vec<usize> = (0..start.len()).filter(|&vertex| inside(&start[vertex])).collect();
            if chosen.is_empty() { Err(PinError::EmptyBox { pin, min, max }) } else { Ok(chosen) }
        }
        &PinChoice::Nearest(point) => {
            let distance = |vertex: &usize| norm(subtract(start[*vertex], point));
            Ok((0..start.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).into_iter().collect())
        }
        PinChoice::Group(name) => groups.get(name).cloned().ok_or_else(|| {
            let known = groups.keys().cloned().collect();
            PinError::NoSuchGroup { pin, name: name.clone(), known }
        }),
        PinChoice::Boundary if edge.is_empty() => Err(PinError::NoBoundary { pin }),
        PinChoice::Boundary => Ok(edge.to_vec()),
        PinChoice::All => Ok((0..start.len()).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_choose_vertices_or_say_why_not() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let groups = BTreeMap::from([("collar".to_owned(), vec![1, 2])]);
        let chosen = |choice| super::chosen(&Pin::fixed(choice), 1, &vertices, &[0, 2], &groups);
        assert_eq!(chosen(PinChoice::Nearest([0.9, 0.2, 0.0])).unwrap(), [1]);
        let inside = PinBox { min: [-0.1, 0.5, -0.1], max: [0.1, 1.5, 0.1] };
        assert_eq!(chosen(PinChoice::Box(inside)).unwrap(), [2]);
        assert_eq!(chosen(PinChoice::Boundary).unwrap(), [0, 2]);
        assert_eq!(chosen(PinChoice::All).unwrap(), [0, 1, 2]);
        assert_eq!(chosen(PinChoice::Group("collar".to_owned())).unwrap(), [1, 2]);
        let error = chosen(PinChoice::Group("hem".to_owned())).unwrap_err().to_string();
        assert_eq!(error, "pins[1]: there is no group `hem` in the chosen garments; there are collar");
        assert_eq!(chosen(PinChoice::Vertices(vec![2, 0])).unwrap(), [2, 0]);
        assert!(chosen(PinChoice::Vertices(vec![2, 3])).is_err());
        let error = chosen(PinChoice::Vertex(3)).unwrap_err();
        assert_eq!(error.to_string(), "pins[1]: there is no vertex 3; the mesh has 3 (0 to 2)");
        let empty = PinBox { min: [5.0; 3], max: [6.0; 3] };
        assert!(matches!(chosen(PinChoice::Box(empty)), Err(PinError::EmptyBox { pin: 1, .. })));
    }
}
