//! The routines of an element as functions.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers};
use super::expression::{Meanings, statement};
use super::function::Function;
use crate::graph::{Input, NodeId, Op};
use crate::interpreted::InputNumbers;
use crate::plan::{Code, Plan, RoutinePlan};
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

    /// Writes a routine: its general path, and the function itself. One term of a sum gets its own numbers.
    pub(super) fn routine(&self, routine: &RoutinePlan, is_term: bool) -> String {
        let function = self.function(routine.kind, &routine.sizes());
        let name = if is_term { format!("term_{}", function.name) } else { function.name.clone() };
        let mut text = String::new();
        let is_scalar = self.dialect.numbers == Numbers::Plain;
        if let Some(general) = routine.general.as_ref().filter(|_| is_scalar) {
            text.push_str(&self.general(&function, &name, general, is_term));
        }
        if !is_term {
            text.push_str(&self.comment(&function));
        }
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let name_here = self.named(&name);
        let _ = writeln!(text, "ENERGY_ROUTINE {returned} {name_here}({}) {{", self.signature(&function, is_term));
        let guarded =
            routine.general.as_ref().map(|general| routine.ordinary.with_guard(&general.guard, !routine.is_broken));
        let code = guarded.as_ref().unwrap_or(&routine.ordinary);
        let written = self.written(self.dialect, code, &|input| self.read(input, is_term), "    ", &mut text);
        let used = code.inputs();
        self.unused(&function, is_term, &used, is_scalar && routine.general.is_some(), &mut text);
        if let (Some(guard), true) = (code.guard, is_scalar) {
            let list = self.arguments(&function, is_term);
            let _ = writeln!(text, "    if (!{}) {{", written.name(guard));
            let _ = writeln!(text, "        return {}_{name}_in_general({list});\n    }}", self.name);
        }
        for (result, group) in function.results.iter().zip(&code.groups) {
            for (place, &number) in group.iter().enumerate() {
                let _ = writeln!(text, "    {}[{place}] = {};", result.name, written.name(number));
            }
        }
        if !is_scalar {
            let [degenerate, kink] = code.flags.map(|mask| mask.map(|mask| written.name(mask)));
            let guard = code.guard.map(|guard| format!("~{}", written.name(guard)));
            let masks: Vec<String> = [degenerate, kink, guard].into_iter().flatten().collect();
            let rare = match masks.is_empty() {
                true => "0U".to_owned(),
                false => self.dialect.call("marked", &[&masks.join(" | ")]),
            };
            let _ = writeln!(text, "    return {rare};\n}}\n");
        } else if routine.kind == RoutineKind::Rest {
            let sound = self.dialect.call("are_finite", &["stored", &function.results[0].size.to_string()]);
            let degenerate = code.flags[0].map_or_else(|| "0".to_owned(), |mask| written.name(mask));
            let result = match function.results[0].size {
                0 => degenerate,
                _ => format!("{degenerate} || !{sound}"),
            };
            let _ = writeln!(text, "    return {result} ? ENERGY_DEGENERATE : 0U;\n}}\n");
        } else {
            let _ = writeln!(text, "    return {};\n}}\n", flags(code, &written));
        }
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

    /// Writes the expansion of the reduced Hessian to points, and the Hessian; nothing without them.
    pub(super) fn expansion(&self) -> String {
        let (Some(expansion), Some(reduced)) = (&self.plan.expansion, self.plan.find(RoutineKind::ReducedHessian))
        else {
            return String::new();
        };
        let (real, is_scalar) = (self.dialect.of_type(false), self.dialect.numbers == Numbers::Plain);
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let sizes = reduced.sizes();
        let (first, second) = (sizes[1], sizes[2]);
        let hessian = self.functions().pop().expect("compiler bug: the Hessian comes last");
        let mut text = format!(
            "/* Expands derivatives by reduced coordinates to points: signed sums. */\nENERGY_ROUTINE void \
             {}(const {real} *ENERGY_RESTRICT reduced_gradient, const {real} *ENERGY_RESTRICT reduced_hessian, \
             {real} *ENERGY_RESTRICT gradient, {real} *ENERGY_RESTRICT hessian) {{\n",
            self.named("expand")
        );
        let read = |input: Input| match input {
            Input::Precomputed(number) if usize::from(number) < first => format!("reduced_gradient[{number}]"),
            Input::Precomputed(number) => format!("reduced_hessian[{}]", usize::from(number) - first),
            _ => unreachable!("compiler bug: an expansion reads derivatives"),
        };
        let written = self.written(self.dialect, expansion, &read, "    ", &mut text);
        for name in ["reduced_gradient", "reduced_hessian"] {
            if !expansion.inputs().iter().any(|&input| read(input).starts_with(&format!("{name}["))) {
                let _ = writeln!(text, "    (void){name};");
            }
        }
        for (result, group) in ["gradient", "hessian"].iter().zip(&expansion.groups) {
            for (place, &number) in group.iter().enumerate() {
                let _ = writeln!(text, "    {result}[{place}] = {};", written.name(number));
            }
        }
        text.push_str("}\n\n");
        text.push_str(&if is_scalar { self.comment(&hessian) } else { String::new() });
        let name_here = self.named("hessian");
        let _ = writeln!(text, "ENERGY_ROUTINE {returned} {name_here}({}) {{", self.signature(&hessian, false));
        let _ = writeln!(text, "    {real} reduced_gradient[{first}], reduced_hessian[{second}];");
        let inputs: Vec<&str> = hessian.arguments.iter().map(|argument| argument.name).collect();
        let _ = writeln!(
            text,
            "    const {returned} flags = {}({}, value, reduced_gradient, reduced_hessian);",
            self.named("reduced_hessian"),
            inputs.join(", ")
        );
        let _ = writeln!(text, "    {}(reduced_gradient, reduced_hessian, gradient, hessian);", self.named("expand"));
        text.push_str("    return flags;\n}\n\n");
        if is_scalar {
            text.push_str(&self.projected(&hessian));
        }
        text
    }

    /// Writes the function of the positive semi-definite Hessian.
    fn projected(&self, hessian: &Function) -> String {
        let (real, coordinates) = (self.dialect.precision.real(), self.plan.coordinates);
        let (numbers, points) = (hessian.results[2].size, coordinates / 3);
        let signature = self.signature(hessian, false);
        let inputs: Vec<&str> = hessian.arguments.iter().map(|argument| argument.name).collect();
        format!(
            "/* As {name}_hessian, but the Hessian is a full matrix, row by row, whose negative eigenvalues are 0. \
             */\nENERGY_ROUTINE unsigned {name}_projected_hessian({signature}) {{\n    {real} triangle[{numbers}], \
             work[{work}];\n    const unsigned flags = {name}_hessian({inputs}, value, gradient, triangle);\n    \
             {full};\n    (void){project};\n    return flags;\n}}\n\n",
            name = self.name,
            work = 2 * coordinates * coordinates,
            inputs = inputs.join(", "),
            full = self.dialect.call("full_matrix", &[&points.to_string(), "triangle", "hessian"]),
            project = self.dialect.call("project", &["hessian", "work", &coordinates.to_string()]),
        )
    }

    /// Says that arguments are not used on purpose.
    pub(super) fn unused(
        &self,
        function: &Function,
        is_term: bool,
        used: &[Input],
        passes_on: bool,
        text: &mut String,
    ) {
        if passes_on {
            return;
        }
        let own = ["own", "constants"].into_iter().filter(|_| is_term);
        for name in function.arguments.iter().map(|argument| argument.name).chain(own) {
            if !used.iter().any(|&input| self.read(input, is_term).contains(&format!("{name}["))) {
                let _ = writeln!(text, "    (void){name};");
            }
        }
        for result in function.results.iter().filter(|result| result.size == 0) {
            let _ = writeln!(text, "    (void){};", result.name);
        }
    }

    /// Writes the statements of some code.
    fn written(
        &self,
        dialect: Dialect,
        code: &Code,
        read: &dyn Fn(Input) -> String,
        indent: &str,
        text: &mut String,
    ) -> Written {
        let list = code.statements.list();
        let mut written = Written(Vec::with_capacity(list.len()));
        let mut computed = 0;
        for &op in list {
            let name = match (op, statement(dialect, self.meanings, op, |place| written.name(place))) {
                (Op::Input(input), _) => read(input),
                (Op::Constant(_) | Op::Pi | Op::Truth(_), Some(value)) => value,
                (_, Some(value)) => {
                    let name = format!("t{computed}");
                    let _ = writeln!(text, "{indent}const {} {name} = {value};", dialect.of_type(op.is_mask()));
                    computed += 1;
                    name
                }
                (_, None) => unreachable!("compiler bug: only inputs are read in place"),
            };
            written.0.push(name);
        }
        written
    }

    /// Returns the expression that reads an input.
    pub(super) fn read(&self, input: Input, is_term: bool) -> String {
        match input {
            Input::Position(i) if self.plan.declaration.kind == Kind::Residual => format!("u[{i}]"),
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

/// The expressions of statements' results.
struct Written(Vec<String>);

impl Written {
    fn name(&self, place: NodeId) -> String {
        self.0[place.0 as usize].clone()
    }
}

fn flags(code: &Code, written: &Written) -> String {
    let [degenerate, kink] = code.flags;
    let flag = |mask: Option<NodeId>, flag: &str| mask.map(|mask| format!("({} ? {flag} : 0U)", written.name(mask)));
    let list: Vec<String> =
        [flag(degenerate, "ENERGY_DEGENERATE"), flag(kink, "ENERGY_KINK")].into_iter().flatten().collect();
    if list.is_empty() { "0U".to_owned() } else { list.join(" | ") }
}
