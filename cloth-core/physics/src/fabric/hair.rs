use std::f64::consts::FRAC_PI_2;

use energy_dsl::Vector3;
use energy_elements::{HairBend, HookeSpring};
use schemars::JsonSchema;
use serde::Deserialize;

use super::curled_hair::{Curled, CurledStrands};
use super::{FabricError, FabricTerms, Surroundings, SystemPart};
use crate::bounded::{Count, Direction, MaybeReal, MaybeReals, NonNegative, Number, Positive, Real, Reals};
use crate::geometry::{dot, norm};

/// Strands of hair, straight at rest: springs along the segments, bending at the vertices between them.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hair {
    /// Name for pins and seams. Default `hair` and its index from 0.
    #[serde(default)]
    pub name: Option<String>,
    /// Number of strands. Roots are evenly spaced from `root` to `last_root`.
    #[serde(with = "Count::<1, 4096>")]
    pub count: usize,
    /// Segments per strand.
    #[serde(with = "Count::<2, 4096>")]
    pub segments: usize,
    /// Length of a strand, in m.
    #[serde(with = "Real::<Positive>")]
    pub length: f64,
    /// Root of the first strand, in m. Default the origin.
    #[serde(default, with = "Reals::<Number, 3>")]
    pub root: [f64; 3],
    /// Root of the last strand, in m. Default the root of the first.
    #[serde(default, with = "MaybeReals::<Number, 3>")]
    pub last_root: Option<[f64; 3]>,
    /// Initial direction of the strands, away from the root. Default [0, 0, −1].
    #[serde(default = "down", with = "Direction")]
    pub direction: [f64; 3],
    /// Mass per length, in kg/m.
    #[serde(with = "Real::<Positive>")]
    pub density: f64,
    /// Tension over strain, in N: Young's modulus times the area of the cross-section.
    #[serde(with = "Real::<Positive>")]
    pub stretch_stiffness: f64,
    /// Bending moment over curvature, in N m²: Young's modulus times the second moment of area of the cross-section.
    #[serde(with = "Real::<NonNegative>")]
    pub bend_stiffness: f64,
    /// Natural curl, and resistance to twist. Default none: strands are straight at rest, and twist freely.
    #[serde(default)]
    pub curl: Option<Curl>,
    /// Whether the roots keep their position and direction. Default true.
    #[serde(default = "yes")]
    pub rooted: bool,
}

/// The natural shape of a strand without loads: a helix, or a circle without torsion. Strands start straight and curl.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curl {
    /// Curvature, in 1/m: of a circle, one over its radius.
    #[serde(with = "Real::<NonNegative>")]
    pub curvature: f64,
    /// Torsion, in 1/m. A helix of radius r and rise h per radian has the curvature r/(r² + h²) and the torsion
    /// h/(r² + h²). Default 0.
    #[serde(default, with = "Real::<Number>")]
    pub torsion: f64,
    /// Twisting moment over twist per length, in N m². Default two thirds of `bend_stiffness`, as for a round,
    /// incompressible strand.
    #[serde(default, with = "MaybeReal::<NonNegative>")]
    pub twist_stiffness: Option<f64>,
    /// The axis about which the root curls; its part along the strand does not count. Default [1, 0, 0], or [0, 1, 0]
    /// for strands along it.
    #[serde(default, with = "MaybeReals::<Number, 3>")]
    pub axis: Option<[f64; 3]>,
}

fn down() -> [f64; 3] {
    [0.0, 0.0, -1.0]
}

fn yes() -> bool {
    true
}

impl Hair {
    /// Returns the thickness of a strand in contact, in m: the diameter of the round cross-section with these
    /// stiffnesses, 4 √(bend/stretch), but at least 0.05 mm.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        (4.0 * (self.bend_stiffness / self.stretch_stiffness).sqrt()).max(5e-5)
    }

    /// Returns the initial vertices, strand by strand from the root, in m.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vector3<f64>> {
        let last = self.last_root.unwrap_or(self.root);
        let unit = self.direction.map(|component| component / norm(self.direction));
        let mut vertices = Vec::with_capacity(self.count * (self.segments + 1));
        for strand in 0..self.count {
            let across = strand as f64 / (self.count - 1).max(1) as f64;
            for joint in 0..=self.segments {
                let along = self.length * joint as f64 / self.segments as f64;
                vertices.push(std::array::from_fn(|axis| {
                    self.root[axis] + across * (last[axis] - self.root[axis]) + along * unit[axis]
                }));
            }
        }
        vertices
    }

    /// Returns the mass of each vertex, in kg: half the mass of each adjacent segment.
    #[must_use]
    pub fn masses(&self) -> Vec<f64> {
        let segment = self.density * self.length / self.segments as f64;
        let end = |joint: usize| joint.is_multiple_of(self.segments);
        (0..self.count)
            .flat_map(|_| (0..=self.segments).map(|j| if end(j) { 0.5 * segment } else { segment }))
            .collect()
    }
}

/// Creates the terms of hair, whose strands follow one another in the system.
///
/// # Errors
/// Returns an error if there are more vertices than an index can hold.
pub fn hair_terms(hair: &Hair, surroundings: &Surroundings, part: SystemPart) -> Result<FabricTerms, FabricError> {
    let mut terms = FabricTerms::new(hair.masses(), part);
    let starts = || (0..hair.count).map(|strand| strand * (hair.segments + 1));
    let segments: Vec<[usize; 2]> =
        starts().flat_map(|start| (start..start + hair.segments).map(|at| [at, at + 1])).collect();
    let bends: Vec<[usize; 3]> =
        starts().flat_map(|start| (start..start + hair.segments - 1).map(|at| [at, at + 1, at + 2])).collect();
    let length = hair.length / hair.segments as f64;
    let springs = vec![HookeSpring::new(hair.stretch_stiffness / length, length); segments.len()];
    terms.add_potential("hair stretch", &segments, springs)?;
    if let Some(curl) = &hair.curl {
        let strands = curled(hair, curl)?;
        if !terms.leave_out("hair curl", hair.bend_stiffness == 0.0, bends.len()) {
            terms.add_driven("hair curl", &bends, strands);
        }
    } else if !terms.leave_out("hair bending", hair.bend_stiffness == 0.0, bends.len()) {
        // k/2 (1 − cos φ) ≈ k φ²/4 must equal the energy of a rod over one segment, B φ²/(2 l).
        let bending = vec![HairBend::new(2.0 * hair.bend_stiffness / length); bends.len()];
        terms.add_potential("hair bending", &bends, bending)?;
    }
    terms.add_surroundings(surroundings)?;
    Ok(terms)
}

/// Returns the bending and twist of strands with a natural curl.
fn curled(hair: &Hair, curl: &Curl) -> Result<CurledStrands, FabricError> {
    let length = hair.length / hair.segments as f64;
    // If two segments differ by more than a quarter of a turn, the sense of twist is ambiguous.
    let turn = length * curl.curvature.hypot(curl.torsion);
    if turn > FRAC_PI_2 {
        let least = (hair.length * curl.curvature.hypot(curl.torsion) / FRAC_PI_2).ceil();
        return Err(FabricError::CurlTooTight { turn: turn.to_degrees(), least });
    }
    let along = hair.direction.map(|component| component / norm(hair.direction));
    let across = |axis: Vector3<f64>| {
        let part = dot(axis, along);
        let across: Vector3<f64> = std::array::from_fn(|i| axis[i] - part * along[i]);
        (norm(across) > 1e-6 * norm(axis)).then(|| across.map(|component| component / norm(across)))
    };
    let axis = match curl.axis {
        Some(axis) => across(axis).ok_or(FabricError::CurlAxis { axis })?,
        None => across([1.0, 0.0, 0.0]).or_else(|| across([0.0, 1.0, 0.0])).expect("one of them is across"),
    };
    let numbers = Curled {
        bend: hair.bend_stiffness,
        twist: curl.twist_stiffness.unwrap_or(2.0 / 3.0 * hair.bend_stiffness),
        length,
        curvature: curl.curvature,
        torsion: curl.torsion,
    };
    Ok(CurledStrands::new(numbers, hair.count, hair.segments - 1, [along, axis], hair.rooted))
}
