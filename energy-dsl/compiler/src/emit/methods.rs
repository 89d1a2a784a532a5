//! Emits routines as trait methods.
//!
//! A routine `f` becomes `f_at::<L>`, which is inlined into a caller at SIMD level L, and `f`, which runs it at the
//! best level of the machine. If precautions were split off, `f_at` chooses between `f_if_ordinary` and `f_in_general`
//! by `f_has_guards` and `f_is_ordinary`.
//!
//! For a sum of like terms, these are the routines of one term, and `f_at` is the loop over all.

use std::cell::RefCell;

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use super::repeated::{self, term_of};
use super::schedule::Schedule;
use crate::budget::Budget;
use crate::check::{Input as DeclaredInput, Program};
use crate::graph::{Graph, Input, NodeId};
use crate::routines::{General, Routine, Routines};
use energy_runtime::Kind;

/// Converts a group of outputs to an expression.
pub(super) type Layout = fn(&mut Schedule<'_>, &[NodeId]) -> TokenStream;

pub(super) const NUMBER: Layout = |schedule, nodes| schedule.value(nodes[0]);
pub(super) const NUMBERS: Layout = |schedule, nodes| schedule.array(nodes);
pub(super) const VECTORS: Layout = |schedule, nodes| schedule.vectors(nodes);
pub(super) const BLOCKS: Layout = |schedule, nodes| schedule.blocks(nodes);

/// A routine as a method of its trait.
pub(super) struct Method {
    pub(super) routine: &'static str,
    /// Kernel that calls the routine.
    pub(super) call: &'static str,
    /// Returned struct, its fields, its type arguments, and the types of its fields.
    pub(super) result: &'static str,
    pub(super) fields: &'static [(&'static str, Layout)],
    pub(super) generics: Vec<TokenStream>,
    pub(super) field_types: Vec<TokenStream>,
    /// Arguments after `self`.
    pub(super) arguments: Vec<(&'static str, TokenStream)>,
}

/// Emits the implementation of a trait, and the general paths of its routines.
pub(super) fn implementation(
    name: &Ident,
    of: &str,
    types: &TokenStream,
    methods: &[Method],
    program: &Program,
    routines: &Routines,
) -> TokenStream {
    let of = format_ident!("{of}");
    let term = term_of(name, routines);
    let owner = term.as_ref().unwrap_or(name);
    let emitted = methods.iter().map(|method| self::method(method, owner, program, routines));
    let (levelled, general): (Vec<_>, Vec<_>) = emitted
        .map(|Emitted { plain, levelled, general }| match &term {
            None => (quote!(#plain #levelled), general),
            Some(_) => (plain, quote!(#levelled #general)),
        })
        .unzip();
    let general = general.iter().any(|g| !g.is_empty()).then(|| {
        quote! {
            #[allow(unused_variables, unused_parens, clippy::all, clippy::pedantic)]
            impl<T: ::energy_dsl::Real> #owner<T> {
                #(#general)*
            }
        }
    });
    // Lints do not apply to generated arithmetic.
    quote! {
        #[allow(unused_variables, unused_parens, clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> ::energy_dsl::#of<T> for #name<T> {
            #types
            #(#levelled)*
        }
        #general
    }
}

/// A method of a trait.
struct Emitted {
    /// The method, and for a sum of like terms the loop over the terms.
    plain: TokenStream,
    /// The routine at a SIMD level.
    levelled: TokenStream,
    /// Its general path, if there is one.
    general: TokenStream,
}

/// Emits a method. Its routine is one of `owner`: the element, or one term of it.
fn method(method: &Method, owner: &Ident, program: &Program, routines: &Routines) -> Emitted {
    let routine = routines
        .list
        .iter()
        .find(|r| r.name == method.routine)
        .expect("compiler bug: a routine of another kind of declaration");
    let (plain, call, result) =
        (format_ident!("{}", method.routine), format_ident!("{}", method.call), format_ident!("{}", method.result));
    let levelled = format_ident!("{plain}_at");
    let generics = &method.generics;
    let result_type = quote!(::energy_dsl::#result<#(#generics),*>);
    let names: Vec<_> = method.arguments.iter().map(|(name, _)| format_ident!("{name}")).collect();
    let types = method.arguments.iter().map(|(_, argument_type)| argument_type);
    let arguments = quote!(&self, #(#names: &#types),*);
    let ordinary = body(method, program, routines, &routine.groups, routine.flags);
    let (body, general) = match &routine.general {
        None => (ordinary, TokenStream::new()),
        Some(general) => {
            let [has_guards, is_ordinary, if_ordinary, in_general] =
                ["has_guards", "is_ordinary", "if_ordinary", "in_general"].map(|form| format_ident!("{plain}_{form}"));
            // Field by field in reverse order: passed on as a whole, the struct would live in memory on both paths.
            let fields: Vec<_> = ["flags"]
                .into_iter()
                .chain(method.fields.iter().rev().map(|(field, _)| *field))
                .map(|field| format_ident!("{field}"))
                .collect();
            let field_types = method.field_types.iter().rev();
            let parts = quote!((::energy_dsl::Flags<T>, #(#field_types),*));
            // Lanes are computed first, while they are in registers of the level; lanes that need the general path are
            // replaced afterwards. A scalar branches on the guards first. It looks at its results after they are
            // computed: before the branch, they would occupy registers. Values are passed by copy: a reference would
            // force them into memory on both paths.
            let WithCare { inputs, outputs, reads, returns, summed, code } =
                with_care(method, owner, program, routines, routine, general);
            let select = quote! {
                if T::WIDE {
                    let ordinary = self.#is_ordinary::<L>(#(#names),*);
                    let here = self.#if_ordinary::<L>(#(#names),*);
                    if ::energy_dsl::Mask::all(ordinary) {
                        return here;
                    }
                    let here = ::core::option::Option::Some((#(here.#fields),*));
                    let (#(#fields),*) = Self::#in_general(&[#(#inputs),*], ordinary, here);
                    return ::energy_dsl::#result { #(#fields),* };
                }
                if ::energy_dsl::Mask::all(self.#has_guards::<L>(#(#names),*)) {
                    let here = self.#if_ordinary::<L>(#(#names),*);
                    if ::energy_dsl::Mask::all(self.#is_ordinary::<L>(#(#names),*)) {
                        return here;
                    }
                }
                let (ordinary, here) = (::energy_dsl::Mask::none(), ::core::option::Option::None);
                let (#(#fields),*) = Self::#in_general(&[#(#inputs),*], ordinary, here);
                ::energy_dsl::#result { #(#fields),* }
            };
            let [guards, guard] = [general.guards, general.ordinary].map(|node| mask(program, routines, node));
            let general = quote! {
                /// Whether the guards of the ordinary path hold. Its results may still be infinite.
                #[inline(always)]
                fn #has_guards<L: ::energy_dsl::Level>(#arguments) -> T::Mask {
                    #guards
                }

                /// Whether the ordinary path suffices.
                #[inline(always)]
                fn #is_ordinary<L: ::energy_dsl::Level>(#arguments) -> T::Mask {
                    #guard
                }

                #[inline(always)]
                fn #if_ordinary<L: ::energy_dsl::Level>(#arguments) -> #result_type {
                    #ordinary
                }

                /// The general path, over numbers with an extended exponent. Lanes on the ordinary path do not change.
                #[cold]
                #[inline(never)]
                fn #in_general(
                    inputs: &[T; #reads],
                    ordinary: T::Mask,
                    here: ::core::option::Option<#parts>
                ) -> #parts {
                    #code
                    let (numbers, flags) =
                        ::energy_dsl::with_care::<WithCare, T, #reads, #returns>(inputs, !ordinary, #summed);
                    let mut general = ::energy_dsl::#result { #outputs flags };
                    if let ::core::option::Option::Some((#(#fields),*)) = here {
                        let here = ::energy_dsl::#result { #(#fields),* };
                        general = ::energy_dsl::Choose::choose(ordinary, &here, &general);
                    }
                    (#(general.#fields),*)
                }
            };
            (select, general)
        }
    };
    let sum = routines.repetition.as_ref().map(|_| {
        let sum = repeated::sum(owner, &levelled, &names);
        quote! {
            #[inline(always)]
            fn #levelled<L: ::energy_dsl::Level>(#arguments) -> #result_type {
                #sum
            }
        }
    });
    let plain = quote! {
        #[inline]
        fn #plain(#arguments) -> #result_type {
            T::dispatch(::energy_dsl::#call(self, #(#names),*))
        }

        #sum
    };
    let levelled = quote! {
        #[inline(always)]
        fn #levelled<L: ::energy_dsl::Level>(#arguments) -> #result_type {
            #body
        }
    };
    Emitted { plain, levelled, general }
}

/// The general path of a routine: inputs, outputs and code.
struct WithCare {
    /// Inputs, as read by the method of the element.
    inputs: Vec<TokenStream>,
    /// Fields of the result, taken from `numbers`.
    outputs: TokenStream,
    /// Number of inputs.
    reads: usize,
    /// Number of outputs.
    returns: usize,
    /// Index from which outputs are added to each other.
    summed: usize,
    code: TokenStream,
}

fn with_care(
    method: &Method,
    name: &Ident,
    program: &Program,
    routines: &Routines,
    routine: &Routine,
    general: &General,
) -> WithCare {
    let inputs = RefCell::new(Vec::new());
    let read = |input: Input| {
        let mut inputs = inputs.borrow_mut();
        let number = inputs.iter().position(|&other| other == input).unwrap_or_else(|| {
            inputs.push(input);
            inputs.len() - 1
        });
        quote!(inputs[#number])
    };
    let mut schedule = Schedule::new(&routines.graph, &read);
    let all: Vec<NodeId> = general.groups.concat();
    let results = schedule.array(&all);
    let [degenerate, kink, outside, definite] =
        [general.flags[0], general.flags[1], general.outside, general.definite].map(|mask| schedule.mask(mask));
    let statements = schedule.statements();
    let is_outside = match general.outside {
        None => quote!(::energy_dsl::Mask::none()),
        Some(outside) => {
            let mut schedule = Schedule::new(&routines.graph, &read);
            let outside = schedule.value(outside);
            let statements = schedule.statements();
            quote!(#statements #outside)
        }
    };
    let mut first = 0;
    let outputs = method.fields.iter().zip(&general.groups).map(|((field, layout), nodes)| {
        let field = format_ident!("{field}");
        // The layout of consecutive numbers.
        let mut graph = Graph::textbook().paid_by(routines.graph.budget());
        let places = first..first + nodes.len();
        first = places.end;
        let places: Vec<NodeId> = places.map(|i| graph.input(Input::Precomputed(Budget::input_number(i)))).collect();
        let read = |input: Input| {
            let Input::Precomputed(number) = input else { unreachable!("compiler bug: numbers only") };
            let number = usize::from(number);
            quote!(numbers[#number])
        };
        let value = layout(&mut Schedule::new(&graph, &read), &places);
        quote!(#field: #value,)
    });
    let outputs = outputs.collect();
    let inputs = inputs.into_inner();
    let moves = inputs.iter().map(|input| matches!(input, Input::Position(_) | Input::Velocity(_)));
    let moves: Vec<bool> = moves.collect();
    let (sizes, values_first, is_energy) = (routine.sizes(), routine.has_values(), routine.is_energy());
    let inputs: Vec<TokenStream> = inputs.into_iter().map(|input| read_input(program, input)).collect();
    let (reads, returns) = (inputs.len(), all.len());
    let what = format!("`{}` of [`{name}`].", method.routine);
    let code = quote! {
        #[doc = #what]
        struct WithCare;

        impl ::energy_dsl::WithCare<#reads, #returns> for WithCare {
            const ROLES: ::energy_dsl::Roles<'static> =
                ::energy_dsl::Roles {
                    moves: &[#(#moves),*],
                    groups: &[#(#sizes),*],
                    values_first: #values_first,
                    is_energy: #is_energy,
                };

            fn compiled() -> &'static ::energy_dsl::Precautions<#reads, #returns> {
                static COMPILED: ::energy_dsl::Precautions<#reads, #returns> =
                    ::energy_dsl::Precautions::of::<WithCare>();
                &COMPILED
            }

            fn run_at<T: ::energy_dsl::Real, L: ::energy_dsl::Level>(
                inputs: &[T; #reads],
            ) -> ([T; #returns], ::energy_dsl::Care<T>) {
                #statements
                let flags = ::energy_dsl::Flags { degenerate: #degenerate, kink: #kink };
                (#results, ::energy_dsl::Care { flags, outside: #outside, definite: #definite })
            }

            fn is_outside_at<T: ::energy_dsl::Real, L: ::energy_dsl::Level>(inputs: &[T; #reads]) -> T::Mask {
                #is_outside
            }
        }
    };
    // Derivatives by several difference vectors are summed when they are expanded to points.
    let is_summed = method.routine == "reduced_hessian" && routines.vectors.len() > 1;
    let summed = if is_summed { general.groups[0].len() } else { returns };
    WithCare { inputs, outputs, reads, returns, summed, code }
}

/// Emits statements and a mask.
fn mask(program: &Program, routines: &Routines, node: NodeId) -> TokenStream {
    let read = |input: Input| read_input(program, input);
    let mut schedule = Schedule::new(&routines.graph, &read);
    let mask = schedule.value(node);
    let statements = schedule.statements();
    quote!(#statements #mask)
}

/// Emits statements and the returned struct.
fn body(
    method: &Method,
    program: &Program,
    routines: &Routines,
    groups: &[Vec<NodeId>],
    flags: [Option<NodeId>; 2],
) -> TokenStream {
    let read = |input: Input| read_input(program, input);
    let mut schedule = Schedule::new(&routines.graph, &read);
    let mut values = Vec::new();
    for ((field, layout), nodes) in method.fields.iter().zip(groups) {
        let (field, value) = (format_ident!("{field}"), layout(&mut schedule, nodes));
        values.push(quote!(#field: #value));
    }
    let (degenerate, kink) = (schedule.mask(flags[0]), schedule.mask(flags[1]));
    let statements = schedule.statements();
    let result = format_ident!("{}", method.result);
    quote! {
        #statements
        ::energy_dsl::#result { #(#values,)* flags: ::energy_dsl::Flags { degenerate: #degenerate, kink: #kink } }
    }
}

/// Reads an input in a method.
fn read_input(program: &Program, input: Input) -> TokenStream {
    let coordinate = |list: &str, i: u16| {
        let (list, point, axis) = (format_ident!("{list}"), usize::from(i) / 3, usize::from(i) % 3);
        quote!(#list[#point][#axis])
    };
    match input {
        Input::Position(i) if program.kind == Kind::Residual => {
            let i = usize::from(i);
            quote!(u[#i])
        }
        Input::Position(i) => coordinate("x", i),
        Input::Velocity(i) => coordinate("v", i),
        Input::Parameter(i) => component(&program.parameters, usize::from(i), &quote!(self.)),
        Input::Precomputed(i) => {
            let i = usize::from(i);
            quote!(self.precomputed[#i])
        }
        Input::Rest(_) => unreachable!("compiler bug: the rest shape is read when an element is made"),
    }
}

/// Reads one component of the inputs, as `prefix name`.
pub(super) fn component(inputs: &[DeclaredInput], number: usize, prefix: &TokenStream) -> TokenStream {
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
