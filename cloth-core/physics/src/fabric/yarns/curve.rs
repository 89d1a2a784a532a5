//! Curves that stiffen: k e + a e³ + b e⁵ up to a largest strain m, and straight beyond.

/// Points whose tension is below this part of the largest one count by their absolute error: testers are least precise
/// there.
const PRECISION: f64 = 0.05;
/// The least slope at rest, relative to the first secant of the points.
const LEAST_SLOPE: f64 = 0.01;

/// A tension per width over a strain, or a shear force per width over a shear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffeningCurve {
    /// Slope k at rest, in N/m.
    pub k: f64,
    /// Coefficient a of the third power, in N/m.
    pub a: f64,
    /// Coefficient b of the fifth power, in N/m.
    pub b: f64,
    /// Strain m beyond which the curve is straight.
    pub m: f64,
}

impl StiffeningCurve {
    /// Creates a straight line, with the slope in N/m.
    #[must_use]
    pub fn straight(slope: f64) -> Self {
        Self { k: slope, a: 0.0, b: 0.0, m: 1.0 }
    }

    /// Creates a curve with the slope k at rest, in N/m, that ends at a strain and a tension, in N/m. `fifth` is the
    /// part of the stiffening that grows with the fifth power; the others grow with the third.
    pub(super) fn to_end(k: f64, [strain, tension]: [f64; 2], fifth: f64) -> Self {
        let excess = tension - k * strain;
        Self { k, a: (1.0 - fifth) * excess / strain.powi(3), b: fifth * excess / strain.powi(5), m: strain }
    }

    /// Returns the tension at a strain, in N/m.
    ///
    /// ```
    /// use cloth_physics::fabric::StiffeningCurve;
    /// let curve = StiffeningCurve { k: 100.0, a: 800.0, b: 0.0, m: 0.5 };
    /// assert_eq!(curve.tension(0.5), 150.0);
    /// assert_eq!(curve.tension(0.6), 150.0 + 0.1 * 700.0); // straight beyond 0.5
    /// ```
    #[must_use]
    pub fn tension(&self, strain: f64) -> f64 {
        let e = strain.abs().min(self.m);
        let square = e * e;
        let slope = self.k + square * (3.0 * self.a + 5.0 * square * self.b);
        (e * (self.k + square * (self.a + square * self.b)) + slope * (strain.abs() - e)).copysign(strain)
    }

    /// Fits points (strain, tension in N/m) with ascending coordinates above 0: weighted least squares with k, a, b ≥
    /// 0, so the curve is convex. Errors count relative to the tension of the point, or to 5 % of the largest tension
    /// if that is more.
    pub(super) fn fitted(points: &[[f64; 2]]) -> Self {
        let Some(&[m, largest]) = points.last() else { return Self::straight(0.0) };
        let least = LEAST_SLOPE * points[0][1] / points[0][0];
        // In x = e/m, with the least slope taken off.
        let row = |&[strain, tension]: &[f64; 2]| {
            let (x, weight) = (strain / m, 1.0 / tension.max(PRECISION * largest));
            ([x, x.powi(3), x.powi(5)].map(|power| weight * power), weight * (tension - least * strain))
        };
        let rows: Vec<([f64; 3], f64)> = points.iter().map(row).collect();
        let [k, a, b] = non_negative_least_squares(&rows);
        Self { k: least + k / m, a: a / m.powi(3), b: b / m.powi(5), m }
    }

    /// Returns the largest error at the points, relative to their tension, or to 5 % of the largest if that is more.
    pub(super) fn misfit(&self, points: &[[f64; 2]]) -> f64 {
        let largest = points.iter().map(|point| point[1]).fold(0.0, f64::max);
        let error =
            |&[strain, tension]: &[f64; 2]| (self.tension(strain) - tension).abs() / tension.max(PRECISION * largest);
        points.iter().map(error).fold(0.0, f64::max)
    }
}

/// Returns x ≥ 0 that minimises Σ (row · x − value)²: the best of the least-squares solutions on all subsets of
/// coordinates that are not negative.
fn non_negative_least_squares(rows: &[([f64; 3], f64)]) -> [f64; 3] {
    let error = |x: &[f64; 3]| -> f64 {
        let one = |(row, value): &([f64; 3], f64)| (0..3).map(|i| row[i] * x[i]).sum::<f64>() - value;
        rows.iter().map(|row| one(row).powi(2)).sum()
    };
    let mut best = [0.0; 3];
    for subset in 1..8_u8 {
        let used: Vec<usize> = (0..3).filter(|i| subset & (1 << i) != 0).collect();
        if let Some(x) = least_squares(rows, &used)
            && x.iter().all(|number| *number >= 0.0)
            && error(&x) < error(&best)
        {
            best = x;
        }
    }
    best
}

/// Least squares over some coordinates, by modified Gram–Schmidt; `None` if the points do not determine them.
fn least_squares(rows: &[([f64; 3], f64)], used: &[usize]) -> Option<[f64; 3]> {
    let product = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>();
    let mut rest: Vec<f64> = rows.iter().map(|(_, value)| *value).collect();
    let (mut units, mut triangle, mut parts) = (Vec::<Vec<f64>>::new(), Vec::<Vec<f64>>::new(), Vec::new());
    for &i in used {
        let mut column: Vec<f64> = rows.iter().map(|(row, _)| row[i]).collect();
        let before = product(&column, &column).sqrt();
        let mut above = Vec::new();
        for unit in &units {
            let part = product(unit, &column);
            column.iter_mut().zip(unit).for_each(|(number, unit)| *number -= part * unit);
            above.push(part);
        }
        let length = product(&column, &column).sqrt();
        if length <= 1e-9 * before {
            return None;
        }
        column.iter_mut().for_each(|number| *number /= length);
        let part = product(&column, &rest);
        rest.iter_mut().zip(&column).for_each(|(number, unit)| *number -= part * unit);
        above.push(length);
        parts.push(part);
        units.push(column);
        triangle.push(above);
    }
    let mut x = [0.0; 3];
    for number in (0..used.len()).rev() {
        let later: f64 = (number + 1..used.len()).map(|other| triangle[other][number] * x[used[other]]).sum();
        x[used[number]] = (parts[number] - later) / triangle[number][number];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_the_curve_that_its_points_lie_on() {
        for curve in [
            StiffeningCurve { k: 2800.0, a: 4e5, b: 0.0, m: 0.088 },
            StiffeningCurve { k: 40.0, a: 3.0, b: 900.0, m: 0.4 },
            StiffeningCurve { k: 1790.0, a: 0.0, b: 3e5, m: 0.16 },
        ] {
            let points: Vec<[f64; 2]> =
                (1..=5).map(|i| f64::from(i) / 5.0 * curve.m).map(|e| [e, curve.tension(e)]).collect();
            let fitted = StiffeningCurve::fitted(&points);
            let close =
                |found: f64, exact: f64, power: i32| (found - exact).abs() * curve.m.powi(power) < 1e-9 * points[4][1];
            assert!(
                close(fitted.k, curve.k, 1) && close(fitted.a, curve.a, 3) && close(fitted.b, curve.b, 5),
                "{fitted:?}"
            );
            assert!(fitted.misfit(&points) < 1e-12);
        }
    }

    #[test]
    fn a_curve_that_bends_down_is_fitted_by_a_straight_line_and_its_misfit_is_reported() {
        // The best line through (1, 3) and (2, 4) by relative error: minimises (k/3 − 1)² + (k/2 − 1)².
        let points = [[1.0, 3.0], [2.0, 4.0]];
        let fitted = StiffeningCurve::fitted(&points);
        let k = (1.0 / 3.0 + 1.0 / 2.0) / (1.0 / 9.0 + 1.0 / 4.0);
        assert!((fitted.k - k).abs() < 1e-12 && fitted.a == 0.0 && fitted.b == 0.0, "{fitted:?}");
        assert!((fitted.misfit(&points) - (1.0 - k / 3.0)).abs() < 1e-12);
    }

    #[test]
    fn one_point_makes_a_line_and_steep_points_keep_a_slope_at_rest() {
        let line = StiffeningCurve::fitted(&[[0.05, 20.0]]);
        assert!((line.tension(0.05) - 20.0).abs() < 1e-12);
        let steep = StiffeningCurve::fitted(&[[0.1, 1.0], [0.2, 400.0]]);
        assert!(steep.k > 0.0999 && steep.a >= 0.0 && steep.b > 0.0, "{steep:?}");
        // Slope and curve join without a jump, in both directions.
        let beyond = (steep.tension(0.2 + 1e-9) - steep.tension(0.2)) / 1e-9;
        let before = (steep.tension(0.2) - steep.tension(0.2 - 1e-9)) / 1e-9;
        assert!((beyond / before - 1.0).abs() < 1e-5 && steep.tension(-0.3) == -steep.tension(0.3));
    }
}
