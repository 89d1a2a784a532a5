//! Generated C of elements with any unknowns and with states has the bits of the tape; loops over elements gather their
//! unknowns, add their results to slots, and advance their states.

use std::path::Path;
use std::process::Command;

use energy_compiler::{Budget, Interpreted, Precision, Target, sources};
use verify_command::catalogue;

use super::c::{Bits, Case, Compiler, OPTIONS, Suite, check, exists, folder, samples};

/// Declarations over all types of unknowns, with states.
const TEXT: &str = include_str!("../../tests/unknowns.energy");

/// Returns these declarations, and the elements of the library that are like them.
fn suite<S: Bits>() -> Suite<S> {
    let library = catalogue::mixed().iter().chain(catalogue::find("RodBend"));
    // Both have a BallJoint.
    let of_library =
        library.map(|entry| entry.declaration.source.replace("constraint BallJoint", "constraint BallConstraint"));
    let texts: Vec<String> = std::iter::once(TEXT.to_owned()).chain(of_library).collect();
    let (mut elements, mut plain) = (Vec::new(), Vec::new());
    for text in &texts {
        let budget = Budget::default;
        elements.extend(Interpreted::from_file_with_vertices(text, "unknowns", &budget()).expect("it compiles"));
        plain.extend(Interpreted::from_file_within(text, "unknowns", &budget()).expect("it compiles"));
    }
    let cases_of = |(number, element): (usize, &Interpreted)| {
        let case = |sample: &_| Case::new(number, element, sample);
        samples(element.declaration()).iter().map(case).collect::<Vec<_>>()
    };
    let cases = elements.iter().enumerate().flat_map(cases_of).collect();
    Suite { elements, plain, cases }
}

#[test]
fn c_has_the_bits_of_rust() {
    let counts = check::<f64>(&Compiler::new("gcc -std=c99"), "c-mixed-f64", suite);
    assert!(counts.is_none_or(|counts| counts.routines > 5_000 && counts.flagged > 100));
}

#[test]
fn c_in_single_precision_has_the_bits_of_rust() {
    check::<f32>(&Compiler::new("gcc -std=c99").unoptimised(), "c-mixed-f32", || suite().sufficient());
}

#[test]
fn c_by_clang_has_the_bits_of_rust() {
    check::<f64>(&Compiler::clang().unoptimised(), "c-mixed-clang-f64", || suite().sufficient());
}

#[test]
fn c_for_aarch64_has_the_bits_of_rust() {
    check::<f64>(&Compiler::aarch64().unoptimised(), "c-mixed-aarch64-f64", || suite().sufficient());
}

/// Elements whose loops are compared: of each kind of declaration and of unknowns, with and without a state.
const LOOPS: [&str; 12] = [
    "ChainOfAngles",
    "Plane",
    "GasInTriangle",
    "Reservoir",
    "Arm",
    "BallJoint",
    "Axle",
    "Thrust",
    "Maxwell",
    "Transported",
    "Remembered",
    "Turning",
];

/// Loops have the bits of single elements: one at a time and in vectors, with unknowns of their own and with gathered
/// ones, with the state after the parameters and apart, into slots, and in place.
#[test]
fn loops_have_the_bits_of_single_elements() {
    loops::<f64>("loops-mixed-f64");
    loops::<f32>("loops-mixed-f32");
}

fn loops<S: Bits>(name: &str) {
    if !exists("gcc") {
        println!("skipped: there is no gcc");
        return;
    }
    let all = suite::<S>();
    let is_chosen = |number: &usize| LOOPS.contains(&&*all.elements[*number].declaration().name);
    let chosen: Vec<usize> = (0..all.elements.len()).filter(is_chosen).collect();
    let Suite { elements, cases, .. } = all.only(&chosen);
    let folder = folder(name);
    let records = folder.join("records");
    std::fs::write(&records, cases.iter().flat_map(Case::bytes).collect::<Vec<u8>>()).unwrap();
    let real = if S::PRECISION == Precision::Double { "double" } else { "float" };
    let (mut text, mut names) = (String::new(), Vec::new());
    for file in sources(&elements, Target::C, &[S::PRECISION]).unwrap() {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
        let Some(name) = file.name.strip_suffix(".c") else { continue };
        text.push_str(&format!("#include \"{}\"\n", file.name));
        names.extend((!name.ends_with("_lanes")).then(|| name.to_owned()));
    }
    assert_eq!(names.len(), LOOPS.len());
    let entry = |name: &String| format!("{{&{name}, {name}_layout, {{{name}_evaluate, {name}_evaluate_lanes}}}}");
    let entries: Vec<String> = names.iter().map(entry).collect();
    let prefix = format!("energy_{}_", S::PRECISION.name());
    text.push_str(&format!(
        "typedef {real} REAL;\n#define OF(name) {prefix}##name\ntypedef struct {{\n    const {prefix}element *element;\n    \
         {prefix}layout (*layout)(void);\n    void (*loops[2])(int32_t, {prefix}mixed_batch *);\n}} entry;\nstatic const \
         entry entries[] = {{{}}};\n",
        entries.join(", ")
    ));
    std::fs::write(folder.join("elements.h"), text).unwrap();
    let program = folder.join("loops");
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mixed.c");
    let mut gcc = Command::new("gcc");
    gcc.args(["-std=c99", "-march=native"])
        .args(OPTIONS)
        .arg("-O0")
        .arg("-I")
        .arg(&folder)
        .arg(driver)
        .arg("-o")
        .arg(&program);
    let output = gcc.arg("-lm").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(program).arg(&records).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    println!("{printed}");
    assert!(output.status.success() && printed.contains("results compared"), "{printed}");
}
