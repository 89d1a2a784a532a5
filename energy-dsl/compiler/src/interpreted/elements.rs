//! Evaluation of many elements of one declaration.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use super::{Interpreted, Layouts};
use energy_runtime::tape::{Output, Places, TapeElements};
use energy_runtime::{BatchError, Declaration, Flagged, Float, RoutineKind};

/// Elements of one declaration, bound to their parameters and rest shapes.
///
/// Methods take a range of elements that starts at a multiple of [`TAPE_BLOCK`](energy_runtime::tape::TAPE_BLOCK), and
/// slices of that range alone. Inputs are positions, p points of three coordinates per element, or the unknowns of a
/// residual and of mixed declarations. Gradients have 3 p numbers, or one per increment. Methods return the indices and
/// flags of flagged elements. Several threads may call them for different ranges.
#[derive(Clone, Debug)]
pub struct Elements<S = f64> {
    element: Interpreted,
    tape: TapeElements<S>,
}

/// Elements that cannot be evaluated. Nothing was written.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EvaluateError {
    /// Declarations of this kind do not have the routine.
    Routine {
        /// Name of the declaration.
        declaration: Arc<Declaration>,
        /// Name of the routine.
        routine: &'static str,
    },
    /// Range and slices do not fit each other.
    Batch(BatchError),
}

impl fmt::Display for EvaluateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Routine { declaration, routine } => {
                // Hessians are computed in reduced coordinates; callers ask for `hessian`.
                let asked = |name: &'static str| if name == "reduced_hessian" { "hessian" } else { name };
                let names: Vec<&str> = declaration.routines.iter().map(|routine| asked(routine.name)).collect();
                let (name, kind) = (&declaration.name, declaration.kind.keyword());
                write!(f, "{name}: no `{routine}` of this {kind}; it has {}", names.join(", "))
            }
            Self::Batch(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for EvaluateError {}

impl From<BatchError> for EvaluateError {
    fn from(error: BatchError) -> Self {
        Self::Batch(error)
    }
}

impl<S: Float> Elements<S> {
    pub(super) fn new(element: Interpreted, tape: TapeElements<S>) -> Self {
        Self { element, tape }
    }

    /// Returns the declaration that was bound.
    #[must_use]
    pub fn element(&self) -> &Interpreted {
        &self.element
    }

    /// Returns the elements as tapes.
    #[must_use]
    pub fn tape(&self) -> &TapeElements<S> {
        &self.tape
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tape.len()
    }

    /// Returns whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tape.is_empty()
    }

    /// Writes U of each element.
    ///
    /// # Errors
    /// When the declaration is a force or a residual, or the slices do not fit the range.
    pub fn values(&self, range: Range<usize>, x: &[S], energies: &mut [S]) -> Result<Flagged, EvaluateError> {
        let Layouts { value, .. } = self.layouts();
        self.evaluate(RoutineKind::Value, range, x, None, &mut [output("energies", value, energies)])
    }

    /// Writes U and ∂U/∂x (3 p numbers) of each element.
    ///
    /// # Errors
    /// When the declaration is a force or a residual, or the slices do not fit the range.
    pub fn gradients(
        &self,
        range: Range<usize>,
        x: &[S],
        energies: &mut [S],
        gradients: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { value, gradient, .. } = self.layouts();
        let outputs = &mut [output("energies", value, energies), output("gradients", gradient, gradients)];
        self.evaluate(RoutineKind::Gradient, range, x, None, outputs)
    }

    /// Writes U, ∂U/∂x (3 p numbers) and ∂²U/∂x² (3 p × 3 p numbers, row by row) of each element.
    ///
    /// # Errors
    /// When the declaration is a force or a residual, or the slices do not fit the range.
    pub fn hessians(
        &self,
        range: Range<usize>,
        x: &[S],
        energies: &mut [S],
        gradients: &mut [S],
        hessians: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { value, gradient, hessian, .. } = self.layouts();
        let (energies, gradients) = (output("energies", value, energies), output("gradients", gradient, gradients));
        let outputs = &mut [energies, gradients, output("Hessians", hessian, hessians)];
        self.evaluate(RoutineKind::Hessian, range, x, None, outputs)
    }

    /// Writes U, ∂U/∂xᵢ (3 numbers) and ∂²U/∂xᵢ² (3 × 3 numbers, row by row) of each element, where xᵢ is its point
    /// `point`.
    ///
    /// # Errors
    /// When the declaration has no routines of single vertices or no such point, or the slices do not fit the range.
    pub fn vertices(
        &self,
        point: u8,
        range: Range<usize>,
        x: &[S],
        energies: &mut [S],
        gradients: &mut [S],
        blocks: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let [value, gradient, block]: [&[u16]; 3] = [&[0], &[1, 2, 3], &[4, 5, 6, 7, 8, 9, 10, 11, 12]];
        let (energies, gradients) = (output("energies", value, energies), output("gradients", gradient, gradients));
        let outputs = &mut [energies, gradients, output("blocks", block, blocks)];
        self.evaluate(RoutineKind::Vertex(point), range, x, None, outputs)
    }

    /// Writes (∂²U/∂x²) v (3 p numbers) of each element.
    ///
    /// # Errors
    /// When the declaration is a force or a residual, or the slices do not fit the range.
    pub fn hessian_vectors(
        &self,
        range: Range<usize>,
        x: &[S],
        v: &[S],
        products: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { vectors, .. } = self.layouts();
        self.evaluate(RoutineKind::HessianVector, range, x, Some(v), &mut [output("products", vectors, products)])
    }

    /// Writes f(x, v) (3 p numbers) of each element.
    ///
    /// # Errors
    /// When the declaration is an energy or a residual, or the slices do not fit the range.
    pub fn forces(&self, range: Range<usize>, x: &[S], v: &[S], forces: &mut [S]) -> Result<Flagged, EvaluateError> {
        let Layouts { vectors, .. } = self.layouts();
        self.evaluate(RoutineKind::Force, range, x, Some(v), &mut [output("forces", vectors, forces)])
    }

    /// Writes f(x, v) (3 p numbers), ∂f/∂x and ∂f/∂v (3 p × 3 p numbers each, row by row) of each element.
    ///
    /// # Errors
    /// When the declaration is an energy or a residual, or the slices do not fit the range.
    pub fn force_jacobians(
        &self,
        range: Range<usize>,
        x: &[S],
        v: &[S],
        forces: &mut [S],
        by_position: &mut [S],
        by_velocity: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { vectors, force_jacobians: [position, velocity], .. } = self.layouts();
        let by_position = output("Jacobians by position", position, by_position);
        let by_velocity = output("Jacobians by velocity", velocity, by_velocity);
        let outputs = &mut [output("forces", vectors, forces), by_position, by_velocity];
        self.evaluate(RoutineKind::Jacobians, range, x, Some(v), outputs)
    }

    /// Writes C (one number per row) and ∂C/∂x (3 p numbers per row) of each element.
    ///
    /// # Errors
    /// When the declaration is of another kind than a constraint, or the slices do not fit the range.
    pub fn constraints(
        &self,
        range: Range<usize>,
        x: &[S],
        constraints: &mut [S],
        jacobians: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { rows, jacobian, .. } = self.layouts();
        let outputs = &mut [output("constraints", rows, constraints), output("Jacobians", jacobian, jacobians)];
        self.evaluate(RoutineKind::ConstraintJacobian, range, x, None, outputs)
    }

    /// Writes r (one number per row) of each element. `u` holds all unknowns of each element, in declared order.
    ///
    /// # Errors
    /// When the declaration is of another kind than a residual, or the slices do not fit the range.
    pub fn residuals(&self, range: Range<usize>, u: &[S], residuals: &mut [S]) -> Result<Flagged, EvaluateError> {
        let Layouts { rows, .. } = self.layouts();
        self.evaluate(RoutineKind::Residual, range, u, None, &mut [output("residuals", rows, residuals)])
    }

    /// Writes r (one number per row) and ∂r/∂u (one number per row and unknown) of each element.
    ///
    /// # Errors
    /// When the declaration is of another kind than a residual, or the slices do not fit the range.
    pub fn jacobians(
        &self,
        range: Range<usize>,
        u: &[S],
        residuals: &mut [S],
        jacobians: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { rows, jacobian, .. } = self.layouts();
        let outputs = &mut [output("residuals", rows, residuals), output("Jacobians", jacobian, jacobians)];
        self.evaluate(RoutineKind::Jacobian, range, u, None, outputs)
    }

    /// Writes the state of each element after a step that ends at its unknowns `u`.
    ///
    /// # Errors
    /// When the declaration has no state, or the slices do not fit the range.
    pub fn next_states(&self, range: Range<usize>, u: &[S], states: &mut [S]) -> Result<Flagged, EvaluateError> {
        let Layouts { state, .. } = self.layouts();
        self.evaluate(RoutineKind::Next, range, u, None, &mut [output("states", state, states)])
    }

    /// Writes the state of each element after a step, and its derivatives by the increments of the unknowns and by the
    /// state before, row by row.
    ///
    /// # Errors
    /// When the declaration has no state, or the slices do not fit the range.
    pub fn next_jacobians(
        &self,
        range: Range<usize>,
        u: &[S],
        states: &mut [S],
        by_unknowns: &mut [S],
        by_state: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { state, next_jacobians: [unknowns, before], .. } = self.layouts();
        let by_unknowns = output("Jacobians by unknowns", unknowns, by_unknowns);
        let by_state = output("Jacobians by state", before, by_state);
        self.evaluate(
            RoutineKind::NextJacobians,
            range,
            u,
            None,
            &mut [output("states", state, states), by_unknowns, by_state],
        )
    }

    /// Writes ∂U/∂u and ∂²U/∂u∂(state) of each element, row by row; r and ∂r/∂(state) of a residual.
    ///
    /// # Errors
    /// When the declaration has no state or is a force, or the slices do not fit the range.
    pub fn state_jacobians(
        &self,
        range: Range<usize>,
        u: &[S],
        slopes: &mut [S],
        by_state: &mut [S],
    ) -> Result<Flagged, EvaluateError> {
        let Layouts { slopes: [first, mixed], .. } = self.layouts();
        let outputs = &mut [output("slopes", first, slopes), output("Jacobians by state", mixed, by_state)];
        self.evaluate(RoutineKind::StateJacobian, range, u, None, outputs)
    }

    fn layouts(&self) -> &Layouts {
        &self.element.layouts
    }

    fn evaluate(
        &self,
        routine: RoutineKind,
        range: Range<usize>,
        x: &[S],
        v: Option<&[S]>,
        outputs: &mut [Output<'_, S>],
    ) -> Result<Flagged, EvaluateError> {
        let routines = self.tape.routines();
        if !routines.has(routine) {
            let declaration = Arc::clone(&self.element.plan.declaration);
            return Err(EvaluateError::Routine { declaration, routine: routine.name() });
        }
        Ok(self.tape.evaluate(routine, range, Places::Rows(x), v.map(Places::Rows), outputs)?)
    }
}

fn output<'a, S>(name: &'static str, layout: &'a [u16], numbers: &'a mut [S]) -> Output<'a, S> {
    Output { name, layout, numbers }
}
