//! Curves of testers, and the numbers that are read off them.

/// Points (x, y) of a curve, in the order in which a tester passes them.
pub type Curve = Vec<[f64; 2]>;

/// Returns y at x by linear interpolation of a branch, on which x is monotone; `None` outside of it.
fn at(branch: &[[f64; 2]], x: f64) -> Option<f64> {
    let contains = |pair: &&[[f64; 2]]| (pair[0][0] - x) * (pair[1][0] - x) <= 0.0 && pair[0][0] != pair[1][0];
    let pair = branch.windows(2).find(contains)?;
    let part = (x - pair[0][0]) / (pair[1][0] - pair[0][0]);
    Some(pair[0][1] + part * (pair[1][1] - pair[0][1]))
}

/// Divides a curve where x turns.
fn branches(curve: &[[f64; 2]]) -> Vec<&[[f64; 2]]> {
    let (mut found, mut start, mut direction) = (Vec::new(), 0, 0.0);
    for at in 1..curve.len() {
        let way = curve[at][0] - curve[at - 1][0];
        if way * direction < 0.0 {
            found.push(&curve[start..at]);
            start = at - 1;
        }
        if way != 0.0 {
            direction = way;
        }
    }
    found.push(&curve[start..]);
    found
}

/// EMT and LT of a tensile curve of strain and force per width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tensile {
    /// Strain at the largest load.
    pub emt: f64,
    /// LT = 2 WT/(F_max EMT), with the work WT per area up to it: 1 for a straight line.
    pub lt: f64,
}

impl Tensile {
    /// Reads a curve off at a load per width, in N/m; `None` if it does not reach it.
    ///
    /// ```text
    /// F = k ε up to F_max has EMT = F_max/k and LT = 1.
    /// ```
    pub(super) fn of(curve: &[[f64; 2]], load: f64) -> Option<Self> {
        let last = curve.windows(2).position(|pair| pair[0][1] < load && pair[1][1] >= load)?;
        let [from, to] = [curve[last], curve[last + 1]];
        let emt = from[0] + (load - from[1]) / (to[1] - from[1]) * (to[0] - from[0]);
        let piece = |pair: &[[f64; 2]]| 0.5 * (pair[0][1] + pair[1][1]) * (pair[1][0] - pair[0][0]);
        let work: f64 = curve[..=last].windows(2).map(piece).sum::<f64>() + piece(&[from, [emt, load]]);
        Some(Self { emt, lt: 2.0 * work / (load * emt) })
    }
}

/// Stiffness and hysteresis of a curve that goes to one side, to the other, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Loop {
    /// Mean slope of loading on both sides.
    pub slope: f64,
    /// Mean width of the loop on both sides, at each of some places; `None` for a curve that does not return.
    pub widths: [Option<f64>; 2],
}

impl Loop {
    /// Reads slopes between two values of x, and widths at two others.
    pub(super) fn of(curve: &[[f64; 2]], [from, to]: [f64; 2], places: [f64; 2]) -> Option<Self> {
        let all = branches(curve);
        // Loading on a side is the first branch that gets to it.
        let slope = |side: f64| {
            let of =
                |branch: &&[[f64; 2]]| Some((at(branch, side * to)? - at(branch, side * from)?) / (side * (to - from)));
            all.iter().find_map(of)
        };
        let width = |place: f64| {
            let of_side = |side: f64| {
                let mut values = all.iter().filter_map(|branch| at(branch, side * place));
                Some((values.next()? - values.next()?) * side)
            };
            Some(0.5 * (of_side(1.0)? + of_side(-1.0)?))
        };
        Some(Self { slope: 0.5 * (slope(1.0)? + slope(-1.0)?), widths: places.map(width) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emt_and_lt_of_a_cubic_are_exact() {
        // F = k ε + a ε³: LT = (k ε²/2 + a ε⁴/4) · 2/(F ε).
        let force = |strain: f64| 3000.0 * strain + 1e6 * strain * strain * strain;
        let curve: Curve = (0..=2000).map(|at| f64::from(at) * 1e-4).map(|strain| [strain, force(strain)]).collect();
        let found = Tensile::of(&curve, force(0.08)).unwrap();
        let expected = 2.0 * (1500.0 * 0.0064 + 2.5e5 * 0.08_f64.powi(4)) / (force(0.08) * 0.08);
        assert!((found.emt - 0.08).abs() < 1e-9 && (found.lt - expected).abs() < 1e-5, "{found:?} {expected}");
        assert_eq!(Tensile::of(&curve[..10], 490.0), None);
    }

    #[test]
    fn a_loop_with_friction_has_its_slope_and_width() {
        // M = 2 x ± ½: friction of ½ to either side.
        let leg = |from: i32, to: i32| -> Curve {
            let sign = f64::from((to - from).signum());
            (0..=80)
                .map(|step| f64::from(from) + f64::from(to - from) * f64::from(step) / 80.0)
                .map(|x| [x, 2.0 * x + 0.5 * sign])
                .collect()
        };
        let curve = [leg(0, 8), leg(8, -8), leg(-8, 0)].concat();
        let found = Loop::of(&curve, [0.5, 2.5], [0.5, 5.0]).unwrap();
        assert!((found.slope - 2.0).abs() < 1e-12, "{found:?}");
        assert!(found.widths.iter().all(|width| (width.unwrap() - 1.0).abs() < 1e-12), "{found:?}");
        let once: Curve = (-8..=8).map(|x| [f64::from(x), 3.0 * f64::from(x)]).collect();
        let found = Loop::of(&once, [0.5, 2.5], [0.5, 5.0]).unwrap();
        assert!((found.slope - 3.0).abs() < 1e-12 && found.widths == [None; 2], "{found:?}");
    }
}
