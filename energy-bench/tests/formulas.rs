//! The formulas run in lanes and in batches, and their inputs are ordinary.

use energy_bench::formulas::{FORMULAS, Options, Program, formulas, table, write_inputs};

fn options() -> Options {
    Options { elements: vec![32], repetitions: 1, names: Vec::new(), python: None, inputs: None }
}

#[test]
fn all_formulas_are_timed() {
    let report = formulas(&options()).expect("no script runs");
    assert_eq!(report.formulas.len(), FORMULAS.len());
    for one in &report.formulas {
        assert!(one.operations > one.instructions && one.instructions > 0, "{}", one.formula);
        let programs: Vec<Program> = one.nanoseconds.keys().copied().collect();
        assert_eq!(programs, [Program::Lanes, Program::Batches, Program::Memory], "{}", one.formula);
        assert!(one.nanoseconds.values().all(|time| *time > 0.0), "{}", one.formula);
    }
    assert!(report.notes.iter().any(|note| note.contains("--python")));
    let text = table(&report).to_string();
    assert!(FORMULAS.iter().all(|formula| text.contains(formula.name())), "{text}");
}

#[test]
fn inputs_are_ordinary() {
    for formula in &FORMULAS {
        let expected = formula.expected(&formula.inputs(320));
        let largest = expected.iter().fold(0.0, |largest: f64, number| largest.max(number.abs()));
        assert!(expected.iter().all(|number| number.is_finite()) && largest < 1e5, "{}: {largest:e}", formula.name());
    }
}

#[test]
fn files_have_all_numbers() {
    let folder = std::env::temp_dir().join(format!("energy-bench-formulas-test-{}", std::process::id()));
    write_inputs(&options(), &folder).expect("the folder can be written");
    for formula in &FORMULAS {
        let size =
            |name: &str| folder.join(format!("{}.{name}", formula.name())).metadata().map_or(0, |file| file.len());
        let inputs = formula.inputs(32);
        assert_eq!(size("inputs"), 8 * inputs.len() as u64);
        assert_eq!(size("expected"), 8 * formula.expected(&inputs).len() as u64);
    }
    std::fs::remove_dir_all(&folder).expect("the folder can be removed");
}

#[test]
fn an_unknown_name_is_an_error_that_lists_all() {
    let options = Options { names: vec!["Spring".to_owned()], ..options() };
    let folder = std::env::temp_dir().join("energy-bench-no-such-formula");
    let errors =
        [formulas(&options).expect_err("no such formula"), write_inputs(&options, &folder).expect_err("nor here")];
    for error in errors {
        assert!(error.to_string().contains("LennardJones") && error.to_string().contains("`Spring`"), "{error}");
    }
    assert!(!folder.exists(), "nothing is written");
}
