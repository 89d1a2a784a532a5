//! The self-description of an element.

use std::borrow::Cow;

use super::Code;
use crate::check::{Input, Program};
use crate::graph::{Graph, NodeId};
use crate::lower::Repetition;
use crate::routines::Routines;
use energy_runtime::{Declaration, Field, FieldKind, Kind, OperationCount, Routine, RoutineKind};

/// Returns the self-description of an element. It owns its texts and lists.
pub(super) fn description(program: &Program, routines: &Routines) -> Declaration {
    // The stiffness and damping of a constraint are implied by its kind.
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - program.states - implied];
    let docs: Vec<&str> = program.docs.iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    let Character { curved, quadratic, velocity_dependent, symmetric } = character(program, routines);
    let list = routines.all().map(|(graph, routine)| Routine {
        name: routine.kind.name(),
        reduced: operations(routines, graph, &routine.reduced_outputs()),
        full: operations(routines, graph, &routine.outputs()),
    });
    Declaration {
        name: Cow::Owned(program.name.clone()),
        kind: program.kind,
        docs: Cow::Owned(docs.join("\n")),
        formula: Cow::Owned(program.formula.clone()),
        source: Cow::Owned(program.source.clone()),
        points: fields(&program.moving),
        rest: fields(&program.rest),
        parameters: fields(declared),
        state: fields(program.state()),
        rows: program.rows(),
        properties: program.properties.iter().map(|(property, _)| *property).collect(),
        translation_invariant: routines.translation_invariant,
        curved,
        quadratic,
        velocity_dependent,
        symmetric,
        reduced_coordinates: routines.coordinates,
        reduced_vectors: routines.vectors.iter().map(|vector| Cow::Owned(vector.clone())).collect(),
        dihedral: routines.dihedral,
        primitives: Cow::Owned(routines.primitives.clone()),
        routines: list.collect(),
    }
}

/// Counts the operations that compute some outputs in double precision, in all terms of a sum.
pub(crate) fn operations(routines: &Routines, graph: &Graph, outputs: &[NodeId]) -> OperationCount {
    let code = Code::new(graph, &[outputs.to_vec()], [None, None]).in_precision(|number| number);
    let mut count = OperationCount::default();
    code.statements.list().iter().for_each(|op| op.add_to(&mut count));
    count.times(routines.repetition.as_ref().map_or(1, Repetition::terms))
}

fn fields(inputs: &[Input]) -> Cow<'static, [Field]> {
    let field = |input: &Input| Field {
        name: Cow::Owned(input.name.clone()),
        kind: if input.is_time_step { FieldKind::TimeStep } else { input.input_type.element.field_kind() },
        shared: input.shared,
        size: input.input_type.size(),
        entries: input.input_type.length.unwrap_or(1),
        unit: Cow::Owned(input.unit.clone()),
    };
    inputs.iter().map(field).collect()
}

/// Properties that solvers rely on.
struct Character {
    curved: bool,
    quadratic: bool,
    velocity_dependent: bool,
    symmetric: bool,
}

fn character(program: &Program, routines: &Routines) -> Character {
    let group = |kind: RoutineKind, number: usize| routines.find(kind)?.groups.get(number);
    let varies = |nodes: Option<&Vec<NodeId>>| nodes.is_some_and(|n| n.iter().any(|&e| !routines.graph.is(e, 0.0)));
    let (by_position, by_velocity) = (group(RoutineKind::Jacobians, 1), group(RoutineKind::Jacobians, 2));
    let (n, size) = (program.points(), program.increments());
    let mirrored = |square: &Vec<NodeId>| {
        let entry = |row: usize, column: usize| match program.is_mixed() {
            true => square[row * size + column],
            false => square[9 * (row / 3 * n + column / 3) + 3 * (row % 3) + column % 3],
        };
        (0..size).all(|row| (0..row).all(|column| entry(row, column) == entry(column, row)))
    };
    let constant = |nodes: &Vec<NodeId>| nodes.iter().all(|&entry| !routines.graph.varies(entry));
    Character {
        quadratic: match (by_position, by_velocity) {
            (None, None) => group(RoutineKind::Hessian, 2).is_some_and(constant),
            jacobians => [jacobians.0, jacobians.1].into_iter().flatten().all(constant),
        },
        curved: varies(group(RoutineKind::Hessian, 2).or(by_position)),
        velocity_dependent: varies(by_velocity),
        symmetric: [by_position, by_velocity].into_iter().flatten().all(mirrored),
    }
}
