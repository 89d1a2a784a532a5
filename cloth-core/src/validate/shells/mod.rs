//! Known answers of shells by mid-edge normals: sheets with natural curvature, plates, and a roof.

mod grid;
mod plates;
mod sheets;

use super::{Finding, ValidateError};

/// Answers the question `shells`. A quick answer has coarse meshes and wider limits.
pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    for (clamped, what, exact) in [(false, "simply supported", 0.004_062_35), (true, "clamped", 0.001_265_32)] {
        let (cells, limit) = if quick { (16, 1e-1) } else { (48, 1e-2) };
        let fine = plates::deflection(clamped, cells)?;
        let case = format!("{what} plate, {cells} cells, deflection D/qa⁴");
        report(Finding::relative("shells", case, fine, exact, limit));
        if !quick {
            let errors = [plates::deflection(clamped, cells / 2)?, fine].map(|found| found - exact);
            report(Finding::order("shells", &format!("{what} plate"), errors, 2.0));
        }
    }
    let narrow = sheets::curvature(1.0 / 50.0, [50, 2])?;
    report(Finding::relative("shells", "natural curvature, narrow strip, κ/κ₀".into(), narrow, 1.0, 1e-2));
    if !quick {
        let wide = sheets::curvature(1.0, [40, 40])?;
        report(Finding::relative("shells", "natural curvature, wide sheet, κ/κ₀".into(), wide, 1.3, 1e-2));
        let roof = plates::roof(40)?;
        report(Finding::relative("shells", "roof of Scordelis and Lo, 40 cells".into(), roof, 0.3024, 2e-2));
    }
    Ok(())
}
