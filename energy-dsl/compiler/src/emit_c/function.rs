//! The functions of an element: arguments, results, and their descriptions.

use std::fmt::Write as _;

use super::element::Element;
use crate::interpreted::{InputKind, InputNumbers};
use crate::plan::groups;
use energy_runtime::RoutineKind;

/// An argument of a function: an array.
pub(super) struct Argument {
    pub(super) name: &'static str,
    /// Numbers that it points to.
    pub(super) size: usize,
    pub(super) docs: String,
}

/// The function of a routine.
pub(super) struct Function {
    pub(super) kind: RoutineKind,
    /// Name without that of the element: `gradient`.
    pub(super) name: String,
    pub(super) arguments: Vec<Argument>,
    pub(super) results: Vec<Argument>,
}

impl Element<'_> {
    /// Returns all functions that callers may use.
    pub(super) fn functions(&self) -> Vec<Function> {
        let rest = self.function(RoutineKind::Rest, &self.plan.rest.sizes());
        let routines = self.plan.routines.iter().map(|routine| self.function(routine.kind, &routine.sizes()));
        let expanded = self.plan.expansion.as_ref().map(|expansion| {
            let sizes: Vec<usize> = expansion.groups.iter().map(Vec::len).collect();
            self.function(RoutineKind::Hessian, &[1, sizes[0], sizes[1]])
        });
        std::iter::once(rest).chain(routines).chain(expanded).collect()
    }

    pub(super) fn function(&self, kind: RoutineKind, sizes: &[usize]) -> Function {
        let docs = |kinds: &[InputKind]| self.listed(kinds);
        let (coordinates, increments) = (self.plan.coordinates, self.plan.declaration.increments());
        let parameters =
            Argument { name: "parameters", size: self.plan.parameters, docs: docs(&[InputKind::Parameter]) };
        let mut arguments = match kind {
            RoutineKind::Rest => {
                vec![Argument { name: "rest", size: self.plan.shape, docs: docs(&[InputKind::Rest]) }]
            }
            _ if self.is_flat() => {
                vec![Argument { name: "u", size: coordinates, docs: docs(&[InputKind::Unknown]) }]
            }
            _ => vec![Argument { name: "x", size: coordinates, docs: docs(&[InputKind::Point]) }],
        };
        let is_mixed = self.plan.declaration.is_mixed();
        let of_vectors = match (kind, is_mixed) {
            (RoutineKind::HessianVector, false) => Some("a vector for each point"),
            (RoutineKind::HessianVector, true) => Some("a number for each increment"),
            (RoutineKind::Force | RoutineKind::Jacobians, false) => Some("the velocities of the points"),
            (RoutineKind::Force | RoutineKind::Jacobians, true) => {
                Some("the velocities of the unknowns; those of rotations are angular")
            }
            _ => None,
        };
        arguments.extend(of_vectors.map(|docs| Argument { name: "v", size: increments, docs: docs.to_owned() }));
        arguments.push(parameters);
        if kind != RoutineKind::Rest {
            let docs = "what the rest shape determines".to_owned();
            arguments.push(Argument { name: "stored", size: self.plan.stored(), docs });
        }
        let result = |(&(name, _), &size): (&(&'static str, _), &usize)| Argument {
            name: if kind == RoutineKind::Rest { "stored" } else { name },
            size,
            docs: if is_mixed { mixed_docs(kind, name) } else { result_docs(kind, name) }.to_owned(),
        };
        let results = groups(kind).iter().zip(sizes).map(result).collect();
        Function { kind, name: kind.name().to_owned(), arguments, results }
    }

    /// Lists inputs with their sizes and units. The state is marked, and unknowns that all elements share.
    fn listed(&self, kinds: &[InputKind]) -> String {
        let declaration = &self.plan.declaration;
        let state = self.inputs.len() - declaration.state.len();
        let describe = |(place, input): (usize, &InputNumbers)| {
            let unit = if input.unit.is_empty() { String::new() } else { format!(" in {}", input.unit) };
            let size = if input.size() == 1 { String::new() } else { format!(" ({})", input.size()) };
            let before = if place == state { "then the state: " } else { "" };
            let is_shared = declaration.points.get(place).is_some_and(|field| field.shared);
            format!("{before}{}{size}{unit}{}", input.name, if is_shared { ", shared by all" } else { "" })
        };
        let list = self.inputs.iter().enumerate().filter(|(_, input)| kinds.contains(&input.kind)).map(describe);
        list.collect::<Vec<_>>().join(", ")
    }

    pub(super) fn comment(&self, function: &Function) -> String {
        let mut text = format!("/* {}\n", routine_docs(function.kind));
        for argument in function.arguments.iter().chain(&function.results).filter(|argument| argument.size > 0) {
            let _ = writeln!(text, "   {}[{}]: {}", argument.name, argument.size, argument.docs.replace("*/", "* /"));
        }
        text + "   Returns flags. */\n"
    }

    pub(super) fn signature(&self, function: &Function, is_term: bool) -> String {
        let real = self.dialect.of_type(false);
        let inputs = function.arguments.iter().map(|argument| format!("const {real} *{}", argument.name));
        let own = [("own", &*real), ("constants", self.dialect.precision.real())];
        let own = own.into_iter().filter(|_| is_term).map(|(name, of)| format!("const {of} *{name}"));
        let results = function.results.iter().map(|result| format!("{real} *ENERGY_RESTRICT {}", result.name));
        inputs.chain(own).chain(results).collect::<Vec<_>>().join(", ")
    }

    pub(super) fn arguments(&self, function: &Function, is_term: bool) -> String {
        let own = ["own", "constants"].into_iter().filter(|_| is_term);
        let inputs = function.arguments.iter().map(|argument| argument.name);
        inputs.chain(own).chain(function.results.iter().map(|result| result.name)).collect::<Vec<_>>().join(", ")
    }
}

fn routine_docs(kind: RoutineKind) -> &'static str {
    match kind {
        RoutineKind::Rest => "The numbers that the rest shape determines, once for each element.",
        RoutineKind::Value => "U.",
        RoutineKind::Gradient => "U and its gradient.",
        RoutineKind::Hessian => "U, its gradient and its Hessian.",
        RoutineKind::ReducedHessian => "U, its gradient and Hessian in reduced coordinates.",
        RoutineKind::HessianVector => "The Hessian times a vector.",
        RoutineKind::Force => "The force.",
        RoutineKind::Jacobians => "The force and its derivatives.",
        RoutineKind::ConstraintJacobian => "C and its derivatives.",
        RoutineKind::ConstraintHessian => "C, its first and second derivatives.",
        RoutineKind::GaussNewton => "U, its gradient and ks J^T J.",
        RoutineKind::Residual => "The residual.",
        RoutineKind::Jacobian => "The residual and its Jacobian.",
        RoutineKind::Vertex(_) => "U, and its derivatives by one point alone.",
        RoutineKind::Next => "The state after a step.",
        RoutineKind::NextJacobians => "The state after a step and its derivatives.",
        RoutineKind::StateJacobian => "The gradient and its derivatives by the state.",
    }
}

fn result_docs(kind: RoutineKind, name: &str) -> &'static str {
    match (kind, name) {
        (RoutineKind::Rest, _) => "the numbers",
        (RoutineKind::ReducedHessian, "hessian") => "the upper triangle, row by row",
        (RoutineKind::Residual | RoutineKind::Jacobian, "value") => "one number a row",
        (RoutineKind::Jacobian, _) => "row by row",
        (RoutineKind::Vertex(_), "gradient") => "by the point",
        (RoutineKind::Next | RoutineKind::NextJacobians, "state") => "the state",
        (_, "by_unknowns") => "its derivatives by the unknowns, row by row",
        (_, "by_state") => "derivatives by the state before, row by row",
        (RoutineKind::Vertex(_), "block") => "second derivatives by the point, row by row",
        (_, "hessian" | "hessians") => "3x3 blocks (i, j) with i <= j, row by row",
        (_, "by_position" | "by_velocity") => "3x3 blocks (i, j), row by row",
        (_, "jacobian") => "a vector for each row and point",
        (_, "value") => "U, or C",
        _ => "a vector for each point",
    }
}

/// Documents results of mixed unknowns, whose matrices are flat.
fn mixed_docs(kind: RoutineKind, name: &str) -> &'static str {
    match (kind, name) {
        (_, "gradient" | "product" | "force") => "a number for each increment",
        (_, "hessian") => "the upper triangle, row by row",
        (_, "hessians") => "the upper triangle of each row of C, row by row",
        (_, "by_position" | "by_velocity") => "row by row",
        (_, "jacobian") => "a number for each row and increment",
        (_, "by_unknowns") => "its derivatives by the increments of the unknowns, row by row",
        _ => result_docs(kind, name),
    }
}
