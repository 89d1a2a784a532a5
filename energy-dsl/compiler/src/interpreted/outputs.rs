//! Evaluation of one element: all blocks, or one routine.

use std::sync::Arc;

use super::Interpreted;
use super::mutants::EVALUATED;
use energy_runtime::tape::{Column, Input, Places, Routine, Routines, TapeElements, TermNumber};
use energy_runtime::{
    Baseline, Flags, Float, Inputs, Kind, Mask, Number, Outputs, RestError, RoutineKind, triangle_index,
};

/// The results of a routine by group, and its flags.
type Results<T> = (Vec<Vec<T>>, Flags<T>);

impl Interpreted {
    /// Evaluates all blocks, as `Element::evaluate` of generated code does, with the same bits.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    ///
    /// # Panics
    /// When an input slice other than that of velocities has another length than declared.
    pub fn evaluate<S: Float>(&self, inputs: &Inputs<'_, S>) -> Result<Outputs<S>, RestError> {
        let element = self.one(inputs)?;
        Ok(self.outputs(&|routine| of_one(&element, routine, inputs)))
    }

    /// Checks a rest shape.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    pub fn check_rest(&self, inputs: &Inputs<'_, f64>) -> Result<(), RestError> {
        self.one(inputs).map(drop)
    }

    /// Evaluates one routine (`value`, `gradient`, `hessian`, …). Returns its numbers by group (a Hessian as its
    /// triangle of blocks) and its flags; `None` if the kind has no such routine.
    ///
    /// ```
    /// use energy_compiler::Interpreted;
    /// use energy_runtime::Inputs;
    ///
    /// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
    /// let pull = Interpreted::from_source(source).unwrap().remove(0);
    /// let x = [3.0, 0.0, 4.0, 0.0, 0.0, 0.0];
    /// let inputs = Inputs { parameters: &[2.0], rest: &[], positions: &x, velocities: &[] };
    /// assert_eq!(pull.routine("value", &inputs).unwrap().unwrap().0, [[25.0]]);
    /// ```
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    ///
    /// # Panics
    /// When an input slice other than that of velocities has another length than declared.
    pub fn routine<S: Float>(&self, name: &str, inputs: &Inputs<'_, S>) -> Result<Option<Results<S>>, RestError> {
        let Some(kind) = RoutineKind::named(name).filter(|&kind| self.routines.has(kind)) else { return Ok(None) };
        let element = self.one(inputs)?;
        Ok(Some(of_one(&element, kind, inputs)))
    }

    /// Evaluates all blocks over any number type, without fused operations.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    ///
    /// # Panics
    /// When an input slice other than that of velocities is shorter than declared.
    pub fn evaluate_over<T: Number>(&self, inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        let stored = self.stored(inputs)?;
        Ok(self.outputs(&|routine| over(&self.routines, routine, inputs, &stored)))
    }

    /// Returns the outcomes of all comparisons on the ordinary path: the branches that an input takes.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    pub fn branches(&self, inputs: &Inputs<'_, f64>) -> Result<Vec<bool>, RestError> {
        let stored = self.stored(inputs)?;
        let mut outcomes = Vec::new();
        for routine in self.routines.list.iter().filter(|routine| EVALUATED.contains(&routine.kind)) {
            for term in terms(&self.routines) {
                let numbers = read(&self.routines, routine, term, inputs, &stored);
                let _ = routine.tape.run_noting::<f64, Baseline>(numbers, &mut |outcome| outcomes.push(outcome));
            }
        }
        Ok(outcomes)
    }

    fn one<S: Float>(&self, inputs: &Inputs<'_, S>) -> Result<TapeElements<S>, RestError> {
        let rest = [(Column::Same(inputs.rest), inputs.rest.len())];
        let parameters = [(Column::Same(inputs.parameters), inputs.parameters.len())];
        TapeElements::new(Arc::clone(&self.routines), 1, &rest, &parameters).map_err(|(_, error)| error)
    }

    /// Returns the numbers that the rest shape determines.
    fn stored<T: Number>(&self, inputs: &Inputs<'_, T>) -> Result<Vec<T>, RestError> {
        let rest = &self.routines.rest;
        let (numbers, flags) = rest.run::<T, Baseline>(&read(&self.routines, rest, 0, inputs, &[]));
        // False for infinite numbers and NaN.
        let sound = |x: &T| (x.clone() - x.clone()).equal(T::from_f64(0.0)).all();
        if flags.degenerate.any() || !numbers.iter().all(sound) {
            return Err(RestError { element: self.plan.declaration.name.clone() });
        }
        Ok(numbers)
    }

    /// Collects the blocks of a kind from its routines.
    fn outputs<T: Number>(&self, run: &dyn Fn(RoutineKind) -> Results<T>) -> Outputs<T> {
        let declaration = &self.plan.declaration;
        let (points, increments) = (declaration.points.len(), declaration.increments());
        let symmetric = |triangle: &[T]| match declaration.is_mixed() {
            true => full_upper(increments, triangle),
            false => full_triangle(points, triangle),
        };
        let square = |square: &[T]| match declaration.is_mixed() {
            true => square.to_vec(),
            false => full_square(points, square),
        };
        let (mut blocks, mut repeats) = (Vec::new(), Vec::new());
        let mut flags = [Flags::clear(), Flags::clear(), Flags::clear()];
        if matches!(self.plan.declaration.kind, Kind::Energy | Kind::Constraint) {
            let ((value, of_value), (gradient, of_gradient)) = (run(RoutineKind::Value), run(RoutineKind::Gradient));
            let (hessian, of_hessian) = run(RoutineKind::Hessian);
            blocks.push(("energy", value[0].clone()));
            blocks.push(("grad", gradient[1].clone()));
            blocks.push(("hess", symmetric(&hessian[2])));
            repeats.push(("gradient", "energy", gradient[0].clone()));
            repeats.push(("hessian", "energy", hessian[0].clone()));
            repeats.push(("hessian", "grad", hessian[1].clone()));
            flags = [of_value, of_gradient, of_hessian];
        }
        if matches!(self.plan.declaration.kind, Kind::Force | Kind::Constraint) {
            let ((force, of_force), (jacobians, of_jacobians)) = (run(RoutineKind::Force), run(RoutineKind::Jacobians));
            blocks.push(("force", force[0].clone()));
            blocks.push(("dfdx", square(&jacobians[1])));
            blocks.push(("dfdv", square(&jacobians[2])));
            repeats.push(("jacobians", "force", jacobians[0].clone()));
            if self.plan.declaration.kind == Kind::Force {
                flags = [of_force, of_jacobians.clone(), of_jacobians];
            }
        }
        match self.plan.declaration.kind {
            Kind::Constraint => {
                let (jacobian, _) = run(RoutineKind::ConstraintJacobian);
                blocks.extend([("constraint", jacobian[0].clone()), ("jacobian", jacobian[1].clone())]);
            }
            Kind::Residual => {
                let (residual, of_residual) = run(RoutineKind::Residual);
                let (jacobian, of_jacobian) = run(RoutineKind::Jacobian);
                blocks.extend([("residual", residual[0].clone()), ("jacobian", jacobian[1].clone())]);
                repeats.push(("jacobian", "residual", jacobian[0].clone()));
                flags = [of_residual, of_jacobian, Flags::clear()];
            }
            Kind::Energy | Kind::Force => {}
        }
        if !declaration.state.is_empty() {
            let ((next, _), (jacobians, _)) = (run(RoutineKind::Next), run(RoutineKind::NextJacobians));
            blocks.push(("next", next[0].clone()));
            blocks.push(("next_by_unknowns", jacobians[1].clone()));
            blocks.push(("next_by_state", jacobians[2].clone()));
            repeats.push(("next_jacobians", "next", jacobians[0].clone()));
            if declaration.kind != Kind::Force {
                let (slopes, _) = run(RoutineKind::StateJacobian);
                blocks.push(("slopes_by_state", slopes[1].clone()));
            }
        }
        Outputs { blocks, repeats, flags }
    }
}

/// Evaluates a routine of one element in lanes.
fn of_one<S: Float>(element: &TapeElements<S>, routine: RoutineKind, inputs: &Inputs<'_, S>) -> Results<S> {
    let velocities = Some(inputs.velocities).filter(|velocities| !velocities.is_empty()).map(Places::Rows);
    let (groups, [degenerate, kink]) = element.one(routine, Places::Rows(inputs.positions), velocities);
    let mask = <S as Number>::Mask::from_bits;
    (groups, Flags { degenerate: mask(u32::from(degenerate)), kink: mask(u32::from(kink)) })
}

/// Evaluates a routine over any number type.
fn over<T: Number>(routines: &Routines, routine: RoutineKind, inputs: &Inputs<'_, T>, stored: &[T]) -> Results<T> {
    let (routine, expansion) = routines.expanded(routine);
    let routine = routines.find(routine).expect("compiler bug: the kind decides the routines");
    let mut terms =
        terms(routines).map(|term| routine.run::<T, Baseline>(&read(routines, routine, term, inputs, stored)));
    let first = terms.next().expect("compiler bug: a sum has terms");
    let (mut results, mut flags) = terms.fold(first, |(sum, flags), (term, more)| {
        (sum.into_iter().zip(term).map(|(a, b)| a + b).collect(), flags.union(more))
    });
    if routines.repetition.is_some() {
        let sum = results.iter().cloned().fold(T::from_f64(0.0), |sum, number| sum + number);
        flags.degenerate = flags.degenerate | !(sum.clone() - sum).equal(T::from_f64(0.0));
    }
    let sizes = match expansion {
        Some(expansion) => {
            results = expansion.run::<T, Baseline>(&results).0;
            expansion.sizes()
        }
        None => routine.sizes(),
    };
    let mut results = results.into_iter();
    (sizes.iter().map(|&size| results.by_ref().take(size).collect()).collect(), flags)
}

fn terms(routines: &Routines) -> std::ops::Range<usize> {
    0..routines.repetition.as_ref().map_or(1, |repetition| repetition.terms())
}

/// Returns the numbers that a routine reads.
fn read<T: Number>(
    routines: &Routines,
    routine: &Routine,
    term: usize,
    inputs: &Inputs<'_, T>,
    stored: &[T],
) -> Vec<T> {
    let zero = || T::from_f64(0.0);
    let number = |input: &Input| match *input {
        Input::Position(i) => inputs.positions[usize::from(i)].clone(),
        Input::Increment(_) => zero(),
        Input::Velocity(i) => inputs.velocities.get(usize::from(i)).cloned().unwrap_or_else(zero),
        Input::Parameter(i) => inputs.parameters[usize::from(i)].clone(),
        Input::Rest(i) => inputs.rest[usize::from(i)].clone(),
        Input::Precomputed(i) => {
            let own = routines.repetition.as_ref().map(|repetition| repetition.number(term, usize::from(i)));
            match own.unwrap_or(TermNumber::Stored(usize::from(i))) {
                TermNumber::Stored(number) => stored[number].clone(),
                TermNumber::Constant(value) => T::from_f64(value),
            }
        }
    };
    routine.inputs.iter().map(number).collect()
}

/// Expands a triangle of 3×3 blocks to a full matrix, row by row.
fn full_triangle<T: Number>(points: usize, triangle: &[T]) -> Vec<T> {
    entries(points)
        .map(|(row, column)| {
            let (row, column) = if row / 3 <= column / 3 { (row, column) } else { (column, row) };
            triangle[9 * triangle_index(points, row / 3, column / 3) + row % 3 * 3 + column % 3].clone()
        })
        .collect()
}

/// Expands an upper triangle to a full matrix, row by row.
fn full_upper<T: Number>(increments: usize, upper: &[T]) -> Vec<T> {
    let entries = (0..increments).flat_map(|row| (0..increments).map(move |column| (row, column)));
    entries.map(|(row, column)| upper[triangle_index(increments, row.min(column), row.max(column))].clone()).collect()
}

/// Expands a square of 3×3 blocks to a full matrix, row by row.
fn full_square<T: Number>(points: usize, square: &[T]) -> Vec<T> {
    entries(points)
        .map(|(row, column)| square[9 * (row / 3 * points + column / 3) + row % 3 * 3 + column % 3].clone())
        .collect()
}

fn entries(points: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..3 * points).flat_map(move |row| (0..3 * points).map(move |column| (row, column)))
}
