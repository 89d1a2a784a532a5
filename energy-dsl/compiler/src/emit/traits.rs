//! Lists the methods of each kind's traits.

use proc_macro2::{Ident, TokenStream};
use quote::quote;

use super::methods::{BLOCKS, Method, NUMBER, NUMBERS, VECTORS, implementation};
use super::schedule::Schedule;
use crate::check::Program;
use crate::graph::Input;
use crate::routines::Routines;
use energy_runtime::Kind;

/// Emits all traits of the declaration's kind.
pub(super) fn traits(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    match program.kind {
        Kind::Energy => potential(name, program, routines),
        Kind::Force => force_law(name, program, routines),
        Kind::Constraint => {
            let (potential, force) = (potential(name, program, routines), force_law(name, program, routines));
            let constraint = constraint(name, program, routines);
            quote!(#potential #force #constraint)
        }
        Kind::Residual => residual(name, program, routines),
    }
}

fn points(program: &Program) -> TokenStream {
    let points = program.points();
    quote!([::energy_dsl::Vector3<T>; #points])
}

fn blocks(number: usize) -> TokenStream {
    quote!([::energy_dsl::Block<T>; #number])
}

fn potential(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let n = program.points();
    let (points, triangle) = (points(program), blocks(n * (n + 1) / 2));
    let x = || vec![("x", points.clone())];
    let methods = [
        Method {
            routine: "value",
            call: "ValueCall",
            result: "Value",
            fields: &[("value", NUMBER)],
            generics: vec![quote!(T)],
            field_types: vec![quote!(T)],
            arguments: x(),
        },
        Method {
            routine: "gradient",
            call: "GradientCall",
            result: "Gradient",
            fields: &[("value", NUMBER), ("gradient", VECTORS)],
            generics: vec![quote!(T), quote!(#points)],
            field_types: vec![quote!(T), quote!(#points)],
            arguments: x(),
        },
        Method {
            routine: "hessian_vector",
            call: "HessianVectorCall",
            result: "HessianVector",
            fields: &[("product", VECTORS)],
            generics: vec![quote!(T), quote!(#points)],
            field_types: vec![quote!(#points)],
            arguments: vec![("x", points.clone()), ("v", points.clone())],
        },
    ];
    let hessian = quote! {
        type Points = #points;
        type Triangle = #triangle;

        #[inline]
        fn hessian(&self, x: &#points) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            T::dispatch(::energy_dsl::HessianCall(self, x))
        }

        #[inline(always)]
        fn hessian_at<L: ::energy_dsl::Level>(&self, x: &#points) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            <Self as ::energy_dsl::ReducedPotential<T>>::expand::<{ u32::MAX }>(
                &<Self as ::energy_dsl::ReducedPotential<T>>::reduced_hessian_at::<L>(self, x),
            )
        }
    };
    let potential = implementation(name, "Potential", &hessian, &methods, program, routines);
    let reduced = reduced_potential(name, program, routines);
    quote!(#potential #reduced)
}

/// Emits the Hessian in reduced coordinates and its expansion to points.
fn reduced_potential(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let (n, points_number) = (routines.coordinates, program.points());
    let entries = n * (n + 1) / 2;
    let (coordinates, upper) = (quote!([T; #n]), quote!([T; #entries]));
    let (points, triangle) = (points(program), blocks(points_number * (points_number + 1) / 2));
    let method = Method {
        routine: "reduced_hessian",
        call: "ReducedHessianCall",
        result: "ReducedHessian",
        fields: &[("value", NUMBER), ("gradient", NUMBERS), ("hessian", NUMBERS)],
        generics: vec![quote!(T), quote!(#coordinates), quote!(#upper)],
        field_types: vec![quote!(T), quote!(#coordinates), quote!(#upper)],
        arguments: vec![("x", points.clone())],
    };
    let expansion = routines.expansion.as_ref().expect("compiler bug: an energy has an expansion");
    let read = |input: Input| {
        let Input::Precomputed(number) = input else { unreachable!("compiler bug: sums of reduced numbers only") };
        let number = usize::from(number);
        match number.checked_sub(n) {
            None => quote!(reduced.gradient[#number]),
            Some(entry) => quote!(reduced.hessian[#entry]),
        }
    };
    let mut schedule = Schedule::new(&expansion.graph, &read);
    let gradient = schedule.vectors(&expansion.gradient);
    let pairs = (0..points_number).flat_map(|i| (i..points_number).map(move |j| (i, j)));
    let triangle_blocks: Vec<TokenStream> = pairs
        .zip(expansion.triangle.chunks(9))
        .map(|((i, j), block)| {
            // The mask has 32 points. Blocks of others are always expanded.
            let bit = |point: usize| 1_u32.checked_shl(point as u32).unwrap_or(0);
            let free = bit(i) | bit(j);
            let block = schedule.vectors(block);
            quote!(if FREE & #free == #free { #block } else { [[T::from_f64(0.0); 3]; 3] })
        })
        .collect();
    let hessian = quote!([#(#triangle_blocks),*]);
    let statements = schedule.statements();
    let types = quote! {
        type Coordinates = #coordinates;
        type Upper = #upper;

        #[inline(always)]
        fn expand<const FREE: u32>(
            reduced: &::energy_dsl::ReducedHessian<T, #coordinates, #upper>,
        ) -> ::energy_dsl::Hessian<T, #points, #triangle> {
            #statements
            ::energy_dsl::Hessian { value: reduced.value, gradient: #gradient, hessian: #hessian, flags: reduced.flags }
        }
    };
    implementation(name, "ReducedPotential", &types, &[method], program, routines)
}

fn force_law(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let n = program.points();
    let (points, square) = (points(program), blocks(n * n));
    let state = || vec![("x", points.clone()), ("v", points.clone())];
    let methods = [
        Method {
            routine: "force",
            call: "ForceCall",
            result: "ForceValue",
            fields: &[("force", VECTORS)],
            generics: vec![quote!(T), quote!(#points)],
            field_types: vec![quote!(#points)],
            arguments: state(),
        },
        Method {
            routine: "jacobians",
            call: "JacobiansCall",
            result: "ForceJacobians",
            fields: &[("force", VECTORS), ("by_position", BLOCKS), ("by_velocity", BLOCKS)],
            generics: vec![quote!(T), quote!(#points), quote!(#square)],
            field_types: vec![quote!(#points), quote!(#square), quote!(#square)],
            arguments: state(),
        },
    ];
    let types = quote!(type Points = #points; type Square = #square;);
    implementation(name, "ForceLaw", &types, &methods, program, routines)
}

fn constraint(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let (n, rows) = (program.points(), program.rows());
    let vectors = rows * n;
    let rows_type = quote!([T; #rows]);
    let jacobian = quote!([::energy_dsl::Vector3<T>; #vectors]);
    let (points, triangle, triangles) = (points(program), blocks(n * (n + 1) / 2), blocks(rows * n * (n + 1) / 2));
    let x = || vec![("x", points.clone())];
    let methods = [
        Method {
            routine: "constraint_jacobian",
            call: "ConstraintJacobianCall",
            result: "ConstraintJacobian",
            fields: &[("value", NUMBERS), ("jacobian", VECTORS)],
            generics: vec![quote!(T), quote!(#rows_type), quote!(#jacobian)],
            field_types: vec![quote!(#rows_type), quote!(#jacobian)],
            arguments: x(),
        },
        Method {
            routine: "constraint_hessian",
            call: "ConstraintHessianCall",
            result: "ConstraintHessian",
            fields: &[("value", NUMBERS), ("jacobian", VECTORS), ("hessians", BLOCKS)],
            generics: vec![quote!(T), quote!(#rows_type), quote!(#jacobian), quote!(#triangles)],
            field_types: vec![quote!(#rows_type), quote!(#jacobian), quote!(#triangles)],
            arguments: x(),
        },
        Method {
            routine: "gauss_newton",
            call: "GaussNewtonCall",
            result: "Hessian",
            fields: &[("value", NUMBER), ("gradient", VECTORS), ("hessian", BLOCKS)],
            generics: vec![quote!(T), quote!(#points), quote!(#triangle)],
            field_types: vec![quote!(T), quote!(#points), quote!(#triangle)],
            arguments: x(),
        },
    ];
    let types = quote!(type Rows = #rows_type; type Jacobian = #jacobian; type Triangles = #triangles;);
    implementation(name, "Constraint", &types, &methods, program, routines)
}

fn residual(name: &Ident, program: &Program, routines: &Routines) -> TokenStream {
    let (unknowns, rows) = (program.moving_size(), program.rows());
    let entries = unknowns * rows;
    let (unknowns, rows, jacobian) = (quote!([T; #unknowns]), quote!([T; #rows]), quote!([T; #entries]));
    let u = || vec![("u", unknowns.clone())];
    let methods = [
        Method {
            routine: "residual",
            call: "ResidualCall",
            result: "ResidualValue",
            fields: &[("value", NUMBERS)],
            generics: vec![quote!(T), quote!(#rows)],
            field_types: vec![quote!(#rows)],
            arguments: u(),
        },
        Method {
            routine: "jacobian",
            call: "ResidualJacobianCall",
            result: "ResidualJacobian",
            fields: &[("value", NUMBERS), ("jacobian", NUMBERS)],
            generics: vec![quote!(T), quote!(#rows), quote!(#jacobian)],
            field_types: vec![quote!(#rows), quote!(#jacobian)],
            arguments: u(),
        },
    ];
    let types = quote!(type Unknowns = #unknowns; type Rows = #rows; type Jacobian = #jacobian;);
    implementation(name, "Residual", &types, &methods, program, routines)
}
