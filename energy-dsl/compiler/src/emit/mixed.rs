//! Lists the routines of the traits of mixed unknowns.

use proc_macro2::TokenStream;
use quote::quote;

use super::Emitter;
use super::methods::{array, implementation};
use crate::plan::Shape;
use energy_runtime::RoutineKind;

pub(super) fn potential(emitter: &Emitter<'_>) -> TokenStream {
    let n = emitter.program.increments();
    let [unknowns, increments, upper] =
        [emitter.program.moving_size(), n, n * (n + 1) / 2].map(|length| array(Shape::Numbers, length));
    let types = quote!(type Unknowns = #unknowns; type Increments = #increments; type Upper = #upper;);
    let list = [RoutineKind::Value, RoutineKind::Gradient, RoutineKind::Hessian, RoutineKind::HessianVector];
    implementation(emitter, "MixedPotential", &types, &list)
}

pub(super) fn force(emitter: &Emitter<'_>) -> TokenStream {
    let n = emitter.program.increments();
    let [unknowns, increments, square] =
        [emitter.program.moving_size(), n, n * n].map(|length| array(Shape::Numbers, length));
    let types = quote!(type Unknowns = #unknowns; type Increments = #increments; type Square = #square;);
    implementation(emitter, "MixedForce", &types, &[RoutineKind::Force, RoutineKind::Jacobians])
}

pub(super) fn constraint(emitter: &Emitter<'_>) -> TokenStream {
    let (n, rows) = (emitter.program.increments(), emitter.program.rows());
    let [row_numbers, jacobian, triangles] =
        [rows, rows * n, rows * n * (n + 1) / 2].map(|length| array(Shape::Numbers, length));
    let types = quote!(type Rows = #row_numbers; type Jacobian = #jacobian; type Triangles = #triangles;);
    let list = [RoutineKind::ConstraintJacobian, RoutineKind::ConstraintHessian, RoutineKind::GaussNewton];
    let constraint = implementation(emitter, "MixedConstraint", &types, &list);
    let (potential, force) = (potential(emitter), force(emitter));
    quote!(#potential #force #constraint)
}
