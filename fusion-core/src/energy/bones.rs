//! Terms for unknown bones.

use std::sync::Arc;

use energy_elements::{Binding, BoneBinding, GraphEdge, SkeletonPlane};
use energy_solve::{CouplingError, Couplings, Loss, Pattern, Placed, ResidualTerm};
use nalgebra::{Isometry3, Vector3};

use super::BoneTargets;
use super::options::{EnergyOptions, TermWeights};
use crate::body::Bone;
use crate::model::DeformationModel;
use crate::twist::Twist;

/// The terms for unknown bones.
#[derive(Debug)]
pub(super) struct BoneTerms {
    pub(super) skeleton: ResidualTerm<SkeletonPlane, 6>,
    pub(super) binding: ResidualTerm<BoneBinding, 6>,
    pub(super) prior: ResidualTerm<Binding, 6>,
    pub(super) joints: ResidualTerm<GraphEdge, 6>,
    /// Weights of the four bones of each vertex's stencil.
    pub(super) shares: Vec<[f64; 4]>,
}

impl BoneTerms {
    /// Replaces the motions near which bones stay: the reported ones with the weight λ_prior, and the expected ones
    /// with the weight λ_motion.
    pub(super) fn set_targets(&mut self, model: &DeformationModel, options: &EnergyOptions, targets: &BoneTargets<'_>) {
        let (turn, TermWeights { prior, motion, .. }) = (options.angle.turn(), options.weights);
        let sources =
            [targets.reported.map(|motions| (targets.trust * prior, motions)), Some((motion, targets.expected))];
        let elements = sources.into_iter().flatten().flat_map(|(weight, motions)| {
            model.bones.iter().enumerate().flat_map(move |(bone, at)| {
                prior_places(at, options.prior_reach).map(move |x| {
                    let target = motions[bone].transform_point(&x.into()).coords;
                    Placed { element: Binding::new(turn, x.into(), target.into()), stencil: bone as u32, weight }
                })
            })
        });
        self.prior.set_elements(elements.filter(|placed| placed.weight > 0.0));
    }

    /// Returns the mean square distance between two motions of the bones, in m², at the points where the prior compares
    /// them.
    pub(super) fn square_difference(
        bones: &[Bone],
        reach: f64,
        first: &[Isometry3<f64>],
        second: &[Isometry3<f64>],
    ) -> f64 {
        let one = |((bone, first), second): ((&Bone, &Isometry3<f64>), &Isometry3<f64>)| {
            let places = prior_places(bone, reach).map(nalgebra::Point3::from);
            places.map(|x| (first.transform_point(&x) - second.transform_point(&x)).norm_squared()).iter().sum::<f64>()
        };
        bones.iter().zip(first).zip(second).map(one).sum::<f64>() / (4 * bones.len()) as f64
    }

    pub(super) fn evaluate_jacobians(&self, x: &[Twist]) -> f64 {
        let Self { skeleton, binding, prior, joints, .. } = self;
        let data = skeleton.evaluate_jacobians(x) + binding.evaluate_jacobians(x);
        data + prior.evaluate_jacobians(x) + joints.evaluate_jacobians(x)
    }
}

/// Returns four points around a bone's joint, at which its motion is compared with another: the corners of a
/// tetrahedron, so that rotation and translation do not mix.
fn prior_places(bone: &Bone, reach: f64) -> [Vector3<f64>; 4] {
    let head = Vector3::from(bone.head);
    [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
        .map(|corner| head + reach / 3.0_f64.sqrt() * Vector3::from(corner))
}

/// Stencils of the terms for unknown bones. The blocks of the bones follow those of the nodes.
pub(super) struct BoneStencils {
    vertices: Vec<[u32; 4]>,
    vertex_shares: Vec<[f64; 4]>,
    nodes: Vec<[u32; 5]>,
    node_shares: Vec<[f64; 4]>,
    joints: Vec<[u32; 2]>,
}

impl BoneStencils {
    pub(super) fn new(model: &DeformationModel) -> Self {
        let first = model.nodes.len() as u32;
        let (vertices, vertex_shares) = model.vertex_bones.iter().map(|bones| four_bones(model, bones, first)).unzip();
        let (mut nodes, mut node_shares) = (Vec::new(), Vec::new());
        for (node, row) in model.attachments.rows.iter().enumerate() {
            let mut bones: Vec<(usize, f64)> = row.iter().copied().enumerate().filter(|(_, s)| *s > 0.0).collect();
            bones.sort_by(|a, b| b.1.total_cmp(&a.1));
            let ([a, b, c, d], shares) = four_bones(model, &bones, first);
            nodes.push([node as u32, a, b, c, d]);
            node_shares.push(shares);
        }
        let joints = model
            .bones
            .iter()
            .enumerate()
            .filter_map(|(bone, b)| Some([first + b.parent? as u32, first + bone as u32]))
            .collect();
        Self { vertices, vertex_shares, nodes, node_shares, joints }
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &[u32]> {
        let vertices = self.vertices.iter().map(<[u32; 4]>::as_slice);
        let nodes = self.nodes.iter().map(<[u32; 5]>::as_slice);
        vertices.chain(nodes).chain(self.joints.iter().map(<[u32; 2]>::as_slice))
    }

    pub(super) fn terms(
        self,
        model: &DeformationModel,
        options: &EnergyOptions,
        pattern: &Pattern,
    ) -> Result<BoneTerms, CouplingError> {
        let (turn, weights) = (options.angle.turn(), &options.weights);
        let first = model.nodes.len() as u32;
        let coupled = |stencils: &[[u32; 4]]| Couplings::new(pattern, stencils).map(Arc::new);
        let mut skeleton = ResidualTerm::new("skeleton", coupled(&self.vertices)?, weights.skeleton);
        skeleton.loss = options.data_tukey.map_or(Loss::Squares, Loss::Tukey);
        let mut binding =
            ResidualTerm::new("binding", Arc::new(Couplings::new(pattern, &self.nodes)?), weights.binding);
        binding.set_elements(model.nodes.iter().enumerate().map(|(node, x)| Placed {
            element: BoneBinding::new(turn, self.node_shares[node], (*x).into()),
            stencil: node as u32,
            weight: 1.0,
        }));
        let own: Vec<[u32; 1]> = (0..model.bones.len() as u32).map(|bone| [first + bone]).collect();
        let prior = ResidualTerm::new("prior", Arc::new(Couplings::new(pattern, &own)?), 1.0);
        let couplings = Arc::new(Couplings::new(pattern, &self.joints)?);
        let mut joints = ResidualTerm::new("joints", couplings, weights.joints);
        joints.set_elements(self.joints.iter().enumerate().map(|(joint, &[_, child])| Placed {
            element: GraphEdge::new(turn, model.bones[(child - first) as usize].head),
            stencil: joint as u32,
            weight: 1.0,
        }));
        Ok(BoneTerms { skeleton, binding, prior, joints, shares: self.vertex_shares })
    }
}

/// Returns the four bones of largest weight, with weights normalised to a sum of 1. Bones with zero weight fill up the
/// four: first parents and children, so that few blocks are added.
fn four_bones(model: &DeformationModel, bones: &[(usize, f64)], first: u32) -> ([u32; 4], [f64; 4]) {
    let mut chosen: Vec<(usize, f64)> = bones.iter().copied().take(4).collect();
    let mut related: Vec<usize> = Vec::new();
    for &(bone, _) in &chosen {
        related.extend(model.bones[bone].parent);
        related.extend((0..model.bones.len()).filter(|&other| model.bones[other].parent == Some(bone)));
    }
    for bone in related.into_iter().chain(0..model.bones.len()) {
        if chosen.len() == 4 {
            break;
        }
        if chosen.iter().all(|&(other, _)| other != bone) {
            chosen.push((bone, 0.0));
        }
    }
    let sum: f64 = chosen.iter().map(|(_, share)| share).sum();
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    (std::array::from_fn(|i| first + chosen[i].0 as u32), std::array::from_fn(|i| scale * chosen[i].1))
}
