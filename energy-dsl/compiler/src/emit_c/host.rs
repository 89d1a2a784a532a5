//! Code for hosts: the description of an element, loops over elements, CUDA kernels.

use std::fmt::Write as _;

use super::element::Element;
use super::function::{Argument, Function};
use crate::plan::Plan;
use energy_runtime::RoutineKind;

impl Element<'_> {
    /// Writes the function that runs a routine by number over vectors.
    pub(super) fn run(&self) -> String {
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
    pub(super) fn case(&self, function: &Function) -> String {
        let arguments = (0..function.arguments.len()).map(|number| format!("arguments[{number}]"));
        let results = (0..function.results.len()).map(|number| format!("results[{number}]"));
        let list = arguments.chain(results).collect::<Vec<_>>().join(", ");
        let constant = function.name.to_uppercase();
        format!("    case ENERGY_{constant}:\n        return {}({list});", self.named(&function.name))
    }

    /// Writes the loop over elements: one at a time, or vectors of them.
    pub(super) fn loops(&self, in_lanes: bool) -> String {
        let (name, precision, real) = (self.name, self.dialect.precision.name(), self.dialect.precision.real());
        let room = self.room();
        if self.has_mixed_loops() {
            return format!("{}{}", if in_lanes { "" } else { "\n" }, self.mixed_loops(in_lanes));
        }
        match in_lanes {
            false => format!(
                "\nvoid {name}_evaluate(int32_t routine, energy_{precision}_batch *batch) {{\n    {real} \
                 work[{room}];\n    batch->flagged = 0U;\n    batch->unsettled_count = 0U;\n    \
                 energy_{precision}_run_each(&{name}, routine, batch, 0U, batch->count, work);\n}}\n"
            ),
            true => format!(
                "void {name}_evaluate_lanes(int32_t routine, energy_{precision}_batch *batch) {{\n    \
                 energy_{precision}_lanes work[{}];\n    {real} single[{room}];\n    batch->flagged = 0U;\n    \
                 batch->unsettled_count = 0U;\n    energy_{precision}_run_lanes(&{name}, {name}_lanes_run, routine, \
                 batch, work, single);\n}}\n",
                room + self.largest_result()
            ),
        }
    }

    /// Returns the count of numbers of all inputs and results of one element.
    pub(super) fn room(&self) -> usize {
        let results = |function: &Function| function.results.iter().map(|result| result.size).sum::<usize>();
        let results = self.functions().iter().map(results).max().unwrap_or_default();
        let Plan { coordinates, parameters, shape, .. } = self.plan;
        coordinates.max(shape) + coordinates + parameters + self.plan.stored() + results
    }

    /// Returns the count of numbers of the largest result.
    fn largest_result(&self) -> usize {
        let sizes = |function: Function| function.results.into_iter().map(|result| result.size);
        self.functions().into_iter().flat_map(sizes).max().unwrap_or_default()
    }

    /// Writes a kernel of CUDA for each routine, one element a thread, and a function that launches them.
    pub(super) fn kernels(&self) -> String {
        let name = self.name;
        let (batch, count) = if self.has_mixed_loops() { ("mixed_batch", "batch.count") } else { ("batch", "count") };
        let batch = format!("energy_{}_{batch}", self.dialect.precision.name());
        let (mut text, mut cases) = (String::new(), String::new());
        for function in self.functions() {
            // One kernel serves all vertices. Loops over mixed unknowns have no routines of single vertices.
            let is_vertex = matches!(function.kind, RoutineKind::Vertex(_));
            if is_vertex && (self.has_mixed_loops() || function.kind != RoutineKind::Vertex(0)) {
                continue;
            }
            let routine = if is_vertex { "vertex" } else { &function.name };
            text.push_str(&if self.has_mixed_loops() {
                self.mixed_kernel(&function)
            } else {
                self.kernel(&function, routine)
            });
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
             threads = 128U;\n    const unsigned blocks = (unsigned)((batch->{count} + threads - 1U) / threads);\n    if \
             (blocks == 0U) {{\n        return cudaSuccess;\n    }}\n    switch (routine) {{\n{cases}    default:\n        \
             return cudaErrorInvalidValue;\n    }}\n    return cudaGetLastError();\n}}\n"
        );
        text
    }

    /// Writes the kernel of a routine, or of all single vertices.
    fn kernel(&self, function: &Function, routine: &str) -> String {
        let Function { kind, arguments, results, .. } = function;
        let (name, real) = (self.name, self.dialect.precision.real());
        let is_vertex = matches!(kind, RoutineKind::Vertex(_));
        let batch = format!("energy_{}_batch", self.dialect.precision.name());
        let call = |function: &str, arguments: &str| {
            format!("energy_{}_{function}({arguments});", self.dialect.precision.name())
        };
        let mut text = String::new();
        let _ = writeln!(text, "__global__ void {name}_{routine}_kernel({batch} batch) {{");
        let _ = writeln!(text, "    const size_t i = (size_t)blockIdx.x * blockDim.x + threadIdx.x;");
        for array in arguments.iter().chain(results) {
            // A vertex that does not exist has no results.
            let zero = if is_vertex { " = {0}" } else { "" };
            let _ = writeln!(text, "    {real} {}[{}]{zero};", array.name, array.size.max(1));
        }
        text.push_str("    unsigned flags;\n    if (i >= batch.count) {\n        return;\n    }\n");
        for Argument { name, size, .. } in arguments {
            let (how, from) = match *name {
                "x" | "u" => ("read_points", "&batch, &batch.x"),
                "v" => ("read_points", "&batch, &batch.v"),
                "rest" => ("read", "&batch.x"),
                "parameters" => ("read", "&batch.parameters"),
                _ => ("read", "&batch.stored"),
            };
            let _ = writeln!(text, "    {}", call(how, &format!("{from}, i, {size}, {name}")));
        }
        let list: Vec<&str> = arguments.iter().chain(results).map(|array| array.name).collect();
        let (before, point) = match is_vertex {
            true => ("batch.points == NULL ? ENERGY_DEGENERATE : ", "(int32_t)batch.points[i], "),
            false => ("", ""),
        };
        let _ = writeln!(text, "    flags = {before}{name}_{routine}({point}{});", list.join(", "));
        for (place, Argument { name, size, .. }) in results.iter().enumerate() {
            let slots = format!(
                "energy_{}_slot_size(ENERGY_{}, {place}, {size})",
                self.dialect.precision.name(),
                routine.to_uppercase()
            );
            let coordinates = if is_vertex { 3 } else { self.plan.coordinates };
            let write = format!("&batch.results[{place}], i, {size}, {slots}, {coordinates}, {name}");
            let _ = writeln!(text, "    {}", call("write", &write));
        }
        let _ = writeln!(text, "    {}\n}}\n", call("device_note", "&batch, i, flags"));
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
