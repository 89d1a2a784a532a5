use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::attachments::{Attachments, FillReport};
use super::neighbours::Near;
use super::node_space::{NodeDistance, NodeSpace};
use crate::body::{Bone, Mesh, SkinnedBody};
use crate::option_error::OptionError;
use crate::twist::{AngleConvention, Twist, blended};

/// Options of a [`DeformationModel`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModelOptions {
    /// Distance between nodes, in m, which is also the width of their influence.
    pub node_radius: f64,
    /// K, the number of nodes that move a vertex: 1, 4 or 8.
    pub nodes_per_vertex: usize,
    /// Neighbours of a node in the graph.
    pub graph_neighbours: usize,
    /// Distance in m that entirely different attachments add between nodes and vertices, so that the two arms, or arm
    /// and trunk, do not move each other on contact.
    pub attachment_length: f64,
    /// Attach nodes to the nearest bone within this distance, in m, then fill and relax. `None` uses the skinning
    /// weights of the body.
    pub attachment_reach: Option<f64>,
    /// Passes of relaxation after a fill.
    pub relaxations: usize,
    /// Distance of nodes from each other and from vertices.
    pub distance: NodeDistance,
}

impl Default for ModelOptions {
    fn default() -> Self {
        Self {
            node_radius: 0.06,
            nodes_per_vertex: 4,
            graph_neighbours: 8,
            attachment_length: 0.1,
            attachment_reach: None,
            relaxations: 2,
            distance: NodeDistance::Surface,
        }
    }
}

impl ModelOptions {
    /// Largest number of relaxations: attachments are then the same on the whole body.
    const MOST_RELAXATIONS: usize = 100;

    /// Checks every option except the number of nodes per vertex, which has its own error.
    ///
    /// # Errors
    /// Names the first option that cannot be used.
    pub fn validate(&self) -> Result<(), OptionError> {
        OptionError::ensure_positive("model.node_radius", self.node_radius)?;
        OptionError::ensure(self.graph_neighbours > 0, "model.graph_neighbours", "at least 1", self.graph_neighbours)?;
        OptionError::ensure_not_negative("model.attachment_length", self.attachment_length)?;
        if let Some(reach) = self.attachment_reach {
            OptionError::ensure_positive("model.attachment_reach", reach)?;
        }
        let few = self.relaxations <= Self::MOST_RELAXATIONS;
        OptionError::ensure(few, "model.relaxations", "at most 100", self.relaxations)
    }
}

/// A body for which no model can be created.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// K is not 1, 4 or 8.
    #[error("expected 1, 4 or 8 nodes per vertex, got {0}")]
    NodesPerVertex(usize),
    /// There are fewer nodes than a vertex or a node needs.
    #[error(
        "{nodes} nodes, but {needed} are needed ({what}); \
         reduce the node radius of {radius_mm} mm, or ask for fewer nodes"
    )]
    TooFewNodes {
        /// Number of nodes.
        nodes: usize,
        /// Required number.
        needed: usize,
        /// Purpose of the nodes.
        what: &'static str,
        /// Sampling radius, in mm.
        radius_mm: usize,
    },
    /// An option cannot be used.
    #[error(transparent)]
    Option(#[from] OptionError),
}

/// Nodes on a body, and everything that is constant while they move. Coordinates are relative to [`Self::origin`], the
/// mesh's centroid at rest: rotations about a distant origin would couple rotation and translation of a node.
#[derive(Clone, Debug)]
pub struct DeformationModel {
    /// The origin in the world.
    pub origin: Vector3<f64>,
    /// The mesh at rest.
    pub mesh: Mesh,
    /// The bones at rest.
    pub bones: Vec<Bone>,
    /// Positions of the nodes at rest.
    pub nodes: Vec<Vector3<f64>>,
    /// Unit normals of the surface at the nodes, at rest.
    pub node_normals: Vec<Vector3<f64>>,
    /// Neighbours of each node, without itself.
    pub graph: Vec<Vec<usize>>,
    /// Weights of the bones for each node.
    pub attachments: Attachments,
    /// Nodes that move each vertex, nearest first.
    pub vertex_nodes: Vec<Vec<u32>>,
    /// Weights of these nodes.
    pub vertex_weights: Vec<Vec<f64>>,
    /// Weights of the bones for each vertex: the weighted mean of its nodes' attachments.
    pub vertex_bones: Vec<Vec<(usize, f64)>>,
    /// Statistics of filling the attachments.
    pub fill: FillReport,
    /// Options of the model.
    pub options: ModelOptions,
}

impl DeformationModel {
    /// Samples nodes on a body and connects them.
    ///
    /// # Errors
    /// If an option cannot be used, K is not 1, 4 or 8, or there are too few nodes.
    pub fn new(body: &SkinnedBody, options: ModelOptions) -> Result<Self, ModelError> {
        let ModelOptions { node_radius, nodes_per_vertex, graph_neighbours, attachment_length, .. } = options;
        options.validate()?;
        if ![1, 4, 8].contains(&nodes_per_vertex) {
            return Err(ModelError::NodesPerVertex(nodes_per_vertex));
        }
        let origin = body.mesh.centroid();
        let mut mesh = body.mesh.clone();
        mesh.vertices.iter_mut().for_each(|vertex| *vertex -= origin);
        let shifted = |point: [f64; 3]| (Vector3::from(point) - origin).into();
        let bones: Vec<Bone> = body
            .bones
            .iter()
            .map(|bone| Bone { head: shifted(bone.head), tail: shifted(bone.tail), ..bone.clone() })
            .collect();

        let space = NodeSpace::new(body, &mesh.vertices, options.distance, node_radius);
        let nodes: Vec<Vector3<f64>> = space.nodes.iter().map(|&vertex| mesh.vertices[vertex]).collect();
        let node_normals = space.nodes.iter().map(|&vertex| mesh.normals[vertex]).collect();
        for (needed, what) in
            [(nodes_per_vertex, "to move a vertex"), (graph_neighbours + 1, "for a node's neighbours")]
        {
            if nodes.len() < needed {
                let radius_mm = (1e3 * node_radius) as usize;
                return Err(ModelError::TooFewNodes { nodes: nodes.len(), needed, what, radius_mm });
            }
        }
        let dense = |vertex: usize| {
            let mut row = vec![0.0; bones.len()];
            body.weights[vertex].iter().for_each(|&(bone, weight)| row[bone] += weight);
            row
        };
        let skinning: Vec<Vec<f64>> = (0..mesh.vertices.len()).map(dense).collect();
        let (attachments, fill) = attach(&space, &nodes, &bones, &skinning, &options);

        let square_length = attachment_length * attachment_length;
        let near = space.around_nodes(graph_neighbours, |i, j| square_length * attachments.square_distance(i, j));
        let graph = near.into_iter().map(|near| near.into_iter().map(|(node, _)| node).collect()).collect();
        let apart = |vertex: usize, node: usize| {
            let there = &skinning[space.nodes[node]];
            square_length * skinning[vertex].iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
        };
        let (mut vertex_nodes, mut vertex_weights, mut vertex_bones) = (Vec::new(), Vec::new(), Vec::new());
        for around in space.around_vertices(nodes_per_vertex, apart) {
            // The nearest node has weight 1, so that the weights of distant nodes do not all vanish.
            let weights: Vec<f64> =
                around.iter().map(|(_, s)| (-(s - around[0].1) / (2.0 * node_radius * node_radius)).exp()).collect();
            vertex_bones.push(mean_attachment(&attachments, &around, &weights));
            vertex_nodes.push(around.iter().map(|&(node, _)| node as u32).collect());
            vertex_weights.push(weights);
        }
        Ok(Self {
            origin,
            mesh,
            bones,
            nodes,
            node_normals,
            graph,
            attachments,
            vertex_nodes,
            vertex_weights,
            vertex_bones,
            fill,
            options,
        })
    }

    /// Returns the motion of each vertex from rest, in the model's coordinates: the dual quaternion blend of its nodes.
    #[must_use]
    pub fn vertex_motions(&self, twists: &[Twist], angle: AngleConvention) -> Vec<Isometry3<f64>> {
        let nodes: Vec<Isometry3<f64>> = twists.iter().map(|twist| angle.motion(twist)).collect();
        let of_vertex = |(ids, weights): (&Vec<u32>, &Vec<f64>)| {
            blended(weights.iter().zip(ids).map(|(weight, &node)| (*weight, &nodes[node as usize])))
        };
        self.vertex_nodes.iter().zip(&self.vertex_weights).map(of_vertex).collect()
    }

    /// Returns the mesh with moved vertices, given in the model's coordinates, as the camera sees it: in the camera's
    /// coordinates, without normals.
    pub(crate) fn seen(&self, vertices: impl Iterator<Item = Vector3<f64>>) -> Mesh {
        let vertices = vertices.map(|vertex| vertex + self.origin).collect();
        Mesh { vertices, normals: Vec::new(), triangles: self.mesh.triangles.clone() }
    }

    /// Converts a motion from the world to the model's coordinates: (R, t) becomes (R, t + R o − o).
    #[must_use]
    pub fn centred(&self, motion: &Isometry3<f64>) -> Isometry3<f64> {
        let shift = motion.translation.vector + motion.rotation * self.origin - self.origin;
        Isometry3::from_parts(shift.into(), motion.rotation)
    }
}

/// Returns the attachments of the nodes: the body's skinning weights, or the nearest bones, smoothed.
fn attach(
    space: &NodeSpace<'_>,
    nodes: &[Vector3<f64>],
    bones: &[Bone],
    skinning: &[Vec<f64>],
    options: &ModelOptions,
) -> (Attachments, FillReport) {
    let Some(reach) = options.attachment_reach else {
        let rows = space.nodes.iter().map(|&vertex| skinning[vertex].clone()).collect();
        return (Attachments::given(rows), FillReport { passes: 0, left: Vec::new() });
    };
    let segments: Vec<[Vector3<f64>; 2]> = bones.iter().map(|bone| [bone.head.into(), bone.tail.into()]).collect();
    let mut attachments = Attachments::nearest_bone(nodes, &segments, reach);
    let graph = symmetric(&space.around_nodes(options.graph_neighbours, |_, _| 0.0));
    let report = attachments.fill(&graph);
    (0..options.relaxations).for_each(|_| attachments.relax_once(&graph));
    (attachments, report)
}

/// Returns a graph with the edges of both directions: otherwise a fill could not reach nodes that are not neighbours of
/// others.
fn symmetric(near: &[Near]) -> Vec<Vec<usize>> {
    let mut graph: Vec<Vec<usize>> = near.iter().map(|near| near.iter().map(|&(node, _)| node).collect()).collect();
    for (i, near) in near.iter().enumerate() {
        for &(j, _) in near {
            if !graph[j].contains(&i) {
                graph[j].push(i);
            }
        }
    }
    graph
}

/// Returns Σ w_k H_k/Σ w_k, with bones from the largest weight on.
fn mean_attachment(attachments: &Attachments, around: &[(usize, f64)], weights: &[f64]) -> Vec<(usize, f64)> {
    let bones = attachments.rows.first().map_or(0, Vec::len);
    let sum: f64 = weights.iter().sum();
    let mean = |bone: usize| {
        around.iter().zip(weights).map(|(&(node, _), w)| w * attachments.rows[node][bone]).sum::<f64>() / sum
    };
    let mut mixed: Vec<(usize, f64)> = (0..bones).map(|bone| (bone, mean(bone))).filter(|(_, w)| *w > 0.0).collect();
    mixed.sort_by(|a, b| b.1.total_cmp(&a.1));
    mixed
}
