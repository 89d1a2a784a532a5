//! The energy λ_n E_nonrigid + λ_s E_skeleton + λ_g E_graph + λ_b E_binding over the twists of nodes, and optionally of
//! bones.

mod bones;
mod data_term;
mod options;

use std::sync::Arc;

use energy_elements::{Binding, GraphEdge, SkeletonPlane};
use energy_solve::{CouplingError, Couplings, LeastSquaresTerm, Loss, Pattern, Placed, ResidualTerm};
use nalgebra::{Isometry3, Vector3};

use self::bones::{BoneStencils, BoneTerms};
use self::data_term::{DataTerm, data_term};
pub use self::data_term::{Moved, Pair};
pub use self::options::{BoneMode, EdgeWeight, EnergyOptions, NormalDerivative, TermWeights};
use crate::body::Bone;
use crate::model::DeformationModel;
use crate::option_error::OptionError;
use crate::twist::{Twist, blended};

/// An energy that cannot be created.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EnergyError {
    /// There are fewer bones than the four that a declared residual blends.
    #[error("expected at least four bones if bones are unknowns, got {0}")]
    TooFewBones(usize),
    /// An option cannot be used.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The model names a node or bone that does not exist, which is a bug.
    #[error(transparent)]
    Coupling(#[from] CouplingError),
}

/// Motions near which bones are expected, in the model's coordinates.
#[derive(Clone, Copy, Debug)]
pub struct BoneTargets<'a> {
    /// Motions that a body tracker reports; `None` without one.
    pub reported: Option<&'a [Isometry3<f64>]>,
    /// Motions predicted from the last frames.
    pub expected: &'a [Isometry3<f64>],
    /// Factor of λ_prior: 1 for reported bones with the errors for which λ_prior was chosen, less for larger errors.
    pub trust: f64,
}

/// The energy of a model. The data change with each search for correspondences, the other terms do not.
///
/// The unknowns are the twists of the nodes, followed by those of the bones if bones are unknown.
#[derive(Debug)]
pub struct FusionEnergy {
    /// Options of the energy.
    pub options: EnergyOptions,
    pattern: Arc<Pattern>,
    data: Box<dyn DataTerm>,
    graph: ResidualTerm<GraphEdge, 6>,
    binding: ResidualTerm<Binding, 6>,
    bones: Option<BoneTerms>,
}

impl FusionEnergy {
    /// Creates the energy of a model, without data.
    ///
    /// # Errors
    /// If an option cannot be used, or bones are unknowns and there are fewer than four.
    pub fn new(model: &DeformationModel, options: EnergyOptions) -> Result<Self, EnergyError> {
        options.validate()?;
        let nodes = model.nodes.len();
        let unknown_bones = options.bones == BoneMode::Unknown;
        if unknown_bones && model.bones.len() < 4 {
            return Err(EnergyError::TooFewBones(model.bones.len()));
        }
        let edges: Vec<[u32; 2]> = model
            .graph
            .iter()
            .enumerate()
            .flat_map(|(i, around)| around.iter().map(move |&j| [i as u32, j as u32]))
            .collect();
        let skinning = unknown_bones.then(|| BoneStencils::new(model));
        let bone_count = skinning.as_ref().map_or(0, |_| model.bones.len());
        let all: Vec<&[u32]> = model
            .vertex_nodes
            .iter()
            .map(Vec::as_slice)
            .chain(edges.iter().map(<[u32; 2]>::as_slice))
            .chain(skinning.iter().flat_map(BoneStencils::all))
            .collect();
        let pattern = Arc::new(Couplings::pattern(nodes + bone_count, all.iter().copied())?);

        let turn = options.angle.turn();
        let data = data_term(model, &options, &pattern)?;
        let couplings = Arc::new(Couplings::new(&pattern, &edges)?);
        let mut graph = ResidualTerm::new("graph", couplings, options.weights.graph);
        graph.loss = options.graph_huber.map_or(Loss::Squares, Loss::Huber);
        graph.set_elements(edges.iter().enumerate().map(|(edge, &[i, j])| {
            let s = model.attachments.square_distance(i as usize, j as usize);
            Placed {
                element: GraphEdge::new(turn, model.nodes[j as usize].into()),
                stencil: edge as u32,
                weight: options.edges.of(s, EdgeWeight::DELTA),
            }
        }));
        let own: Vec<[u32; 1]> = (0..nodes as u32).map(|node| [node]).collect();
        let couplings = Arc::new(Couplings::new(&pattern, &own)?);
        let binding = ResidualTerm::new("binding", couplings, options.weights.binding);
        let bones = skinning.map(|stencils| stencils.terms(model, &options, &pattern)).transpose()?;
        Ok(Self { options, pattern, data, graph, binding, bones })
    }

    /// Returns the pattern of JᵀJ.
    #[must_use]
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Replaces the data. `moved` contains the normals for [`NormalDerivative::Frozen`].
    pub fn set_pairs(&mut self, model: &DeformationModel, pairs: &[Pair], moved: &Moved) {
        self.data.set_pairs(model, pairs, Some(&moved.normals));
        if let Some(bones) = &mut self.bones {
            let turn = self.options.angle.turn();
            let shares = &bones.shares;
            bones.skeleton.set_elements(pairs.iter().map(|pair| {
                let vertex = pair.vertex as usize;
                let (v, n) = (model.mesh.vertices[vertex].into(), model.mesh.normals[vertex].into());
                let element = SkeletonPlane::new(turn, shares[vertex], v, n, pair.point.into());
                Placed { element, stencil: pair.vertex, weight: 1.0 }
            }));
        }
    }

    /// Replaces the targets of bones, in the model's coordinates. Without reported motions, known bones release their
    /// nodes, and unknown ones stay near the expected motions.
    pub fn set_bones(&mut self, model: &DeformationModel, targets: &BoneTargets<'_>) {
        if let Some(bones) = &mut self.bones {
            bones.set_targets(model, &self.options, targets);
            return;
        }
        let Some(motions) = targets.reported else {
            self.binding.set_elements([]);
            return;
        };
        self.bind(model, motions, None);
    }

    /// Binds nodes to known bones, in the model's coordinates. With the twists `x`, targets follow the nodes along
    /// their normals by the part κ of [`EnergyOptions::normal_slack`]: x̃ + κ ñ ñ·(T x − x̃). A node far from its bones
    /// is only pulled with (1 − κ) λ_b along the normal, but with λ_b along the surface.
    pub fn bind(&mut self, model: &DeformationModel, motions: &[Isometry3<f64>], x: Option<&[Twist]>) {
        let EnergyOptions { angle, normal_slack, .. } = self.options;
        let turn = angle.turn();
        self.binding.set_elements(model.nodes.iter().enumerate().map(|(node, place)| {
            let row = &model.attachments.rows[node];
            let mut target = bound_place(place, row, motions);
            if let Some(x) = x {
                let moved = angle.motion(&x[node]).transform_point(&(*place).into()).coords;
                let normal = bound_normal(&model.node_normals[node], row, motions);
                target += normal_slack * normal.dot(&(moved - target)) * normal;
            }
            Placed { element: Binding::new(turn, (*place).into(), target.into()), stencil: node as u32, weight: 1.0 }
        }));
    }

    /// Returns the motions between the reported and the expected ones where unknown bones start: rotations and
    /// translations are averaged with the weights of the terms.
    #[must_use]
    pub fn bone_start(&self, targets: &BoneTargets<'_>) -> Vec<Isometry3<f64>> {
        let TermWeights { prior, motion, .. } = self.options.weights;
        let prior = targets.trust * prior;
        let Some(reported) = targets.reported.filter(|_| prior > 0.0) else { return targets.expected.to_vec() };
        let both = reported.iter().zip(targets.expected);
        both.map(|(reported, expected)| blended([(prior, reported), (motion, expected)].into_iter())).collect()
    }

    /// Returns the mean square distance in m² between two motions of unknown bones, at the points where the prior
    /// compares them: at [`EnergyOptions::prior_reach`] from the joints.
    #[must_use]
    pub fn bone_difference(&self, bones: &[Bone], first: &[Isometry3<f64>], second: &[Isometry3<f64>]) -> f64 {
        BoneTerms::square_difference(bones, self.options.prior_reach, first, second)
    }

    /// Returns the terms that depend on the unknowns.
    #[must_use]
    pub fn terms(&self) -> Vec<&dyn LeastSquaresTerm<6>> {
        let mut terms: Vec<&dyn LeastSquaresTerm<6>> = vec![self.data.term(), &self.graph];
        match &self.bones {
            Some(bones) => {
                terms.extend([
                    &bones.skeleton as &dyn LeastSquaresTerm<6>,
                    &bones.binding,
                    &bones.prior,
                    &bones.joints,
                ]);
            }
            None => terms.push(&self.binding),
        }
        terms
    }

    /// Computes the Jacobians of all terms and discards them, to measure the cost of derivatives alone. Returns the sum
    /// of some entries.
    #[must_use]
    pub fn evaluate_jacobians(&self, x: &[Twist]) -> f64 {
        let sum = self.data.evaluate_jacobians(x) + self.graph.evaluate_jacobians(x);
        sum + match &self.bones {
            Some(bones) => bones.evaluate_jacobians(x),
            None => self.binding.evaluate_jacobians(x),
        }
    }

    /// Returns all vertices and normals, moved by the twists.
    #[must_use]
    pub fn moved(&self, x: &[Twist]) -> Moved {
        self.data.moved(x)
    }
}

/// Returns x̃ = Σ_j η_j T_bj x.
fn bound_place(x: &Vector3<f64>, row: &[f64], motions: &[Isometry3<f64>]) -> Vector3<f64> {
    let followed = row.iter().zip(motions).filter(|(share, _)| **share > 0.0);
    followed.map(|(share, motion)| *share * motion.transform_point(&(*x).into()).coords).sum()
}

/// Returns ñ = Σ η_j R_bj n with unit length; zero if the sum vanishes.
fn bound_normal(n: &Vector3<f64>, row: &[f64], motions: &[Isometry3<f64>]) -> Vector3<f64> {
    let followed = row.iter().zip(motions).filter(|(share, _)| **share > 0.0);
    let sum: Vector3<f64> = followed.map(|(share, motion)| *share * (motion.rotation * n)).sum();
    sum.try_normalize(1e-9).unwrap_or_default()
}

/// Returns λ_s E_skeleton of known bones, Σ (ñ·(ṽ − u))² over the pairs. It does not depend on the unknowns.
#[must_use]
pub fn skeleton_energy(model: &DeformationModel, lambda: f64, motions: &[Isometry3<f64>], pairs: &[Pair]) -> f64 {
    let one = |pair: &Pair| {
        let vertex = pair.vertex as usize;
        let (v, n) = (model.mesh.vertices[vertex], model.mesh.normals[vertex]);
        let (mut moved, mut normal) = (Vector3::zeros(), Vector3::zeros());
        for &(bone, share) in &model.vertex_bones[vertex] {
            moved += share * motions[bone].transform_point(&v.into()).coords;
            normal += share * (motions[bone].rotation * n);
        }
        normal.dot(&(moved - pair.point)).powi(2)
    };
    lambda * pairs.iter().map(one).sum::<f64>()
}
