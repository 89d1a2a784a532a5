use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use super::declaration::declaration;
use super::schedule::{Reader, Schedule};
use crate::check::{Input as DeclaredInput, Program};
use crate::graph::{Input, NodeId, count};
use crate::routines::{Routine, Routines};
use crate::runtime::Kind;

/// The type, its constructor, its traits, and its test if one was asked for.
#[must_use]
pub fn emit(program: &Program, routines: &Routines) -> TokenStream {
    let name = format_ident!("{}", program.name, span = program.span.token);
    let structure = structure(&name, program, routines);
    let constructor = constructor(&name, program, routines);
    let element = element(&name, program, routines);
    let traits = match program.kind {
        Kind::Energy => potential(&name, program, routines),
        Kind::Force => force_law(&name, program, routines),
        Kind::Constraint => {
            let (potential, force) = (potential(&name, program, routines), force_law(&name, program, routines));
            let constraint = constraint(&name, program, routines);
            quote!(#potential #force #constraint)
        }
        Kind::Residual => residual(&name, program, routines),
    };
    let test = audit_test(&name, program);
    quote!(#structure #constructor #element #traits #test)
}

fn structure(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let docs = documentation(program, routines);
    let visibility: TokenStream = program.visibility.parse().unwrap_or_default();
    let fields = program.parameters.iter().map(|parameter| {
        let (field, field_type) = (format_ident!("{}", parameter.name), input_type(parameter));
        let doc = match parameter.unit.as_str() {
            "" => format!("The parameter {}.", parameter.name),
            unit => format!("The parameter {} in {unit}.", parameter.name),
        };
        quote!(#[doc = #doc] pub #field: #field_type,)
    });
    let precomputed = (!routines.rest.outputs.is_empty()).then(|| {
        let stored = routines.rest.outputs.len();
        quote!(precomputed: [T; #stored],)
    });
    // Nothing to hold, but the number type to remember.
    let marker = holds_nothing(program, routines).then(|| quote!(number: ::core::marker::PhantomData<T>,));
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

fn holds_nothing(program: &Program, routines: &Routines) -> bool {
    program.parameters.is_empty() && routines.rest.outputs.is_empty()
}

/// The doc comment, and what was made of the formula.
fn documentation(program: &Program, routines: &Routines) -> Vec<String> {
    let mut lines = program.docs.clone();
    let list = |inputs: &[DeclaredInput]| inputs.iter().map(|i| i.name.clone()).collect::<Vec<_>>().join(", ");
    lines.extend(["".into(), "# Formula".into(), "```text".into(), program.formula.clone(), "```".into()]);
    let moving = if program.kind == Kind::Residual { "unknowns" } else { "points" };
    lines.push(format!("A declared {} of the {moving} {}.", program.kind.keyword(), list(&program.moving)));
    if !routines.primitives.is_empty() {
        lines.push(format!("Compiled to the robust primitives: {}.", routines.primitives.join("; ")));
    }
    lines.extend(["".into(), "| routine | operations | in reduced coordinates |".into(), "|---|---|---|".into()]);
    for routine in &routines.list {
        let (full, reduced) = (
            count(&routines.graph, &routine.outputs()).total(),
            count(&routines.graph, &routine.reduced_outputs()).total(),
        );
        lines.push(format!("| `{}` | {full} | {reduced} |", routine.name));
    }
    lines
}

fn input_type(input: &DeclaredInput) -> TokenStream {
    input.input_type.dimensions().into_iter().rev().fold(quote!(T), |entry, length| quote!([#entry; #length]))
}

/// `new` with the rest shape and then the parameters, and the same from flat slices.
fn constructor(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
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
    let (result, body, from_flat) = if routines.rest.outputs.is_empty() {
        let marker = holds_nothing(program, routines).then(|| quote!(number: ::core::marker::PhantomData));
        (quote!(Self), quote!(Self { #(#fields,)* #marker }), quote!(Ok(Self::new(#(#values),*))))
    } else {
        let read = |input: Input| read_input(&program.rest, &program.parameters, input);
        let mut schedule = Schedule::new(&routines.rest.graph, &read);
        let precomputed = schedule.array(&routines.rest.outputs);
        let degenerate = schedule.mask(routines.rest_flags[0]);
        let statements = schedule.statements();
        let body = quote! {
            #statements
            let precomputed = #precomputed;
            let mut sound = !(#degenerate);
            for value in precomputed {
                // Neither infinite nor NaN.
                sound = sound & (value - value).equal(T::from_f64(0.0));
            }
            if ::energy_dsl::Mask::any(!sound) {
                return Err(::energy_dsl::RestError { element: #element });
            }
            Ok(Self { #(#fields,)* precomputed })
        };
        let result = quote!(::core::result::Result<Self, ::energy_dsl::RestError>);
        (result, body, quote!(Self::new(#(#values),*)))
    };
    let errors = (!routines.rest.outputs.is_empty()).then(|| {
        quote!(#[doc = ""] #[doc = "# Errors"] #[doc = "When the rest shape is degenerate: zero length or area, or not finite."])
    });
    quote! {
        #[allow(non_snake_case, mixed_script_confusables, confusable_idents, unused_parens, clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> #name<T> {
            /// The element, from its rest shape (if any) and its parameters in declared order.
            #errors
            #[inline]
            #[must_use]
            pub fn new(#(#arguments),*) -> #result {
                #body
            }

            #[allow(unused_variables)]
            fn from_flat(rest: &[T], parameters: &[T]) -> ::core::result::Result<Self, ::energy_dsl::RestError> {
                #from_flat
            }
        }
    }
}

/// Inside `new`: rest shape and parameters are its arguments.
fn read_input(rest: &[DeclaredInput], parameters: &[DeclaredInput], input: Input) -> TokenStream {
    let (list, number) = match input {
        Input::Rest(i) => (rest, usize::from(i)),
        Input::Parameter(i) => (parameters, usize::from(i)),
        _ => unreachable!("compiler bug: the rest block reads rest shape and parameters only"),
    };
    component(list, number, &quote!())
}

/// The component with a number among the inputs, each read as `prefix name`.
fn component(inputs: &[DeclaredInput], number: usize, prefix: &TokenStream) -> TokenStream {
    let input = inputs
        .iter()
        .find(|i| (i.first..i.first + i.input_type.size()).contains(&number))
        .expect("compiler bug: inputs are numbered without gaps");
    let name = format_ident!("{}", input.name);
    let mut place = number - input.first;
    let mut size = input.input_type.size();
    let mut read = quote!(#prefix #name);
    for length in input.input_type.dimensions() {
        size /= length;
        let index = place / size;
        read.extend(quote!([#index]));
        place %= size;
    }
    read
}

fn element(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let declaration = declaration(program, routines);
    let evaluate = format_ident!(
        "evaluate_{}",
        match program.kind {
            Kind::Energy => "potential",
            Kind::Constraint => "constraint",
            Kind::Force => "force_law",
            Kind::Residual => "residual",
        }
    );
    quote! {
        impl<S: ::energy_dsl::Real> ::energy_dsl::Element for #name<S> {
            const DECLARATION: &'static ::energy_dsl::Declaration = &#declaration;
            type Over<T: ::energy_dsl::Real> = #name<T>;

            fn evaluate<T: ::energy_dsl::Real>(
                inputs: &::energy_dsl::Inputs<'_, T>,
            ) -> ::core::result::Result<::energy_dsl::Outputs<T>, ::energy_dsl::RestError> {
                let element = #name::<T>::from_flat(inputs.rest, inputs.parameters)?;
                Ok(::energy_dsl::#evaluate(&element, inputs))
            }
        }
    }
}

/// What turns a group of outputs into an expression.
type Layout = fn(&mut Schedule<'_>, &[NodeId]) -> TokenStream;

const NUMBER: Layout = |schedule, nodes| schedule.value(nodes[0]);
const NUMBERS: Layout = |schedule, nodes| schedule.array(nodes);
const VECTORS: Layout = |schedule, nodes| schedule.vectors(nodes);
const BLOCKS: Layout = |schedule, nodes| schedule.blocks(nodes);

/// The body of a method: statements, then the struct it returns.
fn body(program: &Program, routines: &Routines, name: &str, result: &str, fields: &[(&str, Layout)]) -> TokenStream {
    let routine: &Routine =
        routines.list.iter().find(|r| r.name == name).expect("compiler bug: a routine of another kind of declaration");
    let unknowns = program.kind == Kind::Residual;
    let read = |input: Input| match input {
        Input::Position(i) if unknowns => {
            let i = usize::from(i);
            quote!(u[#i])
        }
        Input::Position(i) => {
            let (point, axis) = (usize::from(i) / 3, usize::from(i) % 3);
            quote!(x[#point][#axis])
        }
        Input::Velocity(i) => {
            let (point, axis) = (usize::from(i) / 3, usize::from(i) % 3);
            quote!(v[#point][#axis])
        }
        Input::Parameter(i) => component(&program.parameters, usize::from(i), &quote!(self.)),
        Input::Precomputed(i) => {
            let i = usize::from(i);
            quote!(self.precomputed[#i])
        }
        Input::Rest(_) => unreachable!("compiler bug: the rest shape is read when an element is made"),
    };
    let reader: Reader<'_> = &read;
    let mut schedule = Schedule::new(&routines.graph, reader);
    let mut values = Vec::new();
    for ((field, layout), nodes) in fields.iter().zip(&routine.groups) {
        let (field, value) = (format_ident!("{field}"), layout(&mut schedule, nodes));
        values.push(quote!(#field: #value));
    }
    let (degenerate, kink) = (schedule.mask(routine.flags[0]), schedule.mask(routine.flags[1]));
    let statements = schedule.statements();
    let result = format_ident!("{result}");
    quote! {
        #statements
        ::energy_dsl::#result { #(#values,)* flags: ::energy_dsl::Flags { degenerate: #degenerate, kink: #kink } }
    }
}

/// Generated arithmetic is not written to be read by lints.
fn allowances() -> TokenStream {
    quote!(#[allow(unused_variables, unused_parens, clippy::all, clippy::pedantic)])
}

fn potential(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let points = program.points();
    let blocks = points * (points + 1) / 2;
    let value = body(program, routines, "value", "Value", &[("value", NUMBER)]);
    let gradient = body(program, routines, "gradient", "Gradient", &[("value", NUMBER), ("gradient", VECTORS)]);
    let hessian =
        body(program, routines, "hessian", "Hessian", &[("value", NUMBER), ("gradient", VECTORS), ("hessian", BLOCKS)]);
    let allowances = allowances();
    quote! {
        #allowances
        impl<T: ::energy_dsl::Real> ::energy_dsl::Potential<T> for #name<T> {
            type Points = [::energy_dsl::Vector3<T>; #points];
            type Triangle = [::energy_dsl::Block<T>; #blocks];

            #[inline]
            fn value(&self, x: &Self::Points) -> ::energy_dsl::Value<T> {
                #value
            }

            #[inline]
            fn gradient(&self, x: &Self::Points) -> ::energy_dsl::Gradient<T, Self::Points> {
                #gradient
            }

            #[inline]
            fn hessian(&self, x: &Self::Points) -> ::energy_dsl::Hessian<T, Self::Points, Self::Triangle> {
                #hessian
            }
        }
    }
}

fn force_law(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let points = program.points();
    let blocks = points * points;
    let force = body(program, routines, "force", "ForceValue", &[("force", VECTORS)]);
    let jacobians = body(
        program,
        routines,
        "jacobians",
        "ForceJacobians",
        &[("force", VECTORS), ("by_position", BLOCKS), ("by_velocity", BLOCKS)],
    );
    let allowances = allowances();
    quote! {
        #allowances
        impl<T: ::energy_dsl::Real> ::energy_dsl::ForceLaw<T> for #name<T> {
            type Points = [::energy_dsl::Vector3<T>; #points];
            type Square = [::energy_dsl::Block<T>; #blocks];

            #[inline]
            fn force(
                &self,
                x: &<Self as ::energy_dsl::ForceLaw<T>>::Points,
                v: &<Self as ::energy_dsl::ForceLaw<T>>::Points,
            ) -> ::energy_dsl::ForceValue<T, <Self as ::energy_dsl::ForceLaw<T>>::Points> {
                #force
            }

            #[inline]
            fn jacobians(
                &self,
                x: &<Self as ::energy_dsl::ForceLaw<T>>::Points,
                v: &<Self as ::energy_dsl::ForceLaw<T>>::Points,
            ) -> ::energy_dsl::ForceJacobians<T, <Self as ::energy_dsl::ForceLaw<T>>::Points, Self::Square> {
                #jacobians
            }
        }
    }
}

fn constraint(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let (points, rows) = (program.points(), program.rows());
    let (vectors, blocks) = (rows * points, rows * points * (points + 1) / 2);
    let jacobian = body(
        program,
        routines,
        "constraint_jacobian",
        "ConstraintJacobian",
        &[("value", NUMBERS), ("jacobian", VECTORS)],
    );
    let hessian = body(
        program,
        routines,
        "constraint_hessian",
        "ConstraintHessian",
        &[("value", NUMBERS), ("jacobian", VECTORS), ("hessians", BLOCKS)],
    );
    let gauss_newton = body(
        program,
        routines,
        "gauss_newton",
        "Hessian",
        &[("value", NUMBER), ("gradient", VECTORS), ("hessian", BLOCKS)],
    );
    let points_type = quote!(<Self as ::energy_dsl::Potential<T>>::Points);
    let allowances = allowances();
    quote! {
        #allowances
        impl<T: ::energy_dsl::Real> ::energy_dsl::Constraint<T> for #name<T> {
            type Rows = [T; #rows];
            type Jacobian = [::energy_dsl::Vector3<T>; #vectors];
            type Triangles = [::energy_dsl::Block<T>; #blocks];

            #[inline]
            fn constraint_jacobian(
                &self,
                x: &#points_type,
            ) -> ::energy_dsl::ConstraintJacobian<T, Self::Rows, Self::Jacobian> {
                #jacobian
            }

            #[inline]
            fn constraint_hessian(
                &self,
                x: &#points_type,
            ) -> ::energy_dsl::ConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles> {
                #hessian
            }

            #[inline]
            fn gauss_newton(
                &self,
                x: &#points_type,
            ) -> ::energy_dsl::Hessian<T, #points_type, <Self as ::energy_dsl::Potential<T>>::Triangle> {
                #gauss_newton
            }
        }
    }
}

fn residual(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let (unknowns, rows) = (program.moving_size(), program.rows());
    let entries = unknowns * rows;
    let value = body(program, routines, "residual", "ResidualValue", &[("value", NUMBERS)]);
    let jacobian =
        body(program, routines, "jacobian", "ResidualJacobian", &[("value", NUMBERS), ("jacobian", NUMBERS)]);
    let allowances = allowances();
    quote! {
        #allowances
        impl<T: ::energy_dsl::Real> ::energy_dsl::Residual<T> for #name<T> {
            type Unknowns = [T; #unknowns];
            type Rows = [T; #rows];
            type Jacobian = [T; #entries];

            #[inline]
            fn residual(&self, u: &Self::Unknowns) -> ::energy_dsl::ResidualValue<T, Self::Rows> {
                #value
            }

            #[inline]
            fn jacobian(&self, u: &Self::Unknowns) -> ::energy_dsl::ResidualJacobian<T, Self::Rows, Self::Jacobian> {
                #jacobian
            }
        }
    }
}

/// The test that `#[audit]` asks for.
fn audit_test(name: &Ident, program: &Program) -> TokenStream {
    let Some(samples) = program.audit_samples else { return TokenStream::new() };
    let test = format_ident!("derivatives_of_{}", snake_case(&program.name));
    quote! {
        #[cfg(test)]
        #[test]
        fn #test() {
            ::verify::assert_derivatives::<#name<f64>>(#samples);
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
