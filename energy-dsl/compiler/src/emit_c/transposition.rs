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

/// Writes the transposition by Eklundh's method: with step s, rows i and i + s exchange the columns whose index has, or
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
    text.push_str(
        "/* Stores as many vectors as there are lanes as rows, which are `stride` apart. */\nENERGY_FN void \
         @lanes_store_rows(const @lanes *numbers, @real *rows, size_t stride) {\n",
    );
    for row in 0..lanes {
        let _ = writeln!(text, "    const @lanes a{row} = numbers[{row}];");
    }
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
    for row in 0..lanes {
        let _ = writeln!(text, "    @lanes_store({}{row}, rows + {row} * stride);", letter(steps.len()));
    }
    text + "}\n\n"
}

fn letter(stage: usize) -> char {
    ['a', 'b', 'c', 'd', 'e'][stage]
}
