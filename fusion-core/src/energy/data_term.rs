use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::PackedResidual;
use energy_elements::{
    BlendedPoint1, BlendedPoint4, BlendedPoint8, FrozenPlane1, FrozenPlane4, FrozenPlane8, NonrigidPlane1,
    NonrigidPlane4, NonrigidPlane8,
};
use energy_solve::{CouplingError, Couplings, LeastSquaresTerm, Loss, Pattern, Placed, ResidualTerm};
use nalgebra::Vector3;

use super::options::{EnergyOptions, NormalDerivative};
use crate::model::DeformationModel;
use crate::twist::Twist;

/// A vertex and its matching point, in the model's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the vertex.
    pub vertex: u32,
    /// Measured point.
    pub point: Vector3<f64>,
}

/// Moved vertices and normals, in the model's coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moved {
    /// Positions of the vertices.
    pub vertices: Vec<Vector3<f64>>,
    /// Unit normals.
    pub normals: Vec<Vector3<f64>>,
}

/// Residuals that blend K nodes.
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

/// The data term for any K.
pub(super) trait DataTerm: Debug + Send {
    fn set_pairs(&mut self, model: &DeformationModel, pairs: &[Pair], normals: Option<&[Vector3<f64>]>);
    fn moved(&self, x: &[Twist]) -> Moved;
    fn term(&self) -> &dyn LeastSquaresTerm<6>;
    fn evaluate_jacobians(&self, x: &[Twist]) -> f64;
}

/// Creates the data term for the model's K.
pub(super) fn data_term(
    model: &DeformationModel,
    options: &EnergyOptions,
    pattern: &Pattern,
) -> Result<Box<dyn DataTerm>, CouplingError> {
    Ok(match model.options.nodes_per_vertex {
        1 => Box::new(Nonrigid::<One, 1>::new(model, options, pattern)?),
        4 => Box::new(Nonrigid::<Four, 4>::new(model, options, pattern)?),
        _ => Box::new(Nonrigid::<Eight, 8>::new(model, options, pattern)?),
    })
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
    fn new(model: &DeformationModel, options: &EnergyOptions, pattern: &Pattern) -> Result<Self, CouplingError> {
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

    fn evaluate_jacobians(&self, x: &[Twist]) -> f64 {
        if self.is_frozen { self.frozen.evaluate_jacobians(x) } else { self.full.evaluate_jacobians(x) }
    }
}
