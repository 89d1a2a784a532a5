//! Invariants of knots and links, from the crossings that closed polygons show when seen from above.

use energy_dsl::Vector3;

use crate::geometry::{dot, subtract};

/// A closed polygon.
pub(super) type Loop = Vec<Vector3<f64>>;

/// A place where one strand passes over another.
struct Crossing {
    over: Place,
    under: Place,
    /// 1 if the lower strand runs from right to left under the upper one, otherwise −1.
    sign: f64,
}

/// A point of a polygon.
#[derive(Clone, Copy)]
struct Place {
    polygon: usize,
    /// The index of the side, plus the part of it before the point.
    along: f64,
}

/// Axes of a view in which sides of regular meshes hide no other.
const VIEW: [Vector3<f64>; 3] = [[0.95, 0.21, 0.23], [-0.25, 0.94, 0.23], [-0.17, -0.28, 0.94]];

/// Returns the linking number of two closed polygons: half the sum of the signs of their crossings.
pub(super) fn linking_number(a: &Loop, b: &Loop) -> f64 {
    let crossings = crossings(&[a, b]);
    let mutual = crossings.iter().filter(|crossing| crossing.over.polygon != crossing.under.polygon);
    0.5 * mutual.map(|crossing| crossing.sign).sum::<f64>()
}

/// Returns the determinant of a knot, |Δ(−1)| for its Alexander polynomial Δ: 1 for an unknotted loop, 3 for a trefoil,
/// 9 for a reef knot.
pub(super) fn determinant(knot: &Loop) -> f64 {
    let crossings = crossings(&[knot]);
    let mut ends: Vec<f64> = crossings.iter().map(|crossing| crossing.under.along).collect();
    ends.sort_by(f64::total_cmp);
    // Arcs run from one passage below to the next.
    let arc = |along: f64| ends.partition_point(|end| *end < along) % ends.len();
    let row = |Crossing { over, under, .. }: &Crossing| {
        let mut row = vec![0.0; ends.len()];
        let before = arc(under.along);
        row[arc(over.along)] += 2.0;
        row[before] -= 1.0;
        row[(before + 1) % ends.len()] -= 1.0;
        row
    };
    // Any minor will do: the last row and the last column are left out.
    let size = ends.len().saturating_sub(1);
    size_of_determinant(crossings.iter().take(size).map(|crossing| row(crossing)[..size].to_vec()).collect())
}

/// Returns the absolute value of a determinant, by elimination with pivots.
fn size_of_determinant(mut rows: Vec<Vec<f64>>) -> f64 {
    let mut product = 1.0;
    for column in 0..rows.len() {
        let size = |row: &usize| rows[*row][column].abs();
        let pivot = (column..rows.len()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        rows.swap(column, pivot);
        let (done, below) = rows.split_at_mut(column + 1);
        let pivot = &done[column];
        product *= pivot[column];
        if product == 0.0 {
            return 0.0;
        }
        for row in below {
            let factor = row[column] / pivot[column];
            row.iter_mut().zip(pivot).for_each(|(entry, above)| *entry -= factor * above);
        }
    }
    product.abs()
}

fn crossings(polygons: &[&Loop]) -> Vec<Crossing> {
    let seen = |x: &Vector3<f64>| VIEW.map(|axis| dot(axis, *x));
    let side = |polygon: usize| {
        let points: Loop = polygons[polygon].iter().map(seen).collect();
        let count = points.len();
        (0..count).map(move |at| (Place { polygon, along: at as f64 }, [points[at], points[(at + 1) % count]]))
    };
    let sides: Vec<_> = (0..polygons.len()).flat_map(side).collect();
    let mut all = Vec::new();
    for (number, &(at, a)) in sides.iter().enumerate() {
        let later = sides[number + 1..].iter().filter_map(|&(other, b)| crossing((at, a), (other, b)));
        all.extend(later);
    }
    all
}

/// Returns the crossing of two sides in the plane of the first two axes. Sides that share a corner do not cross.
fn crossing((at, [a, b]): (Place, [Vector3<f64>; 2]), (other, [c, d]): (Place, [Vector3<f64>; 2])) -> Option<Crossing> {
    let (u, v, w) = (subtract(b, a), subtract(d, c), subtract(c, a));
    let turn = |p: Vector3<f64>, q: Vector3<f64>| p[0] * q[1] - p[1] * q[0];
    let area = turn(u, v);
    let (first, second) = (turn(w, v) / area, turn(w, u) / area);
    let shares = a == c || a == d || b == c || b == d;
    if shares || !((0.0..1.0).contains(&first) && (0.0..1.0).contains(&second)) {
        return None;
    }
    let places = [Place { along: at.along + first, ..at }, Place { along: other.along + second, ..other }];
    let height = w[2] + second * v[2] - first * u[2];
    let (over, under) = if height < 0.0 { (places[0], places[1]) } else { (places[1], places[0]) };
    // Exchanging the strands changes the sign of the area, and that of the height.
    Some(Crossing { over, under, sign: -(area * height).signum() })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn curve(x: impl Fn(f64) -> Vector3<f64>) -> Loop {
        (0..120).map(|at| x(TAU * f64::from(at) / 120.0)).collect()
    }

    fn torus_knot(turns: f64) -> Loop {
        curve(|t| {
            let radius = 2.0 + (turns * t).cos();
            [radius * (2.0 * t).cos(), radius * (2.0 * t).sin(), (turns * t).sin()]
        })
    }

    #[test]
    fn rings_link_once_or_not_at_all() {
        let ring = curve(|t| [t.cos(), t.sin(), 0.0]);
        let through = curve(|t| [1.0 + t.cos(), 0.0, t.sin()]);
        let reversed: Loop = through.iter().rev().copied().collect();
        assert_eq!(linking_number(&ring, &through).abs(), 1.0);
        assert_eq!(linking_number(&ring, &reversed), -linking_number(&ring, &through));
        assert_eq!(linking_number(&ring, &curve(|t| [3.0 + t.cos(), 0.0, t.sin()])), 0.0);
    }

    #[test]
    fn determinants_match_the_tables() {
        assert_eq!(determinant(&curve(|t| [t.cos(), t.sin(), 0.3 * (2.0 * t).cos()])), 1.0);
        for (turns, exact) in [(3.0, 3.0), (5.0, 5.0), (7.0, 7.0)] {
            assert!((determinant(&torus_knot(turns)) - exact).abs() < 1e-9, "{turns}");
        }
        // A figure-eight knot.
        let eight = curve(|t| {
            let radius = 2.0 + (2.0 * t).cos();
            [radius * (3.0 * t).cos(), radius * (3.0 * t).sin(), (4.0 * t).sin()]
        });
        assert!((determinant(&eight) - 5.0).abs() < 1e-9);
    }
}
