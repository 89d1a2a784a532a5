//! The language reference agrees with the compiler. `UPDATE_GOLDEN=1 cargo test` records the compiler's tables in it.

use std::path::Path;

/// LANGUAGE.md ends with the table of functions; it is the table that the compiler reads.
#[test]
fn the_table_of_functions_is_the_compilers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("LANGUAGE.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, _) = text.split_once("| usage |").unwrap_or((&text, ""));
    let mut table = String::from("| usage | what it is | accuracy, u |\n|---|---|---|\n");
    for function in energy_compiler::functions() {
        let cell = |text: &str| text.replace('|', "\\|");
        let (usage, docs, accuracy) = (cell(function.usage), cell(function.docs), cell(function.accuracy));
        table += &format!("| `{usage}` | {docs} | {accuracy} |\n");
    }
    table += "| `sum(j in a..b, term)` | The sum of the terms with j = a, …, b − 1, unrolled. |  |\n";
    table += "| `gradient(U, p)` | The derivative of a scalar by a point. |  |\n";
    let expected = format!("{before}{table}");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    assert!(text == expected || std::env::var_os("UPDATE_GOLDEN").is_some(), "LANGUAGE.md is behind the compiler");
}
