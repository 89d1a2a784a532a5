//! Generated C compiles for microcontrollers, calls nothing but arithmetic, and keeps to the rules of MISRA but for those
//! that its README names.

use std::path::{Path, PathBuf};
use std::process::Command;

use energy_compiler::{Interpreted, Precision, Target, sources};
use verify_command::catalogue;

use super::c::{OPTIONS, exists, folder, interpreted};
use super::cover::sufficient;

/// A processor, with the precisions that it computes in hardware.
const PROCESSORS: [(&str, &[Precision]); 2] = [
    ("-mcpu=cortex-m4 -mfpu=fpv4-sp-d16", &[Precision::Single]),
    ("-mcpu=cortex-m7 -mfpu=fpv5-d16", &[Precision::Single, Precision::Double]),
];

/// What the code may call: arithmetic, integers of 64 bits, and copies. Neither memory of the heap nor `errno` is among it,
/// nor are doubles in software.
const CALLED: [&str; 13] = [
    "fma",
    "fmaf",
    "sqrt",
    "sqrtf",
    "round",
    "roundf",
    "memcpy",
    "memset",
    "memmove",
    "__aeabi_ul2f",
    "__aeabi_ul2d",
    "__aeabi_l2f",
    "__aeabi_l2d",
];

fn elements() -> Vec<Interpreted> {
    let all: Vec<Interpreted> = catalogue::elements().iter().map(|entry| interpreted(entry.declaration)).collect();
    sufficient(&all).into_iter().map(|number| all[number].clone()).collect()
}

/// Writes the files of elements, and returns those to compile: loops over vectors need other processors.
fn written(elements: &[Interpreted], precision: Precision, folder: &Path) -> Vec<PathBuf> {
    let files = sources(elements, Target::C, &[precision]).expect("they have C");
    for file in &files {
        std::fs::write(folder.join(&file.name), &file.text).expect("the folder exists");
    }
    let names = files.iter().map(|file| &file.name);
    names.filter(|name| name.ends_with(".c") && !name.ends_with("_lanes.c")).map(|name| folder.join(name)).collect()
}

/// Returns what an object file needs from elsewhere.
fn called(object: &Path) -> Vec<String> {
    let output = Command::new("arm-none-eabi-nm").arg("-u").arg(object).output().expect("it comes with the compiler");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.split_whitespace().filter(|word| *word != "U").map(str::to_owned).collect()
}

#[test]
fn c_compiles_for_microcontrollers() {
    let gcc = "arm-none-eabi-gcc";
    if !exists(gcc) {
        println!("skipped: there is no {gcc}");
        return;
    }
    let elements = elements();
    for (processor, precisions) in PROCESSORS {
        for &precision in precisions {
            let folder = folder(&format!("embedded-{}", precision.name()));
            for file in written(&elements, precision, &folder) {
                let object = file.with_extension("o");
                let mut command = Command::new(gcc);
                command.args(processor.split_whitespace()).args(["-mthumb", "-mfloat-abi=hard", "-std=c99"]);
                // Single precision must not compute in double precision.
                command.args(OPTIONS).args(["-Wdouble-promotion", "-c", "-o"]).arg(&object).arg(&file);
                let output = command.output().expect("it exists");
                let message = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(output.status.success(), "{processor}, {}: {message}", file.display());
                let called = called(&object);
                let other: Vec<&String> = called.iter().filter(|name| !CALLED.contains(&name.as_str())).collect();
                assert!(other.is_empty(), "{processor}, {} calls {other:?}", file.display());
            }
        }
    }
}

/// Returns the rules that the README of a folder says are broken, such as `10.1 to 10.8` or `4.1`.
fn documented(readme: &str) -> Vec<String> {
    let text = readme.split("cppcheck tests").nth(1).expect("the README lists rules");
    let words = text.split_whitespace().map(|word| word.trim_matches(|c: char| !c.is_ascii_digit()));
    let mut rules: Vec<String> = Vec::new();
    let mut is_range = false;
    for (word, whole) in words.zip(text.split_whitespace()) {
        if let (true, Some((chapter, last))) = (is_range, word.split_once('.')) {
            let first = rules.last().and_then(|rule| rule.split_once('.')).expect("a range has a start").1.to_owned();
            let numbers = first.parse::<usize>().expect("a number")..=last.parse::<usize>().expect("a number");
            rules.extend(numbers.map(|number| format!("{chapter}.{number}")));
        } else if word.contains('.') {
            rules.push(word.to_owned());
        }
        is_range = whole == "to";
    }
    rules
}

#[test]
fn c_keeps_to_the_rules_of_misra_that_the_readme_does_not_name() {
    if !exists("cppcheck") {
        println!("skipped: there is no cppcheck");
        return;
    }
    let folder = folder("misra");
    let element = interpreted(catalogue::find("StVK").expect("it is in the library").declaration);
    let files = sources(std::slice::from_ref(&element), Target::C, &[Precision::Double]).expect("it has C");
    let readme = &files.iter().find(|file| file.name == "README.md").expect("folders have one").text;
    let documented = documented(readme);
    assert!(["10.4", "4.1", "20.7"].iter().all(|rule| documented.contains(&(*rule).to_owned())), "{documented:?}");
    let source = written(std::slice::from_ref(&element), Precision::Double, &folder).pop().expect("one file");
    let mut command = Command::new("cppcheck");
    command.args(["--addon=misra", "--std=c99", "--quiet", "--max-configs=4", "--template={id} {file}:{line}"]);
    let output = command.arg(source).output().expect("it exists");
    let findings = String::from_utf8_lossy(&output.stderr).into_owned();
    let rules: Vec<(&str, &str)> =
        findings.lines().filter_map(|line| line.strip_prefix("misra-c2012-")?.split_once(' ')).collect();
    assert!(!rules.is_empty(), "{findings}");
    for (rule, place) in rules {
        assert!(documented.contains(&rule.to_owned()), "rule {rule} at {place} is not in the README");
    }
}
