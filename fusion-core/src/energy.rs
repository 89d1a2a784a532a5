//! The energy: λ_n E_nonrigid + λ_s E_skeleton + λ_g E_graph + λ_b E_binding over the twists of nodes, and perhaps of bones.

use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::PackedResidual;
use energy_elements::{
    Binding, BlendedPoint1, BlendedPoint4, BlendedPoint8, BoneBinding, FrozenPlane1, FrozenPlane4, FrozenPlane8,
    GraphEdge, NonrigidPlane1, NonrigidPlane4, NonrigidPlane8, SkeletonPlane,
};
use energy_solve::{CouplingError, Couplings, LeastSquaresTerm, Loss, NormalPattern, Placed, ResidualTerm};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use crate::body::Bone;
use crate::model::DeformationModel;
use crate::twist::{AngleConvention, Twist};

/// λ of each term, in 1/m² if the energy is to be a number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TermWeights {
    /// λ_n, vertices to measured points along normals.
    pub nonrigid: f64,
    /// λ_s, the same for the skinned skeleton. With known bones it is reported only.
    pub skeleton: f64,
    /// λ_g, neighbouring nodes alike.
    pub graph: f64,
    /// λ_b, nodes with their bones.
    pub binding: f64,
    /// Unknown bones: near to what the body tracker says.
    pub prior: f64,
    /// Unknown bones: together at their joints.
    pub joints: f64,
}

impl Default for TermWeights {
    fn default() -> Self {
        Self { nonrigid: 1.0, skeleton: 1.0, graph: 2.0, binding: 5.0, prior: 3.0, joints: 1000.0 }
    }
}

/// ψ of an edge, by s = |H_i − H_j|².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeWeight {
    /// min(1, δ/s): nodes of one part hold together, those of different parts less.
    #[default]
    Decreasing,
    /// min(1, δ/√s).
    DecreasingByNorm,
    /// Huber's loss ρ(s) itself, as the paper prints it: none inside a part, most across joints.
    Printed,
    /// 1.
    Uniform,
}

impl EdgeWeight {
    /// δ, as the paper has it.
    pub const DELTA: f64 = 0.2;

    /// ψ(s).
    #[must_use]
    pub fn of(self, s: f64, delta: f64) -> f64 {
        match self {
            Self::Decreasing if s <= delta => 1.0,
            Self::Decreasing => delta / s,
            Self::DecreasingByNorm if s.sqrt() <= delta => 1.0,
            Self::DecreasingByNorm => delta / s.sqrt(),
            Self::Printed if s <= delta => s * s / 2.0,
            Self::Printed => delta * (s - delta / 2.0),
            Self::Uniform => 1.0,
        }
    }
}

/// What the normal does in the derivative of the data term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormalDerivative {
    /// It moves with the nodes.
    #[default]
    Full,
    /// It is held, as many systems do.
    Frozen,
}

/// Whether bones are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoneMode {
    /// As the body tracker says.
    #[default]
    Known,
    /// Six unknowns each, near to what the body tracker says.
    Unknown,
}

/// Which energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnergyOptions {
    /// λ.
    pub weights: TermWeights,
    /// ψ.
    pub edges: EdgeWeight,
    /// What ‖θ‖ means.
    pub angle: AngleConvention,
    /// Which Jacobian the data term has.
    pub normal: NormalDerivative,
    /// Whether bones are unknowns.
    pub bones: BoneMode,
    /// Tukey's limit of the data term, m; none for least squares.
    pub data_tukey: Option<f64>,
    /// Huber's limit of the graph, m; none for least squares.
    pub graph_huber: Option<f64>,
}

/// A vertex and the measured point it is matched with, in the model's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The vertex.
    pub vertex: u32,
    /// The point.
    pub point: Vector3<f64>,
}

/// Vertices and normals as moved, in the model's coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moved {
    /// Positions.
    pub vertices: Vec<Vector3<f64>>,
    /// Unit normals.
    pub normals: Vec<Vector3<f64>>,
}

/// What blends K nodes.
trait Blend<const K: usize>: Debug + Send {
    type Plane: PackedResidual<f64> + Debug + Send;
    type Frozen: PackedResidual<f64> + Debug + Send;
    type Point: PackedResidual<f64> + Debug + Send;

    fn plane(turn: f64, w: [f64; K], v: [f64; 3], n: [f64; 3], u: [f64; 3]) -> Self::Plane;
    fn frozen(turn: f64, w: [f64; K], v: [f64; 3], m: [f64; 3], u: [f64; 3]) -> Self::Frozen;
    fn point(turn: f64, w: [f64; K], v: [f64; 3], n: [f64; 3]) -> Self::Point;
}

#[derive(Debug)]
struct One;

impl Blend<1> for One {
    type Plane = NonrigidPlane1;
    type Frozen = FrozenPlane1;
    type Point = BlendedPoint1;

    fn plane(turn: f64, _: [f64; 1], v: [f64; 3], n: [f64; 3], u: [f64; 3]) -> NonrigidPlane1 {
        NonrigidPlane1::new(turn, v, n, u)
    }
    fn frozen(turn: f64, _: [f64; 1], v: [f64; 3], m: [f64; 3], u: [f64; 3]) -> FrozenPlane1 {
        FrozenPlane1::new(turn, v, m, u)
    }
    fn point(turn: f64, _: [f64; 1], v: [f64; 3], n: [f64; 3]) -> BlendedPoint1 {
        BlendedPoint1::new(turn, v, n)
    }
}

macro_rules! blend {
    ($name:ident, $k:literal, $plane:ident, $frozen:ident, $point:ident) => {
        #[derive(Debug)]
        struct $name;

        impl Blend<$k> for $name {
            type Plane = $plane;
            type Frozen = $frozen;
            type Point = $point;

            fn plane(turn: f64, w: [f64; $k], v: [f64; 3], n: [f64; 3], u: [f64; 3]) -> $plane {
                $plane::new(turn, w, v, n, u)
            }
            fn frozen(turn: f64, w: [f64; $k], v: [f64; 3], m: [f64; 3], u: [f64; 3]) -> $frozen {
                $frozen::new(turn, w, v, m, u)
            }
            fn point(turn: f64, w: [f64; $k], v: [f64; 3], n: [f64; 3]) -> $point {
                $point::new(turn, w, v, n)
            }
        }
    };
}

blend!(Four, 4, NonrigidPlane4, FrozenPlane4, BlendedPoint4);
blend!(Eight, 8, NonrigidPlane8, FrozenPlane8, BlendedPoint8);

/// The data term, whatever K.
trait DataTerm: Debug + Send {
    fn set_pairs(&mut self, model: &DeformationModel, pairs: &[Pair], normals: Option<&[Vector3<f64>]>);
    fn moved(&self, x: &[Twist]) -> Moved;
    fn term(&self) -> &dyn LeastSquaresTerm<6>;
}

#[derive(Debug)]
struct Nonrigid<B: Blend<K>, const K: usize> {
    turn: f64,
    full: ResidualTerm<B::Plane, 6>,
    frozen: ResidualTerm<B::Frozen, 6>,
    is_frozen: bool,
    points: ResidualTerm<B::Point, 6>,
}

fn weights_of<const K: usize>(model: &DeformationModel, vertex: usize) -> [f64; K] {
    std::array::from_fn(|k| model.vertex_weights[vertex][k])
}

impl<B: Blend<K>, const K: usize> Nonrigid<B, K> {
    fn new(model: &DeformationModel, options: &EnergyOptions, pattern: &NormalPattern) -> Result<Self, CouplingError> {
        let stencils: Vec<[u32; K]> =
            model.vertex_nodes.iter().map(|nodes| std::array::from_fn(|k| nodes[k])).collect();
        let couplings = Arc::new(Couplings::new(pattern, &stencils)?);
        let (turn, lambda) = (options.angle.turn(), options.weights.nonrigid);
        let mut full = ResidualTerm::new("nonrigid", couplings.clone(), lambda);
        let mut frozen = ResidualTerm::new("nonrigid", couplings.clone(), lambda);
        let loss = options.data_tukey.map_or(Loss::Squares, Loss::Tukey);
        (full.loss, frozen.loss) = (loss, loss);
        let mut points = ResidualTerm::new("vertices", couplings, 1.0);
        points.set_elements((0..model.mesh.vertices.len()).map(|vertex| Placed {
            element: B::point(
                turn,
                weights_of(model, vertex),
                model.mesh.vertices[vertex].into(),
                model.mesh.normals[vertex].into(),
            ),
            stencil: vertex as u32,
            weight: 1.0,
        }));
        let is_frozen = options.normal == NormalDerivative::Frozen;
        Ok(Self { turn, full, frozen, is_frozen, points })
    }
}

impl<B: Blend<K>, const K: usize> DataTerm for Nonrigid<B, K> {
    fn set_pairs(&mut self, model: &DeformationModel, pairs: &[Pair], normals: Option<&[Vector3<f64>]>) {
        let turn = self.turn;
        let parts = |pair: &Pair| {
            let vertex = pair.vertex as usize;
            (vertex, weights_of(model, vertex), model.mesh.vertices[vertex].into(), pair.point.into())
        };
        match normals {
            Some(normals) if self.is_frozen => self.frozen.set_elements(pairs.iter().map(|pair| {
                let (vertex, w, v, u) = parts(pair);
                Placed { element: B::frozen(turn, w, v, normals[vertex].into(), u), stencil: pair.vertex, weight: 1.0 }
            })),
            _ => self.full.set_elements(pairs.iter().map(|pair| {
                let (vertex, w, v, u) = parts(pair);
                let n = model.mesh.normals[vertex].into();
                Placed { element: B::plane(turn, w, v, n, u), stencil: pair.vertex, weight: 1.0 }
            })),
        }
    }

    fn moved(&self, x: &[Twist]) -> Moved {
        let rows = self.points.residuals(x);
        let vector = |at: usize| move |row: &[f64]| Vector3::new(row[at], row[at + 1], row[at + 2]);
        Moved {
            vertices: rows.chunks_exact(6).map(vector(0)).collect(),
            normals: rows.chunks_exact(6).map(vector(3)).collect(),
        }
    }

    fn term(&self) -> &dyn LeastSquaresTerm<6> {
        if self.is_frozen { &self.frozen } else { &self.full }
    }
}

/// The terms that unknown bones add.
#[derive(Debug)]
struct BoneTerms {
    skeleton: ResidualTerm<SkeletonPlane, 6>,
    binding: ResidualTerm<BoneBinding, 6>,
    prior: ResidualTerm<Binding, 6>,
    joints: ResidualTerm<GraphEdge, 6>,
    /// How much each vertex follows the four bones of its stencil.
    shares: Vec<[f64; 4]>,
}

/// Unknown bones need four of them at least: the declared residuals blend four.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnergyError {
    /// There are fewer bones than a stencil has.
    #[error("{0} bones; with bones as unknowns there must be four at least")]
    TooFewBones(usize),
    /// A bug: the model names what it does not have.
    #[error(transparent)]
    Coupling(#[from] CouplingError),
}

/// The energy of a model: terms that stay, data that comes with each search for correspondences.
///
/// The unknowns are the twists of the nodes and, if bones are unknown, those of the bones behind them.
#[derive(Debug)]
pub struct FusionEnergy {
    /// Its parameters.
    pub options: EnergyOptions,
    pattern: Arc<NormalPattern>,
    data: Box<dyn DataTerm>,
    graph: ResidualTerm<GraphEdge, 6>,
    binding: ResidualTerm<Binding, 6>,
    bones: Option<BoneTerms>,
}

impl FusionEnergy {
    /// The energy of a model, without data.
    ///
    /// # Errors
    /// When bones are unknowns and there are fewer than four.
    pub fn new(model: &DeformationModel, options: EnergyOptions) -> Result<Self, EnergyError> {
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
        let all = model
            .vertex_nodes
            .iter()
            .map(Vec::as_slice)
            .chain(edges.iter().map(<[u32; 2]>::as_slice))
            .chain(skinning.iter().flat_map(BoneStencils::all));
        let pattern = Arc::new(NormalPattern::new(nodes + bone_count, all)?);

        let turn = options.angle.turn();
        let data: Box<dyn DataTerm> = match model.options.nodes_per_vertex {
            1 => Box::new(Nonrigid::<One, 1>::new(model, &options, &pattern)?),
            4 => Box::new(Nonrigid::<Four, 4>::new(model, &options, &pattern)?),
            _ => Box::new(Nonrigid::<Eight, 8>::new(model, &options, &pattern)?),
        };
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
        let binding = ResidualTerm::new("binding", Arc::new(Couplings::new(&pattern, &own)?), options.weights.binding);
        let bones = skinning.map(|stencils| stencils.terms(model, &options, &pattern)).transpose()?;
        Ok(Self { options, pattern, data, graph, binding, bones })
    }

    /// Which blocks of JᵀJ there are.
    #[must_use]
    pub fn pattern(&self) -> &Arc<NormalPattern> {
        &self.pattern
    }

    /// Replaces the data. `moved` gives the normals that are held, if they are.
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

    /// Replaces what a body tracker says, in the model's coordinates; nothing takes nodes off their bones.
    pub fn set_bones(&mut self, model: &DeformationModel, motions: Option<&[Isometry3<f64>]>) {
        let turn = self.options.angle.turn();
        let Some(motions) = motions else {
            self.binding.set_elements([]);
            if let Some(bones) = &mut self.bones {
                bones.prior.set_elements([]);
            }
            return;
        };
        match &mut self.bones {
            Some(bones) => bones.prior.set_elements((0..model.bones.len()).flat_map(|bone| {
                prior_places(&model.bones[bone]).map(move |x| {
                    let target = motions[bone].transform_point(&x.into()).coords;
                    Placed { element: Binding::new(turn, x.into(), target.into()), stencil: bone as u32, weight: 1.0 }
                })
            })),
            None => self.binding.set_elements(model.nodes.iter().enumerate().map(|(node, x)| {
                let target = bound_place(x, &model.attachments.rows[node], motions);
                Placed { element: Binding::new(turn, (*x).into(), target.into()), stencil: node as u32, weight: 1.0 }
            })),
        }
    }

    /// The terms that have unknowns.
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

    /// All vertices moved.
    #[must_use]
    pub fn moved(&self, x: &[Twist]) -> Moved {
        self.data.moved(x)
    }
}

/// x̃ = Σ_j η_j T_bj x.
fn bound_place(x: &Vector3<f64>, row: &[f64], motions: &[Isometry3<f64>]) -> Vector3<f64> {
    let followed = row.iter().zip(motions).filter(|(share, _)| **share > 0.0);
    followed.map(|(share, motion)| *share * motion.transform_point(&(*x).into()).coords).sum()
}

/// λ_s E_skeleton of known bones, Σ (ñ·(ṽ − u))² over the pairs: it depends on no unknown, and is reported.
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

/// Four places around a bone's joint, by which its motion is compared with another.
fn prior_places(bone: &Bone) -> [Vector3<f64>; 4] {
    const REACH: f64 = 0.1;
    let head = Vector3::from(bone.head);
    [head, head + REACH * Vector3::x(), head + REACH * Vector3::y(), head + REACH * Vector3::z()]
}

/// Which bones the terms of unknown bones act on; their blocks stand behind those of the nodes.
struct BoneStencils {
    vertices: Vec<[u32; 4]>,
    vertex_shares: Vec<[f64; 4]>,
    nodes: Vec<[u32; 5]>,
    node_shares: Vec<[f64; 4]>,
    joints: Vec<[u32; 2]>,
}

impl BoneStencils {
    fn new(model: &DeformationModel) -> Self {
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

    fn all(&self) -> impl Iterator<Item = &[u32]> {
        let vertices = self.vertices.iter().map(<[u32; 4]>::as_slice);
        let nodes = self.nodes.iter().map(<[u32; 5]>::as_slice);
        vertices.chain(nodes).chain(self.joints.iter().map(<[u32; 2]>::as_slice))
    }

    fn terms(
        self,
        model: &DeformationModel,
        options: &EnergyOptions,
        pattern: &NormalPattern,
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
        let prior = ResidualTerm::new("prior", Arc::new(Couplings::new(pattern, &own)?), weights.prior);
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

/// The four heaviest bones and their shares, brought to a sum of one. Where there are fewer, others fill up with a share of none:
/// their relations first, so that few blocks are added.
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
