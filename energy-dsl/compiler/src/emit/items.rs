use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use super::Emitter;
use super::declaration::declaration;
use super::methods::component;
use super::repeated;
use super::statements::arranged;
use super::traits::traits;
use crate::check::{Input as DeclaredInput, Program};
use crate::graph::Input;
use crate::plan::{Plan, Shape};
use energy_runtime::{Kind, Routine};

impl Emitter<'_> {
    pub(super) fn items(&self) -> TokenStream {
        let parts = [
            structure(self),
            constructor(self),
            element(self),
            repeated::term(self),
            traits(self),
            packed(self),
            audit_test(&self.name, self.program),
        ];
        parts.into_iter().collect()
    }
}

fn structure(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    let docs = documentation(program, plan);
    let visibility: TokenStream = program.visibility.parse().unwrap_or_default();
    let fields = program.parameters.iter().map(|parameter| {
        let (field, field_type) = (format_ident!("{}", parameter.name), input_type(parameter));
        let doc = match parameter.unit.as_str() {
            "" => format!("The parameter {}.", parameter.name),
            unit => format!("The parameter {} in {unit}.", parameter.name),
        };
        quote!(#[doc = #doc] pub #field: #field_type,)
    });
    let stored = plan.stored();
    let precomputed = (stored > 0).then(|| quote!(precomputed: [T; #stored],));
    // A type without fields still needs to name its number type.
    let marker = holds_nothing(program, plan).then(|| quote!(number: ::core::marker::PhantomData<T>,));
    quote! {
        #(#[doc = #docs])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(non_snake_case, mixed_script_confusables, confusable_idents, uncommon_codepoints)]
        #visibility struct #name<T = f64> {
            #(#fields)*
            #precomputed
            #marker
        }
    }
}

fn holds_nothing(program: &Program, plan: &Plan) -> bool {
    program.parameters.is_empty() && plan.stored() == 0
}

/// Returns the doc comment and a description of the compiled form.
fn documentation(program: &Program, plan: &Plan) -> Vec<String> {
    let mut lines = program.docs.clone();
    let list = |inputs: &[DeclaredInput]| inputs.iter().map(|i| i.name.clone()).collect::<Vec<_>>().join(", ");
    lines.extend(["".into(), "# Formula".into(), "```text".into(), program.formula.clone(), "```".into()]);
    let is_flat = program.kind == Kind::Residual || program.is_mixed();
    let moving = if is_flat { "unknowns" } else { "points" };
    lines.push(format!("A declared {} of the {moving} {}.", program.kind.keyword(), list(&program.moving)));
    let primitives = &plan.declaration.primitives;
    if !primitives.is_empty() {
        lines.push(format!("Compiled to the robust primitives: {}.", primitives.join("; ")));
    }
    if program.uncompensated {
        lines.push(
            "Uncompensated: differences of points, and what cancels, are accurate to the rounding of the points \
             themselves."
                .into(),
        );
    }
    lines.extend(["".into(), "| routine | operations | in reduced coordinates |".into(), "|---|---|---|".into()]);
    for Routine { name, full, reduced } in plan.declaration.routines.iter() {
        lines.push(format!("| `{name}` | {} | {} |", full.total(), reduced.total()));
    }
    lines
}

pub(super) fn input_type(input: &DeclaredInput) -> TokenStream {
    input.input_type.dimensions().into_iter().rev().fold(quote!(T), |entry, length| quote!([#entry; #length]))
}

/// Emits `new`, which takes the rest shape and then the parameters, and its counterpart for flat slices.
fn constructor(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    let argument = |input: &DeclaredInput| {
        let (name, input_type) = (format_ident!("{}", input.name), input_type(input));
        quote!(#name: #input_type)
    };
    let arguments: Vec<_> = program.rest.iter().chain(&program.parameters).map(argument).collect();
    let fields: Vec<_> = program.parameters.iter().map(|p| format_ident!("{}", p.name)).collect();
    let flat = |inputs: &[DeclaredInput], list: Ident| -> Vec<TokenStream> {
        inputs
            .iter()
            .map(|input| {
                let mut numbers: Vec<TokenStream> =
                    (input.first..input.first + input.input_type.size()).map(|i| quote!(#list[#i])).collect();
                for length in input.input_type.dimensions().into_iter().rev() {
                    numbers = numbers.chunks(length).map(|entries| quote!([#(#entries),*])).collect();
                }
                numbers.into_iter().collect()
            })
            .collect()
    };
    let mut values = flat(&program.rest, format_ident!("rest"));
    values.extend(flat(&program.parameters, format_ident!("parameters")));
    let element = &program.name;
    let (result, body, from_flat) = if plan.stored() == 0 {
        let marker = holds_nothing(program, plan).then(|| quote!(number: ::core::marker::PhantomData));
        (quote!(Self), quote!(Self { #(#fields,)* #marker }), quote!(Ok(Self::new(#(#values),*))))
    } else {
        let code = &plan.rest.ordinary;
        let mut read = |input: Input| read_input(&program.rest, &program.parameters, input);
        let rendered = emitter.rendered(code, &mut read);
        let precomputed = arranged(Shape::Numbers, &rendered.numbers(&code.groups[0]));
        let degenerate = rendered.mask(code.flags[0]);
        let statements = rendered.statements;
        let inputs = || program.rest.iter().chain(&program.parameters);
        let names: Vec<_> = inputs().map(|input| format_ident!("{}", input.name)).collect();
        let types = inputs().map(input_type);
        // Runs at the level of the routines: a number that both the rest shape and the moving points determine must be
        // equal.
        let body = quote! {
            struct New<T>(#(#types),*);
            impl<T: ::energy_dsl::Real> ::energy_dsl::Kernel for New<T> {
                type Output = ::core::result::Result<#name<T>, ::energy_dsl::RestError>;

                #[inline(always)]
                fn run<L: ::energy_dsl::Level>(self) -> Self::Output {
                    let New(#(#names),*) = self;
                    #statements
                    let precomputed = #precomputed;
                    let mut sound = !(#degenerate);
                    for value in precomputed {
                        // False for infinite numbers and NaN.
                        sound = sound & (value - value).equal(T::from_f64(0.0));
                    }
                    if ::energy_dsl::Mask::any(!sound) {
                        return Err(::energy_dsl::RestError { element: ::std::borrow::Cow::Borrowed(#element) });
                    }
                    Ok(#name { #(#fields,)* precomputed })
                }
            }
            T::dispatch(New(#(#names),*))
        };
        let result = quote!(::core::result::Result<Self, ::energy_dsl::RestError>);
        (result, body, quote!(Self::new(#(#values),*)))
    };
    let at_rest = at_rest(emitter, &result);
    let errors = (plan.stored() > 0).then(|| {
        quote! {
            #[doc = ""]
            #[doc = "# Errors"]
            #[doc = "When the rest shape is degenerate: zero length or area, or not finite."]
        }
    });
    quote! {
        #[allow(non_snake_case, mixed_script_confusables, confusable_idents, unused_parens)]
        #[allow(clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> #name<T> {
            /// Creates the element from its rest shape (if any) and its parameters, in declared order.
            #errors
            #[inline]
            #[must_use]
            pub fn new(#(#arguments),*) -> #result {
                #body
            }

            #at_rest

            #[allow(unused_variables)]
            fn from_flat(rest: &[T], parameters: &[T]) -> ::core::result::Result<Self, ::energy_dsl::RestError> {
                #from_flat
            }
        }
    }
}

/// Emits the constructor of an element whose state begins at rest; nothing if the state is given with each element.
fn at_rest(emitter: &Emitter<'_>, result: &TokenStream) -> Option<TokenStream> {
    let Emitter { program, plan, .. } = emitter;
    let code = plan.at_rest.as_ref()?;
    let given = || program.rest.iter().chain(&program.parameters[..program.parameters.len() - program.states]);
    let names: Vec<_> = given().map(|input| format_ident!("{}", input.name)).collect();
    let types: Vec<_> = given().map(input_type).collect();
    let rendered = emitter.rendered(code, &mut |input: Input| read_input(&program.rest, &program.parameters, input));
    let (size, numbers) = (program.state_size(), arranged(Shape::Numbers, &rendered.numbers(&code.groups[0])));
    let statements = rendered.statements;
    let mut next = 0_usize;
    let states = program.state().iter().map(|state| {
        let mut values: Vec<TokenStream> = (next..next + state.input_type.size()).map(|i| quote!(state[#i])).collect();
        next += state.input_type.size();
        for length in state.input_type.dimensions().into_iter().rev() {
            values = values.chunks(length).map(|entries| quote!([#(#entries),*])).collect();
        }
        values.into_iter().collect::<TokenStream>()
    });
    let states: Vec<TokenStream> = states.collect();
    Some(quote! {
        /// Creates the element with its state at rest, from its rest shape (if any) and its parameters, in declared order.
        #[doc = ""]
        #[doc = "# Errors"]
        #[doc = "Those of `new`, if it has any."]
        #[inline]
        #[must_use]
        pub fn at_rest(#(#names: #types),*) -> #result {
            #[allow(unused_variables)]
            struct AtRest<T>(#(#types,)* ::core::marker::PhantomData<T>);
            impl<T: ::energy_dsl::Real> ::energy_dsl::Kernel for AtRest<T> {
                type Output = [T; #size];

                #[inline(always)]
                #[allow(unused_variables)]
                fn run<L: ::energy_dsl::Level>(self) -> [T; #size] {
                    let AtRest(#(#names,)* _) = self;
                    #statements
                    #numbers
                }
            }
            let state = T::dispatch(AtRest(#(#names,)* ::core::marker::PhantomData));
            Self::new(#(#names,)* #(#states),*)
        }
    })
}

/// Reads an input inside `new`, where rest shape and parameters are arguments.
fn read_input(rest: &[DeclaredInput], parameters: &[DeclaredInput], input: Input) -> TokenStream {
    let (list, number) = match input {
        Input::Rest(i) => (rest, usize::from(i)),
        Input::Parameter(i) => (parameters, usize::from(i)),
        _ => unreachable!("compiler bug: the rest block reads rest shape and parameters only"),
    };
    component(list, number, &quote!())
}

fn element(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    let declaration = declaration(&plan.declaration);
    let evaluate = format_ident!(
        "evaluate_{}",
        match (program.kind, program.is_mixed()) {
            (Kind::Energy, false) => "potential",
            (Kind::Energy, true) => "mixed_potential",
            (Kind::Constraint, false) => "constraint",
            (Kind::Constraint, true) => "mixed_constraint",
            (Kind::Force, false) => "force_law",
            (Kind::Force, true) => "mixed_force",
            (Kind::Residual, _) => "residual",
        }
    );
    let outputs = match (program.states > 0, program.kind) {
        (false, _) => quote!(Ok(::energy_dsl::#evaluate(&element, inputs))),
        (true, Kind::Force) => {
            quote!(Ok(::energy_dsl::evaluate_next(&element, inputs, ::energy_dsl::#evaluate(&element, inputs))))
        }
        (true, _) => {
            quote!(Ok(::energy_dsl::evaluate_state(&element, inputs, ::energy_dsl::#evaluate(&element, inputs))))
        }
    };
    quote! {
        impl<S: ::energy_dsl::Real> ::energy_dsl::Element for #name<S> {
            const DECLARATION: &'static ::energy_dsl::Declaration = &#declaration;
            type Over<T: ::energy_dsl::Real> = #name<T>;

            fn evaluate<T: ::energy_dsl::Real>(
                inputs: &::energy_dsl::Inputs<'_, T>,
            ) -> ::core::result::Result<::energy_dsl::Outputs<T>, ::energy_dsl::RestError> {
                let element = #name::<T>::from_flat(inputs.rest, inputs.parameters)?;
                #outputs
            }
        }
    }
}

/// Emits the packed form: elements as plain numbers, and one element per lane.
fn packed(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    // Fields and their indices, number by number.
    let mut stores = Vec::new();
    let mut loads = Vec::new();
    let mut number = 0usize;
    let mut field = |field: &Ident, dimensions: &[usize]| {
        let size: usize = dimensions.iter().product();
        let mut reads = Vec::with_capacity(size);
        for place in 0..size {
            let (mut rest, mut left) = (place, size);
            let mut indices = TokenStream::new();
            for length in dimensions {
                left /= length;
                let index = rest / left;
                indices.extend(quote!([#index]));
                rest %= left;
            }
            stores.push(quote!(numbers[#number * stride] = self.#field #indices;));
            reads.push(quote!(V::load(&numbers[#number * stride..])));
            number += 1;
        }
        for &length in dimensions.iter().rev() {
            reads = reads.chunks(length).map(|entries| quote!([#(#entries),*])).collect();
        }
        loads.push(quote!(#field: #(#reads)*,));
    };
    for parameter in &program.parameters {
        field(&format_ident!("{}", parameter.name), &parameter.input_type.dimensions());
    }
    if plan.stored() > 0 {
        field(&format_ident!("precomputed"), &[plan.stored()]);
    }
    let marker = holds_nothing(program, plan).then(|| quote!(number: ::core::marker::PhantomData,));
    let traits = match program.kind {
        Kind::Energy | Kind::Constraint if program.is_mixed() => vec!["PackedMixed"],
        Kind::Force if program.is_mixed() => Vec::new(),
        Kind::Energy => vec!["PackedPotential"],
        Kind::Constraint => vec!["PackedPotential", "PackedForce"],
        Kind::Force => vec!["PackedForce"],
        Kind::Residual => vec!["PackedResidual"],
    };
    let over_lanes = traits.into_iter().map(|packed| {
        let packed = format_ident!("{packed}");
        quote! {
            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<S: ::energy_dsl::Real> ::energy_dsl::#packed<S> for #name<S> {
                type Wide<V: ::energy_dsl::Lane<S>> = #name<V>;

                #[inline(always)]
                fn load<V: ::energy_dsl::Lane<S>>(numbers: &[S], stride: usize) -> #name<V> {
                    #name { #(#loads)* #marker }
                }
            }
        }
    });
    quote! {
        #[allow(unused_variables, clippy::all, clippy::pedantic)]
        impl<S: ::energy_dsl::Real> ::energy_dsl::Stored<S> for #name<S> {
            const NUMBERS: usize = #number;

            fn store(&self, numbers: &mut [S], stride: usize) {
                #(#stores)*
            }
        }
        #(#over_lanes)*
    }
}

/// Emits the test that `#[audit]` requests.
fn audit_test(name: &Ident, program: &Program) -> TokenStream {
    let Some(samples) = program.audit_samples else { return TokenStream::new() };
    let test = format_ident!("derivatives_of_{}", snake_case(&program.name));
    quote! {
        #[cfg(test)]
        #[test]
        fn #test() {
            ::verify::assert_derivatives!(#name<f64>, samples = #samples);
        }
    }
}

fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut previous_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && previous_lower {
            snake.push('_');
        }
        previous_lower = !c.is_uppercase();
        snake.extend(c.to_lowercase());
    }
    snake
}
