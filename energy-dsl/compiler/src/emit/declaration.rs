use proc_macro2::TokenStream;
use quote::{ToTokens, format_ident, quote};

use energy_runtime::{Declaration, Field, OperationCount, Routine};

/// Emits the self-description of the generated type, which borrows its texts and lists.
pub(super) fn declaration(declaration: &Declaration) -> TokenStream {
    let Declaration { name, docs, formula, source, rows, translation_invariant, curved, quadratic, .. } = declaration;
    let Declaration { velocity_dependent, symmetric, reduced_coordinates, primitives, .. } = declaration;
    let kind = declaration.kind;
    let kind = format_ident!("{kind:?}");
    let vectors = declaration.reduced_vectors.iter().map(|vector| {
        let ends = vector.iter().map(|(point, weight)| quote!((#point, #weight)));
        borrowed(quote!(&[#(#ends),*]))
    });
    let dihedral = match declaration.dihedral {
        Some(points) => quote!(::core::option::Option::Some([#(#points),*])),
        None => quote!(::core::option::Option::None),
    };
    let properties = declaration.properties.iter().map(|property| format_ident!("{property:?}"));
    let list = declaration.routines.iter().map(routine);
    let [name, docs, formula, source] = [name, docs, formula, source].map(|text| borrowed(&**text));
    let Declaration { points, rest, parameters, state, .. } = declaration;
    let [points, rest, parameters, state] = [points, rest, parameters, state].map(|fields| {
        let fields = fields.iter().map(field);
        borrowed(quote!(&[#(#fields)*]))
    });
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
            state: #state,
            rows: #rows,
            properties: #properties,
            translation_invariant: #translation_invariant,
            curved: #curved,
            quadratic: #quadratic,
            velocity_dependent: #velocity_dependent,
            symmetric: #symmetric,
            reduced_coordinates: #reduced_coordinates,
            reduced_vectors: #vectors,
            dihedral: #dihedral,
            primitives: #primitives,
            routines: #list,
        }
    }}
}

/// Writes a constant that a description borrows.
fn borrowed(constant: impl ToTokens) -> TokenStream {
    quote!(Borrowed(#constant))
}

fn field(field: &Field) -> TokenStream {
    let [name, unit] = [&field.name, &field.unit].map(|text| borrowed(&**text));
    let Field { kind, shared, size, entries, .. } = field;
    let kind = format_ident!("{kind:?}");
    quote! {
        ::energy_dsl::Field {
            name: #name,
            kind: ::energy_dsl::FieldKind::#kind,
            shared: #shared,
            size: #size,
            entries: #entries,
            unit: #unit,
        },
    }
}

fn routine(routine: &Routine) -> TokenStream {
    let name = routine.name;
    let [reduced, full] = [routine.reduced, routine.full].map(tokens);
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
