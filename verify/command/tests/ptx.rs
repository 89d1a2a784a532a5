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

/// Functions of the text, with the names of PTX. Compilers take x + (−y) and x − y for each other.
const OPERATIONS: [(&str, &str); 6] =
    [("add", "add"), ("sub", "add"), ("mul", "mul"), ("mul_add", "fma"), ("div", "div"), ("sqrt", "sqrt")];

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
    let elements = KERNELS.map(|(name, _)| interpreted(name));
    let generated = Generated::new("ptx", &elements, Precision::Single);
    for (name, (element, routine)) in generated.names.iter().zip(KERNELS) {
        let ptx = generated.ptx(&nvcc, name);
        let Counted { found, expected, .. } = generated.counts(name, routine, &ptx);
        println!("{element}, {routine}: {found:?}");
        assert_eq!(found, expected, "{element}, {routine}");
    }
}

/// All routines of all elements, with points and with any unknowns, in both precisions.
#[test]
#[ignore = "takes minutes"]
fn ptx_of_all_elements_has_the_operations_of_the_plan() {
    let Some(nvcc) = nvcc() else {
        println!("skipped: no nvcc in PATH, and none named by NVCC");
        return;
    };
    let named = catalogue::elements().iter().map(|entry| interpreted(&entry.declaration.name));
    let text = include_str!("../../tests/unknowns.energy");
    let mixed = Interpreted::from_file(text, "unknowns.energy").expect("it compiles");
    let elements: Vec<Interpreted> = named.chain(mixed).collect();
    for precision in [Precision::Single, Precision::Double] {
        let generated = Generated::new(&format!("ptx-all-{}", precision.name()), &elements, precision);
        let (mut equal, mut repeated, mut different) = (0, 0, Vec::new());
        for name in &generated.names {
            let ptx = generated.ptx(&nvcc, name);
            for routine in generated.routines(name) {
                let Counted { found, expected, has_branches } = generated.counts(name, &routine, &ptx);
                // Code after a branch may be compiled once for each side.
                let has_all = expected.iter().all(|(name, count)| found.get(name).is_some_and(|found| found >= count));
                if found == expected {
                    equal += 1;
                } else if has_branches && has_all {
                    repeated += 1;
                } else {
                    different.push(format!("{name}_{routine}: {found:?}, text {expected:?}"));
                }
            }
        }
        let others = different.len();
        println!("{}: {equal} routines equal, {repeated} repeat operations, {others} others", precision.name());
        assert!(different.is_empty() && equal > 10 * repeated, "{different:#?}");
    }
}

/// Generated CUDA in one precision, in a folder.
struct Generated {
    folder: PathBuf,
    precision: Precision,
    files: Vec<SourceFile>,
    /// Elements, as files name them.
    names: Vec<String>,
}

impl Generated {
    fn new(name: &str, elements: &[Interpreted], precision: Precision) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let files = sources(elements, Target::Cuda, &[precision]).unwrap();
        for file in &files {
            std::fs::write(folder.join(&file.name), &file.text).unwrap();
        }
        let names = files.iter().filter_map(|file| Some(file.name.strip_suffix(".cu")?.to_owned())).collect();
        Self { folder, precision, files, names }
    }

    fn text(&self, name: &str) -> &str {
        &self.files.iter().find(|file| file.name == name).expect("the file was written").text
    }

    /// Compiles an element. Fused operations are allowed: intrinsics are not to be contracted.
    fn ptx(&self, nvcc: &Path, element: &str) -> String {
        let [source, ptx] = ["cu", "ptx"].map(|ending| self.folder.join(format!("{element}.{ending}")));
        let mut command = Command::new(nvcc);
        command.args(["-ptx", "-Werror", "all-warnings", "-arch=sm_80"]);
        let output = command.arg(source).arg("-o").arg(&ptx).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let ptx = std::fs::read_to_string(ptx).unwrap();
        assert!(self.precision == Precision::Double || !ptx.contains(".f64"), "{element}: double precision");
        ptx
    }

    /// Routines that have a kernel and compute in its ordinary part.
    fn routines(&self, element: &str) -> Vec<String> {
        let kernels = self.text(&format!("{element}.cu"));
        let named = kernels.split("__global__ void ").skip(1).filter_map(|text| text.split_once("_kernel("));
        let routines = named.filter_map(|(name, _)| name.strip_prefix(element)?.strip_prefix('_'));
        // These have no statements of their own: they expand, project or choose what others compute.
        let wrapped = |routine: &str| {
            routine == "projected_hessian"
                || routine == "vertex"
                || routine == "hessian" && kernels.contains("reduced_hessian_kernel")
        };
        routines.filter(|routine| !wrapped(routine)).map(str::to_owned).collect()
    }

    fn counts(&self, element: &str, routine: &str, ptx: &str) -> Counted {
        let found = instructions(ptx, &format!("{element}_{routine}_kernel"), self.precision.name());
        let Values { counts: expected, has_branches, .. } = operations(self, element, routine);
        Counted { found, expected, has_branches }
    }
}

/// Operations of a kernel in PTX and in the text, and whether the text has branches: sines of huge arguments, loops.
struct Counted {
    found: Counts,
    expected: Counts,
    has_branches: bool,
}

/// The kernels of the book compile without warnings. Those for RXMesh need its headers and their dependencies, in the
/// folders that `RXMESH_INCLUDE` lists.
#[test]
fn kernels_of_the_book_compile() {
    let Some(nvcc) = nvcc() else {
        println!("skipped: no nvcc in PATH, and none named by NVCC");
        return;
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ptx-book");
    std::fs::create_dir_all(&folder).unwrap();
    let elements = ["HookeSpring", "QuadraticHinge"].map(interpreted);
    for file in sources(&elements, Target::Cuda, &[Precision::Single]).unwrap() {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
    }
    let chapter = include_str!("../../../docs/book/from-cuda.md");
    let blocks: Vec<&str> =
        chapter.split("```cuda\n").skip(1).map(|text| text.split("```").next().unwrap_or_default()).collect();
    let [launch, vectors, accessors, rxmesh] = blocks[..] else { panic!("{} blocks", blocks.len()) };
    let compile = |name: &str, text: &str, flags: &[&str]| {
        let (source, ptx) = (folder.join(format!("{name}.cu")), folder.join(format!("{name}.ptx")));
        std::fs::write(&source, text).unwrap();
        let mut command = Command::new(&nvcc);
        command.args(["-std=c++17", "-ptx", "-arch=sm_80"]).args(flags).arg("-I").arg(&folder);
        let output = command.arg(&source).arg("-o").arg(ptx).output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    };
    for (name, text) in [("launch", launch), ("vectors", vectors), ("accessors", accessors)] {
        compile(name, text, &["-Werror", "all-warnings"]);
    }
    let Some(folders) = std::env::var_os("RXMESH_INCLUDE") else {
        println!("skipped: RXMESH_INCLUDE does not name folders with headers of RXMesh");
        return;
    };
    let include: Vec<String> =
        std::env::split_paths(&folders).map(|folder| format!("-I{}", folder.display())).collect();
    let rates = ["-DclockRate=multiProcessorCount", "-DmemoryClockRate=memoryBusWidth"];
    let flags = ["--expt-extended-lambda", "--expt-relaxed-constexpr"].into_iter().chain(rates);
    let flags: Vec<&str> = flags.chain(include.iter().map(String::as_str)).collect();
    let wrapper = accessors.split("/* Stand-ins").next().unwrap_or_default();
    compile("rxmesh", &format!("{wrapper}{rxmesh}"), &flags);
}

fn interpreted(name: &str) -> Interpreted {
    let text = &catalogue::find(name).expect("the catalogue has it").declaration.source;
    let elements = Interpreted::from_file_with_vertices(text, name, &Budget::default()).expect("it compiles");
    elements.into_iter().next_back().expect("it declares the element")
}

/// Counts the instructions of a kernel. Each is rounded to nearest; sums in memory have no rounding of their own.
fn instructions(ptx: &str, kernel: &str, of_type: &str) -> Counts {
    // The name goes on with the length and the name of the argument's type.
    let begin = ["16energy", "22energy"].iter().find_map(|argument| ptx.find(&format!("{kernel}{argument}")));
    let body = &ptx[begin.expect("PTX has the kernel")..];
    let body = &body[..body.find("\n}").expect("the kernel ends")];
    let mut counts = Counts::new();
    let ending = format!(".{of_type}");
    for instruction in body.lines().filter_map(|line| line.split_whitespace().find(|word| word.ends_with(&ending))) {
        let (name, rest) = instruction.split_once('.').expect("it has a type");
        // 1 / x is a reciprocal in double precision, with the same rounding.
        let name = match name {
            "sub" => "add",
            "rcp" => "div",
            other => other,
        };
        let Some(&(_, name)) = OPERATIONS.iter().find(|(_, of_ptx)| *of_ptx == name) else { continue };
        assert_eq!(rest, format!("rn.{of_type}"), "{instruction}");
        *counts.entry(name).or_default() += 1;
    }
    counts
}

/// Counts the operations of a routine in the generated text. Equal ones with equal operands count once.
fn operations(generated: &Generated, element: &str, routine: &str) -> Values {
    let prefix = format!("energy_{}", generated.precision.name());
    let (shared, own) = (generated.text(&format!("{prefix}.h")), generated.text(&format!("{element}.h")));
    let mut values = Values { prefix: format!("{prefix}_"), ..Values::default() };
    for (signature, body) in shared.split("\nENERGY_").skip(1).filter_map(|function| function.split_once(" {")) {
        let body = body.split("\n}").next().unwrap_or_default();
        let has_branches = ["if (", "for (", "? energy_"].iter().any(|branch| body.contains(branch));
        let function = Function { parameters: parameters(signature), statements: statements(body), has_branches };
        values.functions.insert(function_name(signature), function);
    }
    let functions = || own.split("\nENERGY_").filter_map(|function| function.split_once(" {"));
    let named = |name: String| functions().find(|(signature, _)| function_name(signature) == name);
    let (_, body) = named(format!("{element}_{routine}_if_ordinary"))
        .or_else(|| named(format!("{element}_{routine}")))
        .expect("the routine was written");
    values.has_branches = body.split("\n}").next().is_some_and(|body| body.contains("for ("));
    values.run(&statements(body), HashMap::new());
    values
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
    let statements = without_comments(body);
    let statements = statements.split(';').map(|statement| statement.trim().to_owned());
    statements.filter(|statement| !statement.is_empty()).collect()
}

fn without_comments(text: &str) -> String {
    text.split("/*")
        .enumerate()
        .map(|(i, part)| if i == 0 { part } else { part.split_once("*/").map_or("", |p| p.1) })
        .collect()
}

/// A function of the shared header.
#[derive(Clone)]
struct Function {
    parameters: Vec<String>,
    statements: Vec<String>,
    has_branches: bool,
}

/// Value numbering of straight-line code.
#[derive(Default)]
struct Values {
    /// Prefix of the names of functions.
    prefix: String,
    functions: HashMap<String, Function>,
    /// Numbers of expressions whose operands are numbers.
    known: HashMap<String, usize>,
    counts: Counts,
    has_branches: bool,
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
            let has = |(name, _): &(&str, &str)| text.contains(&format!("{}{name}(", self.prefix));
            assert!(!OPERATIONS.iter().any(has), "operations inside of another expression: {text}");
            return self.number(key.collect());
        };
        let operands: Vec<usize> = arguments(list).iter().map(|operand| self.value(operand, names)).collect();
        let short = function.trim_start_matches(self.prefix.as_str());
        if let Some(&(_, operation)) = OPERATIONS.iter().find(|(name, _)| *name == short) {
            let (before, key) = (self.known.len(), format!("{short}{operands:?}"));
            let number = self.number(key);
            *self.counts.entry(operation).or_default() += usize::from(self.known.len() > before);
            return number;
        }
        let function = self.functions.get(function).cloned();
        self.has_branches |= function.as_ref().is_some_and(|function| function.has_branches);
        match function.filter(|function| !function.statements.is_empty()) {
            Some(Function { parameters, statements, .. }) => {
                self.run(&statements, parameters.into_iter().zip(operands).collect())
            }
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
