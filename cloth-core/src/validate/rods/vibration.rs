//! Frequencies of a clamped rod, from its stiffness and its masses.

use super::ValidateError;
use super::buckling::largest;
use super::rod::{Ends, Loaded, Rod, arc};
use energy_solve::UnknownKind;

/// Angular frequencies of bending, over √(B/ρA)/L².
pub(super) const BENDING: [f64; 3] = [3.516_015_3, 22.034_491_6, 61.697_214_4];

/// Returns the frequencies of the three slowest motions of bending, over √(B/ρA)/L², and those of torsion, over
/// √(C/ρI)/L.
pub(super) fn frequencies(segments: usize) -> Result<[f64; 6], ValidateError> {
    let rod = Rod::new(arc(1.0, 0.0, segments), [0.0, 1.0, 0.0], Ends::Clamped, [1.0; 2], 1.0);
    let mut loaded = rod.at_rest()?;
    // A round rod bends in two planes with the same frequency.
    let mut frequencies = [0.0; 6];
    for number in 0..3 {
        frequencies[number] = frequency(&mut loaded, UnknownKind::Vector3, 2 * number + 1, segments)?;
        frequencies[3 + number] = frequency(&mut loaded, UnknownKind::Scalar, number + 1, segments)?;
    }
    Ok(frequencies)
}

/// Returns the angular frequency of a mode if only unknowns of one kind have masses: K − ω² M has as many negative
/// eigenvalues as there are slower modes (Sylvester).
fn frequency(loaded: &mut Loaded, kind: UnknownKind, mode: usize, segments: usize) -> Result<f64, ValidateError> {
    let (stiffness, mut factor, _) = loaded.factored()?;
    let body = loaded.system.body();
    let free: Vec<usize> = (0..body.len()).filter(|&unknown| !body.is_fixed(unknown)).collect();
    let mass = |unknown: usize| match body.kind(unknown) {
        of if of != kind => 0.0,
        // Only half an edge belongs to the tip.
        UnknownKind::Vector3 if unknown + 1 == body.len() => 0.5 / segments as f64,
        _ => 1.0 / segments as f64,
    };
    let mut slower = |frequency: f64| -> Result<usize, ValidateError> {
        let mut matrix = stiffness.clone();
        for (row, &unknown) in free.iter().enumerate() {
            let inertia = frequency * frequency * mass(unknown);
            matrix.kinds_mut().add(row, row, |i, j| if i == j { -inertia } else { 0.0 });
        }
        Ok(factor.factor(matrix.kinds())?)
    };
    largest(100.0, 1e-9, |frequency| Ok(slower(frequency)? < mode))
}
