//! The self-description of an element that is read at run time.

use std::borrow::Cow;

use crate::check::{Input, Program};
use crate::emit::{Character, character};
use crate::routines::Routines;
use energy_runtime::{Declaration, Field, Kind, Routine};

/// Returns the self-description that generated code would have. It owns its texts and lists.
pub(super) fn description(program: &Program, routines: &Routines) -> Declaration {
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - implied];
    let docs: Vec<&str> = program.docs.iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    let Character { curved, quadratic, velocity_dependent, symmetric } = character(program, routines);
    let list = routines.list.iter().map(|routine| Routine {
        name: routine.name,
        reduced: routines.count(&routine.reduced_outputs()),
        full: routines.count(&routine.outputs()),
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

fn fields(inputs: &[Input]) -> Cow<'static, [Field]> {
    let field = |input: &Input| Field {
        name: Cow::Owned(input.name.clone()),
        size: input.input_type.size(),
        unit: Cow::Owned(input.unit.clone()),
    };
    inputs.iter().map(field).collect()
}
