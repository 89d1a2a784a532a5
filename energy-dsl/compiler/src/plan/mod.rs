//! The plan of a declaration: what each routine computes, in order, and how its results are arranged. It is made once.
//! The Rust emitter (`emit`) and the block tape (`tape`) render it, and planted faults change it.

mod description;
mod groups;
mod precision;
mod routine;
mod statements;

pub(crate) use description::operations;
pub(crate) use groups::{Shape, groups};
pub(crate) use routine::{GeneralPlan, RoutinePlan};
pub(crate) use statements::{Code, RETURNED, Statements};

use std::sync::Arc;

use crate::check::Program;
use crate::lower::Repetition;
use crate::routines::Routines;
use energy_runtime::{Declaration, RoutineKind};

/// The plan of a declaration.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// The self-description that all renderings have.
    pub(crate) declaration: Arc<Declaration>,
    /// Coordinates of the points, or unknowns of a residual.
    pub(crate) coordinates: usize,
    /// Number of parameter numbers.
    pub(crate) parameters: usize,
    /// Number of rest-shape numbers.
    pub(crate) shape: usize,
    /// The `rest` block: its results are the stored numbers, and its first flag marks degenerate shapes.
    pub(crate) rest: RoutinePlan,
    /// The state at rest, from the rest shape and the parameters; `None` if it is given with each element.
    pub(crate) at_rest: Option<Code>,
    /// The routines of the moving part, or of one term of it. The Hessian of an energy is not among them: it is
    /// expanded from the reduced one.
    pub(crate) routines: Vec<RoutinePlan>,
    /// The expansion of the reduced Hessian to points: gradient and triangle.
    pub(crate) expansion: Option<Code>,
    /// The numbers of each term, if the routines compute one term of a sum.
    pub(crate) repetition: Option<Repetition>,
}

impl Plan {
    /// Plans all routines of a program.
    pub(crate) fn new(program: &Program, routines: &Routines) -> Self {
        let expansion = routines.expansion.as_ref().map(|expansion| {
            Code::new(&expansion.graph, &[expansion.gradient.clone(), expansion.triangle.clone()], [None, None])
        });
        let is_expanded = |kind: RoutineKind| kind == RoutineKind::Hessian && expansion.is_some();
        let list = routines.all().filter(|(_, routine)| !is_expanded(routine.kind));
        Self {
            declaration: Arc::new(description::description(program, routines)),
            coordinates: program.moving_size(),
            parameters: program.parameters_size(),
            shape: program.rest.iter().map(|input| input.input_type.size()).sum(),
            rest: RoutinePlan::of_rest(routines),
            at_rest: routines
                .at_rest
                .as_ref()
                .map(|state| Code::new(&state.graph, std::slice::from_ref(&state.outputs), [None, None])),
            routines: list.map(|(graph, routine)| RoutinePlan::new(routines, graph, routine)).collect(),
            expansion,
            repetition: routines.repetition.clone(),
        }
    }

    /// Returns the plan of a routine; `None` if declarations of this kind do not have it.
    pub(crate) fn find(&self, kind: RoutineKind) -> Option<&RoutinePlan> {
        self.routines.iter().find(|routine| routine.kind == kind)
    }

    /// Returns the number of stored numbers that the rest shape determines.
    pub(crate) fn stored(&self) -> usize {
        self.rest.ordinary.groups[0].len()
    }
}
