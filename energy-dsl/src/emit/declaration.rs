use proc_macro2::TokenStream;
use quote::quote;

use crate::check::{Input, Program};
use crate::graph::{Graph, NodeId, count};
use crate::routines::{Routine, Routines};
use crate::runtime::{Kind, OperationCount};

/// The `Declaration` that generated code carries.
pub(super) fn declaration(program: &Program, routines: &Routines) -> TokenStream {
    let name = &program.name;
    let kind = match program.kind {
        Kind::Energy => quote!(Energy),
        Kind::Constraint => quote!(Constraint),
        Kind::Force => quote!(Force),
        Kind::Residual => quote!(Residual),
    };
    let docs = program.docs.iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect::<Vec<_>>().join("\n");
    let (formula, source) = (&program.formula, &program.source);
    // A constraint's stiffness and damping are implied by its kind.
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - implied];
    let (points, rest, parameters) = (fields(&program.moving), fields(&program.rest), fields(declared));
    let rows = program.rows();
    let (invariant, coordinates) = (routines.translation_invariant, routines.coordinates);
    let primitives = &routines.primitives;
    let list = routines.list.iter().map(|r| routine(&routines.graph, r));
    quote! {
        ::energy_dsl::Declaration {
            name: #name,
            kind: ::energy_dsl::Kind::#kind,
            docs: #docs,
            formula: #formula,
            source: #source,
            points: &[#points],
            rest: &[#rest],
            parameters: &[#parameters],
            rows: #rows,
            translation_invariant: #invariant,
            reduced_coordinates: #coordinates,
            primitives: &[#(#primitives),*],
            routines: &[#(#list),*],
        }
    }
}

fn fields(inputs: &[Input]) -> TokenStream {
    inputs
        .iter()
        .map(|input| {
            let (name, size, unit) = (&input.name, input.input_type.size(), &input.unit);
            quote!(::energy_dsl::Field { name: #name, size: #size, unit: #unit },)
        })
        .collect()
}

fn routine(graph: &Graph, routine: &Routine) -> TokenStream {
    let name = routine.name;
    let (reduced, full) = (counted(graph, &routine.reduced_outputs()), counted(graph, &routine.outputs()));
    quote!(::energy_dsl::Routine { name: #name, reduced: #reduced, full: #full })
}

fn counted(graph: &Graph, outputs: &[NodeId]) -> TokenStream {
    let OperationCount { basic, divisions_and_roots, transcendental, error_terms } = count(graph, outputs);
    quote! {
        ::energy_dsl::OperationCount {
            basic: #basic,
            divisions_and_roots: #divisions_and_roots,
            transcendental: #transcendental,
            error_terms: #error_terms,
        }
    }
}
