//! Writes statements to tapes, for declarations that are read at run time.

mod recorder;
mod steps;

use crate::check::Program;
use crate::graph::{Graph, Input, NodeId};
use crate::routines::{self, Routines};
use crate::statements::Code;
use energy_runtime::Kind;
use energy_runtime::tape::{self, General};
use recorder::{Recorded, record};

pub(crate) use recorder::TooLarge;

/// The statements of a routine.
#[derive(Clone, Debug)]
pub(crate) struct RoutineCode {
    pub(crate) name: &'static str,
    /// The ordinary path.
    pub(crate) ordinary: Code,
    /// Whether a fault was planted in the ordinary path. The guard then does not share its statements.
    pub(crate) is_broken: bool,
    /// The path for inputs that the ordinary path does not suffice for.
    general: Option<GeneralCode>,
    /// Whether the first group is of values, not of derivatives.
    values_first: bool,
    /// Whether the first group is an energy.
    is_energy: bool,
    /// Whether derivatives are added to each other when they are expanded to points.
    is_summed: bool,
}

/// The statements of a general path.
#[derive(Clone, Debug)]
struct GeneralCode {
    /// The mask where the ordinary path suffices.
    guard: Code,
    path: Code,
    /// The mask of inputs outside of the domain; `None` if all inputs are inside.
    outside: Option<Code>,
}

impl GeneralCode {
    fn new(graph: &Graph, general: &routines::General) -> Self {
        let settled = [general.outside, general.definite];
        Self {
            guard: Code::guard(graph, general.ordinary),
            path: Code::settling(graph, &general.groups, general.flags, settled),
            outside: general.outside.map(|outside| Code::guard(graph, outside)),
        }
    }
}

impl RoutineCode {
    fn new(routines: &Routines, routine: &routines::Routine) -> Self {
        let graph = &routines.graph;
        Self {
            name: routine.name,
            ordinary: Code::new(graph, &routine.groups, routine.flags),
            is_broken: false,
            general: routine.general.as_ref().map(|general| GeneralCode::new(graph, general)),
            values_first: routine.has_values(),
            is_energy: routine.is_energy(),
            is_summed: routine.name == "reduced_hessian" && routines.vectors.len() > 1,
        }
    }

    /// Creates the code of the `rest` block. Its first flag marks degenerate shapes.
    fn of_rest(routines: &Routines) -> Self {
        let rest = &routines.rest;
        let outputs = std::slice::from_ref(&rest.outputs);
        Self {
            name: "rest",
            ordinary: Code::new(&rest.graph, outputs, [routines.refused, None]),
            is_broken: false,
            general: None,
            values_first: true,
            is_energy: false,
            is_summed: false,
        }
    }

    /// Writes the routine to a tape. `leading` are the inputs that come first.
    fn record(&self, leading: &[Input]) -> Result<tape::Routine, TooLarge> {
        let guarded = self.general.as_ref().map(|general| self.ordinary.with_guard(&general.guard, !self.is_broken));
        let code = guarded.as_ref().unwrap_or(&self.ordinary);
        let mut inputs = leading.to_vec();
        // The mask of the domain is one of the path's results, so that it has no other inputs.
        let others = self.general.as_ref().map(|general| inputs_of(&general.path)).unwrap_or_default();
        for input in inputs_of(code).into_iter().chain(others.iter().copied()) {
            if !inputs.contains(&input) {
                inputs.push(input);
            }
        }
        let ordinary = record(code, &inputs)?;
        let place = |input: &Input| inputs.iter().position(|other| other == input).expect("it was added");
        let general = match &self.general {
            None => None,
            Some(GeneralCode { path, outside, .. }) => {
                let Recorded { tape, groups, flags, settled, .. } = record(path, &others)?;
                let (values, results) = (groups[0].len(), groups.concat());
                let outside = outside.as_ref().map(|code| record(code, &others)).transpose()?;
                let outside = outside.and_then(|Recorded { tape, guard, .. }| Some((tape, guard?)));
                Some(General {
                    ordinary: ordinary.guard.expect("compiler bug: a general path has a guard"),
                    inputs: others
                        .iter()
                        .map(place)
                        .map(u16::try_from)
                        .collect::<Result<_, _>>()
                        .map_err(|_| TooLarge)?,
                    moves: others.iter().map(|i| matches!(i, Input::Position(_) | Input::Velocity(_))).collect(),
                    tape,
                    summed: if self.is_summed { values } else { results.len() },
                    results,
                    flags,
                    settled,
                    outside,
                    values_first: self.values_first,
                    is_energy: self.is_energy,
                })
            }
        };
        let Recorded { tape, groups, flags, .. } = ordinary;
        Ok(tape::Routine { name: self.name, inputs, tape, groups, flags, general })
    }
}

/// Returns the inputs that code reads, in order.
fn inputs_of(code: &Code) -> Vec<Input> {
    let input = |op: &crate::graph::Op| if let crate::graph::Op::Input(input) = *op { Some(input) } else { None };
    let mut inputs = Vec::new();
    for input in code.statements.list().iter().filter_map(input) {
        if !inputs.contains(&input) {
            inputs.push(input);
        }
    }
    inputs
}

/// The statements of an element.
#[derive(Clone, Debug)]
pub(crate) struct ElementCode {
    name: String,
    coordinates: usize,
    parameters: usize,
    shape: usize,
    pub(crate) rest: RoutineCode,
    pub(crate) routines: Vec<RoutineCode>,
    expansion: Option<Code>,
    repetition: Option<tape::Repetition>,
}

impl ElementCode {
    pub(crate) fn new(program: &Program, routines: &Routines) -> Self {
        // The full Hessian is expanded from the reduced one.
        let has_expansion = matches!(program.kind, Kind::Energy | Kind::Constraint);
        let wanted = |routine: &&routines::Routine| !(has_expansion && routine.name == "hessian");
        let list = routines.list.iter().filter(wanted).map(|routine| RoutineCode::new(routines, routine));
        let expansion = routines.expansion.as_ref().map(|expansion| {
            Code::new(&expansion.graph, &[expansion.gradient.clone(), expansion.triangle.clone()], [None, None])
        });
        Self {
            name: program.name.clone(),
            coordinates: program.moving_size(),
            parameters: program.parameters_size(),
            shape: program.rest.iter().map(|input| input.input_type.size()).sum(),
            rest: RoutineCode::of_rest(routines),
            routines: list.collect(),
            expansion,
            repetition: routines.repetition.clone(),
        }
    }

    /// Writes all routines to tapes.
    pub(crate) fn record(&self) -> Result<tape::Routines, TooLarge> {
        let list = self.routines.iter().map(|routine| self.record_routine(routine)).collect::<Result<_, _>>()?;
        let reduced = self.routines.iter().find(|routine| routine.name == "reduced_hessian");
        let expansion = match (&self.expansion, reduced) {
            (Some(expansion), Some(reduced)) => {
                let results = reduced.ordinary.groups.iter().map(Vec::len).sum();
                Some(record_expansion(expansion, results)?)
            }
            _ => None,
        };
        Ok(tape::Routines {
            name: self.name.clone(),
            coordinates: self.coordinates,
            parameters: self.parameters,
            shape: self.shape,
            rest: self.rest.record(&[])?,
            list,
            expansion,
            repetition: self.repetition.clone(),
        })
    }

    /// Writes one routine to a tape. Positions come first, then velocities, if it reads any.
    pub(crate) fn record_routine(&self, routine: &RoutineCode) -> Result<tape::Routine, TooLarge> {
        let coordinates = u16::try_from(self.coordinates).map_err(|_| TooLarge)?;
        let reads = |code: &Code| inputs_of(code).iter().any(|input| matches!(input, Input::Velocity(_)));
        let paths = std::iter::once(&routine.ordinary)
            .chain(routine.general.iter().flat_map(|general| [&general.guard, &general.path]));
        let velocities = if paths.into_iter().any(reads) { coordinates } else { 0 };
        let leading = (0..coordinates).map(Input::Position).chain((0..velocities).map(Input::Velocity));
        routine.record(&leading.collect::<Vec<_>>())
    }
}

/// Writes the expansion to points. Its inputs are all `results` of the reduced routine, the value first.
fn record_expansion(code: &Code, results: usize) -> Result<tape::Routine, TooLarge> {
    let results = u16::try_from(results).map_err(|_| TooLarge)?;
    // The derivatives are numbered from 0; the value gets a number that no derivative has.
    let inputs: Vec<Input> =
        std::iter::once(Input::Parameter(0)).chain((0..results - 1).map(Input::Precomputed)).collect();
    let Recorded { tape, groups, .. } = record(code, &inputs)?;
    let groups = std::iter::once(vec![0]).chain(groups).collect();
    Ok(tape::Routine { name: "hessian", inputs, tape, groups, flags: [None, None], general: None })
}

/// Returns whether a statement's result is a number of the results, other than through a comparison.
pub(crate) fn are_numbers_of_results(code: &Code) -> Vec<bool> {
    let list = code.statements.list();
    let mut reach = vec![false; list.len()];
    let mark = |reach: &mut Vec<bool>, at: NodeId| reach[at.0 as usize] = true;
    code.groups.iter().flatten().for_each(|&at| mark(&mut reach, at));
    for place in (0..list.len()).rev().filter(|&place| !list[place].is_mask()) {
        if reach[place] {
            list[place].operands().for_each(|at| mark(&mut reach, at));
        }
    }
    reach
}
