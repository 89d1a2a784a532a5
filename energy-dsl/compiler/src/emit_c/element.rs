//! The routines of an element as functions.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers};
use super::expression::{Meanings, statement};
use crate::graph::{Input, NodeId, Op};
use crate::interpreted::{InputKind, InputNumbers};
use crate::plan::{Code, Plan, RoutinePlan, groups};
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
    fn named(&self, function: &str) -> String {
        match self.dialect.numbers {
            Numbers::Lanes => format!("{}_lanes_{function}", self.name),
            _ => format!("{}_{function}", self.name),
        }
    }

    /// Writes the function that chooses among the routines of single vertices; nothing without these.
    fn vertex(&self) -> String {
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

    fn function(&self, kind: RoutineKind, sizes: &[usize]) -> Function {
        let docs = |kinds: &[InputKind]| {
            let list = self.inputs.iter().filter(|input| kinds.contains(&input.kind)).map(|input| {
                let unit = if input.unit.is_empty() { String::new() } else { format!(" in {}", input.unit) };
                let size = if input.size() == 1 { String::new() } else { format!(" ({})", input.size()) };
                format!("{}{size}{unit}", input.name)
            });
            list.collect::<Vec<_>>().join(", ")
        };
        let coordinates = self.plan.coordinates;
        let is_residual = self.plan.declaration.kind == Kind::Residual;
        let parameters =
            Argument { name: "parameters", size: self.plan.parameters, docs: docs(&[InputKind::Parameter]) };
        let mut arguments = match kind {
            RoutineKind::Rest => {
                vec![Argument { name: "rest", size: self.plan.shape, docs: docs(&[InputKind::Rest]) }]
            }
            _ if is_residual => {
                vec![Argument { name: "u", size: coordinates, docs: docs(&[InputKind::Unknown]) }]
            }
            _ => vec![Argument { name: "x", size: coordinates, docs: docs(&[InputKind::Point]) }],
        };
        match kind {
            RoutineKind::HessianVector => {
                arguments.push(Argument { name: "v", size: coordinates, docs: "a vector for each point".into() });
            }
            RoutineKind::Force | RoutineKind::Jacobians => {
                arguments.push(Argument { name: "v", size: coordinates, docs: "the velocities of the points".into() });
            }
            _ => {}
        }
        arguments.push(parameters);
        if kind != RoutineKind::Rest {
            let docs = "what the rest shape determines".to_owned();
            arguments.push(Argument { name: "stored", size: self.plan.stored(), docs });
        }
        let result = |(&(name, _), &size): (&(&'static str, _), &usize)| Argument {
            name: if kind == RoutineKind::Rest { "stored" } else { name },
            size,
            docs: result_docs(kind, name).to_owned(),
        };
        let results = groups(kind).iter().zip(sizes).map(result).collect();
        Function { kind, name: kind.name().to_owned(), arguments, results }
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

    /// Writes the function that runs a routine by number over vectors.
    fn run(&self) -> String {
        let number = self.dialect.of_type(false);
        let mut text = format!(
            "static uint32_t {}(int32_t routine, const {number} *const *arguments, {number} *const *results) {{\n    \
             switch (routine) {{\n",
            self.named("run")
        );
        let is_run = |function: &Function| !matches!(function.kind, RoutineKind::Vertex(_) | RoutineKind::Rest);
        for function in self.functions().into_iter().filter(is_run) {
            let _ = writeln!(text, "{}", self.case(&function));
        }
        text.push_str("    default:\n        return UINT32_MAX;\n    }\n}\n\n");
        text
    }

    /// Writes the case of a routine in a function that runs it by number.
    fn case(&self, function: &Function) -> String {
        let arguments = (0..function.arguments.len()).map(|number| format!("arguments[{number}]"));
        let results = (0..function.results.len()).map(|number| format!("results[{number}]"));
        let list = arguments.chain(results).collect::<Vec<_>>().join(", ");
        let constant = function.name.to_uppercase();
        format!("    case ENERGY_{constant}:\n        return {}({list});", self.named(&function.name))
    }

    /// Writes the loop over elements: one at a time, or vectors of them.
    pub(super) fn loops(&self, in_lanes: bool) -> String {
        let (name, precision, real) = (self.name, self.dialect.precision.name(), self.dialect.precision.real());
        let results = |function: &Function| function.results.iter().map(|result| result.size).sum::<usize>();
        let results = self.functions().iter().map(results).max().unwrap_or_default();
        let Plan { coordinates, parameters, shape, .. } = self.plan;
        let room = coordinates.max(shape) + coordinates + parameters + self.plan.stored() + results;
        match in_lanes {
            false => format!(
                "\nvoid {name}_evaluate(int32_t routine, energy_{precision}_batch *batch) {{\n    {real} \
                 work[{room}];\n    batch->flagged = 0U;\n    batch->unsettled_count = 0U;\n    \
                 energy_{precision}_run_each(&{name}, routine, batch, 0U, batch->count, work);\n}}\n"
            ),
            true => format!(
                "void {name}_evaluate_lanes(int32_t routine, energy_{precision}_batch *batch) {{\n    \
                 energy_{precision}_lanes work[{room}];\n    {real} single[{room}];\n    batch->flagged = 0U;\n    \
                 batch->unsettled_count = 0U;\n    energy_{precision}_run_lanes(&{name}, {name}_lanes_run, routine, \
                 batch, work, single);\n}}\n"
            ),
        }
    }

    /// Writes a kernel of CUDA for each routine, one element a thread, and a function that launches them.
    pub(super) fn kernels(&self) -> String {
        let (name, real) = (self.name, self.dialect.precision.real());
        let batch = format!("energy_{}_batch", self.dialect.precision.name());
        let function = |function: &str, arguments: &str| {
            format!("energy_{}_{function}({arguments});", self.dialect.precision.name())
        };
        let (mut text, mut cases) = (String::new(), String::new());
        for Function { kind, name: routine, arguments, results } in self.functions() {
            if matches!(kind, RoutineKind::Vertex(_)) {
                continue;
            }
            let _ = writeln!(text, "__global__ void {name}_{routine}_kernel({batch} batch) {{");
            let _ = writeln!(text, "    const size_t i = (size_t)blockIdx.x * blockDim.x + threadIdx.x;");
            for array in arguments.iter().chain(&results) {
                let _ = writeln!(text, "    {real} {}[{}];", array.name, array.size.max(1));
            }
            text.push_str("    unsigned flags;\n    if (i >= batch.count) {\n        return;\n    }\n");
            for Argument { name, size, .. } in &arguments {
                let (how, from) = match *name {
                    "x" | "u" => ("read_points", "&batch, &batch.x"),
                    "v" => ("read_points", "&batch, &batch.v"),
                    "rest" => ("read", "&batch.x"),
                    "parameters" => ("read", "&batch.parameters"),
                    _ => ("read", "&batch.stored"),
                };
                let _ = writeln!(text, "    {}", function(how, &format!("{from}, i, {size}, {name}")));
            }
            let list: Vec<&str> = arguments.iter().chain(&results).map(|array| array.name).collect();
            let _ = writeln!(text, "    flags = {name}_{routine}({});", list.join(", "));
            for (place, Argument { name, size, .. }) in results.iter().enumerate() {
                let slots = format!(
                    "energy_{}_slot_size(ENERGY_{}, {place}, {size})",
                    self.dialect.precision.name(),
                    routine.to_uppercase()
                );
                let coordinates = self.plan.coordinates;
                let write = format!("&batch.results[{place}], i, {size}, {slots}, {coordinates}, {name}");
                let _ = writeln!(text, "    {}", function("write", &write));
            }
            let _ = writeln!(text, "    {}\n}}\n", function("device_note", "&batch, i, flags"));
            let constant = routine.to_uppercase();
            let _ = writeln!(
                cases,
                "    case ENERGY_{constant}:\n        {name}_{routine}_kernel<<<blocks, threads, 0, stream>>>(*batch);\n        \
                 break;"
            );
        }
        let _ = write!(
            text,
            "/* Runs a routine on many elements on a GPU. All arrays of the batch are in its memory. */\nextern \"C\" \
             cudaError_t {name}_launch(int32_t routine, const {batch} *batch, cudaStream_t stream) {{\n    const unsigned \
             threads = 128U;\n    const unsigned blocks = (unsigned)((batch->count + threads - 1U) / threads);\n    if \
             (blocks == 0U) {{\n        return cudaSuccess;\n    }}\n    switch (routine) {{\n{cases}    default:\n        \
             return cudaErrorInvalidValue;\n    }}\n    return cudaGetLastError();\n}}\n"
        );
        text
    }

    /// Writes the description of the element, with a function that runs all routines.
    pub(super) fn description(&self) -> String {
        let (name, real, declaration) = (self.name, self.dialect.precision.real(), &self.plan.declaration);
        let functions = self.functions();
        let mut text = format!(
            "static unsigned {name}_run(int32_t routine, const {real} *const *arguments, {real} *const *results) {{\n    \
             switch (routine) {{\n"
        );
        let (vertices, functions): (Vec<_>, Vec<_>) =
            functions.into_iter().partition(|function| matches!(function.kind, RoutineKind::Vertex(_)));
        for function in &functions {
            let _ = writeln!(text, "{}", self.case(function));
        }
        text.push_str("    default:\n        return ENERGY_DEGENERATE;\n    }\n}\n\n");
        let of_vertex = if vertices.is_empty() { "NULL".to_owned() } else { format!("{name}_vertex") };
        let sizes = RoutineKind::ALL.iter().map(|&kind| {
            let function = functions.iter().find(|function| function.kind == kind);
            let size = |place: usize| {
                function.and_then(|function| function.results.get(place)).map_or(0, |result| result.size)
            };
            format!("{{{}, {}, {}}}", size(0), size(1), size(2))
        });
        let sizes = sizes.collect::<Vec<_>>().join(", ");
        let Plan { coordinates, parameters, shape, .. } = self.plan;
        let _ = writeln!(
            text,
            "const energy_{}_element {name} = {{\n    {}, {}, {},\n    {coordinates}, {parameters}, {shape}, \
             {},\n    {{{sizes}}},\n    {name}_run,\n    {of_vertex}}};",
            self.dialect.precision.name(),
            quoted(&declaration.name),
            quoted(declaration.kind.keyword()),
            quoted(&declaration.formula),
            self.plan.stored(),
        );
        text
    }

    fn comment(&self, function: &Function) -> String {
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

    fn arguments(&self, function: &Function, is_term: bool) -> String {
        let own = ["own", "constants"].into_iter().filter(|_| is_term);
        let inputs = function.arguments.iter().map(|argument| argument.name);
        inputs.chain(own).chain(function.results.iter().map(|result| result.name)).collect::<Vec<_>>().join(", ")
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

/// Returns a string literal of bytes that every compiler reads in the same way.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' => quoted.extend(['\\', char::from(byte)]),
            b' '..=b'~' if byte != b'?' => quoted.push(char::from(byte)),
            _ => {
                let _ = write!(quoted, "\\{byte:03o}");
            }
        }
    }
    quoted.push('"');
    quoted
}

fn flags(code: &Code, written: &Written) -> String {
    let [degenerate, kink] = code.flags;
    let flag = |mask: Option<NodeId>, flag: &str| mask.map(|mask| format!("({} ? {flag} : 0U)", written.name(mask)));
    let list: Vec<String> =
        [flag(degenerate, "ENERGY_DEGENERATE"), flag(kink, "ENERGY_KINK")].into_iter().flatten().collect();
    if list.is_empty() { "0U".to_owned() } else { list.join(" | ") }
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
    }
}

fn result_docs(kind: RoutineKind, name: &str) -> &'static str {
    match (kind, name) {
        (RoutineKind::Rest, _) => "the numbers",
        (RoutineKind::ReducedHessian, "hessian") => "the upper triangle, row by row",
        (RoutineKind::Residual | RoutineKind::Jacobian, "value") => "one number a row",
        (RoutineKind::Jacobian, _) => "row by row",
        (RoutineKind::Vertex(_), "gradient") => "by the point",
        (RoutineKind::Vertex(_), "block") => "second derivatives by the point, row by row",
        (_, "hessian" | "hessians") => "3x3 blocks (i, j) with i <= j, row by row",
        (_, "by_position" | "by_velocity") => "3x3 blocks (i, j), row by row",
        (_, "jacobian") => "a vector for each row and point",
        (_, "value") => "U, or C",
        _ => "a vector for each point",
    }
}
