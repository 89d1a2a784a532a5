//! Generated functions for Warp have the bits of the tape on Warp's CPU; their adjoints are the generated derivatives.
//!
//! Needs a Python that imports `warp`: `python3`, or the one that WARP_PYTHON names. Tests are skipped without one.

use std::path::{Path, PathBuf};
use std::process::Command;

use energy_compiler::{Budget, Interpreted, Precision, Target, sources};
use energy_dsl::{Declaration, Float, Inputs, Number, triangle_index};
use verify::sample::{Sample, Sampler};
use verify_command::catalogue;
use verify_command::stress::sweeps;

use super::cover::sufficient;

/// A float with its bits.
trait Bits: Float + Number<Mask = bool> {
    const PRECISION: Precision;
    fn of(value: f64) -> Self;
    fn bytes(self) -> Vec<u8>;
    fn read(bytes: &[u8]) -> Vec<Self>;
    fn same(self, other: Self) -> bool;
}

macro_rules! bits {
    ($float:ident, $precision:ident) => {
        impl Bits for $float {
            const PRECISION: Precision = Precision::$precision;
            fn of(value: f64) -> Self {
                value as Self
            }
            fn bytes(self) -> Vec<u8> {
                self.to_le_bytes().to_vec()
            }
            fn read(bytes: &[u8]) -> Vec<Self> {
                bytes.as_chunks().0.iter().map(|&number| Self::from_le_bytes(number)).collect()
            }
            fn same(self, other: Self) -> bool {
                self.to_bits() == other.to_bits() || self.is_nan() && other.is_nan()
            }
        }
    };
}

bits!(f64, Double);
bits!(f32, Single);

/// Returns a Python that has Warp; otherwise prints why the test is skipped.
fn python() -> Option<String> {
    let program = std::env::var("WARP_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&program).args(["-c", "import warp"]).output();
    if found.is_ok_and(|output| output.status.success()) {
        return Some(program);
    }
    println!("skipped: {program} does not import warp; install warp-lang, or set WARP_PYTHON");
    None
}

fn has_fused_operations() -> bool {
    let has = energy_dsl::level() != energy_dsl::LevelName::Baseline || !cfg!(target_arch = "x86_64");
    if !has {
        println!("skipped: this processor has no fused operations");
    }
    has
}

/// Returns an empty folder with the generated module.
fn folder(name: &str, elements: &[Interpreted], precision: Precision) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for file in sources(elements, Target::Warp, &[precision]).unwrap() {
        std::fs::write(folder.join(&file.name), &file.text).unwrap();
    }
    folder
}

/// Runs a program with the generated module; its output is shown if it fails.
fn run(python: &str, program: &Path, folder: &Path) -> String {
    let cache = folder.join("cache");
    let mut command = Command::new(python);
    command.arg(program).arg(folder).env("PYTHONPATH", folder).env("WARP_CACHE_PATH", cache).current_dir(folder);
    let output = command.env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

fn interpreted(declaration: &Declaration) -> Interpreted {
    let elements = Interpreted::from_file_with_vertices(&declaration.source, "element", &Budget::default());
    elements.expect("it compiles").into_iter().next_back().expect("it declares the element")
}

/// Ordinary inputs, inputs on a lattice, inputs with coincidences and extreme sizes, sweeps to every singularity.
fn samples(declaration: &Declaration) -> Vec<Sample> {
    let mut sampler = Sampler::new(declaration, 23);
    let mut list: Vec<Sample> = (0..6).map(|_| sampler.sample()).collect();
    list.extend((0..6).map(|_| sampler.lattice_sample()));
    list.extend((0..16).map(|_| sampler.odd_sample()));
    list.extend(sweeps(declaration).into_iter().flat_map(|sweep| sweep.inputs).map(|(_, sample)| sample));
    list
}

/// The inputs of an element.
struct Case<S> {
    parameters: Vec<S>,
    rest: Vec<S>,
    positions: Vec<S>,
    velocities: Vec<S>,
}

impl<S: Bits> Case<S> {
    fn new(of: &Interpreted, sample: &Sample) -> Self {
        let numbers = |list: &[f64]| list.iter().map(|&x| S::of(x)).collect::<Vec<S>>();
        let mut velocities = numbers(&sample.velocities);
        velocities.resize(of.coordinates(), S::of(0.0));
        let [parameters, rest, positions] =
            [&sample.parameters, &sample.rest, &sample.positions].map(|list| numbers(list));
        Self { parameters, rest, positions, velocities }
    }

    fn inputs(&self) -> Inputs<'_, S> {
        let Self { parameters, rest, positions, velocities, .. } = self;
        Inputs { parameters, rest, positions, velocities }
    }

    fn bytes(&self) -> Vec<u8> {
        let Self { parameters, rest, positions, velocities } = self;
        [positions, velocities, parameters, rest].into_iter().flatten().flat_map(|x| x.bytes()).collect()
    }
}

/// Results of a routine for all inputs: a table of numbers, and flags if the routine returns them.
struct Found<S> {
    numbers: Vec<S>,
    flags: Vec<u32>,
}

impl<S: Bits> Found<S> {
    /// Reads what the driver wrote; `None` if the module lacks the function.
    fn read(folder: &Path, name: &str) -> Option<Self> {
        let numbers = std::fs::read(folder.join(format!("{name}.numbers"))).ok()?;
        let flags = std::fs::read(folder.join(format!("{name}.flags"))).unwrap_or_default();
        let flags = flags.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
        Some(Self { numbers: S::read(&numbers), flags })
    }

    fn row(&self, number: usize, count: usize) -> &[S] {
        let size = self.numbers.len() / count;
        &self.numbers[number * size..][..size]
    }
}

/// Returns the numbers that a function of Warp returns or writes, from the groups of the Rust routine.
fn expected<S: Copy>(routine: &str, groups: &[Vec<S>], declaration: &Declaration) -> Vec<S> {
    let (points, n) = (declaration.points.len(), declaration.increments());
    match routine {
        "gradient" | "hessian_vector" | "force" | "residual" | "value" => groups[groups.len() - 1].clone(),
        "hessian" | "gauss_newton" if declaration.is_mixed() => {
            let number = |place: usize| triangle_index(n, (place / n).min(place % n), (place / n).max(place % n));
            groups[1].iter().copied().chain((0..n * n).map(|place| groups[2][number(place)])).collect()
        }
        "hessian" | "gauss_newton" => {
            let block = |i: usize, j: usize| &groups[2][9 * (i * points - i * (i + 1) / 2 + j)..][..9];
            let all = (0..points * points).flat_map(|place| {
                let (i, j) = (place / points, place % points);
                (0..9).map(move |k| if i <= j { block(i, j)[k] } else { block(j, i)[k % 3 * 3 + k / 3] })
            });
            groups[1].iter().copied().chain(all).collect()
        }
        _ if routine.starts_with("vertex_") => groups[1..].concat(),
        _ => groups.concat(),
    }
}

const ROUTINES: [&str; 16] = [
    "value",
    "gradient",
    "hessian_vector",
    "hessian",
    "force",
    "jacobians",
    "residual",
    "jacobian",
    "vertex_0",
    "vertex_1",
    "vertex_2",
    "vertex_3",
    "gauss_newton",
    "next",
    "next_jacobians",
    "state_jacobian",
];

/// Compares an element with the tape. Returns the numbers of results that were compared, and of those left to rays.
fn compare<S: Bits>(element: &Interpreted, name: &str, cases: &[Case<S>], folder: &Path) -> (usize, usize) {
    let (mut compared, mut left) = (0, 0);
    let rest = Found::<S>::read(folder, &format!("{name}_rest"));
    let flags = Found::<S>::read(folder, &format!("{name}_flags")).expect("every element has flags");
    for routine in ROUTINES {
        let Some(found) = Found::<S>::read(folder, &format!("{name}_{routine}")) else { continue };
        for (number, case) in cases.iter().enumerate() {
            let is_degenerate = element.evaluate(&case.inputs()).is_err();
            if let Some(rest) = &rest {
                assert_eq!(rest.flags[number] != 0, is_degenerate, "{name}: the rest shape of input {number}");
            }
            if is_degenerate {
                continue;
            }
            let (groups, wanted) = element.routine::<S>(routine, &case.inputs()).unwrap().expect("it has the routine");
            let own = found.flags.get(number).copied();
            if own.unwrap_or(flags.flags[number]) & 4 != 0 {
                left += 1;
                continue;
            }
            if let Some(own) = own {
                assert_eq!((own & 1 != 0, own & 2 != 0), (wanted.degenerate, wanted.kink), "{name}, {routine}: flags");
            }
            for (place, (&is, wanted)) in
                found.row(number, cases.len()).iter().zip(expected(routine, &groups, element.declaration())).enumerate()
            {
                let input = (&case.positions, &case.parameters, &case.rest);
                assert!(is.same(wanted), "{name}, {routine}, number {place}: {is:?} for {wanted:?} at {input:?}");
                compared += 1;
            }
        }
    }
    (compared, left)
}

/// Compares elements. Returns how many numbers were compared; `None` without Warp.
fn check<S: Bits>(name: &str, elements: impl FnOnce() -> Vec<Interpreted>) -> Option<usize> {
    let python = python().filter(|_| has_fused_operations())?;
    let elements = elements();
    let folder = folder(name, &elements, S::PRECISION);
    let cases = |element: &Interpreted| {
        samples(element.declaration()).iter().map(|sample| Case::new(element, sample)).collect()
    };
    let all: Vec<Vec<Case<S>>> = elements.iter().map(cases).collect();
    let module = std::fs::read_to_string(folder.join("energies.py")).unwrap();
    let names = module.lines().filter_map(|line| line.strip_prefix("    \"")?.strip_suffix("\": {"));
    let names: Vec<String> = names.map(str::to_owned).collect();
    assert_eq!(names.len(), elements.len());
    for (name, cases) in names.iter().zip(&all) {
        std::fs::write(folder.join(format!("{name}.inputs")), cases.iter().flat_map(Case::bytes).collect::<Vec<u8>>())
            .unwrap();
    }
    println!("{}", run(&python, &script("warp_driver.py"), &folder));
    let mut total = (0, 0);
    for ((element, name), cases) in elements.iter().zip(&names).zip(&all) {
        let (compared, left) = compare(element, name, cases, &folder);
        assert!(compared > 0, "{name}");
        total = (total.0 + compared, total.1 + left);
    }
    println!("{name}: {} numbers compared, {} results left to rays", total.0, total.1);
    Some(total.0)
}

fn check_points<S: Bits>(name: &str) {
    let elements = || {
        let all: Vec<Interpreted> = catalogue::elements().iter().map(|entry| interpreted(entry.declaration)).collect();
        sufficient(&all).into_iter().map(|number| all[number].clone()).collect()
    };
    assert!(check::<S>(name, elements).is_none_or(|compared| compared > 10_000));
}

/// One or two of each kind of declaration and of unknowns: kernels take long to compile.
const MIXED: [&str; 9] =
    ["GasInTriangle", "HotBar", "Arm", "Ring3", "Anchor", "Thrust", "Transported", "Turning", "Maxwell"];

fn mixed() -> Vec<Interpreted> {
    let text = include_str!("../../tests/unknowns.energy");
    let all = Interpreted::from_file(text, "unknowns.energy").expect("it compiles");
    all.into_iter().filter(|element| MIXED.contains(&&*element.declaration().name)).collect()
}

#[test]
fn warp_has_the_bits_of_rust() {
    check_points::<f64>("warp-f64");
}

#[test]
fn warp_in_single_precision_has_the_bits_of_rust() {
    check_points::<f32>("warp-f32");
}

#[test]
fn warp_of_mixed_unknowns_has_the_bits_of_rust() {
    for (name, compared) in
        [("f64", check::<f64>("warp-mixed-f64", mixed)), ("f32", check::<f32>("warp-mixed-f32", mixed))]
    {
        assert!(compared.is_none_or(|compared| compared > 10_000), "{name}");
    }
}

/// Adjoints of rotations are tangent to unit quaternions, up to second order.
#[test]
fn adjoints_of_mixed_unknowns_are_generated_derivatives() {
    let Some(python) = python() else { return };
    let folder = folder("warp-mixed-adjoints", &mixed(), Precision::Double);
    println!("{}", run(&python, &script("warp_mixed.py"), &folder));
}

/// Adjoints of values are generated gradients with equal bits; those of gradients, forces, residuals and constraints are
/// products with the generated matrices.
#[test]
fn adjoints_are_generated_derivatives() {
    let Some(python) = python() else { return };
    let texts = [
        include_str!("warp_elements.energy").to_owned(),
        catalogue::find("StVK").expect("it is in the catalogue").declaration.source.to_string(),
    ];
    let compiled = |text: &String| Interpreted::from_file_with_vertices(text, "element", &Budget::default()).unwrap();
    let elements: Vec<Interpreted> = texts.iter().flat_map(compiled).collect();
    let folder = folder("warp-adjoints", &elements, Precision::Double);
    println!("{}", run(&python, &script("warp_adjoints.py"), &folder));
}

#[test]
fn examples_run() {
    let Some(python) = python() else { return };
    let elements: Vec<Interpreted> = ["StVK", "QuadraticHinge", "Gravity"]
        .map(|name| interpreted(catalogue::find(name).expect("it is in the catalogue").declaration))
        .into();
    let folder = folder("warp-examples", &elements, Precision::Double);
    println!("{}", run(&python, &script("warp_examples.py"), &folder));
}
