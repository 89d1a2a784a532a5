//! Renders plans as tapes, for declarations that are read at run time.

mod recorder;
mod steps;

use crate::graph::Input;
use crate::plan::{Code, GeneralPlan, Plan, RoutinePlan};
use energy_runtime::RoutineKind;
use energy_runtime::tape::{General, GeneralPath, Routine, Routines};
use recorder::Recorded;

pub(crate) use recorder::{TooLarge, record};

/// Writes all routines of a plan to tapes.
pub(crate) fn tapes(plan: &Plan) -> Result<Routines, TooLarge> {
    let list = plan.routines.iter().map(|routine| with_leading_inputs(plan, routine)).collect::<Result<_, _>>()?;
    let expansion = match (&plan.expansion, plan.find(RoutineKind::ReducedHessian)) {
        (Some(expansion), Some(reduced)) => Some(expansion_tape(expansion, reduced.sizes().iter().sum())?),
        _ => None,
    };
    Ok(Routines {
        name: plan.declaration.name.clone().into_owned(),
        coordinates: plan.coordinates,
        increments: plan.declaration.increments(),
        parameters: plan.parameters,
        shape: plan.shape,
        rest: routine_tape(&plan.rest, Vec::new())?,
        at_rest: plan.at_rest.as_ref().map(state_at_rest).transpose()?,
        list,
        expansion,
        repetition: plan.repetition.clone(),
    })
}

/// Writes a routine to a tape. Positions come first, then velocities, if it reads any.
fn with_leading_inputs(plan: &Plan, routine: &RoutinePlan) -> Result<Routine, TooLarge> {
    let coordinates = u16::try_from(plan.coordinates).map_err(|_| TooLarge)?;
    let increments = u16::try_from(plan.declaration.increments()).map_err(|_| TooLarge)?;
    let velocities = if routine.reads_velocities() { increments } else { 0 };
    let leading = (0..coordinates).map(Input::Position).chain((0..velocities).map(Input::Velocity));
    routine_tape(routine, leading.collect())
}

/// Writes a routine to a tape with some inputs first.
fn routine_tape(routine: &RoutinePlan, mut inputs: Vec<Input>) -> Result<Routine, TooLarge> {
    let RoutinePlan { kind, ordinary, is_broken, general } = routine;
    let guarded = general.as_ref().map(|general| ordinary.with_guard(&general.guard, !is_broken));
    let code = guarded.as_ref().unwrap_or(ordinary);
    for input in code.inputs().into_iter().chain(general.iter().flat_map(|general| general.path.inputs())) {
        if !inputs.contains(&input) {
            inputs.push(input);
        }
    }
    let Recorded { tape, groups, flags, guard, .. } = record(code, &inputs)?;
    let general = match (general, guard) {
        (Some(general), Some(ordinary)) => {
            let place = |input: &Input| inputs.iter().position(|other| other == input).expect("it was added");
            let own = general.inputs().0;
            let places = own.iter().map(place).map(u16::try_from).collect::<Result<_, _>>().map_err(|_| TooLarge)?;
            Some(General { ordinary, inputs: places, path: general_path(routine, general)? })
        }
        _ => None,
    };
    Ok(Routine { kind: *kind, inputs, tape, groups, flags, general })
}

/// Returns the general path of a routine as data.
pub(crate) fn general_path(routine: &RoutinePlan, general: &GeneralPlan) -> Result<GeneralPath, TooLarge> {
    let (own, moves) = general.inputs();
    let Recorded { tape, groups, flags, settled, .. } = record(&general.path, &own)?;
    let outside = general.outside.as_ref().map(|code| record(code, &own)).transpose()?;
    Ok(GeneralPath {
        moves,
        groups: routine.sizes(),
        values_first: routine.kind.has_values(),
        is_energy: routine.kind.is_energy(),
        tape,
        results: groups.concat(),
        flags,
        settled,
        outside: outside.and_then(|Recorded { tape, guard, .. }| Some((tape, guard?))),
        summed: general.summed,
    })
}

/// Writes the state at rest to a tape.
fn state_at_rest(code: &Code) -> Result<Routine, TooLarge> {
    let inputs = code.inputs();
    let Recorded { tape, groups, .. } = record(code, &inputs)?;
    Ok(Routine { kind: RoutineKind::Rest, inputs, tape, groups, flags: [None, None], general: None })
}

/// Writes the expansion to points. Its inputs are all `results` of the reduced Hessian, the value first.
fn expansion_tape(code: &Code, results: usize) -> Result<Routine, TooLarge> {
    let results = u16::try_from(results).map_err(|_| TooLarge)?;
    // The derivatives are numbered from 0; the value gets a number that no derivative has.
    let inputs: Vec<Input> =
        std::iter::once(Input::Parameter(0)).chain((0..results - 1).map(Input::Precomputed)).collect();
    let Recorded { tape, groups, .. } = record(code, &inputs)?;
    let groups = std::iter::once(vec![0]).chain(groups).collect();
    Ok(Routine { kind: RoutineKind::Hessian, inputs, tape, groups, flags: [None, None], general: None })
}
