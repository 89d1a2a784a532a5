//! Lists the routines of each kind's traits.

use proc_macro2::TokenStream;
use quote::quote;

use super::Emitter;
use super::methods::{array, component, implementation, vertices};
use super::mixed;
use super::statements::arranged;
use crate::graph::Input;
use crate::plan::Shape;
use energy_runtime::{Kind, RoutineKind};

/// Emits all traits of the declaration's kind.
pub(super) fn traits(emitter: &Emitter<'_>) -> TokenStream {
    let own = match (emitter.program.kind, emitter.program.is_mixed()) {
        (Kind::Energy, false) => potential(emitter),
        (Kind::Energy, true) => mixed::potential(emitter),
        (Kind::Force, false) => force_law(emitter),
        (Kind::Force, true) => mixed::force(emitter),
        (Kind::Constraint, false) => {
            let (potential, force) = (potential(emitter), force_law(emitter));
            let constraint = constraint(emitter);
            quote!(#potential #force #constraint)
        }
        (Kind::Constraint, true) => mixed::constraint(emitter),
        (Kind::Residual, _) => residual(emitter),
    };
    let memory = if emitter.program.states > 0 { memory(emitter) } else { TokenStream::new() };
    quote!(#own #memory)
}

fn potential(emitter: &Emitter<'_>) -> TokenStream {
    let n = emitter.program.points();
    let (points, triangle) = (array(Shape::Vectors, n), array(Shape::Blocks, n * (n + 1) / 2));
    let hessian = quote! {
        type Points = #points;
        type Triangle = #triangle;

        #[inline]
        fn hessian(&self, x: &#points) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            T::dispatch(::energy_dsl::HessianCall(self, x))
        }

        #[inline(always)]
        fn hessian_at<L: ::energy_dsl::Level>(&self, x: &#points) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            <Self as ::energy_dsl::ReducedPotential<T>>::expand::<L, { u32::MAX }>(
                &<Self as ::energy_dsl::ReducedPotential<T>>::reduced_hessian_at::<L>(self, x),
            )
        }
    };
    let list = [RoutineKind::Value, RoutineKind::Gradient, RoutineKind::HessianVector];
    let potential = implementation(emitter, "Potential", &hessian, &list);
    let (reduced, vertices) = (reduced_potential(emitter), vertices(emitter));
    quote!(#potential #reduced #vertices)
}

/// Emits the Hessian in reduced coordinates and its expansion to points.
fn reduced_potential(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { program, plan, .. } = emitter;
    let (n, points_number) = (plan.declaration.reduced_coordinates, program.points());
    let [coordinates, upper] = [n, n * (n + 1) / 2].map(|length| array(Shape::Numbers, length));
    let points = array(Shape::Vectors, points_number);
    let triangle = array(Shape::Blocks, points_number * (points_number + 1) / 2);
    let expansion = plan.expansion.as_ref().expect("compiler bug: an energy has an expansion");
    let mut read = |input: Input| {
        let Input::Precomputed(number) = input else { unreachable!("compiler bug: sums of reduced numbers only") };
        let number = usize::from(number);
        match number.checked_sub(n) {
            None => quote!(reduced.gradient[#number]),
            Some(entry) => quote!(reduced.hessian[#entry]),
        }
    };
    let rendered = emitter.rendered(expansion, &mut read);
    let [gradient, entries] = [0, 1].map(|group| rendered.numbers(&expansion.groups[group]));
    let gradient = arranged(Shape::Vectors, &gradient);
    let pairs = (0..points_number).flat_map(|i| (i..points_number).map(move |j| (i, j)));
    let triangle_blocks = pairs.zip(entries.chunks(9)).map(|((i, j), block)| {
        // The mask has 32 points. Blocks of others are always expanded.
        let bit = |point: usize| 1_u32.checked_shl(point as u32).unwrap_or(0);
        let free = bit(i) | bit(j);
        let block = arranged(Shape::Vectors, block);
        quote!(if FREE & #free == #free { #block } else { [[T::from_f64(0.0); 3]; 3] })
    });
    let hessian = quote!([#(#triangle_blocks),*]);
    let statements = rendered.statements;
    let types = quote! {
        type Coordinates = #coordinates;
        type Upper = #upper;

        #[inline(always)]
        fn expand<L: ::energy_dsl::Level, const FREE: u32>(
            reduced: &::energy_dsl::ReducedHessian<T, #coordinates, #upper>,
        ) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            #statements
            ::energy_dsl::Hessian { value: reduced.value, gradient: #gradient, hessian: #hessian, flags: reduced.flags }
        }
    };
    implementation(emitter, "ReducedPotential", &types, &[RoutineKind::ReducedHessian])
}

fn force_law(emitter: &Emitter<'_>) -> TokenStream {
    let n = emitter.program.points();
    let (points, square) = (array(Shape::Vectors, n), array(Shape::Blocks, n * n));
    let types = quote!(type Points = #points; type Square = #square;);
    implementation(emitter, "ForceLaw", &types, &[RoutineKind::Force, RoutineKind::Jacobians])
}

fn constraint(emitter: &Emitter<'_>) -> TokenStream {
    let (n, rows) = (emitter.program.points(), emitter.program.rows());
    let (row_numbers, jacobian) = (array(Shape::Numbers, rows), array(Shape::Vectors, rows * n));
    let triangles = array(Shape::Blocks, rows * n * (n + 1) / 2);
    let types = quote!(type Rows = #row_numbers; type Jacobian = #jacobian; type Triangles = #triangles;);
    let list = [RoutineKind::ConstraintJacobian, RoutineKind::ConstraintHessian, RoutineKind::GaussNewton];
    implementation(emitter, "Constraint", &types, &list)
}

fn residual(emitter: &Emitter<'_>) -> TokenStream {
    let (unknowns, rows) = (emitter.program.moving_size(), emitter.program.rows());
    let increments = emitter.program.increments();
    let [unknowns, rows, jacobian] = [unknowns, rows, rows * increments].map(|length| array(Shape::Numbers, length));
    let types = quote!(type Unknowns = #unknowns; type Rows = #rows; type Jacobian = #jacobian;);
    implementation(emitter, "Residual", &types, &[RoutineKind::Residual, RoutineKind::Jacobian])
}

/// Emits the traits of an element's state.
fn memory(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { program, plan, .. } = emitter;
    let (size, increments) = (program.state_size(), program.increments());
    let [unknowns, state, by_unknowns, by_state] =
        [program.moving_size(), size, size * increments, size * size].map(|length| array(Shape::Numbers, length));
    let own = program.parameters_size() - size;
    let fields: Vec<TokenStream> =
        (own..own + size).map(|number| component(&program.parameters, number, &quote!(self.))).collect();
    let numbers = 0..size;
    let time_step = program.parameters.iter().find(|input| input.is_time_step).map(|input| {
        let field = component(&program.parameters, input.first, &quote!(self.));
        quote! {
            fn set_time_step(&mut self, h: T) {
                #field = h;
            }
        }
    });
    let types = quote! {
        type Unknowns = #unknowns;
        type State = #state;
        type ByUnknowns = #by_unknowns;
        type ByState = #by_state;

        fn state(&self) -> #state {
            [#(#fields),*]
        }

        fn set_state(&mut self, state: &#state) {
            #(#fields = state[#numbers];)*
        }

        #time_step
    };
    let next = implementation(emitter, "Stateful", &types, &[RoutineKind::Next, RoutineKind::NextJacobians]);
    let sensitivity = plan.find(RoutineKind::StateJacobian).map(|routine| {
        let rows = routine.sizes()[0];
        let [slopes, by_state] = [rows, rows * size].map(|length| array(Shape::Numbers, length));
        let types = quote!(type Slopes = #slopes; type SlopesByState = #by_state;);
        implementation(emitter, "StateSensitivity", &types, &[RoutineKind::StateJacobian])
    });
    quote!(#next #sensitivity)
}
