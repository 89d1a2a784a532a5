//! Assembly of matrices, with a constant part that is evaluated once.

use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Block, Vector3};

use super::constant::{ConstantPart, coupled_runs};
use super::division::{self, Sums};
use super::error::EvaluationError;
use super::{Counted, System};
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::Precision;
use crate::terms::curvature::Curvature;
use crate::terms::linearisation::{Linearisation, Weights};
use crate::terms::state::State;
use crate::terms::term::{Character, PlacedTerm, TermDescription};

/// The vectors that [`System::linearise`] returns, one entry per vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearisedForces {
    /// f, in N.
    pub force: Vec<Vector3<f64>>,
    /// (∂f/∂x) v, in N/s; empty if it was not requested.
    pub stiffness_times_velocity: Vec<Vector3<f64>>,
}

/// Options of [`System::linearise`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinearisationOptions {
    /// α and β.
    pub weights: Weights,
    /// Treatment of negative eigenvalues of element Hessians.
    pub curvature: Curvature,
    /// Whether to compute (∂f/∂x) v.
    pub stiffness_times_velocity: bool,
}

impl LinearisationOptions {
    /// Creates options that do not compute (∂f/∂x) v.
    #[must_use]
    pub const fn new(weights: Weights, curvature: Curvature) -> Self {
        Self { weights, curvature, stiffness_times_velocity: false }
    }

    /// Sets whether to compute (∂f/∂x) v.
    #[must_use]
    pub const fn with_stiffness_times_velocity(self, stiffness_times_velocity: bool) -> Self {
        Self { stiffness_times_velocity, ..self }
    }
}

impl System {
    /// Writes α ∂f/∂x + β ∂f/∂v over the free vertices to `matrix` and returns f and (∂f/∂x) v of all vertices.
    ///
    /// The system keeps the constant part of each matrix, so pass the same matrix to every step.
    ///
    /// # Errors
    /// If the state is incomplete or not finite, a force is not finite, or an element is outside of its formula's
    /// domain.
    ///
    /// # Panics
    /// If the matrix was not created by this system.
    pub fn linearise(
        &mut self,
        state: State<'_>,
        options: LinearisationOptions,
        matrix: &mut BlockMatrix<impl Precision>,
    ) -> Result<LinearisedForces, EvaluationError> {
        self.linearise_with_masses(state, options, &[], matrix)
    }

    /// Writes M + α ∂f/∂x + β ∂f/∂v, with the vertices' masses, in kg, on the diagonal; otherwise as
    /// [`System::linearise`]. Masses belong to the constant part of the matrix.
    ///
    /// # Errors
    /// If the state is incomplete or not finite, a force is not finite, or an element is outside of its formula's
    /// domain.
    ///
    /// # Panics
    /// If the matrix was not created by this system, or the number of masses is neither zero nor that of the vertices.
    pub fn linearise_with_masses<T: Precision>(
        &mut self,
        state: State<'_>,
        options: LinearisationOptions,
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> Result<LinearisedForces, EvaluationError> {
        self.check(state)?;
        assert!(
            masses.is_empty() || masses.len() == self.dofs.vertex_count(),
            "expected a mass for every vertex, or no masses"
        );
        assert!(self.owns(matrix), "the matrix belongs to another system");
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        let LinearisationOptions { weights, curvature, stiffness_times_velocity: wanted } = options;
        // The product (∂f/∂x) v needs the Jacobian of every term, so none is reused.
        let with_constant = !wanted && self.terms.iter().any(|counted| is_constant(&*counted.term));
        if !with_constant {
            self.terms.iter_mut().for_each(|counted| counted.term.place_blocks(&self.dofs, &self.pattern));
        }
        let known = matrix.take_contents().and_then(|contents| Some((self.find_constant(&contents)?, contents)));
        let known = known.filter(|(part, _)| self.constants[*part].matches(weights, curvature, masses));
        let constant = match known {
            _ if !with_constant => None,
            Some(known) => Some(known),
            None => Some(self.constant(state, (weights, curvature), masses, matrix)),
        };
        let linear = |term: &dyn PlacedTerm| term.character().curved && !(with_constant && is_constant(term));
        let mut product = if wanted { force.clone() } else { Vec::new() };
        let product_wanted = wanted.then_some(&mut product[..]);
        state.x.clone_into(&mut self.evaluated_at);
        let values = matrix.values_and_nowhere();
        let mut sums = Sums { weights, curvature, matrix: values, force: &mut force, product: product_wanted };
        let part = constant.as_ref().map(|(part, _)| &self.constants[*part]);
        let divided = division::linearisations(&self.divisible(linear), &self.shares, state, part, &mut sums);
        let (mut sum, mut flagged) = (sums.linearisation(), 0);
        for (Counted { term, counts }, divided) in self.terms.iter_mut().zip(divided) {
            if linear(&**term) {
                let tally = divided.unwrap_or_else(|| term.add_linearisation(state, &mut sum));
                flagged += tally.flagged;
                counts.hessian += tally;
            } else {
                let tally = divided.unwrap_or_else(|| term.add_force(state, sum.force));
                flagged += tally.flagged;
                counts.reused += if term.character().curved { tally.evaluated } else { 0 };
                counts.gradient += tally;
            }
        }
        matrix.set_contents(constant.map(|(_, contents)| contents));
        self.check_results(state, flagged, &force)?;
        if !with_constant {
            add_masses(&self.dofs, &self.pattern, masses, matrix.values_mut());
        }
        Ok(LinearisedForces { force, stiffness_times_velocity: product })
    }

    /// Returns the index of the constant part of matrices with these contents.
    fn find_constant(&self, contents: &Arc<Contents>) -> Option<usize> {
        self.constants.iter().position(|part| part.is_in(contents))
    }

    /// Evaluates the masses and the Jacobians of the quadratic terms, and writes them to the matrix. Returns the index
    /// of their constant part, and the identity of the matrix's contents. Drops the parts of matrices that are gone.
    fn constant<T: Precision>(
        &mut self,
        state: State<'_>,
        (weights, curvature): (Weights, Curvature),
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> (usize, Arc<Contents>) {
        self.constants.retain(ConstantPart::is_in_use);
        let runs = self.changing_places();
        // Projecting tells whether there was anything to project.
        let mut treated = Curvature::Clamped;
        let projected = self.evaluate_constant(state, weights, treated, masses, matrix);
        if projected && curvature != treated {
            treated = curvature;
            self.evaluate_constant(state, weights, treated, masses, matrix);
        }
        let contents = Arc::new(Contents);
        let blocks = T::blocks(matrix.values_mut());
        self.constants.push(ConstantPart::new(&contents, (weights, treated), masses, projected, runs, blocks));
        (self.constants.len() - 1, contents)
    }

    /// Writes masses and quadratic Jacobians to the matrix. Returns whether the Hessian of some element was projected.
    fn evaluate_constant<T: Precision>(
        &mut self,
        state: State<'_>,
        weights: Weights,
        curvature: Curvature,
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> bool {
        let blocks = matrix.values_and_nowhere();
        blocks.fill([[T::from_f64(0.0); 3]; 3]);
        add_masses(&self.dofs, &self.pattern, masses, blocks);
        let mut sum = Linearisation {
            weights,
            curvature,
            matrix: T::blocks(blocks),
            force: &mut vec![[0.0; 3]; self.dofs.vertex_count()],
            stiffness_times_velocity: None,
        };
        let mut projected = false;
        for Counted { term, counts } in self.terms.iter_mut().filter(|counted| is_constant(&*counted.term)) {
            term.place_blocks(&self.dofs, &self.pattern);
            let tally = term.add_linearisation(state, &mut sum);
            term.forget_blocks();
            projected |= tally.projected > 0;
            counts.hessian += tally;
        }
        projected
    }

    /// Returns the blocks that terms with non-constant Jacobians write.
    fn changing_places(&mut self) -> Arc<[Range<u32>]> {
        if let Some(known) = &self.changing {
            return Arc::clone(known);
        }
        let terms = self.terms.iter().map(|counted| &*counted.term);
        let changing = terms.filter(|term| term.character().curved && !is_constant(*term));
        let runs = coupled_runs(
            &self.pattern,
            |vertex| self.dofs.row(vertex as usize),
            changing.map(TermDescription::stencils),
        );
        Arc::clone(self.changing.insert(runs))
    }
}

/// Adds the masses, if there are any, to the diagonal.
fn add_masses<T: Precision>(dofs: &DofMap, pattern: &Pattern, masses: &[f64], blocks: &mut [Block<T>]) {
    let free = if masses.is_empty() { &[] } else { dofs.free() };
    for (row, &vertex) in free.iter().enumerate() {
        let diagonal = &mut blocks[pattern.diagonal(row)];
        for axis in 0..3 {
            diagonal[axis][axis] = diagonal[axis][axis] + T::from_f64(masses[vertex]);
        }
    }
}

/// Whether a term's Jacobians are constant, so that they are evaluated only once.
fn is_constant(term: &dyn PlacedTerm) -> bool {
    let Character { quadratic, curved, .. } = term.character();
    quadratic && curved
}
