//! Vectors of one number each as rows of one element each, for every width of vectors.

use std::fmt::Write as _;

use super::dialect::Precision;

/// Writes the functions that gather vectors from rows and that store vectors as rows.
pub(super) fn functions(precision: Precision) -> String {
    let widest = if precision == Precision::Double { 8 } else { 16 };
    let mut text = String::new();
    for (number, lanes) in [widest / 4, widest / 2, widest].into_iter().enumerate() {
        let _ = writeln!(text, "#{} @LANES == {lanes}", if number == 0 { "if" } else { "elif" });
        text.push_str(&gathers(lanes));
        text.push_str(&transposition(lanes));
    }
    text + "#endif\n"
}

fn gathers(lanes: usize) -> String {
    let list = |entry: &dyn Fn(usize) -> String| (0..lanes).map(entry).collect::<Vec<_>>().join(", ");
    let strided = list(&|lane| format!("first[{lane} * stride]"));
    let indexed = list(&|lane| format!("first[places[{lane}]]"));
    format!(
        "/* One number of each row; rows are `stride` apart. */\nENERGY_FN @lanes @lanes_strided(const @real *first, size_t \
         stride) {{\n    const @lanes numbers = {{{strided}}};\n    return numbers;\n}}\n\n/* The numbers at some places. \
         */\nENERGY_FN @lanes @lanes_gathered(const @real *first, const size_t *places) {{\n    const @lanes numbers = \
         {{{indexed}}};\n    return numbers;\n}}\n\n"
    )
}

/// Writes the functions that load a square of rows, which are `stride` apart, as vectors, and that store vectors as such
/// rows. Both transpose by Eklundh's method: with step s, rows i and i + s exchange the columns whose index has, or
/// lacks, the bit s.
fn transposition(lanes: usize) -> String {
    let steps: Vec<usize> = std::iter::successors(Some(1), |step| Some(2 * step)).take_while(|&s| s < lanes).collect();
    let mut text = String::new();
    for &step in &steps {
        let shuffle = |name: &str, entry: &dyn Fn(usize) -> usize| {
            let order = (0..lanes).map(|lane| entry(lane).to_string()).collect::<Vec<_>>().join(", ");
            format!(
                "ENERGY_FN @lanes @lanes_{name}_{step}(@lanes a, @lanes b) {{\n    ENERGY_SHUFFLE(@lane_mask, a, b, \
                 {order});\n}}\n\n"
            )
        };
        text.push_str(&shuffle("low", &|lane| if lane & step == 0 { lane } else { lanes + lane - step }));
        text.push_str(&shuffle("high", &|lane| if lane & step == 0 { lane + step } else { lanes + lane }));
    }
    let last = letter(steps.len());
    let load = |row| format!("@lanes_load(rows + {row} * stride)");
    let store = |row| format!("@lanes_store({last}{row}, rows + {row} * stride);");
    let network = network(lanes, &steps);
    let mut function = |signature: &str, from: &dyn Fn(usize) -> String, to: &dyn Fn(usize) -> String| {
        let _ = writeln!(text, "ENERGY_FN void {signature} {{");
        for row in 0..lanes {
            let _ = writeln!(text, "    const @lanes a{row} = {};", from(row));
        }
        text.push_str(&network);
        for row in 0..lanes {
            let _ = writeln!(text, "    {}", to(row));
        }
        text.push_str("}\n\n");
    };
    function("@lanes_load_rows(const @real *rows, size_t stride, @lanes *numbers)", &load, &|row| {
        format!("numbers[{row}] = {last}{row};")
    });
    function(
        "@lanes_store_rows(const @lanes *numbers, @real *rows, size_t stride)",
        &|row| format!("numbers[{row}]"),
        &store,
    );
    text
}

fn network(lanes: usize, steps: &[usize]) -> String {
    let mut text = String::new();
    for (stage, &step) in steps.iter().enumerate() {
        let (from, to) = (letter(stage), letter(stage + 1));
        for row in (0..lanes).filter(|row| row & step == 0) {
            let other = row + step;
            for (name, row_after) in [("low", row), ("high", other)] {
                let _ = writeln!(
                    text,
                    "    const @lanes {to}{row_after} = @lanes_{name}_{step}({from}{row}, {from}{other});"
                );
            }
        }
    }
    text
}

fn letter(stage: usize) -> char {
    ['a', 'b', 'c', 'd', 'e'][stage]
}
