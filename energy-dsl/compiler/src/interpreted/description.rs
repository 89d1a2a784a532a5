//! The self-description of an element that is read at run time.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use crate::check::{Input, Program};
use crate::emit::{Character, character};
use crate::routines::Routines;
use energy_runtime::{Declaration, Field, Kind, Routine};

/// Descriptions so far, by their text.
static KNOWN: Mutex<BTreeMap<String, &'static Declaration>> = Mutex::new(BTreeMap::new());

/// Returns the self-description that generated code would have. Like that, it lives until the program ends; equal
/// declarations share one.
pub(super) fn description(program: &Program, routines: &Routines) -> &'static Declaration {
    let Program { name, docs, source, formula, properties, .. } = program;
    let properties: Vec<_> = properties.iter().map(|(property, _)| property).collect();
    let key = format!("{name}\n{docs:?}\n{source}\n{formula}\n{properties:?}");
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    known.entry(key).or_insert_with(|| Box::leak(Box::new(describe(program, routines))))
}

fn describe(program: &Program, routines: &Routines) -> Declaration {
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - implied];
    let docs: Vec<&str> = program.docs.iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    let Character { curved, quadratic, velocity_dependent, symmetric } = character(program, routines);
    let vectors = routines.vectors.iter().map(|vector| &*vector.clone().leak()).collect::<Vec<_>>();
    let list = routines.list.iter().map(|routine| Routine {
        name: routine.name,
        reduced: routines.count(&routine.reduced_outputs()),
        full: routines.count(&routine.outputs()),
    });
    Declaration {
        name: program.name.clone().leak(),
        kind: program.kind,
        docs: docs.join("\n").leak(),
        formula: program.formula.clone().leak(),
        source: program.source.clone().leak(),
        points: fields(&program.moving),
        rest: fields(&program.rest),
        parameters: fields(declared),
        rows: program.rows(),
        properties: program.properties.iter().map(|(property, _)| *property).collect::<Vec<_>>().leak(),
        translation_invariant: routines.translation_invariant,
        curved,
        quadratic,
        velocity_dependent,
        symmetric,
        reduced_coordinates: routines.coordinates,
        reduced_vectors: vectors.leak(),
        dihedral: routines.dihedral,
        primitives: routines.primitives.clone().leak(),
        routines: list.collect::<Vec<_>>().leak(),
    }
}

fn fields(inputs: &[Input]) -> &'static [Field] {
    let field = |input: &Input| Field {
        name: input.name.clone().leak(),
        size: input.input_type.size(),
        unit: input.unit.clone().leak(),
    };
    inputs.iter().map(field).collect::<Vec<_>>().leak()
}
