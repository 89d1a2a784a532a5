//! Rods bent to helices: one of constant pitch between clamps (Love, chapter XIX), and the localised one of a long rod
//! under tension and torque (van der Heijden and Thompson 2000).

use super::ValidateError;
use super::rod::{Ends, Loaded, Rod, Vector, unit};
use crate::geometry::subtract;

/// Finds the equilibrium of a rod through points whose first and last edges are fixed. It is evenly twisted at the
/// start.
fn settled(mut rod: Rod, twist: f64, spacing: f64) -> Result<Loaded, ValidateError> {
    // Frames of reference that follow the first points have no twist.
    rod.twists = (0..rod.edges()).map(|edge| twist * edge as f64 * spacing).collect();
    let mut loaded = rod.at_rest()?;
    let report = loaded.settle(0.0)?;
    if report.converged() { Ok(loaded) } else { Err(ValidateError::NoRest(report)) }
}

/// A helix of a straight rod: radius, angle between tangent and axis, twist, and stiffnesses.
const RADIUS: f64 = 1.0;
const ANGLE: f64 = 0.6;
const TWIST: f64 = 1.0;
const BENDING: f64 = 1.0;
const TWISTING: f64 = 0.8;

/// Returns force and moment along the axis, with the exact ones: κ (C Ω − B τ)/sin ψ and C Ω cos ψ + B κ sin ψ.
pub(super) fn wrench(segments: usize) -> Result<[f64; 2], ValidateError> {
    // Half a turn: a whole one is not stable.
    let length = std::f64::consts::PI * RADIUS / ANGLE.sin();
    let spacing = length / segments as f64;
    let point = |number: usize| {
        let along = spacing * number as f64;
        let (sine, cosine) = (along * ANGLE.sin() / RADIUS).sin_cos();
        [RADIUS * cosine, RADIUS * sine, along * ANGLE.cos()]
    };
    let points = (0..=segments).map(point).collect();
    let mut rod = Rod::new(points, [0.0, 1.0, 0.0], Ends::BothHeld, [BENDING; 2], TWISTING);
    rod.stretching *= 10.0;
    let mut loaded = settled(rod, TWIST, spacing)?;
    let (force, moment) = loaded.held_end()?;
    Ok([force[2], moment[2]])
}

/// Returns the exact force and moment of [`wrench`].
pub(super) fn exact_wrench() -> [f64; 2] {
    let (sine, cosine) = ANGLE.sin_cos();
    let (curvature, torsion) = (sine * sine / RADIUS, sine * cosine / RADIUS);
    let force = curvature * (TWISTING * TWIST - BENDING * torsion) / sine;
    [force, TWISTING * TWIST * cosine + BENDING * curvature * sine]
}

/// A long rod whose ends were turned 27 times against each other and moved together by 3 % of its length, as
/// `pyelastica` has it: L, B and C, and m = M L/B and t = T L²/B of its exact shape.
const LONG: f64 = 100.0;
const LONG_BENDING: f64 = 1.345;
const LONG_TWISTING: f64 = 0.789;
const MOMENT: f64 = 98.541_496_171_190_74;
const TENSION: f64 = 2_900.993_205_792_131;

/// Returns m, t and the largest angle between tangent and axis.
///
/// Let φ and ψ be the Euler angles of the tangent. The moments about the axis and the tangent are M, so that ψ′ = M/(B
/// (1 + cos φ)). For v = 1 − cos φ, the energy integral gives v′² = v² (4T/B − M²/B² − 2 T v/B). So v = v₀ sech²(√(t −
/// m²/4) s/L) with v₀ = 2 − m²/2t. The slack ∫ v ds and the turn M L/C + 4 arccos(m/2√t) are those of the ends.
pub(super) fn localised(segments: usize) -> Result<[f64; 3], ValidateError> {
    let spacing = LONG / segments as f64;
    let mut points = vec![[0.0; 3]];
    for edge in 0..segments {
        let tangent = localised_tangent((edge as f64 + 0.5) * spacing - 0.5 * LONG);
        let last = points[edge];
        points.push(std::array::from_fn(|axis| last[axis] + spacing * tangent[axis]));
    }
    let twist = MOMENT * LONG_BENDING / (LONG * LONG_TWISTING);
    let mut rod = Rod::new(points, [0.0, 1.0, 0.0], Ends::BothHeld, [LONG_BENDING; 2], LONG_TWISTING);
    // The tension stretches the rod by less than 10⁻⁶.
    rod.stretching *= 3e4;
    rod.tolerance = 1e-6;
    let mut loaded = settled(rod, twist, spacing)?;
    let (force, moment) = loaded.held_end()?;
    let steepest = |edge: usize| unit(subtract(loaded.point(edge + 1), loaded.point(edge)))[2].acos();
    let angle = (0..segments).map(steepest).fold(0.0, f64::max);
    Ok([moment[2] * LONG / LONG_BENDING, force[2] * LONG * LONG / LONG_BENDING, angle])
}

/// Returns the exact values of [`localised`].
pub(super) fn exact_localised() -> [f64; 3] {
    [MOMENT, TENSION, (0.5 * MOMENT * MOMENT / TENSION - 1.0).acos()]
}

/// Returns the tangent at an arc length from the middle. The azimuth is the integral of ψ′ = m/(L (2 − v)).
fn localised_tangent(along: f64) -> Vector {
    let root = (TENSION - 0.25 * MOMENT * MOMENT).sqrt();
    let v = (2.0 - 0.5 * MOMENT * MOMENT / TENSION) / (root * along / LONG).cosh().powi(2);
    let azimuth = 0.5 * MOMENT * along / LONG + (2.0 * root / MOMENT * (root * along / LONG).tanh()).atan();
    let (sine, cosine) = azimuth.sin_cos();
    let across = (v * (2.0 - v)).sqrt();
    [across * cosine, across * sine, 1.0 - v]
}
