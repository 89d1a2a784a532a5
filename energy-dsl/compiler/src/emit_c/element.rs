//! The routines of an element as functions.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers};
use super::expression::Meanings;
use super::function::Function;

use crate::graph::Input;
use crate::interpreted::InputNumbers;
use crate::plan::{Plan, RoutinePlan};
use energy_runtime::{Kind, RoutineKind};

/// An element that is being written.
pub(super) struct Element<'a> {
    pub(super) plan: &'a Plan,
    pub(super) inputs: &'a [InputNumbers],
    /// Name of the element in the generated code, with its precision: `hooke_spring_f64`.
    pub(super) name: &'a str,
    pub(super) dialect: Dialect,
    pub(super) meanings: &'a Meanings,
}

impl Element<'_> {
    /// Returns whether the unknowns are one flat array, `u`: those of residuals, and mixed ones.
    pub(super) fn is_flat(&self) -> bool {
        self.plan.declaration.kind == Kind::Residual || self.plan.declaration.is_mixed()
    }

    /// Writes all routines.
    pub(super) fn routines(&self) -> String {
        self.moving(&self.routine(&self.plan.rest, false)) + &self.vertex()
    }

    /// Writes all routines of the moving part, after some text.
    fn moving(&self, before: &str) -> String {
        let mut text = before.to_owned();
        let is_scalar = self.dialect.numbers == Numbers::Plain;
        let is_needed = |kind: RoutineKind| is_scalar || !matches!(kind, RoutineKind::Vertex(_));
        for routine in self.plan.routines.iter().filter(|routine| is_needed(routine.kind)) {
            text.push_str(&self.routine(routine, self.plan.repetition.is_some()));
            if self.plan.repetition.is_some() {
                text.push_str(&self.sum(routine));
            }
        }
        text + &self.expansion()
    }

    /// Writes the routines over vectors of elements, and the loop over elements.
    pub(super) fn lanes(&self) -> String {
        let lanes = Element { dialect: self.dialect.of(Numbers::Lanes), ..*self };
        lanes.moving("") + &lanes.run() + &self.loops(true)
    }

    /// Returns the name of a function.
    pub(super) fn named(&self, function: &str) -> String {
        match self.dialect.numbers {
            Numbers::Lanes => format!("{}_lanes_{function}", self.name),
            _ => format!("{}_{function}", self.name),
        }
    }

    /// Writes the function that chooses among the routines of single vertices; nothing without these.
    pub(super) fn vertex(&self) -> String {
        let functions = self.functions();
        let of_vertex = |function: &&Function| matches!(function.kind, RoutineKind::Vertex(_));
        let Some(first) = functions.iter().find(of_vertex) else { return String::new() };
        let list = self.arguments(first, false);
        let mut text = format!(
            "/* U, and its derivatives by point `point` alone: those of vertex_0, vertex_1, and so on. */\n\
             ENERGY_ROUTINE unsigned {}_vertex(int32_t point, {}) {{\n    switch (point) {{\n",
            self.name,
            self.signature(first, false)
        );
        for (point, function) in functions.iter().filter(of_vertex).enumerate() {
            let _ = writeln!(text, "    case {point}:\n        return {}_{}({list});", self.name, function.name);
        }
        text.push_str("    default:\n        return ENERGY_DEGENERATE;\n    }\n}\n\n");
        text
    }

    /// Writes the sum of a routine over all terms.
    pub(super) fn sum(&self, routine: &RoutinePlan) -> String {
        let repetition = self.plan.repetition.as_ref().expect("compiler bug: a sum has terms");
        let function = self.function(routine.kind, &routine.sizes());
        let (real, terms) = (self.dialect.precision.real(), repetition.terms());
        let (number, is_scalar) = (self.dialect.of_type(false), self.dialect.numbers == Numbers::Plain);
        let mut text = if is_scalar { self.comment(&function) } else { String::new() };
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let name_here = self.named(&function.name);
        let _ = writeln!(text, "ENERGY_ROUTINE {returned} {name_here}({}) {{", self.signature(&function, false));
        let constants = repetition.table[0].len();
        let rows: Vec<String> = repetition
            .table
            .iter()
            .map(|row| {
                let numbers: Vec<String> =
                    row.iter().map(|&x| self.dialect.precision.literal(x).unwrap_or_else(|| "0".into())).collect();
                format!("{{{}}}", numbers.join(", "))
            })
            .collect();
        if constants > 0 {
            let _ = writeln!(text, "    static const {real} table[{terms}][{constants}] = {{{}}};", rows.join(", "));
        } else {
            let _ = writeln!(text, "    static const {real} table[{terms}][1] = {{{{0}}}};");
        }
        for result in &function.results {
            let _ = writeln!(text, "    {number} term_{}[{}];", result.name, result.size);
        }
        let _ = writeln!(text, "    {number} all = {};", self.dialect.constant(0.0));
        let _ = writeln!(text, "    {returned} flags = 0U;\n    int32_t term, i;");
        for result in &function.results {
            let _ = writeln!(
                text,
                "    for (i = 0; i < {}; i++) {{\n        {}[i] = {};\n    }}",
                result.size,
                result.name,
                self.dialect.constant(0.0)
            );
        }
        let _ = writeln!(text, "    for (term = 0; term < {terms}; term++) {{");
        let own = format!("stored + {} + {} * term", repetition.shared, repetition.stride);
        let inputs: Vec<&str> = function.arguments.iter().map(|argument| argument.name).collect();
        let terms: Vec<String> = function.results.iter().map(|result| format!("term_{}", result.name)).collect();
        let _ = writeln!(
            text,
            "        flags |= {}({}, {own}, table[term], {});",
            self.named(&format!("term_{}", function.name)),
            inputs.join(", "),
            terms.join(", ")
        );
        for result in &function.results {
            let name = result.name;
            let sum = match self.dialect.operators {
                true => format!("{name}[i] + term_{name}[i]"),
                false => self.dialect.call("add", &[&format!("{name}[i]"), &format!("term_{name}[i]")]),
            };
            let _ = writeln!(
                text,
                "        for (i = 0; i < {}; i++) {{\n            {name}[i] = {sum};\n        }}",
                result.size
            );
        }
        text.push_str("    }\n");
        for result in &function.results {
            let name = result.name;
            let _ = writeln!(text, "    for (i = 0; i < {}; i++) {{\n        all += {name}[i];\n    }}", result.size);
        }
        let zero = self.dialect.constant(0.0);
        let overflow = match is_scalar {
            true => format!("(all - all == {zero} ? 0U : ENERGY_DEGENERATE)"),
            false => self.dialect.call("marked", &[&format!("~(all - all == {zero})")]),
        };
        let _ = writeln!(text, "    return flags | {overflow};\n}}\n");
        text
    }

    /// Returns the expression that reads an input.
    pub(super) fn read(&self, input: Input, is_term: bool) -> String {
        match input {
            Input::Position(i) if self.is_flat() => format!("u[{i}]"),
            Input::Position(i) => format!("x[{i}]"),
            Input::Velocity(i) => format!("v[{i}]"),
            Input::Increment(_) => unreachable!("compiler bug: increments are 0, and nothing reads them"),
            Input::Parameter(i) => format!("parameters[{i}]"),
            Input::Rest(i) => format!("rest[{i}]"),
            Input::Precomputed(i) => match (&self.plan.repetition, usize::from(i)) {
                (Some(of), i) if is_term && i >= of.shared + of.stride => {
                    let constant = format!("constants[{}]", i - of.shared - of.stride);
                    match self.dialect.numbers {
                        Numbers::Lanes => self.dialect.call("splat", &[&constant]),
                        _ => constant,
                    }
                }
                (Some(of), i) if is_term && i >= of.shared => format!("own[{}]", i - of.shared),
                (_, i) => format!("stored[{i}]"),
            },
        }
    }
}
