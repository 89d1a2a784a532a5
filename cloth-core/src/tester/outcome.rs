//! Curves and numbers of a finished test.

use energy_dsl::Vector3;
use serde::Serialize;

use super::curve::{Curve, Loop, Tensile};
use super::specimen::TENSILE_LOAD;
use super::{Threads, Trial};
use crate::measure::{Drape, Outline, Shadow};
use crate::mesh::TriangleMesh;

/// N/m per rad in 1 gf/(cm·°).
const SHEAR_UNIT: f64 = 0.980_665 * 180.0 / std::f64::consts::PI;
/// N m in 1 gf·cm²/cm.
const BENDING_UNIT: f64 = 0.980_665e-4;
/// N in 1 gf·cm/cm.
const MOMENT_UNIT: f64 = 9.80665e-3;

/// A number that a lab prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// The name, such as `EMT warp`.
    pub name: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Value of the simulated test; `None` if it does not exist, such as the extension at a load that was not reached.
    pub simulated: Option<f64>,
    /// Value of the declared material; `None` if it does not exist.
    pub input: Option<f64>,
    /// The simulated number in the unit of KES, with that unit; `None` if it is the same.
    pub kes: Option<(f64, &'static str)>,
}

/// A finished test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The name of the test.
    pub trial: String,
    /// Its kind, one of [`Trial::KINDS`].
    pub kind: &'static str,
    /// Quantities of the two columns of the curves, with units.
    pub axes: [&'static str; 2],
    /// The simulated curve; for the drape, the outline of the shadow.
    pub simulated: Curve,
    /// The curve of the declared material; for the drape, the flat specimen.
    pub input: Curve,
    /// Numbers that were read off.
    pub numbers: Vec<Number>,
}

/// Describes a number, with the size of the unit of KES, if it has another.
fn number(
    name: String,
    unit: &'static str,
    [simulated, input]: [Option<f64>; 2],
    kes: Option<(f64, &'static str)>,
) -> Number {
    let kes = kes.and_then(|(size, unit)| Some((simulated? / size, unit)));
    Number { name, unit, simulated, input, kes }
}

impl Outcome {
    pub(super) fn tensile(trial: Trial, threads: Threads, simulated: Curve, input: Curve) -> Self {
        let read = [&simulated, &input].map(|curve| Tensile::of(curve, TENSILE_LOAD));
        let of = |pick: fn(Tensile) -> f64| read.map(|read| read.map(pick));
        let name = |quantity: &str| format!("{quantity} {}", threads.name());
        let numbers = vec![
            number(name("EMT"), "%", of(|read| 100.0 * read.emt), None),
            number(name("LT"), "", of(|read| read.lt), None),
        ];
        let axes = ["strain", "force per width N/m"];
        Self { trial: trial.name(), kind: trial.kind(), axes, simulated, input, numbers }
    }

    pub(super) fn shear(simulated: Curve, input: Curve) -> Self {
        let read = [&simulated, &input].map(|curve| Loop::of(curve, [0.5, 2.5], [0.5, 5.0]));
        let per_radian = read.map(|read| read.map(|read| read.slope * 180.0 / std::f64::consts::PI));
        let width = |at: usize| [read[0].and_then(|read| read.widths[at]), None];
        let numbers = vec![
            number("G".to_owned(), "N/m", per_radian, Some((SHEAR_UNIT, "gf/(cm °)"))),
            number("2HG".to_owned(), "N/m", width(0), Some((0.980_665, "gf/cm"))),
            number("2HG5".to_owned(), "N/m", width(1), Some((0.980_665, "gf/cm"))),
        ];
        let axes = ["shear angle °", "shear force per width N/m"];
        Self { trial: Trial::Shear.name(), kind: Trial::Shear.kind(), axes, simulated, input, numbers }
    }

    pub(super) fn bending(trial: Trial, threads: Threads, simulated: Curve, input: Curve) -> Self {
        let read = [&simulated, &input].map(|curve| Loop::of(curve, [50.0, 150.0], [100.0, 200.0]));
        let name = |quantity: &str| format!("{quantity} {}", threads.name());
        let slopes = read.map(|read| read.map(|read| 1e6 * read.slope));
        let width = read[0].and_then(|read| Some(1e3 * read.widths[0]?));
        let numbers = vec![
            number(name("B"), "µN m", slopes, Some((1e6 * BENDING_UNIT, "gf cm²/cm"))),
            number(name("2HB"), "mN", [width, None], Some((1e3 * MOMENT_UNIT, "gf cm/cm"))),
        ];
        let axes = ["curvature 1/m", "moment per width N"];
        Self { trial: trial.name(), kind: trial.kind(), axes, simulated, input, numbers }
    }

    pub(super) fn drape(drape: &Drape, x: &[Vector3<f64>], rest: &TriangleMesh) -> Self {
        let outline = |x: &[Vector3<f64>]| -> Curve {
            let outline = Outline::new(&Shadow::new(x, rest.triangles(), [0.0; 3]), [0.0; 2]);
            let count = outline.radii().len();
            let point = |step: usize| {
                let (sine, cosine) = (std::f64::consts::TAU * step as f64 / count as f64).sin_cos();
                [outline.radii()[step % count] * cosine, outline.radii()[step % count] * sine]
            };
            (0..=count).map(point).collect()
        };
        let numbers = vec![
            number("drape".to_owned(), "%", [Some(drape.coefficient), None], None),
            number("nodes".to_owned(), "", [Some(drape.nodes as f64), None], None),
        ];
        let (simulated, input) = (outline(x), outline(rest.vertices()));
        Self { trial: Trial::Drape.name(), kind: Trial::Drape.kind(), axes: ["x m", "y m"], simulated, input, numbers }
    }
}
