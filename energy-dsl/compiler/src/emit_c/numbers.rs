//! The header that all generated code includes: numbers, rounding errors, elementary functions, extended exponents.

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers, Precision};
use super::expression::Expression;
use energy_runtime::{MASKS, RoutineKind, Trace, TraceStep, elementary_functions};

/// Returns the text of the header of scalars.
pub(super) fn header(precision: Precision) -> String {
    let huge = match precision {
        Precision::Double => include_str!("huge_f64.h"),
        Precision::Single => include_str!("huge_f32.h"),
    };
    let functions = functions(Dialect { precision, numbers: Numbers::Plain, operators: false });
    let interpreter = super::tape::interpreter(precision);
    let parts = [
        include_str!("numbers.h"),
        "\n",
        huge,
        include_str!("huge.h"),
        &functions,
        "\n",
        include_str!("wide.h"),
        "\n",
        &interpreter,
        "\n",
        include_str!("project.h"),
    ];
    let includes = "#include <float.h>\n#include <math.h>\n#include <stddef.h>\n#include <stdint.h>\n#include \
                    <string.h>\n\n";
    guarded(precision, "", includes, &parts)
}

/// Returns the functions of the header of scalars, without macros and without the types that hosts need.
pub(super) fn bare(precision: Precision) -> String {
    let header = header(precision);
    let end = format!("}} energy_{}_element;\n", precision.name());
    let begin = header.find("/* Operations that are rounded once.");
    let host = header.find("/* What a host may ask of an element. */");
    let numbers = begin.zip(host).and_then(|(begin, host)| header.get(begin..host));
    let others = header.split_once(&end).map(|(_, others)| others.trim_end().trim_end_matches("#endif"));
    let (numbers, others) =
        numbers.zip(others).expect("compiler bug: the header has numbers, then descriptions of elements");
    format!("{numbers}{others}")
}

/// Returns the text of the header of loops over elements.
pub(super) fn loops(precision: Precision) -> String {
    let includes = format!("#include \"energy_{}.h\"\n\n", precision.name());
    guarded(precision, "_loops", &includes, &[include_str!("loops.h")])
}

/// Returns the text of the header of vectors.
pub(super) fn lanes(precision: Precision) -> String {
    let functions = functions(Dialect { precision, numbers: Numbers::Lanes, operators: true });
    let includes = format!("#include \"energy_{}_loops.h\"\n\n", precision.name());
    let vectors = include_str!("lanes.h").replace("@TRANSPOSITION\n", &super::transposition::functions(precision));
    let parts = [&*vectors, &functions, "\n", include_str!("lane_loops.h")];
    guarded(precision, "_lanes", &includes, &parts)
}

/// Returns the text of the header of loops over elements of mixed unknowns and with states.
pub(super) fn mixed(precision: Precision) -> String {
    let includes = format!("#include \"energy_{}_loops.h\"\n\n", precision.name());
    guarded(precision, "_mixed", &includes, &[include_str!("mixed.h")])
}

/// Returns the text of the header of loops over vectors of such elements.
pub(super) fn mixed_lanes(precision: Precision) -> String {
    let name = precision.name();
    let includes = format!("#include \"energy_{name}_lanes.h\"\n#include \"energy_{name}_mixed.h\"\n\n");
    guarded(precision, "_mixed_lanes", &includes, &[include_str!("mixed_lanes.h")])
}

fn functions(dialect: Dialect) -> String {
    let traces = elementary_functions(dialect.precision == Precision::Single);
    let functions = traces.iter().map(|trace| function(dialect, trace));
    let comment = "\n/* Elementary functions: within 1 ulp, the same bits on every machine. */\n".to_owned();
    std::iter::once(comment).chain(functions).collect()
}

fn guarded(precision: Precision, name: &str, includes: &str, parts: &[&str]) -> String {
    let guard = format!("ENERGY_{}{}_H", precision.name(), name).to_uppercase();
    let body = parts.iter().map(|part| filled(precision, part)).collect::<String>();
    format!("#ifndef {guard}\n#define {guard}\n\n{includes}{body}\n#endif\n")
}

/// Returns the numbers of routines, as entries of an enumeration.
fn routines() -> String {
    let list = RoutineKind::ALL.iter().map(|kind| format!("    ENERGY_{}", kind.name().to_uppercase()));
    let of_vertex = "    /* Of loops: U, and its derivatives by one point alone, which `batch.points` tells. */\n    \
                     ENERGY_VERTEX = ENERGY_ROUTINES";
    list.chain(["    ENERGY_ROUTINES", of_vertex].map(str::to_owned)).collect::<Vec<_>>().join(",\n")
}

/// Writes an elementary function.
fn function(dialect: Dialect, trace: &Trace) -> String {
    let number = dialect.of_type(false);
    let arguments = ["a", "b"][..trace.arguments].iter().map(|name| format!("{number} {name}")).collect::<Vec<_>>();
    let mut text =
        format!("\nENERGY_ROUTINE {number} {}{}({}) {{\n", dialect.prefix(), trace.name, arguments.join(", "));
    let mut names: Vec<String> = Vec::with_capacity(trace.steps.len());
    for (place, step) in trace.steps.iter().enumerate() {
        names.push(match step {
            TraceStep::Argument(number) => ["a", "b"][*number].to_owned(),
            TraceStep::Constant(value) => dialect.constant(*value),
            TraceStep::Operation(name, operands) => {
                let list: Vec<&str> = operands.iter().map(|&operand| names[operand].as_str()).collect();
                let call = Expression::Call((*name).to_owned(), (0..list.len()).map(Expression::Operand).collect());
                let mut value = String::new();
                call.written(dialect, &list, &mut value);
                let of_type = dialect.of_type(MASKS.contains(name));
                let _ = writeln!(text, "    const {of_type} t{place} = {value};");
                format!("t{place}")
            }
        });
    }
    let _ = writeln!(text, "    return {};\n}}", names[names.len() - 1]);
    text
}

/// Fills in a text for both precisions: `@name` is a name of this precision, `1.0@` a number, and words in capitals are
/// constants of the format.
pub(super) fn filled(precision: Precision, text: &str) -> String {
    let is_double = precision == Precision::Double;
    let choose = |double: &'static str, single: &'static str| if is_double { double } else { single };
    let words = [
        ("@I_add", choose("__dadd_rn", "__fadd_rn")),
        ("@I_sub", choose("__dsub_rn", "__fsub_rn")),
        ("@I_mul", choose("__dmul_rn", "__fmul_rn")),
        ("@I_div", choose("__ddiv_rn", "__fdiv_rn")),
        ("@I_sqrt", choose("__dsqrt_rn", "__fsqrt_rn")),
        ("@I_fma", choose("__fma_rn", "__fmaf_rn")),
        ("@S", choose("d", "s")),
        ("@M_sqrt", choose("sqrt", "sqrtf")),
        ("@M_fma", choose("fma", "fmaf")),
        ("@M_fabs", choose("fabs", "fabsf")),
        ("@M_round", choose("round", "roundf")),
        ("@MANTISSA", choose("52", "23")),
        ("@SIGN_BIT", choose("63", "31")),
        ("@EXPONENTS", choose("0x7ff", "0xff")),
        ("@BIAS", choose("1023", "127")),
        ("@FIRST", choose("(-1022)", "(-126)")),
        ("@REACH", choose("500", "95")),
        ("@SPAN", choose("128", "4")),
        ("@MODERATE", choose("80", "12")),
        ("@DIGITS", choose("53", "24")),
        ("@EVEN", choose("0.0", "0.0f")),
        ("@LOG2_E", choose("1.4426950408889634", "1.442695f")),
        ("@LN_2_HIGH", choose("0.6931471805599453", "0.6931472f")),
        ("@LN_2_LOW", choose("2.3190468138462996e-17", "-1.9046542e-9f")),
        ("@WIDEST", choose("8", "16")),
        ("@ints", choose("int64_t", "int32_t")),
        ("@real", precision.real()),
        ("@bits", choose("uint64_t", "uint32_t")),
    ];
    let text = text.replace("@@ROUTINES", &routines());
    let mut filled = String::with_capacity(2 * text.len());
    let mut rest = text.as_str();
    while let Some(place) = rest.find('@') {
        filled.push_str(&rest[..place]);
        rest = &rest[place..];
        let is_word = |word: &str| {
            rest.strip_prefix(word).is_some_and(|after| !after.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        };
        if let Some((word, with)) = words.iter().find(|(word, _)| is_word(word)) {
            filled.push_str(with);
            rest = &rest[word.len()..];
        } else {
            rest = &rest[1..];
            match rest.starts_with(|c: char| c.is_ascii_alphabetic()) {
                true => {
                    filled.push_str("energy_");
                    filled.push_str(precision.name());
                    filled.push('_');
                }
                false => filled.push_str(choose("", "f")),
            }
        }
    }
    filled + rest
}
