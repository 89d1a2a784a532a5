//! The curves that testers draw, of a fabric of the library.

use anyhow::{Context, Result, anyhow};
use cloth_core::physics::fabric::{Bending, Fabric, Hysteresis, LibraryFabric, Material, Rigidity, StiffeningCurve};
use energy_cli::plot::{Axes, Line, linear};

/// Width and height of a plot, in pixels.
const SIZE: (u32, u32) = (640, 440);
/// Points of each curve.
const POINTS: u32 = 100;
/// The largest shear of KES-F testers: 8 degrees.
const LARGEST_ANGLE: f64 = 8.0;
/// The largest curvature of KES-F testers, in 1/m.
const LARGEST_CURVATURE: f64 = 250.0;
const BLUE: (u8, u8, u8) = (0, 114, 178);
const ORANGE: (u8, u8, u8) = (213, 94, 0);

#[derive(serde::Deserialize)]
struct File {
    fabric: Fabric,
}

/// Returns the plots of a fabric as SVG, each with the name of its quantity.
pub(super) fn plots(fabric: &LibraryFabric) -> Result<Vec<(&'static str, String)>> {
    let File { fabric: described } = toml::from_str(fabric.table).context(fabric.name)?;
    let Material::Yarns(yarns) = &described.material else { return Ok(Vec::new()) };
    let law = yarns.law().context(fabric.name)?;
    let mut plots =
        vec![("tension", tension(fabric.name, law.warp, law.weft)), ("shear", shear(fabric.name, law.shear))];
    if let Bending::Plate(Rigidity::Orthotropic { warp, weft, .. }) = yarns.bending {
        plots.push(("bending", bending(fabric.name, [warp, weft], described.hysteresis)));
    }
    plots.into_iter().map(|(name, plot)| Ok((name, plot.map_err(|error| anyhow!(error))?))).collect()
}

/// Returns points on a curve from 0 to `most`.
fn sampled(most: f64, curve: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..=POINTS).map(|i| most * f64::from(i) / f64::from(POINTS)).map(|x| (x, curve(x))).collect()
}

fn draw(title: &str, labels: (&str, &str), lines: &[Line<'_>]) -> Result<String, String> {
    let all = || lines.iter().flat_map(|line| &line.points);
    let most = |pick: fn(&(f64, f64)) -> f64| all().map(|point| pick(point).abs()).fold(0.0, f64::max);
    let (x, y) = (most(|point| point.0), 1.05 * most(|point| point.1));
    let is_loop = all().any(|point| point.0 < 0.0);
    let (across, up) = if is_loop { (-x..x, -y..y) } else { (0.0..x, 0.0..y) };
    linear(&Axes { title, labels, across, up, size: SIZE }, lines)
}

/// Draws tension over strain up to the strain at which the softer direction ends.
fn tension(name: &str, warp: StiffeningCurve, weft: StiffeningCurve) -> Result<String, String> {
    let line = |name, colour, curve: StiffeningCurve| {
        let points = sampled(100.0 * curve.m, |percent| curve.tension(percent / 100.0));
        Line { name, colour, points }
    };
    let lines = [line("warp", BLUE, warp), line("weft", ORANGE, weft)];
    draw(&format!("{name}: tension, sides held"), ("strain, %", "N/m"), &lines)
}

fn shear(name: &str, curve: StiffeningCurve) -> Result<String, String> {
    let points = sampled(LARGEST_ANGLE, |degrees| curve.tension(degrees.to_radians().sin()));
    draw(&format!("{name}: shear force"), ("angle, degrees", "N/m"), &[Line { name: "shear", colour: BLUE, points }])
}

fn bending(name: &str, [warp, weft]: [f64; 2], hysteresis: Option<Hysteresis>) -> Result<String, String> {
    let line = |name, colour, rigidity: f64| Line { name, colour, points: moment_loop(rigidity, hysteresis) };
    let lines = [line("warp", BLUE, warp), line("weft", ORANGE, weft)];
    draw(&format!("{name}: moment per width"), ("curvature, 1/m", "mN"), &lines)
}

/// Returns curvature (in 1/m) and moment per width (in mN) of a strip that is bent from flat to both sides and back.
fn moment_loop(rigidity: f64, hysteresis: Option<Hysteresis>) -> Vec<(f64, f64)> {
    let ends = [0.0, 1.0, -1.0, 1.0].map(|end| LARGEST_CURVATURE * end);
    let mut plastic = 0.0;
    let mut points = Vec::new();
    for pair in ends.windows(2) {
        for (part, _) in sampled(1.0, |part| part) {
            let curvature = pair[0] + part * (pair[1] - pair[0]);
            let friction = hysteresis.map_or(0.0, |Hysteresis { moment, curvature: limit }| {
                let elastic = (curvature - plastic).clamp(-limit, limit);
                plastic = curvature - elastic;
                moment * elastic / limit
            });
            points.push((curvature, 1e3 * (rigidity * curvature + friction)));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use cloth_core::physics::fabric::{LIBRARY, in_library};

    use super::*;

    #[test]
    fn every_fabric_has_three_plots() {
        for fabric in LIBRARY {
            let plots = plots(fabric).unwrap();
            assert_eq!(plots.iter().map(|plot| plot.0).collect::<Vec<_>>(), ["tension", "shear", "bending"]);
            assert!(plots.iter().all(|(_, svg)| svg.starts_with("<svg") && svg.contains(fabric.name)));
        }
        assert!(plots(in_library("denim").unwrap()).unwrap()[0].1.contains("weft"));
    }

    #[test]
    fn the_moment_loop_is_as_wide_as_twice_the_moment_of_friction() {
        let points = moment_loop(10e-6, Some(Hysteresis { moment: 0.6e-3, curvature: 20.0 }));
        let flat: Vec<f64> = points.iter().filter(|point| point.0.abs() < 1e-9).map(|point| point.1).collect();
        // Bent from flat, then crossing flat downwards and upwards.
        assert_eq!(flat.len(), 3);
        assert!(flat[0].abs() < 1e-9 && (flat[1] + 0.6).abs() < 1e-9 && (flat[2] - 0.6).abs() < 1e-9, "{flat:?}");
        assert!((points[100].1 - (10e-3 * 250.0 + 0.6)).abs() < 1e-9);
    }
}
