//! The unknowns of a body.

use super::error::MixedError;
use super::rotation;

/// The kind of an unknown: how many numbers hold it, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UnknownKind {
    /// One number: an angle, a pressure, a temperature.
    Scalar,
    /// Two numbers: a point of a plane, a vector.
    Vector2,
    /// Three numbers: a point in space, a vector.
    Vector3,
    /// A rotation: a unit quaternion w, x, y, z. It moves by a rotation vector δ, in rad: q ← exp(δ) q, which turns by
    /// |δ| about δ.
    Rotation,
}

impl UnknownKind {
    /// Returns the count of numbers.
    #[must_use]
    pub const fn numbers(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector2 => 2,
            Self::Vector3 => 3,
            Self::Rotation => 4,
        }
    }

    /// Returns the count of coordinates in which it moves: 3 for a rotation, else the count of numbers.
    #[must_use]
    pub const fn increments(self) -> usize {
        match self {
            Self::Rotation => 3,
            _ => self.numbers(),
        }
    }
}

impl std::fmt::Display for UnknownKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Scalar => "scalar",
            Self::Vector2 => "vector of 2",
            Self::Vector3 => "vector of 3",
            Self::Rotation => "rotation",
        })
    }
}

/// Kind of equilibrium in a shared unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Extremum {
    /// A minimum of the potential, as in all other unknowns.
    Minimum,
    /// A maximum: the potential is strictly concave in the unknown. So is the potential of a pressure that enforces a
    /// volume with some compliance, −p (V − V₀) − ½ κ p².
    Maximum,
    /// Neither: the potential is linear in the unknown, the multiplier of a constraint, such as a pressure that
    /// enforces a volume, −p (V − V₀). The others are at a minimum under the constraint. Needs a banded factorisation.
    Multiplier,
}

/// The unknowns of a body: those that elements have of their own, in order, and those that all elements share.
///
/// A *configuration* u is a flat vector with the numbers of the unknowns, then of the shared ones. Gradients, forces
/// and rates have one number per increment, in the same order.
///
/// Increments of different units are compared by a *scale*, in m per unit: 1 for vectors, and the length that
/// [`MixedBody::new`] takes for scalars and rotations, whose unit is then the radian.
#[derive(Clone, Debug, PartialEq)]
pub struct MixedBody {
    /// Own unknowns, then shared ones.
    unknowns: Vec<Unknown>,
    /// Number of own unknowns.
    own: usize,
    numbers: usize,
    increments: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unknown {
    pub(super) kind: UnknownKind,
    /// Position of its first number in configurations.
    pub(super) number: usize,
    /// Position of its first increment in gradients.
    pub(super) increment: usize,
    pub(super) fixed: bool,
    /// Metres per unit of its increments.
    pub(super) scale: f64,
    pub(super) extremum: Extremum,
}

impl Unknown {
    /// Returns the scale by which moves are compared with others.
    pub(super) fn metric(&self) -> f64 {
        if self.scale > 0.0 { self.scale } else { 1.0 }
    }

    /// Whether an equilibrium is a minimum in it.
    pub(super) fn is_minimised(&self) -> bool {
        self.extremum == Extremum::Minimum
    }
}

impl MixedBody {
    /// Creates a body. A turn by one radian counts as a move by `length`, in m: about the distance between neighbouring
    /// nodes, or the size of a rigid part.
    ///
    /// ```
    /// use energy_solve::{Extremum, MixedBody, UnknownKind};
    ///
    /// // Two points of a rod with a twist angle between them, and a pressure. The first point is fixed.
    /// let kinds = [UnknownKind::Vector3, UnknownKind::Scalar, UnknownKind::Vector3];
    /// let body = MixedBody::new(&kinds, 0.01);
    /// let body = body.with_shared(UnknownKind::Scalar, Extremum::Maximum, 0.0).with_fixed(&[0])?;
    /// assert_eq!((body.numbers(), body.increments()), (8, 8));
    /// assert_eq!(body.first_number(2), 4);
    /// # Ok::<(), energy_solve::MixedError>(())
    /// ```
    #[must_use]
    pub fn new(kinds: &[UnknownKind], length: f64) -> Self {
        let mut body = Self { unknowns: Vec::with_capacity(kinds.len()), own: 0, numbers: 0, increments: 0 };
        for &kind in kinds {
            let is_angle = matches!(kind, UnknownKind::Scalar | UnknownKind::Rotation);
            body.push(kind, if is_angle { length } else { 1.0 }, Extremum::Minimum);
        }
        body.own = kinds.len();
        body
    }

    fn push(&mut self, kind: UnknownKind, scale: f64, extremum: Extremum) {
        let (number, increment) = (self.numbers, self.increments);
        self.unknowns.push(Unknown { kind, number, increment, fixed: false, scale, extremum });
        self.numbers += kind.numbers();
        self.increments += kind.increments();
    }

    /// Adds an unknown that all elements share. `scale` is in m per unit of the unknown; with 0, its moves do not count
    /// for convergence.
    #[must_use]
    pub fn with_shared(mut self, kind: UnknownKind, extremum: Extremum, scale: f64) -> Self {
        self.push(kind, scale, extremum);
        self
    }

    /// Fixes unknowns: they keep their values and are left out of the matrix.
    ///
    /// # Errors
    /// If an unknown does not exist.
    pub fn with_fixed(mut self, unknowns: &[usize]) -> Result<Self, MixedError> {
        let count = self.own;
        for &unknown in unknowns {
            let own = self.unknowns[..count].get_mut(unknown);
            own.ok_or(MixedError::NoSuchUnknown { unknown, count })?.fixed = true;
        }
        Ok(self)
    }

    /// Fixes shared unknowns, such as a prescribed pressure.
    ///
    /// # Errors
    /// If a shared unknown does not exist.
    pub fn with_fixed_shared(mut self, unknowns: &[usize]) -> Result<Self, MixedError> {
        let count = self.shared_len();
        for &unknown in unknowns {
            let shared = self.unknowns[self.own..].get_mut(unknown);
            shared.ok_or(MixedError::NoSuchUnknown { unknown, count })?.fixed = true;
        }
        Ok(self)
    }

    /// Sets the scale of an unknown, in m per unit: for scalars that are not angles.
    ///
    /// # Errors
    /// If the unknown does not exist.
    pub fn with_scale(mut self, unknown: usize, scale: f64) -> Result<Self, MixedError> {
        let count = self.own;
        let own = self.unknowns[..count].get_mut(unknown);
        own.ok_or(MixedError::NoSuchUnknown { unknown, count })?.scale = scale;
        Ok(self)
    }

    /// Returns the number of unknowns that are not shared.
    #[must_use]
    pub fn len(&self) -> usize {
        self.own
    }

    /// Whether all unknowns are shared.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.own == 0
    }

    /// Returns the number of shared unknowns.
    #[must_use]
    pub fn shared_len(&self) -> usize {
        self.unknowns.len() - self.own
    }

    /// Returns the length of configurations.
    #[must_use]
    pub fn numbers(&self) -> usize {
        self.numbers
    }

    /// Returns the length of gradients.
    #[must_use]
    pub fn increments(&self) -> usize {
        self.increments
    }

    /// Returns the kind of an unknown.
    ///
    /// # Panics
    /// If it does not exist, as in the next functions.
    #[must_use]
    pub fn kind(&self, unknown: usize) -> UnknownKind {
        self.unknowns[..self.own][unknown].kind
    }

    /// Whether an unknown is fixed.
    #[must_use]
    pub fn is_fixed(&self, unknown: usize) -> bool {
        self.unknowns[..self.own][unknown].fixed
    }

    /// Returns the position of an unknown's first number in configurations.
    #[must_use]
    pub fn first_number(&self, unknown: usize) -> usize {
        self.unknowns[..self.own][unknown].number
    }

    /// Returns the position of an unknown's first increment in gradients.
    #[must_use]
    pub fn first_increment(&self, unknown: usize) -> usize {
        self.unknowns[..self.own][unknown].increment
    }

    /// Returns the position of a shared unknown's first number in configurations.
    #[must_use]
    pub fn first_shared_number(&self, shared: usize) -> usize {
        self.unknowns[self.own..][shared].number
    }

    /// Returns the position of a shared unknown's first increment in gradients.
    #[must_use]
    pub fn first_shared_increment(&self, shared: usize) -> usize {
        self.unknowns[self.own..][shared].increment
    }

    /// Returns all unknowns, the shared ones last.
    pub(super) fn all(&self) -> &[Unknown] {
        &self.unknowns
    }

    /// Checks a configuration: its length, that numbers are finite, and that quaternions have unit length.
    ///
    /// # Errors
    /// If it is not a configuration of this body.
    pub fn check(&self, u: &[f64]) -> Result<(), MixedError> {
        self.check_vector("numbers of unknowns", u, self.numbers)?;
        for (index, unknown) in self.unknowns.iter().enumerate() {
            if unknown.kind == UnknownKind::Rotation {
                let norm = u[unknown.number..][..4].iter().map(|c| c * c).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > 1e-6 {
                    return Err(MixedError::NotUnit { unknown: index, norm });
                }
            }
        }
        Ok(())
    }

    /// Checks that scales are positive; those of shared unknowns may be 0.
    pub(super) fn check_scales(&self) -> Result<(), MixedError> {
        let fits = |(index, unknown): (usize, &Unknown)| {
            unknown.scale.is_finite() && (unknown.scale > 0.0 || index >= self.own && unknown.scale == 0.0)
        };
        match self.unknowns.iter().enumerate().position(|unknown| !fits(unknown)) {
            Some(unknown) => Err(MixedError::WrongScale { unknown, scale: self.unknowns[unknown].scale }),
            None => Ok(()),
        }
    }

    /// Checks the length of a vector, and that its numbers are finite.
    pub(super) fn check_vector(&self, what: &'static str, vector: &[f64], expected: usize) -> Result<(), MixedError> {
        if vector.len() != expected {
            return Err(MixedError::WrongLength { what, expected, found: vector.len() });
        }
        match vector.iter().position(|number| !number.is_finite()) {
            Some(index) => Err(MixedError::NonFinite { what, index, value: vector[index] }),
            None => Ok(()),
        }
    }

    /// Returns the configuration that u becomes by `scale` times these increments: u + δ, and exp(δ) q, renormalised,
    /// for rotations. Unknowns whose increments are zero keep their bits.
    ///
    /// # Panics
    /// If a vector does not have the length that the body needs.
    #[must_use]
    pub fn moved(&self, u: &[f64], scale: f64, increments: &[f64]) -> Vec<f64> {
        assert!(u.len() == self.numbers && increments.len() == self.increments, "vectors of another body");
        let mut moved = u.to_vec();
        for unknown in &self.unknowns {
            let delta = &increments[unknown.increment..][..unknown.kind.increments()];
            let own = &mut moved[unknown.number..][..unknown.kind.numbers()];
            if delta.iter().all(|d| *d == 0.0) {
                continue;
            }
            match unknown.kind {
                UnknownKind::Rotation => {
                    let (q, delta) = (std::array::from_fn(|i| own[i]), std::array::from_fn(|i| scale * delta[i]));
                    own.copy_from_slice(&rotation::moved(q, delta));
                }
                _ => own.iter_mut().zip(delta).for_each(|(number, d)| *number += scale * d),
            }
        }
        moved
    }

    /// Returns the longest move of an unknown, in m by its scale.
    pub(super) fn longest(&self, increments: &[f64]) -> f64 {
        let length = |unknown: &Unknown| {
            let own = &increments[unknown.increment..][..unknown.kind.increments()];
            unknown.scale * own.iter().map(|d| d * d).sum::<f64>().sqrt()
        };
        self.unknowns.iter().map(length).fold(0.0, f64::max)
    }

    /// Returns the largest turn of a rotation, in rad.
    pub(super) fn largest_turn(&self, increments: &[f64]) -> f64 {
        let rotations = self.unknowns.iter().filter(|unknown| unknown.kind == UnknownKind::Rotation);
        let turn = |unknown: &Unknown| rotation::length(std::array::from_fn(|i| increments[unknown.increment + i]));
        rotations.map(turn).fold(0.0, f64::max)
    }
}
