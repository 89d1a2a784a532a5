use proc_macro2::TokenStream;
use quote::{ToTokens, format_ident, quote};

use crate::check::{Input, Program};
use crate::graph::NodeId;
use crate::routines::{Routine, Routines};
use energy_runtime::{Kind, OperationCount};

/// Emits the `Declaration` of the generated type.
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
    // The stiffness and damping of a constraint are implied by its kind.
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - implied];
    let (points, rest, parameters) = (fields(&program.moving), fields(&program.rest), fields(declared));
    let rows = program.rows();
    let (invariant, coordinates) = (routines.translation_invariant, routines.coordinates);
    let Character { curved, quadratic, velocity_dependent, symmetric } = character(program, routines);
    let vectors = routines.vectors.iter().map(|vector| {
        let ends = vector.iter().map(|(point, sign)| quote!((#point, #sign)));
        borrowed(quote!(&[#(#ends),*]))
    });
    let dihedral = match routines.dihedral {
        Some(points) => quote!(::core::option::Option::Some([#(#points),*])),
        None => quote!(::core::option::Option::None),
    };
    let primitives = &routines.primitives;
    let properties = program.properties.iter().map(|(property, _)| format_ident!("{property:?}"));
    let list = routines.list.iter().map(|r| routine(routines, r));
    let [name, docs, formula, source] = [name, &docs, formula, source].map(borrowed);
    let [points, rest, parameters] = [points, rest, parameters].map(|fields| borrowed(quote!(&[#fields])));
    let properties = borrowed(quote!(&[#(::energy_dsl::Property::#properties),*]));
    let [vectors, primitives, list] =
        [quote!(&[#(#vectors),*]), quote!(&[#(#primitives),*]), quote!(&[#(#list),*])].map(borrowed);
    quote! {{
        use ::std::borrow::Cow::Borrowed;
        ::energy_dsl::Declaration {
            name: #name,
            kind: ::energy_dsl::Kind::#kind,
            docs: #docs,
            formula: #formula,
            source: #source,
            points: #points,
            rest: #rest,
            parameters: #parameters,
            rows: #rows,
            properties: #properties,
            translation_invariant: #invariant,
            curved: #curved,
            quadratic: #quadratic,
            velocity_dependent: #velocity_dependent,
            symmetric: #symmetric,
            reduced_coordinates: #coordinates,
            reduced_vectors: #vectors,
            dihedral: #dihedral,
            primitives: #primitives,
            routines: #list,
        }
    }}
}

/// Properties that solvers rely on.
pub(crate) struct Character {
    pub(crate) curved: bool,
    pub(crate) quadratic: bool,
    pub(crate) velocity_dependent: bool,
    pub(crate) symmetric: bool,
}

pub(crate) fn character(program: &Program, routines: &Routines) -> Character {
    let group = |routine: &str, number: usize| {
        let routine = routines.list.iter().find(|r| r.name == routine)?;
        routine.groups.get(number)
    };
    let varies = |nodes: Option<&Vec<NodeId>>| nodes.is_some_and(|n| n.iter().any(|&e| !routines.graph.is(e, 0.0)));
    let (by_position, by_velocity) = (group("jacobians", 1), group("jacobians", 2));
    let n = program.points();
    let mirrored = |square: &Vec<NodeId>| {
        let entry = |row: usize, column: usize| square[9 * (row / 3 * n + column / 3) + 3 * (row % 3) + column % 3];
        (0..3 * n).all(|row| (0..row).all(|column| entry(row, column) == entry(column, row)))
    };
    let constant = |nodes: &Vec<NodeId>| nodes.iter().all(|&entry| !routines.graph.varies(entry));
    Character {
        quadratic: match (by_position, by_velocity) {
            (None, None) => group("hessian", 2).is_some_and(constant),
            jacobians => [jacobians.0, jacobians.1].into_iter().flatten().all(constant),
        },
        curved: varies(group("hessian", 2).or(by_position)),
        velocity_dependent: varies(by_velocity),
        symmetric: [by_position, by_velocity].into_iter().flatten().all(mirrored),
    }
}

/// Writes a constant that a description borrows.
fn borrowed(constant: impl ToTokens) -> TokenStream {
    quote!(Borrowed(#constant))
}

fn fields(inputs: &[Input]) -> TokenStream {
    inputs
        .iter()
        .map(|input| {
            let (name, size, unit) = (&input.name, input.input_type.size(), &input.unit);
            let [name, unit] = [name, unit].map(borrowed);
            quote!(::energy_dsl::Field { name: #name, size: #size, unit: #unit },)
        })
        .collect()
}

fn routine(routines: &Routines, routine: &Routine) -> TokenStream {
    let name = routine.name;
    let [reduced, full] =
        [routine.reduced_outputs(), routine.outputs()].map(|outputs| tokens(routines.count(&outputs)));
    quote!(::energy_dsl::Routine { name: #name, reduced: #reduced, full: #full })
}

fn tokens(count: OperationCount) -> TokenStream {
    let OperationCount { basic, fused, divisions_and_roots, transcendental, error_terms } = count;
    quote! {
        ::energy_dsl::OperationCount {
            basic: #basic,
            fused: #fused,
            divisions_and_roots: #divisions_and_roots,
            transcendental: #transcendental,
            error_terms: #error_terms,
        }
    }
}
