//! One routine as a function: its statements, its guard, and its general path.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers};
use super::element::Element;
use super::expression::statement;
use super::function::Function;
use crate::graph::{Input, NodeId, Op};
use crate::plan::{Code, RoutinePlan, Statements};
use energy_runtime::RoutineKind;

/// Statements of a reduced Hessian that is written into the Hessian, too: its results then stay in registers until they
/// are expanded. Where there are more, registers do not suffice, and compilers would take twice the time.
const MERGED: usize = 600;

/// Body of a function: its statements and its fallback.
struct Body<'a> {
    function: &'a Function,
    code: Code,
    /// Expression to return where the ordinary path does not suffice.
    otherwise: Option<String>,
    is_term: bool,
    /// Whether other inputs need all arguments.
    passes_on: bool,
}

impl Element<'_> {
    /// Writes a routine: its general path, and the function itself. One term of a sum gets its own numbers.
    pub(super) fn routine(&self, routine: &RoutinePlan, is_term: bool) -> String {
        let function = self.function(routine.kind, &routine.sizes());
        let name = if is_term { format!("term_{}", function.name) } else { function.name.clone() };
        let is_scalar = self.dialect.numbers == Numbers::Plain;
        let mut text = String::new();
        if let Some(general) = routine.general.as_ref().filter(|_| is_scalar) {
            text.push_str(&self.general(&function, &name, general, is_term));
        }
        let is_merged = routine.kind == RoutineKind::ReducedHessian && self.is_merged();
        let in_general = format!("{}_{name}_in_general({})", self.name, self.arguments(&function, is_term));
        let guarded = routine.general.is_some();
        let comment = if is_term || !is_scalar { String::new() } else { self.comment(&function) };
        let mut body = self.body(&function, routine, is_term);
        match (is_merged, is_scalar) {
            (true, true) => {
                body.otherwise = guarded.then(|| "ENERGY_GENERAL".to_owned());
                body.passes_on = false;
                let list = self.arguments(&function, false);
                let called = format!("{}_{name}_if_ordinary({list})", self.name);
                text.push_str(&self.written_body("ENERGY_FN", &format!("{name}_if_ordinary"), &body));
                text.push_str(&comment);
                let signature = self.signature(&function, false);
                let _ = writeln!(text, "ENERGY_ROUTINE unsigned {}_{name}({signature}) {{", self.name);
                match guarded {
                    true => {
                        let _ = writeln!(text, "    const unsigned flags = {called};");
                        let _ = writeln!(text, "    return flags == ENERGY_GENERAL ? {in_general} : flags;\n}}\n");
                    }
                    false => {
                        let _ = writeln!(text, "    return {called};\n}}\n");
                    }
                }
            }
            (false, true) => {
                body.otherwise = guarded.then_some(in_general);
                text.push_str(&comment);
                text.push_str(&self.written_body("ENERGY_ROUTINE", &name, &body));
            }
            (_, false) => {
                let inlined = if is_merged { "ENERGY_FN" } else { "ENERGY_ROUTINE" };
                text.push_str(&self.written_body(inlined, &name, &body));
            }
        }
        text
    }

    /// Returns whether the Hessian repeats the statements of the reduced one.
    pub(super) fn is_merged(&self) -> bool {
        let reduced = self.plan.find(RoutineKind::ReducedHessian);
        let is_short = reduced.is_some_and(|reduced| reduced.ordinary.statements.list().len() <= MERGED);
        is_short && self.plan.expansion.is_some() && self.plan.repetition.is_none()
    }

    /// Returns the statements of a function. Its guard comes last: gcc arranges one long sequence better than three short
    /// ones.
    fn body<'a>(&self, function: &'a Function, routine: &RoutinePlan, is_term: bool) -> Body<'a> {
        let general = routine.general.as_ref();
        let guarded = general.map(|general| routine.ordinary.with_guard(&general.guard, !routine.is_broken));
        let passes_on = general.is_some() && self.dialect.numbers == Numbers::Plain;
        let code = guarded.unwrap_or_else(|| routine.ordinary.clone());
        Body { function, code, otherwise: None, is_term, passes_on }
    }

    /// Writes a function.
    fn written_body(&self, inlined: &str, name: &str, body: &Body<'_>) -> String {
        let Body { function, code, is_term, .. } = body;
        let is_scalar = self.dialect.numbers == Numbers::Plain;
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let (name, signature) = (self.named(name), self.signature(function, *is_term));
        let mut text = format!("{inlined} {returned} {name}({signature}) {{\n");
        let mut written = Written::default();
        let read = |input| self.read(input, *is_term);
        self.statements(self.dialect, &code.statements, &read, &mut written, &mut text);
        self.unused(function, *is_term, &code.inputs(), body.passes_on, &mut text);
        if let (Some(guard), Some(otherwise)) = (code.guard, &body.otherwise) {
            let _ = writeln!(text, "    if (!{}) {{\n        return {otherwise};\n    }}", written.name(guard));
        }
        for (result, group) in function.results.iter().zip(&code.groups) {
            for (place, &number) in group.iter().enumerate() {
                let _ = writeln!(text, "    {}[{place}] = {};", result.name, written.name(number));
            }
        }
        let returned = match is_scalar {
            false => self.rare_lanes(code, &written),
            true if function.kind == RoutineKind::Rest => self.unsound_rest(function, code, &written),
            true => flags(code, &written),
        };
        let _ = writeln!(text, "    return {returned};\n}}\n");
        text
    }

    /// Returns the expression of the lanes that the scalar function must compute.
    fn rare_lanes(&self, code: &Code, written: &Written) -> String {
        let [degenerate, kink] = code.flags.map(|mask| mask.map(|mask| written.name(mask)));
        let guard = code.guard.map(|guard| format!("~{}", written.name(guard)));
        let masks: Vec<String> = [degenerate, kink, guard].into_iter().flatten().collect();
        match masks.is_empty() {
            true => "0U".to_owned(),
            false => self.dialect.call("marked", &[&masks.join(" | ")]),
        }
    }

    /// Returns the flags of a rest shape.
    fn unsound_rest(&self, function: &Function, code: &Code, written: &Written) -> String {
        let size = function.results[0].size;
        let degenerate = code.flags[0].map_or_else(|| "0".to_owned(), |mask| written.name(mask));
        let unsound = match size {
            0 => degenerate,
            _ => format!("{degenerate} || !{}", self.dialect.call("are_finite", &["stored", &size.to_string()])),
        };
        format!("{unsound} ? ENERGY_DEGENERATE : 0U")
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

    /// Writes statements after those that are written already.
    pub(super) fn statements(
        &self,
        dialect: Dialect,
        statements: &Statements,
        read: &dyn Fn(Input) -> String,
        written: &mut Written,
        text: &mut String,
    ) {
        for (place, &op) in statements.list().iter().enumerate() {
            let name = match (op, statement(dialect, self.meanings, op, |place| written.name(place))) {
                (Op::Input(input), _) => read(input),
                (Op::Constant(_) | Op::Pi | Op::Truth(_), Some(value)) => value,
                (_, Some(value)) => {
                    let name = format!("t{}", written.variables);
                    written.variables += 1;
                    let comment = statements.name(place).map_or_else(String::new, |name| format!(" /* {name} */"));
                    let _ = writeln!(text, "    const {} {name} = {value};{comment}", dialect.of_type(op.is_mask()));
                    name
                }
                (_, None) => unreachable!("compiler bug: only inputs are read in place"),
            };
            written.names.push(name);
        }
    }
}

/// The expressions of statements' results.
#[derive(Default)]
pub(super) struct Written {
    names: Vec<String>,
    /// Number of variables.
    variables: usize,
}

impl Written {
    pub(super) fn name(&self, place: NodeId) -> String {
        self.names[place.0 as usize].clone()
    }
}

fn flags(code: &Code, written: &Written) -> String {
    let [degenerate, kink] = code.flags;
    let flag = |mask: Option<NodeId>, flag: &str| mask.map(|mask| format!("({} ? {flag} : 0U)", written.name(mask)));
    let list: Vec<String> =
        [flag(degenerate, "ENERGY_DEGENERATE"), flag(kink, "ENERGY_KINK")].into_iter().flatten().collect();
    if list.is_empty() { "0U".to_owned() } else { list.join(" | ") }
}
