//! General paths as data, and the function that runs them. They are thousands of operations and rarely run, so that code
//! would only cost compilers' time.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers, Precision};
use super::element::Element;
use super::expression::Expression;
use super::function::Function;
use crate::plan::GeneralPlan;
use crate::tape::record;
use energy_runtime::tape::{Instruction, Operation, ROWS};

/// Returns the operands that an operation has in the code of a tape.
fn operands(operation: Operation) -> usize {
    match operation {
        Operation::IsModerate => 2,
        Operation::Select => 3,
        _ => names(ROWS.iter().find(|row| row.0 == operation).map_or("", |row| row.1)).len(),
    }
}

/// Returns the names in `(a, b)`.
fn names(list: &str) -> Vec<&str> {
    list.trim_matches(['(', ')']).split(',').map(str::trim).filter(|name| !name.is_empty()).collect()
}

/// Writes the function that runs a tape.
pub(super) fn interpreter(precision: Precision) -> String {
    let dialect = Dialect { precision, numbers: Numbers::Wide, operators: false };
    let mut text = String::from(
        "/* Runs a general path: each operation is its number, the place of its result, and the places of its operands. \
         */\nENERGY_RARE void @run_tape(const uint16_t *code, int32_t length, @wide *n, unsigned char *m) {\n    int32_t \
         at = 0;\n    while (at < length) {\n        const uint16_t *i = code + at;\n        switch (i[0]) {\n",
    );
    let place = |list: &str, number: usize| format!("{list}[i[{}]]", number + 2);
    for (operation, list, meaning, section) in ROWS {
        let names = names(list);
        let (is_mask, of_masks) = (matches!(*section, "comparisons" | "connectives"), *section == "connectives");
        let reads: Vec<String> =
            (0..names.len()).map(|number| place(if of_masks { "m" } else { "n" }, number)).collect();
        let reads: Vec<&str> = reads.iter().map(String::as_str).collect();
        let mut value = String::new();
        Expression::of_text(meaning, &names).written(dialect, &reads, &mut value);
        let target = match is_mask {
            true => format!("m[i[1]] = (unsigned char)({value})"),
            false => format!("n[i[1]] = {value}"),
        };
        let _ = writeln!(
            text,
            "        case {}: /* {operation:?} */\n            {target};\n            at += {};\n            break;",
            *operation as u8,
            names.len() + 2
        );
    }
    let _ = writeln!(
        text,
        "        case {}: /* Select */\n            n[i[1]] = m[i[2]] ? n[i[3]] : n[i[4]];\n            at += 5;\n            \
         break;\n        default: /* IsModerate: extended numbers are never said to be. */\n            m[i[1]] = \
         0;\n            at += 4;\n            break;\n        }}\n    }}\n}}",
        Operation::Select as u8
    );
    text
}

impl Element<'_> {
    /// Writes a general path.
    pub(super) fn general(&self, function: &Function, name: &str, general: &GeneralPlan, is_term: bool) -> String {
        let wide = self.dialect.of(Numbers::Wide);
        let (inputs, _) = general.inputs();
        let recorded = record(&general.path, &inputs).expect("compiler bug: the tape of the path exists");
        let tape = &recorded.tape;
        let (reads, sizes) = (inputs.len(), recorded.groups.iter().map(Vec::len).collect::<Vec<_>>());
        let results: Vec<u16> = recorded.groups.concat();
        let code: Vec<u16> = tape.instructions.iter().flat_map(encoded).collect();
        let list = |numbers: &[u16]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>();
        let mut text = format!("/* The general path of {name}. */\n");
        let signature = self.signature(function, is_term);
        let _ = writeln!(text, "ENERGY_RARE unsigned {}_{name}_in_general({signature}) {{", self.name);
        text.push_str(&array("uint16_t", "code", &list(&code)));
        text.push_str(&array("uint16_t", "results", &list(&results)));
        let groups: Vec<String> = sizes.iter().map(ToString::to_string).collect();
        text.push_str(&array("int32_t", "sizes", &groups));
        let places: Vec<u16> = tape.constants.iter().map(|(place, _)| *place).collect();
        let values: Vec<f64> = tape.constants.iter().map(|(_, constant)| constant.nearest()).collect();
        let literals: Option<Vec<String>> = values.iter().map(|&x| self.dialect.precision.literal(x)).collect();
        if let (Some(literals), false) = (&literals, values.is_empty()) {
            text.push_str(&array(self.dialect.precision.real(), "constants", literals));
            text.push_str(&array("uint16_t", "places", &list(&places)));
        }
        let _ = writeln!(text, "    {} n[{}], found[{}];", wide.of_type(false), tape.slots.max(1), results.len());
        let _ = writeln!(text, "    {} numbers[{}];", self.dialect.precision.real(), results.len());
        let _ = writeln!(text, "    unsigned char m[{}];\n    unsigned masks = 0U;\n    int32_t i;", tape.masks.max(1));
        for (place, &input) in inputs.iter().enumerate() {
            let _ = writeln!(text, "    n[{place}] = {};", wide.call("of", &[&self.read(input, is_term)]));
        }
        self.unused(function, is_term, &inputs, false, &mut text);
        match literals {
            Some(literals) if !literals.is_empty() => {
                let _ = writeln!(
                    text,
                    "    for (i = 0; i < {}; i++) {{\n        n[places[i]] = {};\n    }}",
                    literals.len(),
                    wide.call("of", &["constants[i]"])
                );
            }
            _ => {
                for (place, value) in places.iter().zip(&values) {
                    let _ = writeln!(text, "    n[{place}] = {};", wide.constant(*value));
                }
            }
        }
        for (place, truth) in &tape.truths {
            let _ = writeln!(text, "    m[{place}] = {};", u8::from(*truth));
        }
        let _ = writeln!(text, "    {};", self.dialect.call("run_tape", &["code", &code.len().to_string(), "n", "m"]));
        let _ =
            writeln!(text, "    for (i = 0; i < {}; i++) {{\n        found[i] = n[results[i]];\n    }}", results.len());
        let [degenerate, kink] = recorded.flags;
        let [outside, definite] = recorded.settled;
        for (mask, bit) in [(outside, 1), (definite, 2), (degenerate, 4), (kink, 4)] {
            if let Some(mask) = mask {
                let _ = writeln!(text, "    masks |= m[{mask}] ? {bit}U : 0U;");
            }
        }
        let roles = u8::from(function.kind.has_values()) + 2 * u8::from(function.kind.is_energy());
        let (reads, groups) = (reads.to_string(), sizes.len().to_string());
        let (summed, roles) = (general.summed.to_string(), format!("{roles}U"));
        let arguments = ["n", &reads, "found", "sizes", &groups, &summed, &roles, "masks", "numbers"];
        let _ = writeln!(text, "    masks = {};", self.dialect.call("settled", &arguments));
        let mut first = 0;
        for (result, size) in function.results.iter().zip(&sizes).filter(|(_, size)| **size > 0) {
            let _ = writeln!(text, "    memcpy({}, numbers + {first}, {size} * sizeof *numbers);", result.name);
            first += size;
        }
        text.push_str("    return masks;\n}\n\n");
        text
    }
}

/// Returns an instruction as numbers.
fn encoded(instruction: &Instruction) -> Vec<u16> {
    let Instruction { operation, target, operands: of } = *instruction;
    [&[u16::from(operation as u8), target], &of[..operands(operation)]].concat()
}

/// Writes a constant array, in lines of at most 120 characters.
fn array(of_type: &str, name: &str, numbers: &[String]) -> String {
    let mut text = format!("    static const {of_type} {name}[{}] = {{\n       ", numbers.len().max(1));
    let mut width = 7;
    for (place, number) in numbers.iter().enumerate() {
        if width + number.len() + 2 > 120 {
            text.push_str("\n       ");
            width = 7;
        }
        let _ = write!(text, " {number}{}", if place + 1 < numbers.len() { "," } else { "" });
        width += number.len() + 2;
    }
    if numbers.is_empty() {
        text.push_str(" 0");
    }
    text + "};\n"
}
