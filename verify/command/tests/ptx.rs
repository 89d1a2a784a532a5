//! Compilers for CUDA neither contract, reorder nor drop operations: PTX has those of the generated text.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::process::Command;

use energy_compiler::{Budget, Interpreted, Precision, SourceFile, Target, sources};
use verify_command::catalogue;

/// The kernels of the benchmark, with the routine that is counted.
const KERNELS: [(&str, &str); 5] = [
    ("HookeSpring", "reduced_hessian"),
    ("HairBend", "reduced_hessian"),
    ("QuadraticHinge", "reduced_hessian"),
    ("StVK", "reduced_hessian"),
    ("PointToPlane", "jacobian"),
];

/// Functions of the text, with the names of PTX.
const OPERATIONS: [(&str, &str); 6] =
    [("add", "add"), ("sub", "sub"), ("mul", "mul"), ("mul_add", "fma"), ("div", "div"), ("sqrt", "sqrt")];

type Counts = BTreeMap<&'static str, usize>;

/// Returns the compiler that the variable `NVCC` names, or that is in `PATH`.
fn nvcc() -> Option<PathBuf> {
    let named = std::env::var_os("NVCC").map_or_else(|| PathBuf::from("nvcc"), PathBuf::from);
    Command::new(&named).arg("--version").output().is_ok_and(|output| output.status.success()).then_some(named)
}

#[test]
fn ptx_has_the_operations_of_the_plan() {
    let Some(nvcc) = nvcc() else {
        println!("skipped: no nvcc in PATH, and none named by NVCC");
        return;
    };
    let interpreted = |(name, _): (&str, &str)| {
        let entry = catalogue::find(name);
        let text = &entry.expect("the catalogue has it").declaration.source;
        let elements = Interpreted::from_file_with_vertices(text, name, &Budget::default()).expect("it compiles");
        elements.into_iter().next_back().expect("it declares the element")
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ptx");
    std::fs::create_dir_all(&folder).unwrap();
    let files = sources(&KERNELS.map(interpreted), Target::Cuda, &[Precision::Single]).unwrap();
    for file in &files {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
    }
    let sources = files.iter().filter_map(|file| file.name.strip_suffix(".cu"));
    for (name, (element, routine)) in sources.zip(KERNELS) {
        // Fused operations are allowed: intrinsics are not to be contracted.
        let (source, ptx) = (folder.join(format!("{name}.cu")), folder.join(format!("{name}.ptx")));
        let output =
            Command::new(&nvcc).args(["-ptx", "-arch=sm_80"]).arg(source).arg("-o").arg(&ptx).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let ptx = std::fs::read_to_string(ptx).unwrap();
        assert!(!ptx.contains(".f64"), "{element}: double precision");
        let found = instructions(&ptx, &format!("{name}_{routine}_kernel"));
        let expected = operations(&files, name, routine);
        println!("{element}, {routine}: {found:?}");
        assert_eq!(found, expected, "{element}, {routine}");
    }
}

/// Counts the instructions of a kernel. Each is rounded to nearest; sums in memory have no rounding of their own.
fn instructions(ptx: &str, kernel: &str) -> Counts {
    let begin = ptx.find(&format!("{kernel}16")).expect("PTX has the kernel");
    let body = &ptx[begin..];
    let body = &body[..body.find("\n}").expect("the kernel ends")];
    let mut counts = Counts::new();
    for instruction in body.lines().filter_map(|line| line.split_whitespace().find(|word| word.ends_with(".f32"))) {
        let (name, rest) = instruction.split_once('.').expect("it has a type");
        let Some(&(_, name)) = OPERATIONS.iter().find(|(_, of_ptx)| *of_ptx == name) else { continue };
        assert_eq!(rest, "rn.f32", "{instruction}");
        *counts.entry(name).or_default() += 1;
    }
    counts
}

/// Counts the operations of a routine in the generated text. Equal ones with equal operands count once.
fn operations(files: &[SourceFile], element: &str, routine: &str) -> Counts {
    let text = |name: &str| &*files.iter().find(|file| file.name == name).expect("the file was written").text;
    let (shared, own) = (text("energy_f32.h"), text(&format!("{element}.h")));
    let mut values = Values { functions: HashMap::new(), known: HashMap::new(), counts: Counts::new() };
    for (signature, body) in shared.split("\nENERGY_").skip(1).filter_map(|function| function.split_once(" {")) {
        values.functions.insert(function_name(signature), (parameters(signature), statements(body)));
    }
    let functions = || own.split("\nENERGY_").filter_map(|function| function.split_once(" {"));
    let named = |name: String| functions().find(|(signature, _)| function_name(signature) == name);
    let (_, body) = named(format!("{element}_{routine}_if_ordinary"))
        .or_else(|| named(format!("{element}_{routine}")))
        .expect("the routine was written");
    values.run(&statements(body), HashMap::new());
    values.counts
}

/// Returns the last word before the arguments.
fn function_name(signature: &str) -> String {
    let before = signature.split('(').next().unwrap_or_default();
    before.split_whitespace().next_back().unwrap_or_default().to_owned()
}

fn parameters(signature: &str) -> Vec<String> {
    let list = signature.split_once('(').map_or("", |(_, list)| list).trim_end_matches(')');
    list.split(',').map(|parameter| parameter.split([' ', '*']).next_back().unwrap_or_default().to_owned()).collect()
}

/// Returns the statements of a function; empty for those with branches.
fn statements(body: &str) -> Vec<String> {
    let body = body.split("\n}").next().unwrap_or_default();
    let body = if body.contains('\n') { body } else { body.split(" }").next().unwrap_or_default() };
    if body.contains("#if") || body.contains("for (") || body.contains("memcpy") {
        return Vec::new();
    }
    body.split(';').map(|statement| statement.trim().to_owned()).filter(|statement| !statement.is_empty()).collect()
}

/// Value numbering of straight-line code.
struct Values {
    functions: HashMap<String, (Vec<String>, Vec<String>)>,
    /// Numbers of expressions whose operands are numbers.
    known: HashMap<String, usize>,
    counts: Counts,
}

impl Values {
    /// Runs statements; returns the number of the returned value.
    fn run(&mut self, statements: &[String], mut names: HashMap<String, usize>) -> usize {
        for statement in statements {
            if let Some((declared, value)) = statement.strip_prefix("const ").and_then(|text| text.split_once(" = ")) {
                let name = declared.split_whitespace().next_back().unwrap_or_default().to_owned();
                let value = self.value(value, &names);
                names.insert(name, value);
            } else if let Some(value) = statement.strip_prefix("return ").filter(|_| !statement.contains("ENERGY")) {
                return self.value(value, &names);
            }
        }
        0
    }

    /// Returns the number of an expression.
    fn value(&mut self, text: &str, names: &HashMap<String, usize>) -> usize {
        let text = text.trim();
        if let Some(&number) = names.get(text) {
            return number;
        }
        if let Some(operand) = text.strip_prefix('-') {
            let operand = self.value(operand, names);
            return self.number(format!("-#{operand}"));
        }
        let call = text.strip_suffix(')').and_then(|text| text.split_once('('));
        let call = call.filter(|(name, list)| name.starts_with("energy_") && is_balanced(list));
        let Some((function, list)) = call else {
            // Names stand for their values; whatever else there is rounds nothing.
            let words = text.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_'));
            let key = words.map(|word| {
                let name = word.trim_end_matches(|c: char| !(c.is_alphanumeric() || c == '_'));
                names.get(name).map_or_else(|| word.to_owned(), |number| word.replace(name, &format!("#{number}")))
            });
            let has = |(name, _): &(&str, &str)| text.contains(&format!("energy_f32_{name}("));
            assert!(!OPERATIONS.iter().any(has), "operations inside of another expression: {text}");
            return self.number(key.collect());
        };
        let operands: Vec<usize> = arguments(list).iter().map(|operand| self.value(operand, names)).collect();
        let short = function.trim_start_matches("energy_f32_");
        if let Some(&(_, operation)) = OPERATIONS.iter().find(|(name, _)| *name == short) {
            let (before, key) = (self.known.len(), format!("{operation}{operands:?}"));
            let number = self.number(key);
            *self.counts.entry(operation).or_default() += usize::from(self.known.len() > before);
            return number;
        }
        match self.functions.get(function).cloned().filter(|(_, statements)| !statements.is_empty()) {
            Some((parameters, statements)) => self.run(&statements, parameters.into_iter().zip(operands).collect()),
            None => self.number(format!("{short}{operands:?}")),
        }
    }

    fn number(&mut self, key: String) -> usize {
        let next = self.known.len() + 1;
        *self.known.entry(key).or_insert(next)
    }
}

fn is_balanced(list: &str) -> bool {
    let mut depth = 0;
    list.chars().all(|c| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        depth >= 0
    }) && depth == 0
}

/// Splits arguments at the commas outside of brackets.
fn arguments(list: &str) -> Vec<String> {
    let (mut depth, mut all) = (0, vec![String::new()]);
    for c in list.chars() {
        depth += i32::from(c == '(') - i32::from(c == ')');
        match (c, all.last_mut()) {
            (',', _) if depth == 0 => all.push(String::new()),
            (c, Some(last)) => last.push(c),
            (_, None) => {}
        }
    }
    all
}
