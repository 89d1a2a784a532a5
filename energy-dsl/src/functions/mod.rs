//! The functions of the language, one row each: name, what it is, its rule of shapes, its lowering, and its bound of
//! accuracy stand together. Operators are functions too. A robust primitive's own derivatives stand beside its lowering.

mod angle;
mod arithmetic;
mod dihedral;
mod elementary;
mod exponential;
mod inner_product;
mod length;
mod linear_algebra;
mod logic;
mod loss;
mod parallelogram;
mod quaternion;
mod rotated;
mod shape;
mod sinc;
mod trigonometric;

pub use shape::{Lowered, Shape};

pub(crate) use angle::{recognise_one_minus_cosine, recognise_root};
pub(crate) use dihedral::recognise_dihedral;
use dihedral::recognise_sine_difference;
pub(crate) use length::recognise_norm_power;

use crate::graph::{Graph, NodeId};

/// One function of the language.
pub struct Function {
    /// Name, or the operator's symbol.
    pub name: &'static str,
    /// How a call looks, for messages and documentation.
    pub usage: &'static str,
    /// What it is.
    pub docs: &'static str,
    /// The shape of the result, or what was expected.
    pub shape: fn(&[Shape]) -> Result<Shape, String>,
    /// Nodes of the result.
    pub lower: fn(&mut Graph, &[Lowered]) -> Lowered,
    /// Bound on the relative rounding error of value, first and second derivative in units of roundoff, for exact arguments;
    /// empty for what composes by the ordinary rules.
    pub accuracy: &'static str,
}

impl std::fmt::Debug for Function {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Every function and operator.
pub fn all() -> impl Iterator<Item = &'static Function> {
    [
        arithmetic::FUNCTIONS,
        elementary::FUNCTIONS,
        exponential::FUNCTIONS,
        trigonometric::FUNCTIONS,
        sinc::FUNCTIONS,
        loss::FUNCTIONS,
        linear_algebra::FUNCTIONS,
        length::FUNCTIONS,
        angle::FUNCTIONS,
        dihedral::FUNCTIONS,
        quaternion::FUNCTIONS,
        logic::FUNCTIONS,
    ]
    .into_iter()
    .flatten()
}

/// The function of that name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Function> {
    all().find(|f| f.name == name)
}

/// The robust form of a − b, if it has one.
pub(crate) fn recognise_difference(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    recognise_one_minus_cosine(g, a, b)
        .or_else(|| length::recognise_elongation(g, a, b))
        .or_else(|| recognise_sine_difference(g, a, b))
        .or_else(|| elementary::recognise_versine(g, a, b))
        .or_else(|| exponential::recognise_expm1(g, a, b))
}
