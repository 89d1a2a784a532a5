//! Twelve formulas that the library of elements does not have, compared with the C and the Python that SymPy generates
//! for them. Unlike the kernels, results go to memory, of ten thousand and of a million elements.

pub mod declared;
mod report;
mod script;
mod work;

pub use report::{Formulas, Measured, Options, Program, formulas, table, write_inputs};

use std::ops::Range;

use energy_dsl::{Declaration, Element, OperationCount, PackedPotential};

use crate::random::Random;
use crate::work::Work;

/// A program, and its work on all elements.
type Contender = (Program, Work);

/// A declared formula, where to evaluate it, and how it runs.
#[derive(Debug)]
pub struct Formula {
    /// Declaration with the routines and their costs.
    pub declaration: &'static Declaration,
    /// Its parameters, in the order of the declaration: how many lie in which range.
    constants: &'static [(usize, Range<f64>)],
    /// Points around which the element is drawn.
    points: &'static [[f64; 3]],
    expected: fn(&[f64]) -> Vec<f64>,
    contenders: fn(&[f64], usize) -> Vec<Contender>,
}

/// How far random points lie from those of [`Formula`], in each direction.
const SPREAD: f64 = 0.15;

impl Formula {
    const fn of<E>(constants: &'static [(usize, Range<f64>)], points: &'static [[f64; 3]]) -> Self
    where
        E: PackedPotential<f64, Wide<f64> = E> + Element + 'static,
    {
        let declaration = E::DECLARATION;
        Self { declaration, constants, points, expected: work::expected::<E>, contenders: work::contenders::<E> }
    }

    /// Returns the name of the declaration.
    #[must_use]
    pub fn name(&self) -> &'static str {
        &self.declaration.name
    }

    /// Returns the parameters and coordinates of `count` random elements, the same in every run.
    #[must_use]
    pub fn inputs(&self, count: usize) -> Vec<f64> {
        let mut random = Random::new(20);
        let mut all = Vec::new();
        for _ in 0..count {
            for (repeated, range) in self.constants {
                all.extend((0..*repeated).map(|_| random.between(range.start, range.end)));
            }
            for point in self.points.as_flattened() {
                all.push(point + random.between(-SPREAD, SPREAD));
            }
        }
        all
    }

    /// Returns value, gradient and triangle of Hessian blocks of each element, as lanes compute them.
    #[must_use]
    pub fn expected(&self, inputs: &[f64]) -> Vec<f64> {
        (self.expected)(inputs)
    }

    /// Returns the operations of its Hessian, with value and gradient.
    #[must_use]
    pub fn operations(&self) -> OperationCount {
        let routine = self.declaration.routines.iter().find(|routine| routine.name == "hessian");
        routine.map_or_else(Default::default, |routine| routine.full)
    }
}

const SEGMENT: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]];
const ROD: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.8, 0.7, 0.1]];
const TRIANGLE: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.1, 1.0, 0.0]];
const TETRAHEDRON: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// A point above a triangle.
const CONTACT: &[[f64; 3]] = &[[0.3, 0.3, 0.3], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// Two crossing edges.
const CROSSING: &[[f64; 3]] = &[[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, -0.5, 0.7], [0.0, 0.5, 0.7]];
const TRIANGLES: &[[f64; 3]] =
    &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]];
const BRICK: &[[f64; 3]] = &[
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];

const STIFFNESS: Range<f64> = 0.5..1.5;
/// The entries of D₀⁻¹ by rows: near the identity.
const ON: Range<f64> = 0.9..1.1;
const OFF: Range<f64> = -0.1..0.1;

/// D₀⁻¹, then further parameters.
macro_rules! tetrahedron {
    ($($further:expr),*) => {
        &[(1, ON), (3, OFF), (1, ON), (3, OFF), (1, ON) $(, $further)*]
    };
}

/// All formulas of `bench --formulas`.
pub static FORMULAS: [Formula; 12] = [
    Formula::of::<declared::LennardJones>(&[(1, STIFFNESS), (1, 0.7..1.0)], SEGMENT),
    Formula::of::<declared::LaggedFriction>(&[(9, -0.5..0.5), (2, 0.2..0.4), (1, STIFFNESS), (1, 0.2..0.5)], CONTACT),
    Formula::of::<declared::LineBarrier>(&[(1, STIFFNESS), (1, 1.5..2.0)], CROSSING),
    Formula::of::<declared::CurvatureBinormal>(&[(1, STIFFNESS)], ROD),
    Formula::of::<declared::SurfaceArea>(&[(1, STIFFNESS), (1, 0.2..0.4)], TRIANGLE),
    Formula::of::<declared::CohesiveZone>(&[(2, STIFFNESS)], TRIANGLES),
    Formula::of::<declared::Brick>(&[(2, STIFFNESS)], BRICK),
    Formula::of::<declared::SymmetricDirichlet>(tetrahedron!((1, STIFFNESS)), TETRAHEDRON),
    Formula::of::<declared::MooneyRivlin>(tetrahedron!((3, STIFFNESS)), TETRAHEDRON),
    Formula::of::<declared::Fung>(tetrahedron!((2, STIFFNESS)), TETRAHEDRON),
    Formula::of::<declared::Fibres>(tetrahedron!((6, -0.5..0.5), (3, STIFFNESS)), TETRAHEDRON),
    Formula::of::<declared::StVenantKirchhoff>(tetrahedron!((2, STIFFNESS)), TETRAHEDRON),
];
