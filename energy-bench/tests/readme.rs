//! The README's comparison has the rows and columns that the benchmark writes.

use energy_bench::Report;
use energy_bench::readme::{BEGIN, END, comparison};

/// The column titles of a Markdown table, then the first cell of each row.
fn names(table: &str) -> (Vec<&str>, Vec<&str>) {
    let mut lines = table.lines().map(str::trim).filter(|line| line.starts_with('|'));
    let columns: Vec<&str> = lines.next().map(split).unwrap_or_default();
    assert!(lines.next().is_some_and(|line| line.starts_with("|--")), "a rule follows the header");
    let rows = lines.map(|line| {
        let cells = split(line);
        assert_eq!(cells.len(), columns.len(), "the row has a cell in each column: {line}");
        cells[0]
    });
    let rows = rows.collect();
    (columns, rows)
}

fn split(line: &str) -> Vec<&str> {
    line.trim_matches('|').split('|').map(str::trim).collect()
}

#[test]
fn the_comparison_matches_the_benchmark() {
    let readme = include_str!("../../README.md");
    let (_, rest) = readme.split_once(BEGIN).expect("README.md has the line that begins the table");
    let (table, _) = rest.split_once(END).expect("README.md has the line that ends the table");
    let written = comparison(&Report::default());
    let (expected_columns, expected_rows) = names(&written);
    let (columns, rows) = names(table);
    assert_eq!(columns, expected_columns);
    assert_eq!(rows, expected_rows);
}
