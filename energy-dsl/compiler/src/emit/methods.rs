//! Emits routines as trait methods.
//!
//! A routine `f` becomes `f_at::<L>`, which is inlined into a caller at SIMD level L, and `f`, which runs it at the
//! best level of the machine. If precautions were split off, `f_at` chooses between `f_if_ordinary` and `f_in_general`
//! by `f_has_guards` and by a mask that `f_if_ordinary` returns.
//!
//! For a sum of like terms, these are the routines of one term, and `f_at` is the loop over all.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

use super::Emitter;
use super::repeated::{self, term_of};
use super::statements::arranged;
use crate::check::{Input as DeclaredInput, Program};
use crate::graph::Input;
use crate::plan::{Code, GeneralPlan, RoutinePlan, Shape, groups};
use crate::tape::{TooLarge, general_path};
use energy_runtime::tape::EncodedPath;
use energy_runtime::{Kind, RoutineKind};

/// A routine as a method of its trait.
struct Method {
    name: Ident,
    /// Kernel that calls the routine.
    call: Ident,
    /// Returned struct.
    result: Ident,
    /// The fields of the returned struct, but for its flags.
    fields: Vec<Field>,
    /// Arguments after `self`: names and types.
    arguments: Vec<(Ident, TokenStream)>,
}

/// A field of a returned struct.
struct Field {
    name: Ident,
    shape: Shape,
    field_type: TokenStream,
}

impl Method {
    fn new(routine: &RoutinePlan, program: &Program) -> Self {
        let is_mixed = program.is_mixed();
        let (call, result) = names(routine.kind, is_mixed);
        let field = |(&(name, shape), size): (&(&str, Shape), usize)| {
            let shape = if is_mixed { shape.flat() } else { shape };
            let length = match shape {
                Shape::Number | Shape::Numbers => size,
                Shape::Vectors => size / 3,
                Shape::Blocks => size / 9,
            };
            Field { name: format_ident!("{name}"), shape, field_type: array(shape, length) }
        };
        let (unknowns, rates) = match is_flat(program, routine.kind) {
            true => {
                let [unknowns, increments] =
                    [program.moving_size(), program.increments()].map(|length| array(Shape::Numbers, length));
                (("u", unknowns), ("v", increments))
            }
            false => {
                let points = array(Shape::Vectors, program.points());
                (("x", points.clone()), ("v", points))
            }
        };
        let arguments = match routine.kind {
            RoutineKind::HessianVector | RoutineKind::Force | RoutineKind::Jacobians => vec![unknowns, rates],
            _ => vec![unknowns],
        };
        Self {
            name: format_ident!("{}", routine.kind.name()),
            call: format_ident!("{call}"),
            result: format_ident!("{result}"),
            fields: groups(routine.kind).iter().zip(routine.sizes()).map(field).collect(),
            arguments: arguments.into_iter().map(|(name, of)| (format_ident!("{name}"), of)).collect(),
        }
    }

    /// Returns the type of the returned struct. Its arguments are the number type and those of its arrays; both
    /// Jacobians of a force share theirs.
    fn result_type(&self) -> TokenStream {
        let has_argument =
            |field: &&Field| field.shape != Shape::Number && field.name != "by_velocity" && self.result != "Vertex";
        let arrays = self.fields.iter().filter(has_argument).map(|field| &field.field_type);
        let (result, number) = (&self.result, quote!(T));
        let arguments = std::iter::once(&number).chain(arrays);
        quote!(::energy_dsl::#result<#(#arguments),*>)
    }

    /// Returns the names of the fields and of the flags, in reverse order.
    fn reversed_fields(&self) -> Vec<Ident> {
        let flags = format_ident!("flags");
        std::iter::once(flags).chain(self.fields.iter().rev().map(|field| field.name.clone())).collect()
    }
}

/// Returns whether a routine takes the unknowns as flat numbers `u`, not as points `x`.
fn is_flat(program: &Program, kind: RoutineKind) -> bool {
    use RoutineKind::{Next, NextJacobians, StateJacobian};
    program.is_mixed() || program.kind == Kind::Residual || matches!(kind, Next | NextJacobians | StateJacobian)
}

/// Returns the kernel that calls a routine, and the struct that it returns.
fn names(kind: RoutineKind, is_mixed: bool) -> (&'static str, &'static str) {
    match kind {
        RoutineKind::Value if is_mixed => ("MixedValueCall", "Value"),
        RoutineKind::Gradient if is_mixed => ("MixedGradientCall", "MixedGradient"),
        RoutineKind::Hessian if is_mixed => ("MixedHessianCall", "MixedHessian"),
        RoutineKind::HessianVector if is_mixed => ("MixedProductCall", "MixedProduct"),
        RoutineKind::Force if is_mixed => ("MixedForceCall", "MixedForceValue"),
        RoutineKind::Jacobians if is_mixed => ("MixedJacobiansCall", "MixedJacobians"),
        RoutineKind::ConstraintJacobian if is_mixed => ("MixedConstraintJacobianCall", "MixedConstraintJacobian"),
        RoutineKind::ConstraintHessian if is_mixed => ("MixedConstraintHessianCall", "MixedConstraintHessian"),
        RoutineKind::GaussNewton if is_mixed => ("MixedGaussNewtonCall", "MixedHessian"),
        RoutineKind::Next => ("NextCall", "NextState"),
        RoutineKind::NextJacobians => ("NextJacobiansCall", "NextJacobians"),
        RoutineKind::StateJacobian => ("StateJacobianCall", "StateJacobian"),
        RoutineKind::Value => ("ValueCall", "Value"),
        RoutineKind::Gradient => ("GradientCall", "Gradient"),
        RoutineKind::Hessian => ("HessianCall", "Hessian"),
        RoutineKind::ReducedHessian => ("ReducedHessianCall", "ReducedHessian"),
        RoutineKind::HessianVector => ("HessianVectorCall", "HessianVector"),
        RoutineKind::Force => ("ForceCall", "ForceValue"),
        RoutineKind::Jacobians => ("JacobiansCall", "ForceJacobians"),
        RoutineKind::ConstraintJacobian => ("ConstraintJacobianCall", "ConstraintJacobian"),
        RoutineKind::ConstraintHessian => ("ConstraintHessianCall", "ConstraintHessian"),
        RoutineKind::GaussNewton => ("GaussNewtonCall", "Hessian"),
        RoutineKind::Residual => ("ResidualCall", "ResidualValue"),
        RoutineKind::Jacobian => ("ResidualJacobianCall", "ResidualJacobian"),
        RoutineKind::Vertex(_) => ("VertexCall", "Vertex"),
        RoutineKind::Rest => unreachable!("compiler bug: the rest block is run by `new`"),
    }
}

/// Returns the type of `length` numbers, vectors or blocks.
pub(super) fn array(shape: Shape, length: usize) -> TokenStream {
    match shape {
        Shape::Number => quote!(T),
        Shape::Numbers => quote!([T; #length]),
        Shape::Vectors => quote!([::energy_dsl::Vector3<T>; #length]),
        Shape::Blocks => quote!([::energy_dsl::Block<T>; #length]),
    }
}

/// Emits the implementation of a trait, and the general paths of its routines.
pub(super) fn implementation(
    emitter: &Emitter<'_>,
    of: &str,
    types: &TokenStream,
    list: &[RoutineKind],
) -> TokenStream {
    let (name, of) = (&emitter.name, format_ident!("{of}"));
    let term = term_of(emitter);
    let owner = term.as_ref().unwrap_or(name);
    let emitted = list.iter().map(|&kind| {
        let routine = emitter.plan.find(kind).expect("compiler bug: a routine of another kind of declaration");
        method(emitter, routine, owner)
    });
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

/// Emits the routines of single vertices as methods of the type, and the trait that chooses among them; nothing
/// without them.
pub(super) fn vertices(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    let of_vertex = |routine: &&RoutinePlan| matches!(routine.kind, RoutineKind::Vertex(_));
    let list: Vec<&RoutinePlan> = plan.routines.iter().filter(of_vertex).collect();
    if list.is_empty() {
        return TokenStream::new();
    }
    let term = term_of(emitter);
    let owner = term.as_ref().unwrap_or(name);
    let methods = list.iter().map(|routine| method(emitter, routine, owner));
    let (sums, own): (Vec<_>, Vec<_>) =
        methods.map(|Emitted { plain, levelled, general }| (plain, quote!(#levelled #general))).unzip();
    let levelled = list.iter().map(|routine| format_ident!("{}_at", routine.kind.name()));
    let numbers = 0..list.len();
    let points = array(Shape::Vectors, program.points());
    let message = format!("{} has {} points", program.name, list.len());
    quote! {
        #[allow(unused_variables, unused_parens, clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> #owner<T> {
            #(#own)*
        }

        #[allow(unused_variables, unused_parens, clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> #name<T> {
            #(#sums)*
        }

        #[allow(clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> ::energy_dsl::VertexPotential<T> for #name<T> {
            #[inline]
            fn vertex(&self, point: usize, x: &#points) -> ::energy_dsl::Vertex<T> {
                T::dispatch(::energy_dsl::VertexCall(self, point, x))
            }

            #[inline(always)]
            fn vertex_at<L: ::energy_dsl::Level>(&self, point: usize, x: &#points) -> ::energy_dsl::Vertex<T> {
                match point {
                    #(#numbers => self.#levelled::<L>(x),)*
                    _ => ::core::panic!(#message),
                }
            }
        }
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

/// Emits a method. Its routine is one of `owner`: the element, or one term of it, if it is a sum.
fn method(emitter: &Emitter<'_>, routine: &RoutinePlan, owner: &Ident) -> Emitted {
    let method = Method::new(routine, emitter.program);
    let Method { name, call, result, fields, arguments } = &method;
    let levelled = format_ident!("{name}_at");
    let result_type = method.result_type();
    let (names, types): (Vec<_>, Vec<_>) = arguments.iter().map(|(name, of)| (name, of)).unzip();
    let arguments = quote!(&self, #(#names: &#types),*);
    let (body, general) = match &routine.general {
        None => {
            let Body { statements, result, .. } = body(emitter, &method, routine.kind, &routine.ordinary);
            (quote!(#statements #result), TokenStream::new())
        }
        Some(general) => {
            let [has_guards, if_ordinary, in_general] =
                ["has_guards", "if_ordinary", "in_general"].map(|form| format_ident!("{name}_{form}"));
            // Field by field in reverse order: passed on as a whole, the struct would live in memory on both paths.
            let field_types = fields.iter().rev().map(|field| &field.field_type);
            let parts = quote!((::energy_dsl::Flags<T>, #(#field_types),*));
            let fields = method.reversed_fields();
            let (inputs, _) = general.inputs();
            let inputs: Vec<TokenStream> =
                inputs.iter().map(|&input| read_input(emitter.program, routine.kind, input)).collect();
            let (reads, returns) = (inputs.len(), routine.sizes().iter().sum::<usize>());
            let (path, outputs) = (encoded(emitter, routine, general), outputs(&method, general));
            // Lanes are computed first, while they are in registers of the level; lanes that need the general path are
            // replaced afterwards. A scalar branches on the guards first. It looks at its results after they are
            // computed: before the branch, they would occupy registers. Values are passed by copy: a reference would
            // force them into memory on both paths.
            let select = quote! {
                if T::WIDE {
                    let (here, ordinary) = self.#if_ordinary::<L>(#(#names),*);
                    if ::energy_dsl::Mask::all(ordinary) {
                        return here;
                    }
                    let here = ::core::option::Option::Some((#(here.#fields),*));
                    let (#(#fields),*) = Self::#in_general(&[#(#inputs),*], ordinary, here);
                    return ::energy_dsl::#result { #(#fields),* };
                }
                if ::energy_dsl::Mask::all(self.#has_guards::<L>(#(#names),*)) {
                    let (here, ordinary) = self.#if_ordinary::<L>(#(#names),*);
                    if ::energy_dsl::Mask::all(ordinary) {
                        return here;
                    }
                }
                let (ordinary, here) = (::energy_dsl::Mask::none(), ::core::option::Option::None);
                let (#(#fields),*) = Self::#in_general(&[#(#inputs),*], ordinary, here);
                ::energy_dsl::#result { #(#fields),* }
            };
            let guards = mask(emitter, routine.kind, &general.before);
            let guarded = routine.ordinary.with_guard(&general.guard, !routine.is_broken);
            let Body { statements, result: found, guard } = body(emitter, &method, routine.kind, &guarded);
            let general = quote! {
                /// Whether the guards of the ordinary path hold. Its results may still be infinite.
                #[inline(always)]
                fn #has_guards<L: ::energy_dsl::Level>(#arguments) -> T::Mask {
                    #guards
                }

                /// The ordinary path, and whether it suffices.
                #[inline(always)]
                fn #if_ordinary<L: ::energy_dsl::Level>(#arguments) -> (#result_type, T::Mask) {
                    #statements
                    (#found, #guard)
                }

                /// The general path, over numbers with an extended exponent. Lanes on the ordinary path do not change.
                #[cold]
                #[inline(never)]
                fn #in_general(
                    inputs: &[T; #reads],
                    ordinary: T::Mask,
                    here: ::core::option::Option<#parts>
                ) -> #parts {
                    static PATH: ::energy_dsl::tape::EncodedPath = #path;
                    let mut numbers = [T::from_f64(0.0); #returns];
                    let flags = PATH.run(inputs, !ordinary, &mut numbers);
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
    let sum = emitter.plan.repetition.as_ref().map(|_| {
        let sum = repeated::sum(owner, &levelled, &names);
        quote! {
            #[inline(always)]
            fn #levelled<L: ::energy_dsl::Level>(#arguments) -> #result_type {
                #sum
            }
        }
    });
    let dispatched = (!matches!(routine.kind, RoutineKind::Vertex(_))).then(|| {
        quote! {
            #[inline]
            fn #name(#arguments) -> #result_type {
                T::dispatch(::energy_dsl::#call(self, #(#names),*))
            }
        }
    });
    let plain = quote!(#dispatched #sum);
    let levelled = quote! {
        #[inline(always)]
        fn #levelled<L: ::energy_dsl::Level>(#arguments) -> #result_type {
            #body
        }
    };
    Emitted { plain, levelled, general }
}

/// Emits a general path as data. It is thousands of operations and rarely runs, so that code would only cost compilers'
/// time.
fn encoded(emitter: &Emitter<'_>, routine: &RoutinePlan, general: &GeneralPlan) -> TokenStream {
    match general_path(routine, general) {
        Ok(path) => {
            let bytes = EncodedPath::encode(&path);
            emitter.program.budget.spend(bytes.len() as u64, 4 * bytes.len() as u64);
            let bytes = Literal::byte_string(&bytes);
            quote!(::energy_dsl::tape::EncodedPath::new(#bytes))
        }
        Err(TooLarge) => {
            let (name, routine) = (&emitter.program.name, routine.kind.name());
            let message = format!("`{routine}` of `{name}` has more than 65 535 numbers at a time");
            quote!(::core::compile_error!(#message))
        }
    }
}

/// Emits the fields of a routine's result, taken from `numbers`.
fn outputs(method: &Method, general: &GeneralPlan) -> TokenStream {
    let mut numbers = (0_usize..).map(|number| quote!(numbers[#number]));
    let fields = method.fields.iter().zip(&general.path.groups).map(|(Field { name, shape, .. }, group)| {
        let value = arranged(*shape, &numbers.by_ref().take(group.len()).collect::<Vec<_>>());
        quote!(#name: #value,)
    });
    fields.collect()
}

/// Emits statements and the mask of a guard.
fn mask(emitter: &Emitter<'_>, kind: RoutineKind, code: &Code) -> TokenStream {
    let rendered = emitter.rendered(code, &mut |input| read_input(emitter.program, kind, input));
    let (mask, statements) = (rendered.mask(code.guard), rendered.statements);
    quote!(#statements #mask)
}

/// The body of a method.
struct Body {
    statements: TokenStream,
    /// The returned struct.
    result: TokenStream,
    /// The mask of its guard; false without one.
    guard: TokenStream,
}

fn body(emitter: &Emitter<'_>, method: &Method, kind: RoutineKind, code: &Code) -> Body {
    let rendered = emitter.rendered(code, &mut |input| read_input(emitter.program, kind, input));
    let values = method.fields.iter().zip(&code.groups).map(|(Field { name, shape, .. }, group)| {
        let value = arranged(*shape, &rendered.numbers(group));
        quote!(#name: #value)
    });
    let values: Vec<TokenStream> = values.collect();
    let [degenerate, kink] = code.flags.map(|mask| rendered.mask(mask));
    let (of, guard) = (&method.result, rendered.mask(code.guard));
    let result = quote! {
        ::energy_dsl::#of { #(#values,)* flags: ::energy_dsl::Flags { degenerate: #degenerate, kink: #kink } }
    };
    Body { statements: rendered.statements, result, guard }
}

/// Reads an input in a method.
fn read_input(program: &Program, kind: RoutineKind, input: Input) -> TokenStream {
    let coordinate = |points: &str, i: u16, numbers: &str| {
        let i = usize::from(i);
        if is_flat(program, kind) {
            let numbers = format_ident!("{numbers}");
            return quote!(#numbers[#i]);
        }
        let (points, point, axis) = (format_ident!("{points}"), i / 3, i % 3);
        quote!(#points[#point][#axis])
    };
    match input {
        Input::Position(i) => coordinate("x", i, "u"),
        Input::Velocity(i) => coordinate("v", i, "v"),
        Input::Parameter(i) => component(&program.parameters, usize::from(i), &quote!(self.)),
        Input::Precomputed(i) => {
            let i = usize::from(i);
            quote!(self.precomputed[#i])
        }
        Input::Rest(_) => unreachable!("compiler bug: the rest shape is read when an element is made"),
        Input::Increment(_) => unreachable!("compiler bug: increments are 0, and nothing reads them"),
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
