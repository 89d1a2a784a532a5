//! The tables of the language reference match the compiler. `UPDATE_GOLDEN=1 cargo test` records them.

use std::path::Path;

const SPELLINGS: &str = "## Naive spellings with a robust form\n";
const FUNCTIONS: &str = "## Functions\n";

/// Escapes the text of a cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Returns `text` up to and including the first table header below `heading`, without the header.
fn introduction<'a>(text: &'a str, heading: &str) -> &'a str {
    let start = text.find(heading).unwrap_or_else(|| panic!("LANGUAGE.md has no heading {heading:?}"));
    let table = text[start..].find("\n| ").unwrap_or(text.len() - start - 1);
    &text[start..=start + table]
}

fn spellings() -> String {
    let mut table = String::from("| spelling | computed as |\n|---|---|\n");
    for (spelling, form) in energy_compiler::robust_spellings() {
        table += &format!("| `{}` | {} |\n", cell(spelling), cell(form));
    }
    table
}

fn functions() -> String {
    let mut table = String::from("| usage | result | accuracy, u |\n|---|---|---|\n");
    for function in energy_compiler::functions() {
        table += &format!("| `{}` | {} | {} |\n", cell(function.usage), cell(function.docs), cell(function.accuracy));
    }
    table += "| `sum(j in a..b, term)` | Sum of the terms for j = a, …, b − 1, unrolled. |  |\n";
    table += "| `len(a)` | Number of entries of an array, a constant. | 0 |\n";
    table += "| `a % b` | Remainder of two constant whole numbers, for indices. | 0 |\n";
    table += "| `gradient(U, p)` | Derivative of a scalar with respect to an unknown or a parameter. |  |\n";
    table
}

/// LANGUAGE.md ends with two tables that the compiler generates: naive spellings and functions.
#[test]
fn the_tables_are_the_compilers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("LANGUAGE.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, _) = text.split_once(SPELLINGS).expect("LANGUAGE.md has a table of spellings");
    let expected = format!(
        "{before}{}{}\n{}{}",
        introduction(&text, SPELLINGS),
        spellings(),
        introduction(&text, FUNCTIONS),
        functions()
    );
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    assert!(text == expected || std::env::var_os("UPDATE_GOLDEN").is_some(), "LANGUAGE.md is behind the compiler");
}
