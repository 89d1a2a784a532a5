//! Generated C has the bits of the tape, and so of generated Rust: on every reference record, at every degenerate input.

use std::path::{Path, PathBuf};
use std::process::Command;

use energy_compiler::{Budget, Interpreted, Precision, Target, sources};
use energy_dsl::{Flags, Float, Inputs, Kind, Number, RoutineKind};
use verify::sample::{Sample, Sampler};
use verify_command::catalogue;
use verify_command::reference::{Record, mapping};
use verify_command::stress::sweeps;

use super::cover::sufficient;

/// A compiler of C or C++, with the options that all code must compile with.
pub struct Compiler {
    command: Vec<String>,
    level: &'static str,
    /// What runs programs of another processor.
    runner: Option<&'static str>,
}

impl Compiler {
    /// Splits a command at its spaces.
    pub fn new(command: &str) -> Self {
        Self { command: command.split_whitespace().map(str::to_owned).collect(), level: "-O1", runner: None }
    }

    /// Compiles fast. Numbers do not depend on the level of optimisation.
    pub fn unoptimised(self) -> Self {
        Self { level: "-O0", ..self }
    }

    /// Returns the clang that the variable CLANG names, such as `python3 -m ziglang cc`, or that is in `PATH`.
    pub fn clang() -> Self {
        let command = std::env::var("CLANG").unwrap_or_else(|_| "clang".to_owned());
        Self::new(&format!("{command} -std=c99 -march=native"))
    }

    /// Returns gcc for aarch64, whose programs an emulator runs.
    pub fn aarch64() -> Self {
        Self { runner: Some("qemu-aarch64"), ..Self::new("aarch64-linux-gnu-gcc -std=c99 -static") }
    }

    fn exists(&self) -> bool {
        let version = Command::new(&self.command[0]).args(&self.command[1..]).arg("--version").output();
        version.is_ok_and(|output| output.status.success()) && self.runner.is_none_or(exists)
    }
}

pub const OPTIONS: [&str; 7] = ["-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror", "-ffp-contract=off", "-O1"];

/// Returns whether a program can be run.
pub fn exists(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// A float with its bits.
pub trait Bits: Float + Number<Mask = bool> {
    const PRECISION: Precision;
    fn bytes(self) -> Vec<u8>;
    fn read(bytes: &[u8]) -> (Self, &[u8]);
    fn same(self, other: Self) -> bool;
    fn of(value: f64) -> Self;
}

macro_rules! bits {
    ($float:ident, $precision:ident) => {
        impl Bits for $float {
            const PRECISION: Precision = Precision::$precision;
            fn bytes(self) -> Vec<u8> {
                self.to_le_bytes().to_vec()
            }
            fn read(bytes: &[u8]) -> (Self, &[u8]) {
                let (number, rest) = bytes.split_first_chunk().expect("the program writes all results");
                (Self::from_le_bytes(*number), rest)
            }
            fn same(self, other: Self) -> bool {
                self.to_bits() == other.to_bits() || self.is_nan() && other.is_nan()
            }
            fn of(value: f64) -> Self {
                value as Self
            }
        }
    };
}

bits!(f64, Double);
bits!(f32, Single);

/// Ordinary inputs, inputs on a lattice, inputs with zeros, coincidences and extreme sizes, sweeps to every singularity.
pub fn samples(declaration: &energy_dsl::Declaration) -> Vec<Sample> {
    let mut sampler = Sampler::new(declaration, 17);
    let mut list: Vec<Sample> = (0..8).map(|_| sampler.sample()).collect();
    list.extend((0..8).map(|_| sampler.lattice_sample()));
    list.extend((0..16).map(|_| sampler.odd_sample()));
    let mut random = fastrand::Rng::with_seed(17);
    let mut hostiles: Vec<Sample> = (0..24).map(|_| sampler.sample()).collect();
    hostiles.iter_mut().for_each(|sample| hostile(sample, &mut random));
    list.extend(hostiles);
    list.extend(sweeps(declaration).into_iter().flat_map(|sweep| sweep.inputs).map(|(_, sample)| sample));
    list
}

/// Makes inputs singular: points that coincide or are in line, numbers that are 0, of any size, infinite or not numbers.
fn hostile(sample: &mut Sample, random: &mut fastrand::Rng) {
    let points = sample.positions.len() / 3;
    for _ in 0..=random.usize(..2) {
        let (i, j) = (random.usize(..sample.positions.len()), random.usize(..sample.positions.len()));
        // Numbers after the last three that are whole belong to no point.
        let [a, b] = [i, j].map(|number| 3 * (number / 3).min(points.saturating_sub(1)));
        match random.usize(..9) {
            0 | 1 if points > 1 => sample.positions.copy_within(a..a + 3, b),
            2 if points > 2 => {
                let c = random.usize(..points) * 3;
                let weight = [0.5, 2.0, -1.0][random.usize(..3)];
                for axis in 0..3 {
                    let [from, to] = [a, b].map(|point| sample.positions[point + axis]);
                    sample.positions[c + axis] = from + weight * (to - from);
                }
            }
            3 => sample.positions[i] = 0.0,
            4 => sample.positions.iter_mut().for_each(|x| *x *= 1e160),
            5 => sample.positions.iter_mut().for_each(|x| *x *= 1e-170),
            6 => sample.positions[i] = [f64::INFINITY, f64::NAN, 1e300, 5e-324, -0.0][random.usize(..5)],
            7 if !sample.parameters.is_empty() => {
                let number = random.usize(..sample.parameters.len());
                sample.parameters[number] = [0.0, -1.0, 1e200, 1e-200, f64::INFINITY][random.usize(..5)];
            }
            _ => sample.positions.iter_mut().for_each(|x| *x = (*x * 2.0).round() / 2.0),
        }
    }
}

/// The inputs of one element.
pub struct Case<S> {
    pub element: usize,
    parameters: Vec<S>,
    rest: Vec<S>,
    positions: Vec<S>,
    velocities: Vec<S>,
}

impl<S: Bits> Case<S> {
    pub fn new(element: usize, of: &Interpreted, sample: &Sample) -> Self {
        let numbers = |list: &[f64]| list.iter().map(|&x| S::of(x)).collect::<Vec<S>>();
        let mut velocities = numbers(&sample.velocities);
        velocities.resize(of.coordinates(), S::of(0.0));
        let [parameters, rest, positions] =
            [&sample.parameters, &sample.rest, &sample.positions].map(|list| numbers(list));
        Self { element, parameters, rest, positions, velocities }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = u32::try_from(self.element).unwrap().to_le_bytes().to_vec();
        let Self { parameters, rest, positions, velocities, .. } = self;
        bytes.extend([rest, parameters, positions, velocities].into_iter().flatten().flat_map(|x| x.bytes()));
        bytes
    }

    fn inputs(&self) -> Inputs<'_, S> {
        let Self { parameters, rest, positions, velocities, .. } = self;
        Inputs { parameters, rest, positions, velocities }
    }
}

pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Compiles all elements to a program.
fn compiled(compiler: &Compiler, elements: &[Interpreted], precision: Precision, folder: &Path) -> PathBuf {
    let files = sources(elements, Target::C, &[precision]).unwrap();
    let mut all = String::new();
    let mut names = Vec::new();
    for file in &files {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
        if let Some(name) = file.name.strip_suffix(".c").filter(|name| !name.ends_with("_lanes")) {
            all.push_str(&format!("#include \"{}\"\n", file.name));
            names.push(format!("&{name}"));
        }
    }
    let (real, suffix) = match precision {
        Precision::Double => ("double", "f64"),
        Precision::Single => ("float", "f32"),
    };
    all.push_str(&format!(
        "#define REAL {real}\n#define ELEMENT energy_{suffix}_element\n#define energy_arithmetic \
         energy_{suffix}_arithmetic_is_exact\nstatic const ELEMENT *const elements[] = {{{}}};\n",
        names.join(", ")
    ));
    std::fs::write(folder.join("elements.h"), all).unwrap();
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/driver.c");
    let program = folder.join("program");
    let output = Command::new(&compiler.command[0])
        .args(&compiler.command[1..])
        .args(OPTIONS)
        .arg(compiler.level)
        .arg("-I")
        .arg(folder)
        .arg(driver)
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

/// Numbers of compared routines, and of flagged and unsettled elements.
#[derive(Debug, Default)]
pub struct Counts {
    pub routines: usize,
    pub flagged: usize,
    pub unsettled: usize,
}

/// Compares with routines of the tape. `plain` elements lack those of single vertices, which must not change the others.
fn compare<S: Bits>(elements: &[Interpreted], plain: &[Interpreted], cases: &[Case<S>], mut found: &[u8]) -> Counts {
    let mut counts = Counts::default();
    let flags = |found: &mut &[u8]| {
        let (flags, rest) = found.split_first_chunk().expect("the program writes all flags");
        *found = rest;
        u32::from_le_bytes(*flags)
    };
    for case in cases {
        let element = &elements[case.element];
        let name = &*element.declaration().name;
        let is_degenerate = flags(&mut found) != 0;
        let expected = element.evaluate(&case.inputs());
        assert_eq!(expected.is_err(), is_degenerate, "{name}: the rest shape");
        if is_degenerate {
            continue;
        }
        let vertices = (0..u8::MAX).map(RoutineKind::Vertex).take(element.coordinates() / 3);
        for kind in RoutineKind::ALL.into_iter().skip(1).chain(vertices) {
            let of = if matches!(kind, RoutineKind::Vertex(_)) { element } else { &plain[case.element] };
            let Some((groups, expected)) = of.routine::<S>(kind.name(), &case.inputs()).unwrap() else { continue };
            let flags = flags(&mut found);
            let Flags { degenerate, kink } = expected;
            let is_unsettled = flags & 4 != 0;
            counts.routines += 1;
            counts.flagged += usize::from(flags != 0);
            counts.unsettled += usize::from(is_unsettled);
            let place = format!("{name}, {}: positions {:?}", kind.name(), case.positions);
            assert!(is_unsettled || (flags & 1 != 0, flags & 2 != 0) == (degenerate, kink), "{place}: flags {flags}");
            for (number, expected) in groups.concat().into_iter().enumerate() {
                let (result, rest) = S::read(found);
                found = rest;
                assert!(
                    is_unsettled || result.same(expected),
                    "{place}, number {number}: {result:?} for {expected:?}, parameters {:?}, rest {:?}",
                    case.parameters,
                    case.rest
                );
            }
        }
    }
    assert!(found.is_empty());
    counts
}

pub fn interpreted(declaration: &energy_dsl::Declaration) -> Interpreted {
    let text = &declaration.source;
    let elements = Interpreted::from_file_with_vertices(text, "element", &Budget::default()).expect("it compiles");
    elements.into_iter().next_back().expect("it declares the element")
}

/// All samples of all elements, and all reference records.
fn cases<S: Bits>(elements: &[Interpreted]) -> Vec<Case<S>> {
    let mut cases = Vec::new();
    for (number, entry) in catalogue::elements().iter().enumerate() {
        cases.extend(samples(entry.declaration).iter().map(|sample| Case::new(number, &elements[number], sample)));
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/potentials");
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let file: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let Some(mapping) = file["potential"].as_str().and_then(mapping) else { continue };
        let declared = &mapping.entry.declaration.name;
        let number = catalogue::elements().iter().position(|entry| entry.declaration.name == *declared).unwrap();
        for record in file["records"].as_array().unwrap() {
            let record: Record = serde_json::from_value(record.clone()).unwrap();
            cases.push(Case::new(number, &elements[number], &record.sample(&mapping).unwrap()));
        }
    }
    cases
}

/// Elements to compare, with and without routines of single vertices, and inputs for them.
pub struct Suite<S> {
    pub elements: Vec<Interpreted>,
    pub plain: Vec<Interpreted>,
    pub cases: Vec<Case<S>>,
}

impl<S: Bits> Suite<S> {
    /// Returns all elements of points of the library, and all residuals.
    pub fn of_points() -> Self {
        let all = catalogue::elements();
        let elements: Vec<Interpreted> = all.iter().map(|entry| interpreted(entry.declaration)).collect();
        let plain = |entry: &energy_dsl::AnyElement| {
            Interpreted::from_source(&entry.declaration.source).unwrap().pop().unwrap()
        };
        Self { plain: all.iter().map(plain).collect(), cases: cases(&elements), elements }
    }

    /// Returns elements that have all operations of all of them.
    pub fn sufficient(self) -> Self {
        let chosen = sufficient(&self.elements);
        self.only(&chosen)
    }

    /// Returns the chosen elements, renumbered from 0.
    pub fn only(self, chosen: &[usize]) -> Self {
        let of = |elements: &[Interpreted]| chosen.iter().map(|&number| elements[number].clone()).collect();
        let renumbered = |case: Case<S>| {
            let element = chosen.iter().position(|&number| number == case.element)?;
            Some(Case { element, ..case })
        };
        let Self { elements, plain, cases } = self;
        Self { elements: of(&elements), plain: of(&plain), cases: cases.into_iter().filter_map(renumbered).collect() }
    }
}

/// Compares all elements of a suite; `None` without this compiler.
pub fn check<S: Bits>(compiler: &Compiler, name: &str, suite: impl FnOnce() -> Suite<S>) -> Option<Counts> {
    if !compiler.exists() {
        println!("skipped: there is no {} {}", compiler.command[0], compiler.runner.unwrap_or_default());
        return None;
    }
    if energy_dsl::level() == energy_dsl::LevelName::Baseline && cfg!(target_arch = "x86_64") {
        println!("skipped: this processor has no fused operations");
        return None;
    }
    let Suite { elements, plain, cases } = suite();
    let folder = folder(name);
    let program = compiled(compiler, &elements, S::PRECISION, &folder);
    let records = folder.join("records");
    std::fs::write(&records, cases.iter().flat_map(Case::bytes).collect::<Vec<u8>>()).unwrap();
    let output = match compiler.runner {
        Some(runner) => Command::new(runner).arg(program).arg(&records).output(),
        None => Command::new(program).arg(&records).output(),
    };
    let output = output.unwrap();
    assert!(output.status.success(), "{}", output.status);
    let counts = compare(&elements, &plain, &cases, &output.stdout);
    println!("{name}: {} inputs, {counts:?}", cases.len());
    assert!(counts.unsettled * 4 < counts.routines, "{counts:?}");
    Some(counts)
}

#[test]
fn c_has_the_bits_of_rust() {
    let counts = check::<f64>(&Compiler::new("gcc -std=c99"), "c-f64", Suite::of_points);
    assert!(counts.is_none_or(|counts| counts.routines > 10_000));
    assert!(catalogue::elements().iter().any(|entry| entry.declaration.kind == Kind::Residual));
}

#[test]
fn c_in_single_precision_has_the_bits_of_rust() {
    check::<f32>(&Compiler::new("gcc -std=c99"), "c-f32", || Suite::of_points().sufficient());
}

#[test]
fn c_by_clang_has_the_bits_of_rust() {
    check::<f64>(&Compiler::clang(), "c-clang-f64", || Suite::of_points().sufficient());
}

#[test]
fn c_for_aarch64_has_the_bits_of_rust() {
    check::<f64>(&Compiler::aarch64(), "c-aarch64-f64", || Suite::of_points().sufficient());
    check::<f32>(&Compiler::aarch64(), "c-aarch64-f32", || Suite::of_points().sufficient());
}

/// Projected Hessians are the nearest positive semi-definite matrices: Q max(Λ, 0) Qᵀ of nalgebra's decomposition.
/// Both methods are backward stable, so they differ by some n u ‖H‖; 100 u ‖H‖ (Frobenius) is allowed, with u = 2⁻⁵³.
#[test]
fn projected_hessians_are_the_nearest_semi_definite_ones() {
    const NAMES: [&str; 2] = ["QuadraticHinge", "StVK"];
    if !exists("gcc") {
        println!("skipped: there is no gcc");
        return;
    }
    let of_name = |name: &str| {
        let entry = catalogue::elements().iter().find(|entry| entry.declaration.name == name);
        interpreted(entry.expect("the catalogue has it").declaration)
    };
    let elements = NAMES.map(of_name);
    let folder = folder("projected");
    let mut text = String::new();
    for file in sources(&elements, Target::C, &[Precision::Double]).unwrap() {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
        if file.name.ends_with(".h") && !file.is_shared {
            text.push_str(&format!("#include \"{}\"\n", file.name));
        }
    }
    std::fs::write(folder.join("elements.h"), text).unwrap();
    let program = folder.join("program");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/projected.c");
    let mut gcc = Command::new("gcc");
    gcc.arg("-std=c99").args(OPTIONS).arg("-I").arg(&folder).arg(source).arg("-o").arg(&program).arg("-lm");
    let output = gcc.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut random = fastrand::Rng::with_seed(23);
    let mut bytes = Vec::new();
    let numbers: Vec<usize> = (0..400).map(|i| i % 2).collect();
    for &number in &numbers {
        let mut uniform = |count: usize| (0..count).map(|_| 2.0 * random.f64() - 1.0).collect::<Vec<f64>>();
        // Rest triangles around (0, 0), (1, 0), (0, 1); points anywhere, so that triangles are often compressed.
        let corners = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
        let rest: Vec<f64> = uniform(6).iter().zip(corners).map(|(x, corner)| corner + 0.2 * x).collect();
        let parameters: Vec<f64> = uniform(2).iter().map(|x| 1.5 + x).collect();
        let positions = uniform(if number == 0 { 12 } else { 9 });
        bytes.extend(u32::try_from(number).unwrap().to_le_bytes());
        let inputs = rest[..if number == 0 { 0 } else { 6 }].iter().chain(&parameters).chain(&positions);
        bytes.extend(inputs.flat_map(|x| x.to_le_bytes()));
    }
    let records = folder.join("records");
    std::fs::write(&records, bytes).unwrap();
    let output = Command::new(program).arg(&records).output().unwrap();
    assert!(output.status.success(), "{}", output.status);
    let mut found = output.stdout.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
    let (mut indefinite, mut largest) = ([0; 2], 0.0_f64);
    for &number in &numbers {
        let n = if number == 0 { 12 } else { 9 };
        let mut matrix = || nalgebra::DMatrix::from_iterator(n, n, found.by_ref().take(n * n));
        let (hessian, projected) = (matrix(), matrix());
        assert_eq!(projected, projected.transpose());
        let decomposition = hessian.clone().symmetric_eigen();
        indefinite[number] += usize::from(decomposition.eigenvalues.min() < -1e-3 * hessian.norm());
        let clamped = nalgebra::DMatrix::from_diagonal(&decomposition.eigenvalues.map(|value| value.max(0.0)));
        let nearest = &decomposition.eigenvectors * clamped * decomposition.eigenvectors.transpose();
        largest = largest.max((projected - nearest).norm() / (hessian.norm() * f64::EPSILON / 2.0));
    }
    println!("{indefinite:?} of {NAMES:?} are indefinite; the largest difference is {largest:.0} u ‖H‖");
    assert!(found.next().is_none() && indefinite.iter().all(|&count| count > 50), "{indefinite:?}");
    assert!(largest < 100.0, "{largest} u");
}

/// What is compared with single elements, beside loops over one element at a time.
#[derive(Clone, Copy, PartialEq)]
pub enum Loops {
    /// Loops over vectors of elements.
    InLanes,
    /// Kernels of CUDA, which run on the host.
    Kernels,
}

/// Returns a line of CUDA as C++, where it launches a kernel.
fn launched_on_host(line: &str) -> String {
    match line.trim().split_once("<<<blocks, threads, 0, stream>>>") {
        Some((kernel, batch)) => {
            format!("        run_on_host({kernel}, blocks, threads, stream, {}", batch.trim_start_matches('('))
        }
        None => line.to_owned(),
    }
}

/// What compilers of C++ need to run generated CUDA.
pub fn cuda_on_host() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cuda_on_host.h")
}

/// Loops over elements, one at a time and in vectors, have the bits of single calls. Every fifth element suffices: the
/// loops are the same for all.
#[test]
fn loops_have_the_bits_of_single_elements() {
    loops::<f64>("loops-f64", 0, Loops::InLanes);
    loops::<f32>("loops-f32", 3, Loops::InLanes);
}

pub fn loops<S: Bits>(name: &str, first: usize, of: Loops) {
    let command: &[&str] = match of {
        Loops::InLanes => &["gcc", "-std=c99", "-march=native"],
        Loops::Kernels => &["g++", "-std=c++17", "-march=native", "-x", "c++", "-Wno-unused-function", "-include"],
    };
    if !exists(command[0]) {
        println!("skipped: there is no {}", command[0]);
        return;
    }
    let all = Suite::<S>::of_points();
    let chosen: Vec<usize> = (first..all.elements.len()).step_by(5).collect();
    let Suite { elements, cases, .. } = all.only(&chosen);
    let folder = folder(name);
    let records = folder.join("records");
    std::fs::write(&records, cases.iter().flat_map(Case::bytes).collect::<Vec<u8>>()).unwrap();
    let (real, suffix) = (if S::PRECISION == Precision::Double { "double" } else { "float" }, S::PRECISION.name());
    let mut text = String::new();
    let mut names = Vec::new();
    let target = if of == Loops::Kernels { Target::Cuda } else { Target::C };
    for file in sources(&elements, target, &[S::PRECISION]).unwrap() {
        let lines: Vec<String> = file.text.lines().map(launched_on_host).collect();
        std::fs::write(folder.join(&file.name), lines.join("\n") + "\n").unwrap();
        let (stem, ending) = file.name.rsplit_once('.').unwrap_or_default();
        let is_lanes = stem.ends_with("_lanes");
        if ending == "cu" || ending == "c" && (of == Loops::InLanes || !is_lanes) {
            text.push_str(&format!("#include \"{}\"\n", file.name));
            names.extend((ending == "c" && !is_lanes).then(|| stem.to_owned()));
        }
    }
    let list = |before: &str, after: &str| {
        names.iter().map(|name| format!("{before}{name}{after}")).collect::<Vec<_>>().join(", ")
    };
    text.push_str(&format!(
        "#define REAL {real}\n#define ELEMENT energy_{suffix}_element\n#define COLUMN energy_{suffix}_column\n#define BATCH \
         energy_{suffix}_batch\nstatic const ELEMENT *const elements[] = {{{}}};\ntypedef void loop(int32_t, BATCH \
         *);\nstatic loop *const plain[] = {{{}}};\n",
        list("&", ""),
        list("", "_evaluate"),
    ));
    let others = match of {
        Loops::InLanes => list("", "_evaluate_lanes"),
        Loops::Kernels => list("[](int32_t routine, BATCH *batch) { launched(", "_launch, routine, batch); }"),
    };
    text.push_str(&format!("static loop *const in_lanes[] = {{{others}}};\n"));
    std::fs::write(folder.join("elements.h"), text).unwrap();
    let program = folder.join("loops");
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/loops.c");
    let mut compile = Command::new(command[0]);
    compile.args(&command[1..]);
    if of == Loops::Kernels {
        compile.arg(cuda_on_host());
    }
    let output = compile.args(OPTIONS).args(["-O0", "-I"]).arg(&folder).arg(driver).arg("-o").arg(&program).arg("-lm");
    let output = output.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(program).arg(&records).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    println!("{printed}");
    assert!(output.status.success() && printed.contains("results compared"), "{printed}");
}
