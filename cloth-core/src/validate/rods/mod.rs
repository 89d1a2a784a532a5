//! Known answers of elastic rods with bending, twist and natural curvature. Reference frames are transported in time,
//! so loads are applied in steps.

mod bending;
mod buckling;
mod helix;
mod linking;
mod rod;
mod vibration;

use super::{Finding, ValidateError};
use buckling::Tipping;

/// Tips of naturally curved rods that hang from a clamp, by Kirchhoff's equations: w L³/B, κ₀ L, and how far they reach
/// sideways and down, over L.
const CURLS: [(f64, f64, [f64; 2]); 3] = [
    (10.0, 1.0, [0.236_977_507_3, 0.954_674_497_9]),
    (50.0, 3.0, [0.267_678_761_9, 0.910_069_281_8]),
    (100.0, std::f64::consts::TAU, [0.316_271_897_4, 0.802_612_032_7]),
];

/// Displacement of the tip of the bend of Bathe and Bolourchi (1979) against the start's tangent, along the load and
/// towards the centre. By Kirchhoff's equations with B = E/12 and C = 0.1406 E/2; published values of other theories
/// are 23.5, 53.4 and 13.5.
const BEND: [f64; 3] = [23.817_642_9, 53.600_977_2, 13.731_123_3];

/// Reports cases at the finer of two resolutions, and the orders with which errors fall.
struct Cases<'a> {
    quick: bool,
    report: &'a mut dyn FnMut(Finding),
}

impl Cases<'_> {
    /// Compares several numbers of one run with exact ones. The error is relative, or absolute where 0 is exact.
    fn compare<const N: usize>(
        &mut self,
        names: [String; N],
        exact: [f64; N],
        [coarse, fine]: [usize; 2],
        at: &dyn Fn(usize) -> Result<[f64; N], ValidateError>,
    ) -> Result<(), ValidateError> {
        let last = at(fine)?;
        let before = if self.quick { None } else { Some(at(coarse)?) };
        for (number, case) in names.into_iter().enumerate() {
            let (found, exact) = (last[number], exact[number]);
            let finding = if exact == 0.0 { Finding::absolute } else { Finding::relative };
            (self.report)(finding("rods", case.clone(), found, exact, 5e-3));
            if let Some(before) = before {
                let errors = [before[number], found].map(|found| found - exact);
                (self.report)(Finding::order("rods", &case, errors, fine as f64 / coarse as f64));
            }
        }
        Ok(())
    }
}

/// Answers the question `rods`: errors at 100 edges, and the orders with which they fall from 50. A quick answer has no
/// orders.
pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let mut cases = Cases { quick, report };
    bent(&mut cases)?;
    buckled(&mut cases)?;
    twisted(&mut cases)
}

fn bent(cases: &mut Cases<'_>) -> Result<(), ValidateError> {
    for (weight, curvature, tip) in CURLS {
        let names = ["aside", "down"].map(|what| format!("hanging curl, w {weight:.0}, κ₀ {curvature:.2}, {what}"));
        cases.compare(names, tip, [50, 100], &|segments| bending::hanging_curl(weight, curvature, segments))?;
    }
    let names = ["back", "along", "in"].map(|what| format!("45° bend of a cantilever, {what}"));
    cases.compare(names, BEND, [50, 100], &|segments| Ok(bending::bent_cantilever(segments)?.map(f64::abs)))?;
    let names = ["circle by a moment 2π B/L, gap/L".to_owned()];
    cases.compare(names, [0.0], [50, 100], &|segments| Ok([bending::closed_circle(segments)?]))?;
    let names = ["bending 1", "bending 2", "bending 3", "torsion 1", "torsion 2", "torsion 3"];
    let torsion = [0.5, 1.5, 2.5].map(|turns| turns * std::f64::consts::PI);
    let [a, b, c] = vibration::BENDING;
    let exact = [a, b, c, torsion[0], torsion[1], torsion[2]];
    cases.compare(
        names.map(|what| format!("clamped rod, frequency of {what}")),
        exact,
        [50, 100],
        &vibration::frequencies,
    )
}

fn buckled(cases: &mut Cases<'_>) -> Result<(), ValidateError> {
    let sizes = [50, 100];
    let names = ["heavy column, w L³/B".to_owned()];
    cases.compare(names, [7.837_347], sizes, &|segments| Ok([buckling::heavy_column(segments)?]))?;
    for ratio in [1.0, 1.5] {
        let exact = std::f64::consts::TAU * 3_f64.sqrt() * ratio;
        let names = [format!("twisted ring, B/C = {ratio}")];
        cases.compare(names, [exact], sizes, &|segments| Ok([buckling::twisted_ring(ratio, segments)?]))?;
    }
    for (tipping, what, exact) in Tipping::ALL {
        let names = [format!("lateral-torsional buckling, {what}")];
        cases.compare(names, [exact], sizes, &|segments| Ok([tipping.critical(segments)?]))?;
    }
    for compression in [-1.0, 0.0, 0.5] {
        let names = [format!("twisted strut, P L²/π²B = {compression}")];
        cases.compare(names, [1.0], sizes, &|segments| Ok([buckling::twisted_strut(compression, segments)?]))?;
    }
    Ok(())
}

fn twisted(cases: &mut Cases<'_>) -> Result<(), ValidateError> {
    let names = ["force", "moment"].map(|what| format!("loaded helix, {what}"));
    cases.compare(names, helix::exact_wrench(), [50, 100], &helix::wrench)?;
    if !cases.quick {
        // A turn of the helix takes 26 edges. With 801 in all, the search does not converge: a move of the helix along the
        // rod takes no energy.
        let (found, exact) = (helix::localised(401)?, helix::exact_localised());
        for (number, what) in ["M L/B", "T L²/B", "largest angle"].into_iter().enumerate() {
            let case = format!("localised helix, 401 edges, {what}");
            (cases.report)(Finding::relative("rods", case, found[number], exact[number], 5e-3));
        }
    }
    let steps = if cases.quick { 100 } else { 1_000 };
    let [linking, writhe] = linking::drift(if cases.quick { 24 } else { 40 }, steps)?;
    let case = format!("Tw + Wr of a ring, {steps} steps, |Wr| to {writhe:.2}");
    (cases.report)(Finding::absolute("rods", case, linking, 1.0, 1e-12));
    Ok(())
}
