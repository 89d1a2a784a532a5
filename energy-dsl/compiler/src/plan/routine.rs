use super::statements::Code;
use crate::graph::{Graph, Input};
use crate::routines::{General, Routine, Routines};
use energy_runtime::RoutineKind;

/// The plan of a routine.
#[derive(Clone, Debug)]
pub(crate) struct RoutinePlan {
    pub(crate) kind: RoutineKind,
    /// The ordinary path.
    pub(crate) ordinary: Code,
    /// Whether a fault was planted in the ordinary path. The guard then does not share its statements.
    pub(crate) is_broken: bool,
    /// The path for inputs that the ordinary path does not suffice for; `None` without precautions.
    pub(crate) general: Option<GeneralPlan>,
}

/// The plan of a general path.
#[derive(Clone, Debug)]
pub(crate) struct GeneralPlan {
    /// The part of the guard that does not depend on results.
    pub(crate) before: Code,
    /// The mask where the ordinary path suffices.
    pub(crate) guard: Code,
    /// Results with all precautions.
    pub(crate) path: Code,
    /// The mask of inputs outside of the domain, which is one of the path's results, so that it has no other inputs;
    /// `None` if all inputs are inside.
    pub(crate) outside: Option<Code>,
    /// Index from which results are added to each other later: derivatives by several difference vectors are, when they
    /// are expanded to points.
    pub(crate) summed: usize,
}

impl RoutinePlan {
    pub(super) fn new(routines: &Routines, graph: &Graph, routine: &Routine) -> Self {
        let is_summed = routine.kind == RoutineKind::ReducedHessian && routines.vectors.len() > 1;
        let summed = if is_summed { 1 } else { routine.groups.len() };
        let general = routine.general.as_ref().map(|general| GeneralPlan::new(graph, general, summed));
        Self {
            kind: routine.kind,
            ordinary: Code::new(graph, &routine.groups, routine.flags),
            is_broken: false,
            general,
        }
    }

    pub(super) fn of_rest(routines: &Routines) -> Self {
        let outputs = std::slice::from_ref(&routines.rest.outputs);
        let ordinary = Code::new(&routines.rest.graph, outputs, [routines.refused, None]);
        Self { kind: RoutineKind::Rest, ordinary, is_broken: false, general: None }
    }

    /// Returns the number of results in each group.
    pub(crate) fn sizes(&self) -> Vec<usize> {
        self.ordinary.groups.iter().map(Vec::len).collect()
    }

    /// Returns whether some path reads velocities.
    pub(crate) fn reads_velocities(&self) -> bool {
        let general = self.general.iter().flat_map(|general| [&general.guard, &general.path]);
        let mut inputs = std::iter::once(&self.ordinary).chain(general).flat_map(Code::inputs);
        inputs.any(|input| matches!(input, Input::Velocity(_)))
    }
}

impl GeneralPlan {
    /// Plans a general path whose groups from `summed` on are added to each other later.
    fn new(graph: &Graph, general: &General, summed: usize) -> Self {
        let settled = [general.outside, general.definite];
        Self {
            before: Code::guard(graph, general.guards),
            guard: Code::guard(graph, general.ordinary),
            path: Code::settling(graph, &general.groups, general.flags, settled),
            outside: general.outside.map(|outside| Code::guard(graph, outside)),
            summed: general.groups[..summed].iter().map(Vec::len).sum(),
        }
    }

    /// Returns the inputs of the path, and whether derivatives are taken with respect to each.
    pub(crate) fn inputs(&self) -> (Vec<Input>, Vec<bool>) {
        let inputs = self.path.inputs();
        let moves = inputs.iter().map(|input| matches!(input, Input::Position(_) | Input::Velocity(_))).collect();
        (inputs, moves)
    }
}
