//! Run time and error of every method of computing a Hessian. Every error is measured: methods in doubles and
//! multi-precision with 30 digits are compared with 60 digits.

mod elements;
mod methods;
mod plain;

use std::fmt::Write as _;

use energy_cli::plot::{Curve, logarithmic};
use energy_dsl::Kind;

pub use self::methods::Measured;
use self::methods::Methods;
use verify::audit::Target;
use verify::sample::Sample;

/// Inputs per element.
const INPUTS: usize = 8;

/// Returns the names of the elements that [`bench()`] can time.
#[must_use]
pub fn names() -> Vec<&'static str> {
    elements::ELEMENTS.iter().map(|(name, _)| *name).collect()
}

/// Times every method on the elements with these names; all if the list is empty.
///
/// # Errors
/// If a name is not among [`names`].
pub fn bench(wanted: &[String]) -> Result<Vec<Measured>, String> {
    if let Some(unknown) = wanted.iter().find(|name| !names().contains(&name.as_str())) {
        return Err(format!("{unknown} is not timed; {} are", names().join(", ")));
    }
    let mut list = Vec::new();
    for (name, run) in elements::ELEMENTS {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        let entry = crate::catalogue::find(name).ok_or_else(|| format!("{name} is not in the catalogue"))?;
        let subject = Target::of_element(entry).subject()?;
        let mut sampler = subject.sampler(3);
        let samples: Vec<Sample> = (0..INPUTS).map(|_| in_single_precision(sampler.sample())).collect();
        list.extend(run(&Methods::new(&subject, &samples)));
    }
    Ok(list)
}

/// Times every method that needs no compilation on declarations of a file. Those without a Hessian are left out.
///
/// # Errors
/// If no declaration has a Hessian, or one does not compile.
pub fn bench_interpreted(targets: &[Target]) -> Result<Vec<Measured>, String> {
    let mut list = Vec::new();
    for target in targets {
        let subject = target.subject()?;
        if matches!(subject.declaration.kind, Kind::Energy | Kind::Constraint) {
            let mut sampler = subject.sampler(3);
            let samples: Vec<Sample> = (0..INPUTS).map(|_| sampler.sample()).collect();
            list.extend(Methods::new(&subject, &samples).interpreted()?);
        }
    }
    if list.is_empty() {
        return Err("none of these declarations has a Hessian to time: energies and constraints do".into());
    }
    Ok(list)
}

/// Rounds an input to numbers that single precision represents exactly.
fn in_single_precision(sample: Sample) -> Sample {
    let rounded = |numbers: Vec<f64>| numbers.into_iter().map(|x| f64::from(x as f32)).collect();
    Sample {
        parameters: rounded(sample.parameters),
        rest: rounded(sample.rest),
        positions: rounded(sample.positions),
        velocities: rounded(sample.velocities),
    }
}

/// Formats a Markdown table: one row per method, one column per element.
#[must_use]
pub fn markdown(list: &[Measured]) -> String {
    let mut text = String::from("| element | method | ns | error |\n|---|---|---:|---:|\n");
    for Measured { element, method, nanoseconds, error } in list {
        let _ = writeln!(text, "| {element} | {method} | {} | {} |", rounded(*nanoseconds), relative(*error));
    }
    text
}

/// Formats a measured error. All errors are measured: 0 means exact.
fn relative(error: f64) -> String {
    if error == 0.0 { "exact".into() } else { format!("{error:.1e}") }
}

fn rounded(nanoseconds: f64) -> String {
    if nanoseconds < 100.0 { format!("{nanoseconds:.1}") } else { format!("{nanoseconds:.0}") }
}

/// Formats the measurements as comma-separated values.
#[must_use]
pub fn csv(list: &[Measured]) -> String {
    let mut text = String::from("element,method,nanoseconds,error\n");
    for Measured { element, method, nanoseconds, error } in list {
        let _ = writeln!(text, "{element},\"{method}\",{nanoseconds:.2},{error:.3e}");
    }
    text
}

/// Draws one plot per element and one of all, each with its file name.
#[must_use]
pub fn plots(list: &[Measured]) -> Vec<(String, String)> {
    let of = |name: &str| list.iter().filter(|m| m.element == name).cloned().collect::<Vec<_>>();
    let mut names: Vec<&str> = list.iter().map(|m| &*m.element).collect();
    names.dedup();
    let mut groups: Vec<(String, Vec<Measured>)> = names.into_iter().map(|name| (name.to_owned(), of(name))).collect();
    groups.push(("all".into(), list.to_vec()));
    groups
        .into_iter()
        .filter_map(|(name, list)| {
            let mut curves: Vec<Curve> = Vec::new();
            for m in &list {
                // A logarithmic axis has no 0: exact results have a legend of their own, which says where they are
                // drawn.
                let (name, error) = match m.error {
                    0.0 => (format!("{}: exact, drawn at 1e-18", m.method), 1e-18),
                    error => (m.method.to_owned(), error),
                };
                let point = (m.nanoseconds, error);
                match curves.iter_mut().find(|curve| curve.name == name) {
                    Some(curve) => curve.points.push(point),
                    None => curves.push(Curve { name, points: vec![point], joined: false }),
                }
            }
            let title = format!("Hessian of {}", if name == "all" { "each element" } else { &name });
            let axes = ("run time, ns", "error relative to the largest entry");
            Some((format!("{name}.svg"), logarithmic(&title, axes, &curves, (760, 480))?))
        })
        .collect()
}
