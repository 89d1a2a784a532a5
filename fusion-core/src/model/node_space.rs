use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::neighbours::{Near, nearest, nearest_on_surface};
use super::nodes::{sample_nodes, sample_on_surface};
use super::surface::Surface;
use crate::body::{Bone, SkinnedBody};

/// The distance by which nodes are sampled, connected, and assigned to vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeDistance {
    /// Along the surface of the mesh at rest. Parts that only touch at rest, such as a hand on a thigh, stay apart.
    #[default]
    Surface,
    /// Straight through space.
    Euclidean,
}

/// The nodes of a mesh, and distances from them.
pub(super) struct NodeSpace<'a> {
    vertices: &'a [Vector3<f64>],
    /// Vertex of each node.
    pub(super) nodes: Vec<usize>,
    /// `None` for straight distances.
    surface: Option<Surface>,
    radius: f64,
}

impl<'a> NodeSpace<'a> {
    /// Samples nodes at least `radius` apart such that every vertex is within `radius` of one.
    pub(super) fn new(body: &SkinnedBody, vertices: &'a [Vector3<f64>], kind: NodeDistance, radius: f64) -> Self {
        let surface = (kind == NodeDistance::Surface).then(|| surface_of(body));
        let nodes = match &surface {
            Some(surface) => sample_on_surface(surface, vertices.len(), radius),
            None => sample_nodes(vertices, radius),
        };
        Self { vertices, nodes, surface, radius }
    }

    /// Returns the nodes nearest to each node, without itself. The squared distance of nodes i and j grows by
    /// `extra(i, j)`.
    pub(super) fn around_nodes(&self, count: usize, extra: impl Fn(usize, usize) -> f64) -> Vec<Near> {
        let Some(surface) = &self.surface else {
            let places: Vec<Vector3<f64>> = self.nodes.iter().map(|&vertex| self.vertices[vertex]).collect();
            let around = |i: usize| nearest(&places[i], &places, count, |j| extra(i, j), Some(i));
            return (0..places.len()).map(around).collect();
        };
        let mut node_at = vec![None; self.vertices.len()];
        let mut counts = vec![0; self.vertices.len()];
        for (node, &vertex) in self.nodes.iter().enumerate() {
            node_at[vertex] = Some(node);
            counts[vertex] = count + 1;
        }
        let own = |vertex: usize, j: usize| node_at[vertex].map_or(0.0, |i| if i == j { -1.0 } else { extra(i, j) });
        let mut near = nearest_on_surface(surface, &self.nodes, &counts, self.first_limit(), own);
        let without_itself = |(node, &vertex): (usize, &usize)| {
            let mut around = std::mem::take(&mut near[vertex]);
            around.retain(|&(other, _)| other != node);
            around
        };
        self.nodes.iter().enumerate().map(without_itself).collect()
    }

    /// Returns the nodes nearest to each vertex. The squared distance of vertex v and node i grows by `extra(v, i)`.
    pub(super) fn around_vertices(&self, count: usize, extra: impl Fn(usize, usize) -> f64) -> Vec<Near> {
        let Some(surface) = &self.surface else {
            let places: Vec<Vector3<f64>> = self.nodes.iter().map(|&vertex| self.vertices[vertex]).collect();
            let around = |(v, place)| nearest(place, &places, count, |i| extra(v, i), None);
            return self.vertices.iter().enumerate().map(around).collect();
        };
        nearest_on_surface(surface, &self.nodes, &vec![count; self.vertices.len()], self.first_limit(), extra)
    }

    /// Distance at which a search along the surface usually meets enough nodes.
    fn first_limit(&self) -> f64 {
        4.0 * self.radius
    }
}

/// Returns the surface of a body. Disconnected parts are joined where they are close and belong to nearby bones: the
/// trunk to the arm at the shoulder, not at the hand.
fn surface_of(body: &SkinnedBody) -> Surface {
    /// Distance in m that one step between bones counts for.
    const HOP_LENGTH: f64 = 0.1;
    let heaviest =
        |vertex: usize| body.weights[vertex].iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(bone, _)| *bone);
    let hops = bone_hops(&body.bones);
    let between = |a: usize, b: usize| match (heaviest(a), heaviest(b)) {
        (Some(a), Some(b)) => HOP_LENGTH * hops[a][b] as f64,
        _ => 0.0,
    };
    Surface::new(&body.mesh.vertices, &body.mesh.triangles, between)
}

/// Returns the number of steps between each two bones of a tree; bones of different trees are as far as all bones.
fn bone_hops(bones: &[Bone]) -> Vec<Vec<usize>> {
    let far = bones.len();
    let mut hops: Vec<Vec<usize>> = vec![vec![far; bones.len()]; bones.len()];
    for (bone, Bone { parent, .. }) in bones.iter().enumerate() {
        hops[bone][bone] = 0;
        for other in 0..bone {
            let steps = parent.map_or(far, |parent| (hops[parent][other] + 1).min(far));
            (hops[bone][other], hops[other][bone]) = (steps, steps);
        }
    }
    hops
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Mesh, figure, figure_motion};

    #[test]
    fn steps_between_bones_are_counted_along_the_tree() {
        let bones = figure().bones;
        let hops = bone_hops(&bones);
        let at = |name: &str| bones.iter().position(|bone| bone.name == name).unwrap();
        assert_eq!(hops[at("LeftHand")][at("LeftForeArm")], 1);
        assert_eq!(hops[at("LeftHand")][at("LeftUpLeg")], 6, "forearm, arm, chest, spine, hips, thigh");
        assert_eq!(hops[at("LeftUpLeg")][at("LeftHand")], 6);
    }

    /// A strip folded in two: a hairpin whose ends lie 2 cm apart, one above the other.
    fn hairpin() -> SkinnedBody {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for step in 0..=60 {
            let (x, z) = if step <= 30 { (0.02 * step as f64, 0.0) } else { (0.02 * (60 - step) as f64, 0.02) };
            vertices.extend([Vector3::new(x, 0.0, z), Vector3::new(x, 0.02, z)]);
            if step > 0 {
                let a = 2 * (step - 1);
                triangles.extend([[a, a + 1, a + 2], [a + 1, a + 3, a + 2]]);
            }
        }
        let weights = vec![vec![(0, 1.0)]; vertices.len()];
        let bone = Bone { name: "root".into(), parent: None, head: [0.0; 3], tail: [0.0, 0.0, 1.0] };
        SkinnedBody::new(Mesh::new(vertices, triangles), vec![bone], weights).unwrap()
    }

    #[test]
    fn layers_that_touch_share_nodes_only_by_straight_distances() {
        let body = hairpin();
        let lower = |vertex: usize| vertex < 40;
        let upper = |vertex: usize| vertex > 82;
        for (kind, shared) in [(NodeDistance::Surface, false), (NodeDistance::Euclidean, true)] {
            let space = NodeSpace::new(&body, &body.mesh.vertices, kind, 0.05);
            let vertices = space.around_vertices(3, |_, _| 0.0);
            let mixed = vertices.iter().enumerate().any(|(vertex, near)| {
                lower(vertex) && near.iter().any(|&(node, _)| upper(space.nodes[node]))
                    || upper(vertex) && near.iter().any(|&(node, _)| lower(space.nodes[node]))
            });
            let edges = space.around_nodes(2, |_, _| 0.0);
            let crossing = edges
                .iter()
                .enumerate()
                .any(|(i, near)| lower(space.nodes[i]) && near.iter().any(|&(j, _)| upper(space.nodes[j])));
            assert_eq!(mixed, shared, "{kind:?}");
            assert!(shared || !crossing, "edges along the surface stay on their layer");
            assert!(edges.iter().enumerate().all(|(i, near)| near.len() == 2 && near.iter().all(|&(j, _)| j != i)));
        }
    }

    #[test]
    fn hands_next_to_thighs_keep_their_own_nodes() {
        // Arms hang down: the first frame of many recordings.
        let mut pose = figure_motion(0.0);
        let standing = figure();
        for (shoulder, side) in [(4, -1.0), (7, 1.0)] {
            let head = Vector3::from(standing.bones[shoulder].head);
            let turn = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::z() * (side * 1.6));
            let about = nalgebra::Isometry3::from_parts((head - turn * head).into(), turn);
            (shoulder..shoulder + 3).for_each(|bone| pose[bone] = about * pose[bone]);
        }
        let body = standing.at_rest_in(&pose);
        let space = NodeSpace::new(&body, &body.mesh.vertices, NodeDistance::Surface, 0.06);
        let bone = |vertex: usize| body.weights[vertex][0].0;
        let (mut hands, mut legs) = (0, 0);
        for (vertex, near) in space.around_vertices(4, |_, _| 0.0).iter().enumerate() {
            let of_leg = |&(node, _): &(usize, f64)| (10..16).contains(&bone(space.nodes[node]));
            if [6, 9].contains(&bone(vertex)) {
                hands += 1;
                assert!(!near.iter().any(of_leg), "vertex {vertex} of a hand follows a leg");
            } else if (10..16).contains(&bone(vertex)) {
                legs += 1;
                let of_hand = |&(node, _): &(usize, f64)| [6, 9].contains(&bone(space.nodes[node]));
                assert!(!near.iter().any(of_hand), "vertex {vertex} of a leg follows a hand");
            }
        }
        assert!(hands > 100 && legs > 500);
    }
}
