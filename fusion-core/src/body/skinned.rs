use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::mesh::Mesh;

/// A bone at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bone {
    /// Name of the bone.
    pub name: String,
    /// Index of the parent; `None` for a root. Parents come before their children.
    pub parent: Option<usize>,
    /// Position of the joint that it rotates about, in m.
    pub head: [f64; 3],
    /// Position of the other end, in m.
    pub tail: [f64; 3],
}

/// The largest coordinate of a body, in m. Products of larger ones may overflow.
pub const FARTHEST: f64 = 1e9;

/// A body that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// The mesh is empty.
    #[error("the body has no vertices or no triangles")]
    Empty,
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are only {vertices} vertices")]
    TriangleOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the missing vertex.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A position is infinite, NaN or too far away.
    #[error("vertex {vertex} is not finite, or farther than {FARTHEST:e} m from the origin")]
    NonFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// An end of a bone is infinite, NaN or too far away.
    #[error("bone `{bone}` is not finite, or farther than {FARTHEST:e} m from the origin")]
    NonFiniteBone {
        /// Name of the bone.
        bone: String,
    },
    /// The numbers of weight rows and vertices differ.
    #[error("expected one row of skinning weights per vertex, got {found} rows for {vertices} vertices")]
    WeightCount {
        /// Number of rows.
        found: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A weight is negative or not finite, or names a bone that does not exist; or a vertex has no bone.
    #[error("vertex {vertex}: expected at least one positive skinning weight, and only weights of existing bones")]
    BadWeights {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A child comes before its parent.
    #[error("bone `{bone}` comes before its parent")]
    Order {
        /// Name of the child.
        bone: String,
    },
}

/// A mesh that moves with bones by linear blend skinning. Without bones, rows of weights are empty, and the mesh stays.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinnedBody {
    /// The mesh at rest.
    pub mesh: Mesh,
    /// The bones at rest.
    pub bones: Vec<Bone>,
    /// Bones and weights of each vertex; each row sums to 1, or is empty without bones.
    pub weights: Vec<Vec<(usize, f64)>>,
}

impl SkinnedBody {
    /// Checks all parts, and normalises each vertex's weights to a sum of 1.
    ///
    /// # Errors
    /// If the parts do not fit.
    pub fn new(mesh: Mesh, bones: Vec<Bone>, mut weights: Vec<Vec<(usize, f64)>>) -> Result<Self, BodyError> {
        let vertices = mesh.vertices.len();
        if vertices == 0 || mesh.triangles.is_empty() {
            return Err(BodyError::Empty);
        }
        if let Some(vertex) = mesh.vertices.iter().position(|v| !v.iter().all(|x| x.abs() <= FARTHEST)) {
            return Err(BodyError::NonFinite { vertex });
        }
        if let Some(bone) = bones.iter().find(|bone| !bone.head.iter().chain(&bone.tail).all(|x| x.abs() <= FARTHEST)) {
            return Err(BodyError::NonFiniteBone { bone: bone.name.clone() });
        }
        for (triangle, corners) in mesh.triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= vertices) {
                return Err(BodyError::TriangleOutOfRange { triangle, vertex: vertex as usize, vertices });
            }
        }
        if let Some(bone) = bones.iter().enumerate().find(|(i, b)| b.parent.is_some_and(|p| p >= *i)) {
            return Err(BodyError::Order { bone: bone.1.name.clone() });
        }
        if weights.len() != vertices {
            return Err(BodyError::WeightCount { found: weights.len(), vertices });
        }
        for (vertex, row) in weights.iter_mut().enumerate() {
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            if bones.is_empty() && row.is_empty() {
                continue;
            }
            let good = row.iter().all(|&(bone, weight)| bone < bones.len() && weight >= 0.0);
            if !(good && sum > 0.0 && sum.is_finite()) {
                return Err(BodyError::BadWeights { vertex });
            }
            row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        }
        Ok(Self { mesh, bones, weights })
    }

    /// Creates a body without bones.
    ///
    /// # Errors
    /// If the mesh is empty or malformed.
    pub fn without_bones(mesh: Mesh) -> Result<Self, BodyError> {
        let weights = vec![Vec::new(); mesh.vertices.len()];
        Self::new(mesh, Vec::new(), weights)
    }

    /// Returns the mesh moved by the bones' motions from rest, Σ η_j T_j v, with unit normals.
    ///
    /// # Panics
    /// If the numbers of motions and bones differ.
    #[must_use]
    pub fn posed(&self, motions: &[Isometry3<f64>]) -> Mesh {
        assert_eq!(motions.len(), self.bones.len(), "a motion for every bone");
        if self.bones.is_empty() {
            return self.mesh.clone();
        }
        let blend = |vertex: usize, of: &dyn Fn(&Isometry3<f64>) -> Vector3<f64>| {
            self.weights[vertex].iter().map(|&(bone, weight)| weight * of(&motions[bone])).sum::<Vector3<f64>>()
        };
        let all = 0..self.mesh.vertices.len();
        let vertices = all
            .clone()
            .map(|i| blend(i, &|motion| motion.transform_point(&self.mesh.vertices[i].into()).coords))
            .collect();
        let normals = all
            .map(|i| blend(i, &|motion| motion.rotation * self.mesh.normals[i]).try_normalize(0.0).unwrap_or_default())
            .collect();
        Mesh { vertices, normals, triangles: self.mesh.triangles.clone() }
    }

    /// Returns the body moved by the bones, as a new rest shape.
    #[must_use]
    pub fn at_rest_in(&self, motions: &[Isometry3<f64>]) -> Self {
        let moved = |bone: usize, point: [f64; 3]| motions[bone].transform_point(&point.into()).coords.into();
        let bones = self
            .bones
            .iter()
            .enumerate()
            .map(|(i, bone)| Bone { head: moved(i, bone.head), tail: moved(i, bone.tail), ..bone.clone() })
            .collect();
        let posed = self.posed(motions);
        let mesh = Mesh::new(posed.vertices, posed.triangles);
        Self { mesh, bones, weights: self.weights.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Translation3;

    fn triangle() -> Mesh {
        Mesh::new(vec![Vector3::zeros(), Vector3::x(), Vector3::y()], vec![[0, 1, 2]])
    }

    fn bone(parent: Option<usize>) -> Bone {
        Bone { name: "b".into(), parent, head: [0.0; 3], tail: [0.0, 1.0, 0.0] }
    }

    #[test]
    fn vertices_follow_their_bones() {
        let weights = vec![vec![(0, 1.0)], vec![(0, 2.0), (1, 2.0)], vec![(1, 3.0)]];
        let body = SkinnedBody::new(triangle(), vec![bone(None), bone(Some(0))], weights).unwrap();
        let motions =
            [Isometry3::identity(), Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.0), Default::default())];
        let posed = body.posed(&motions);
        assert_eq!(posed.vertices, [Vector3::zeros(), Vector3::new(1.0, 0.0, 0.5), Vector3::new(0.0, 1.0, 1.0)]);
        assert_eq!(body.at_rest_in(&motions).bones[1].tail, [0.0, 1.0, 1.0]);
    }

    #[test]
    fn a_body_without_bones_stays() {
        let body = SkinnedBody::without_bones(triangle()).unwrap();
        assert_eq!(body.posed(&[]), triangle());
        assert_eq!(body.at_rest_in(&[]), body);
    }

    #[test]
    fn parts_that_do_not_fit_are_rejected() {
        let good = vec![vec![(0, 1.0)]; 3];
        let refuse = |mesh, bones, weights| SkinnedBody::new(mesh, bones, weights).unwrap_err();
        assert_eq!(refuse(Mesh::default(), vec![], vec![]), BodyError::Empty);
        assert!(matches!(refuse(triangle(), vec![], good.clone()), BodyError::BadWeights { vertex: 0 }));
        assert!(matches!(refuse(triangle(), vec![bone(Some(0))], good.clone()), BodyError::Order { .. }));
        assert!(matches!(refuse(triangle(), vec![bone(None)], vec![]), BodyError::WeightCount { .. }));
        let mut far = triangle();
        far.triangles[0][2] = 3;
        assert!(matches!(refuse(far, vec![bone(None)], good.clone()), BodyError::TriangleOutOfRange { vertex: 3, .. }));
        let mut broken = triangle();
        broken.vertices[1].x = f64::NAN;
        assert!(matches!(refuse(broken, vec![bone(None)], good), BodyError::NonFinite { vertex: 1 }));
    }
}
