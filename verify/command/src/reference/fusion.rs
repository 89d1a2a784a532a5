//! The residuals of body tracking against multi-precision values (see `data/fusion/README.md`), with errors in the
//! maximum norm of each array.

use std::path::Path;

use energy_dsl::Residual;
use energy_elements::{
    Binding, BlendedMotion4, BlendedPoint1, BlendedPoint4, BlendedPoint8, FrozenPlane1, FrozenPlane4, FrozenPlane8,
    GraphEdge, HuberLoss, NonrigidPlane1, NonrigidPlane4, NonrigidPlane8, SkeletonPlane, SkeletonPoint, TwistMotion,
};
use energy_solve::Loss;
use serde::Serialize;
use serde_json::{Map, Value};

use super::exact::Truth;
use super::file::{RecordError, read};
use super::{fusion_system, smoothing};
use crate::complex::Complex;

/// The error of one array of a family over all cases.
#[derive(Clone, Debug, Serialize)]
pub struct FamilyLine {
    /// Name of the family.
    pub family: &'static str,
    /// Name of the array.
    pub array: String,
    /// Number of cases.
    pub cases: usize,
    /// Worst error relative to the largest entry, or to the terms of a difference.
    pub worst: f64,
    /// Case of the worst error.
    pub worst_case: String,
    /// Bound that a careful implementation meets, with a margin.
    pub bound: f64,
}

impl FamilyLine {
    /// Whether the bound is met; `false` for NaN.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.worst <= self.bound
    }
}

/// Lines of the report so far, and the arrays of the last case.
#[derive(Default)]
pub(super) struct Lines {
    all: Vec<FamilyLine>,
    computed: Map<String, Value>,
}

impl Lines {
    /// Compares one array. Errors are relative to `scale` or to the array's largest entry, whichever is larger.
    pub(super) fn compare(
        &mut self,
        case: &Case<'_>,
        (array, scale, bound): (&str, f64, f64),
        found: &[f64],
        truth: &Value,
    ) -> Result<(), String> {
        self.keep(array, found);
        if case.evaluated_only {
            return Ok(());
        }
        let truths = case.truths(truth).map_err(|error| format!("{array}: {error}"))?;
        if truths.len() != found.len() {
            return Err(format!("{array}: {} numbers computed, {} expected", found.len(), truths.len()));
        }
        let largest = truths.iter().fold(scale, |most, truth| most.max(truth.high.abs()));
        let error = found.iter().zip(&truths).map(|(found, truth)| truth.error_of(*found)).fold(0.0, worse);
        // A zero array must be exactly zero.
        let relative = if error == 0.0 { 0.0 } else { error / largest };
        self.note(case, array, relative, bound);
        Ok(())
    }

    /// Keeps the numbers of an array of the case for a file of results.
    pub(super) fn keep(&mut self, array: &str, found: &[f64]) {
        self.computed.insert(array.to_owned(), found.iter().map(|x| Value::String(format!("{x:.16e}"))).collect());
    }

    /// Records whether a condition holds exactly.
    pub(super) fn exact(&mut self, case: &Case<'_>, array: &str, right: bool) {
        if !case.evaluated_only {
            self.note(case, array, if right { 0.0 } else { f64::INFINITY }, 0.0);
        }
    }

    fn note(&mut self, case: &Case<'_>, array: &str, error: f64, bound: f64) {
        let known = self.all.iter().position(|l| l.family == case.family && l.array == array && l.bound == bound);
        let at = known.unwrap_or_else(|| {
            let (family, array) = (case.family, array.to_owned());
            self.all.push(FamilyLine { family, array, cases: 0, worst: 0.0, worst_case: String::new(), bound });
            self.all.len() - 1
        });
        let line = &mut self.all[at];
        line.cases += 1;
        if worse(line.worst, error) != line.worst {
            line.worst = error;
            line.worst_case.clone_from(&case.id);
        }
    }
}

/// Returns the larger number; NaN if either is NaN.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// One case of a family.
pub(super) struct Case<'a> {
    family: &'static str,
    id: String,
    value: &'a Value,
    /// Whether a true value to compare with is missing.
    evaluated_only: bool,
}

impl Case<'_> {
    /// Returns a field of the case.
    pub(super) fn field(&self, name: &str) -> Result<&Value, String> {
        self.value.get(name).ok_or_else(|| format!("`{name}` is missing"))
    }

    /// Returns a field of its results.
    pub(super) fn out(&self, name: &str) -> Result<&Value, String> {
        if self.evaluated_only {
            return Ok(&Value::Null);
        }
        self.field("out")?.get(name).ok_or_else(|| format!("`out.{name}` is missing"))
    }

    /// Returns all numbers of a field, in order.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
        numbers(self.field(name)?).map_err(|error| format!("{name}: {error}"))
    }

    /// Returns a field that is one number.
    pub(super) fn number(&self, name: &str) -> Result<f64, String> {
        self.numbers(name)?.first().copied().ok_or_else(|| format!("`{name}` is empty"))
    }

    /// Returns a field of three numbers.
    pub(super) fn vector(&self, name: &str) -> Result<[f64; 3], String> {
        fixed(&self.numbers(name)?, name)
    }

    /// Returns the twists of all nodes.
    pub(super) fn twists(&self) -> Result<Vec<[f64; 6]>, String> {
        let (theta, t) = (self.numbers("theta")?, self.numbers("t")?);
        let both = theta.chunks_exact(3).zip(t.chunks_exact(3));
        Ok(both.map(|(a, b)| [a[0], a[1], a[2], b[0], b[1], b[2]]).collect())
    }

    /// Returns the parameter `turn` of the declared residuals.
    pub(super) fn turn(&self) -> Result<f64, String> {
        turn(self.field("conv")?.as_str().unwrap_or_default())
    }

    fn truths(&self, value: &Value) -> Result<Vec<Truth>, String> {
        let mut all = Vec::new();
        flatten(value, &mut |text| {
            all.push(text.parse()?);
            Ok(())
        })?;
        Ok(all)
    }
}

fn turn(convention: &str) -> Result<f64, String> {
    match convention {
        "doc" => Ok(1.0),
        "std" => Ok(0.5),
        other => Err(format!("unknown convention `{other}`")),
    }
}

/// Converts numbers to an array of known length.
pub(super) fn fixed<const N: usize>(numbers: &[f64], name: &str) -> Result<[f64; N], String> {
    numbers.try_into().map_err(|_| format!("`{name}` has {} numbers, expected {N}", numbers.len()))
}

/// Returns all numbers in a value, in order.
pub(super) fn numbers(value: &Value) -> Result<Vec<f64>, String> {
    let mut all = Vec::new();
    flatten(value, &mut |text| {
        all.push(text.parse().map_err(|_| format!("`{text}` is not a number"))?);
        Ok(())
    })?;
    Ok(all)
}

fn flatten(value: &Value, take: &mut impl FnMut(&str) -> Result<(), String>) -> Result<(), String> {
    match value {
        Value::Array(list) => list.iter().try_for_each(|one| flatten(one, take)),
        Value::String(text) => take(text),
        Value::Number(number) => take(&number.to_string()),
        Value::Null => Ok(()),
        other => Err(format!("expected a number, found {other}")),
    }
}

type Check = fn(&Case<'_>, &mut Lines) -> Result<(), String>;

/// Measures the generated code against a `reference.json` of body tracking, and `fusion-core` for the smoothing of
/// attachments (`hsmooth`), which involves no declared residual.
///
/// # Errors
/// If the file cannot be read, a family is missing or has no cases, or a case is malformed.
pub fn fusion_reference(path: &Path) -> Result<Vec<FamilyLine>, RecordError> {
    let file: Value = read(path)?;
    let mut lines = Lines::default();
    for (family, check) in FAMILIES {
        let cases = file.get(family).and_then(Value::as_array);
        let cases = cases.ok_or_else(|| RecordError::record(path, family, "the family is missing"))?;
        not_empty(path, family, cases)?;
        for value in cases {
            let case = Case { family, id: identity(value), value, evaluated_only: false };
            check(&case, &mut lines).map_err(|message| RecordError::record(path, &case.id, message))?;
        }
    }
    Ok(lines.all)
}

/// Evaluates the cases of a file of body tracking, of any families, and writes them with `out` filled by the generated
/// code: the numbers of each array in order, with 17 digits. Returns the number of cases; `None` if the file lacks all
/// families.
///
/// # Errors
/// If the input is malformed, or the output cannot be written. Nothing is written then.
pub fn evaluate_fusion(input: &Path, output: &Path) -> Result<Option<usize>, RecordError> {
    let mut file: Value = read(input)?;
    let mut count = None;
    for (family, check) in FAMILIES {
        let Some(cases) = file.get_mut(family).and_then(Value::as_array_mut) else { continue };
        not_empty(input, family, cases)?;
        for value in cases {
            let mut lines = Lines::default();
            let case = Case { family, id: identity(value), value, evaluated_only: true };
            check(&case, &mut lines).map_err(|message| RecordError::record(input, &case.id, message))?;
            value["out"] = Value::Object(lines.computed);
            *count.get_or_insert(0) += 1;
        }
    }
    if count.is_some() {
        let text = serde_json::to_string_pretty(&file).map_err(|e| RecordError::file(output, e.into()))?;
        energy_cli::write_whole(output, text.as_bytes()).map_err(|e| RecordError::file(output, e))?;
    }
    Ok(count)
}

/// Checks that a family has cases: without any, everything would pass.
fn not_empty(path: &Path, family: &str, cases: &[Value]) -> Result<(), RecordError> {
    if cases.is_empty() { Err(RecordError::record(path, family, "the family has no cases")) } else { Ok(()) }
}

/// Names of the families, for messages.
pub(super) fn family_names() -> String {
    FAMILIES.map(|(family, _)| family).join(", ")
}

const FAMILIES: [(&str, Check); 9] = [
    ("exp", exponential),
    ("dqb", blend),
    ("nonrigid", nonrigid),
    ("lbs_plane", skinned),
    ("graph", graph),
    ("binding", binding),
    ("huber", huber),
    ("hsmooth", smoothing::smoothing),
    ("system", fusion_system::system),
];

fn identity(case: &Value) -> String {
    case.get("id").and_then(Value::as_str).unwrap_or("without id").to_owned()
}

/// exp: 8 numbers and their derivatives, in both conventions, down to a zero rotation.
fn exponential(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let twist = case.twists()?[0];
    // Rounding ‖θ‖ changes the angle by as much.
    let length = twist[0].hypot(twist[1]).hypot(twist[2]);
    let (suffix, bound) = if length <= 3.2 { ("", 1.2e-15) } else { (", ‖θ‖ > π", 8e-15) };
    for convention in ["doc", "std"] {
        let out = case.out(convention)?;
        let at = TwistMotion::new(turn(convention)?).jacobian(&twist);
        lines.compare(case, (&format!("q {convention}{suffix}"), 0.0, bound), &at.value, &out["q"])?;
        lines.compare(case, (&format!("J {convention}{suffix}"), 0.0, bound), &at.jacobian, &out["J"])?;
    }
    Ok(())
}

/// dqb: sum, unit dual quaternion, motion, moved point and normal, and their derivatives.
fn blend(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (turn, mut w) = (case.turn()?, fixed::<4>(&case.numbers("w")?, "w")?);
    let (v, n) = (case.vector("v")?, case.vector("n")?);
    let twists = case.twists()?;
    let motions: Vec<[f64; 8]> = twists.iter().map(|twist| TwistMotion::new(turn).residual(twist).value).collect();
    let sign = |k: usize| {
        let product: f64 = (0..4).map(|i| motions[k][i] * motions[0][i]).sum();
        if product >= 0.0 { 1.0 } else { -1.0 }
    };
    let signs: [f64; 4] = std::array::from_fn(sign);
    let aligned = case.field("align")?.as_bool() == Some(true);
    if aligned {
        lines.exact(case, "sign", numbers(case.out("sign")?)? == signs);
    } else {
        // The declared blend aligns signs; weights with the opposite signs undo that.
        w = std::array::from_fn(|k| signs[k] * w[k]);
    }
    let unknowns = fixed::<24>(twists.as_flattened(), "twists")?;
    let at = BlendedMotion4::new(turn, w, v, n).jacobian(&unknowns);
    let norm = at.value[..4].iter().fold(0.0_f64, |length, x| length.hypot(*x));
    // The nearly antipodal blend cancels.
    let antipodal = norm < 0.1 * w.iter().map(|w| w.abs()).sum::<f64>();
    let (suffix, bound) = if antipodal { (", nearly antipodal", 6e-14) } else { ("", 4e-15) };
    let mut compare = |name: &str, found: &[f64]| {
        lines.compare(case, (&format!("{name}{suffix}"), 0.0, bound), found, case.out(name)?)
    };
    compare("b", &at.value[..8])?;
    compare("norm", &[norm])?;
    compare("qhat", &at.value[8..16])?;
    compare("vhat", &at.value[16..19])?;
    compare("nhat", &at.value[19..])?;
    compare("Jq", &at.jacobian[8 * 24..16 * 24])?;
    compare("Jv", &at.jacobian[16 * 24..19 * 24])?;
    compare("Jn", &at.jacobian[19 * 24..])?;
    // The columns of R are the moved axes, the last column of T the moved origin.
    let mut motion = [0.0; 12];
    for axis in 0..3 {
        let unit = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        let moved = BlendedPoint4::new(turn, w, [0.0; 3], unit).residual(&unknowns).value;
        for row in 0..3 {
            motion[4 * row + axis] = moved[3 + row];
            motion[4 * row + 3] = moved[row];
        }
    }
    compare("T", &motion)
}

/// Results of the data term for one K: (v̂, n̂), (r, J), and (r, J) with a frozen normal.
struct Plane {
    moved: [f64; 6],
    r: f64,
    jacobian: Vec<f64>,
    frozen: Vec<f64>,
}

macro_rules! plane_of {
    (
        $k:literal, $unknowns:literal, $point:ident, $plane:ident, $frozen:ident,
        |$w:ident, $rest:ident| $($weights:tt)*
    ) => {
        |turn: f64, $w: &[f64], v: [f64; 3], n: [f64; 3], u: [f64; 3], twists: &[f64]| -> Result<Plane, String> {
            let unknowns = fixed::<$unknowns>(twists, "twists")?;
            let moved = plane_of!(@new $point, turn, $w, $k, [v, n], $($weights)*).residual(&unknowns).value;
            let at = plane_of!(@new $plane, turn, $w, $k, [v, n, u], $($weights)*).jacobian(&unknowns);
            let m = [moved[3], moved[4], moved[5]];
            let frozen = plane_of!(@new $frozen, turn, $w, $k, [v, m, u], $($weights)*).jacobian(&unknowns);
            Ok(Plane { moved, r: at.value[0], jacobian: at.jacobian.to_vec(), frozen: frozen.jacobian.to_vec() })
        }
    };
    (@new $name:ident, $turn:ident, $w:ident, $k:literal, [$($rest:expr),*], one) => { $name::new($turn, $($rest),*) };
    (@new $name:ident, $turn:ident, $w:ident, $k:literal, [$($rest:expr),*], many) => {
        $name::new($turn, fixed::<$k>($w, "w")?, $($rest),*)
    };
}

/// nonrigid: the data term for K = 1, 4, 8 with its Jacobian, full and with a frozen normal; and the exact Hessian by
/// dual numbers through the generated Jacobian.
fn nonrigid(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (turn, mut w, lambda) = (case.turn()?, case.numbers("w")?, case.number("lambda_n")?);
    let (v, n, u) = (case.vector("v")?, case.vector("n")?, case.vector("u")?);
    let twists = case.twists()?;
    let flat = twists.as_flattened();
    if case.field("align")?.as_bool() != Some(true) {
        let motions: Vec<[f64; 8]> = twists.iter().map(|twist| TwistMotion::new(turn).residual(twist).value).collect();
        for (w, motion) in w.iter_mut().zip(&motions) {
            let product: f64 = (0..4).map(|i| motion[i] * motions[0][i]).sum();
            *w = if product >= 0.0 { *w } else { -*w };
        }
    }
    let plane = match w.len() {
        1 => plane_of!(1, 6, BlendedPoint1, NonrigidPlane1, FrozenPlane1, |_w, rest| one)(turn, &w, v, n, u, flat)?,
        4 => plane_of!(4, 24, BlendedPoint4, NonrigidPlane4, FrozenPlane4, |w, rest| many)(turn, &w, v, n, u, flat)?,
        8 => plane_of!(8, 48, BlendedPoint8, NonrigidPlane8, FrozenPlane8, |w, rest| many)(turn, &w, v, n, u, flat)?,
        other => return Err(format!("expected K = 1, 4 or 8, got {other}")),
    };
    let steepest = plane.jacobian.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
    let Plane { moved, r, jacobian, frozen } = plane;
    let gradient: Vec<f64> = jacobian.iter().map(|entry| 2.0 * lambda * entry * r).collect();
    let mut compare = |name: &str, scale: f64, bound: f64, found: &[f64]| {
        lines.compare(case, (name, scale, bound), found, case.out(name)?)
    };
    compare("vhat", 0.0, 4e-15, &moved[..3])?;
    compare("nhat", 0.0, 4e-15, &moved[3..])?;
    // A difference of lengths of about 1.
    compare("r", 1.0, 1.8e-15, &[r])?;
    compare("J", 0.0, 2.8e-15, &jacobian)?;
    compare("J_frozen_normal", 0.0, 2.8e-15, &frozen)?;
    compare("E", 2.0 * lambda * r.abs(), 1.8e-15, &[lambda * r * r])?;
    compare("gradE", 2.0 * lambda * steepest * (1.0 + r.abs()), 2.8e-15, &gradient)?;
    if let Ok(truth) = case.out("hess_r") {
        let hessian = match w.len() {
            8 => return Ok(()),
            1 => second_derivatives(&twists, |x| complex_plane1(turn, v, n, u).jacobian(&x).jacobian.to_vec())?,
            _ => {
                let w = fixed::<4>(&w, "w")?;
                second_derivatives(&twists, |x: [Complex; 24]| {
                    complex_plane4(turn, w, v, n, u).jacobian(&x).jacobian.to_vec()
                })?
            }
        };
        lines.compare(case, ("hess_r", 0.0, 1e-14), &hessian, truth)?;
    }
    Ok(())
}

fn complex_plane1(turn: f64, v: [f64; 3], n: [f64; 3], u: [f64; 3]) -> NonrigidPlane1<Complex> {
    let [v, n, u] = [v, n, u].map(|vector| vector.map(Complex::real));
    NonrigidPlane1::new(Complex::real(turn), v, n, u)
}

fn complex_plane4(turn: f64, w: [f64; 4], v: [f64; 3], n: [f64; 3], u: [f64; 3]) -> NonrigidPlane4<Complex> {
    let [v, n, u] = [v, n, u].map(|vector| vector.map(Complex::real));
    NonrigidPlane4::new(Complex::real(turn), w.map(Complex::real), v, n, u)
}

/// Computes the derivatives of a generated Jacobian by complex steps.
fn second_derivatives<const U: usize>(
    twists: &[[f64; 6]],
    jacobian: impl Fn([Complex; U]) -> Vec<Complex>,
) -> Result<Vec<f64>, String> {
    let x = fixed::<U>(twists.as_flattened(), "twists")?;
    const STEP: f64 = 1e-100;
    let row = |moving: usize| {
        let at = std::array::from_fn(|i| Complex { re: x[i], im: if i == moving { STEP } else { 0.0 } });
        jacobian(at).into_iter().map(|entry| entry.im / STEP).collect::<Vec<f64>>()
    };
    Ok((0..U).flat_map(row).collect())
}

/// lbs_plane: the data term with a linear blend. Cases with fewer nodes give the others zero weight.
fn skinned(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (turn, w) = (case.turn()?, case.numbers("w")?);
    let (v, n, u) = (case.vector("v")?, case.vector("n")?, case.vector("u")?);
    let k = w.len();
    let mut unknowns = [0.0; 24];
    unknowns[..6 * k].copy_from_slice(case.twists()?.as_flattened());
    let mut share = [0.0; 4];
    share.get_mut(..k).ok_or("more than four nodes")?.copy_from_slice(&w);
    let at = SkeletonPlane::new(turn, share, v, n, u).jacobian(&unknowns);
    let moved = SkeletonPoint::new(turn, share, v, n).residual(&unknowns).value;
    if at.jacobian[6 * k..].iter().any(|&entry| entry != 0.0) {
        return Err("the derivative by a node of weight zero is not zero".into());
    }
    lines.compare(case, ("v", 1.0, 1.8e-15), &moved[..3], case.out("v")?)?;
    lines.compare(case, ("n", 1.0, 1.8e-15), &moved[3..], case.out("n")?)?;
    lines.compare(case, ("r", 1.0, 1.8e-15), &at.value, case.out("r")?)?;
    lines.compare(case, ("J", 0.0, 2.8e-15), &at.jacobian[..6 * k], case.out("J")?)
}

/// graph: an edge with its Jacobian, and the three weights.
fn graph(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (turn, lambda, delta) = (case.turn()?, case.number("lambda_g")?, case.number("delta")?);
    let mut unknowns = Vec::new();
    for name in ["theta_i", "t_i", "theta_j", "t_j"] {
        unknowns.extend(case.numbers(name)?);
    }
    let at = GraphEdge::new(turn, case.vector("x_j")?).jacobian(&fixed(&unknowns, "twists")?);
    let square: f64 = at.value.iter().map(|h| h * h).sum();
    let product = |column: usize| (0..3).map(|row| at.jacobian[12 * row + column] * at.value[row]).sum::<f64>();
    let gradient: Vec<f64> = (0..12).map(product).collect();
    let (h_i, h_j) = (case.numbers("H_i")?, case.numbers("H_j")?);
    let s: f64 = h_i.iter().zip(&h_j).map(|(a, b)| (a - b) * (a - b)).sum();
    lines.compare(case, ("J", 0.0, 8e-16), &at.jacobian, case.out("J")?)?;
    let places = 1.0;
    lines.compare(case, ("h", places, 1.8e-15), &at.value, case.out("h")?)?;
    lines.compare(case, ("hh", 2.0 * square.sqrt(), 3.6e-15), &[square], case.out("hh")?)?;
    lines.compare(case, ("JTh", 1.0, 7e-15), &gradient, case.out("JTh")?)?;
    lines.compare(case, ("s", 0.0, 8e-16), &[s], case.out("s")?)?;
    for (name, psi) in weights(s, delta) {
        lines.compare(case, (&format!("psi {name}"), 0.0, 1.8e-15), &[psi], &case.out("psi")?[name])?;
        let scale = 2.0 * lambda * psi;
        let weighted: Vec<f64> = gradient.iter().map(|entry| scale * entry).collect();
        let label = format!("gradE {name}");
        lines.compare(case, (&label, scale, 9e-15), &weighted, &case.out("gradE")?[name])?;
        let energy = lambda * psi * square;
        lines.compare(case, (&format!("E {name}"), scale * square.sqrt(), 5e-15), &[energy], &case.out("E")?[name])?;
    }
    Ok(())
}

/// Returns ψ as printed, of s and of √s.
pub(super) fn weights(s: f64, delta: f64) -> [(&'static str, f64); 3] {
    let weight = |y: f64| if y == 0.0 { 1.0 } else { HuberLoss::new(delta).jacobian(&[y]).jacobian[0] / y };
    [
        ("printed_huber_of_s", HuberLoss::new(delta).residual(&[s]).value[0]),
        ("weight_of_s", weight(s)),
        ("weight_of_norm", weight(s.sqrt())),
    ]
}

/// binding: a node at its bones.
fn binding(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (turn, lambda, x) = (case.turn()?, case.number("lambda_b")?, case.vector("x")?);
    let mut twist = case.numbers("theta")?;
    twist.extend(case.numbers("t")?);
    let target = bound_place(&case.numbers("Tb")?, &case.numbers("eta")?, &x);
    let at = Binding::new(turn, x, target).jacobian(&fixed(&twist, "twist")?);
    let energy: f64 = at.value.iter().map(|r| lambda * r * r).sum();
    let gradient: Vec<f64> = (0..6)
        .map(|column| (0..3).map(|row| 2.0 * lambda * at.jacobian[6 * row + column] * at.value[row]).sum())
        .collect();
    lines.compare(case, ("xtilde", 1.0, 1.6e-15), &target, case.out("xtilde")?)?;
    lines.compare(case, ("r", 1.0, 1.6e-15), &at.value, case.out("r")?)?;
    lines.compare(case, ("J", 0.0, 1.6e-15), &at.jacobian, case.out("J")?)?;
    lines.compare(case, ("E", lambda, 4e-15), &[energy], case.out("E")?)?;
    lines.compare(case, ("gradE", lambda, 4e-15), &gradient, case.out("gradE")?)
}

/// Returns Σ η_j T_bj x, with each motion given as a 3×4 matrix by rows.
pub(super) fn bound_place(motions: &[f64], shares: &[f64], x: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| {
        let of = |motion: &[f64]| {
            let m = &motion[4 * row..];
            m[0] * x[0] + m[1] * x[1] + m[2] * x[2] + m[3]
        };
        motions.chunks_exact(12).zip(shares).map(|(motion, share)| share * of(motion)).sum()
    })
}

/// huber: the loss, its derivative, its weight, and the form with a squared argument that solvers use.
fn huber(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    let (y, delta) = (case.number("y")?, case.number("delta")?);
    let at = HuberLoss::new(delta).jacobian(&[y]);
    let weight = if y == 0.0 { 1.0 } else { at.jacobian[0] / y };
    lines.compare(case, ("rho", 0.0, 8e-16), &at.value, case.out("rho")?)?;
    lines.compare(case, ("drho", 0.0, 8e-16), &at.jacobian, case.out("drho")?)?;
    lines.compare(case, ("weight", 0.0, 8e-16), &[weight], case.out("weight")?)?;
    lines.exact(case, "inside", case.out("inside")?.as_bool() == Some(y.abs() <= delta));
    if let Ok(truth) = case.out("ceres_rho") {
        let (rho, slope) = Loss::Huber(delta).of(y);
        lines.compare(case, ("of a square: ρ", 0.0, 8e-16), &[rho], truth)?;
        lines.compare(case, ("of a square: ρ′", 0.0, 8e-16), &[slope], case.out("ceres_drho")?)?;
    }
    Ok(())
}
