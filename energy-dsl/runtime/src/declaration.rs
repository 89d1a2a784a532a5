use std::borrow::Cow;

/// The kind of a declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// An energy: a scalar U(x).
    Energy,
    /// A constraint: a scalar or vector C(x).
    Constraint,
    /// A force law: one vector per point, f(x, v).
    Force,
    /// A residual: a vector r(u).
    Residual,
}

impl Kind {
    /// Returns the keyword that declares this kind.
    #[must_use]
    pub const fn keyword(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Constraint => "constraint",
            Self::Force => "force",
            Self::Residual => "residual",
        }
    }
}

/// A property that a declaration claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    /// Translating all points changes nothing. Proved on the expression graph.
    TranslationInvariant,
    /// Rotating all points rotates the forces and changes no energy. Checked by the audit.
    RotationInvariant,
    /// The rest shape feels no force. Checked by the audit.
    ZeroForceAtRest,
    /// Mirroring all points or unknowns at the origin changes no value. Checked by the audit.
    Even,
}

impl Property {
    /// Returns the attribute that declares this property.
    #[must_use]
    pub const fn attribute(self) -> &'static str {
        match self {
            Self::TranslationInvariant => "invariant(translation)",
            Self::RotationInvariant => "invariant(rotation)",
            Self::ZeroForceAtRest => "rest_state(zero_force)",
            Self::Even => "even",
        }
    }
}

/// How an input changes when the scene moves, and how it moves as an unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FieldKind {
    /// Numbers that no motion of the scene changes. As an unknown, they move by addition.
    Numbers,
    /// A point in space or in a plane. As an unknown, it moves by addition.
    Point,
    /// A rotation, a unit quaternion w, x, y, z. As an unknown q, it moves by a rotation vector δ: q ← exp(δ) q, which
    /// turns by |δ| about δ.
    Rotation,
    /// A position in space, then a rotation. Unknowns are listed part by part, so this is a parameter, a rest shape or a
    /// state.
    Motion,
    /// A parameter that integrators set to the length of the time step.
    TimeStep,
}

/// A named input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name, as declared.
    pub name: Cow<'static, str>,
    /// How it moves.
    pub kind: FieldKind,
    /// Whether it is one unknown for all elements.
    pub shared: bool,
    /// Number of scalars.
    pub size: usize,
    /// Number of entries of an array; 1 for other inputs.
    pub entries: usize,
    /// Unit, as declared; empty if none was given.
    pub unit: Cow<'static, str>,
}

impl Field {
    /// Returns the number of scalars of one entry of an array; for other inputs, of the whole input.
    #[must_use]
    pub const fn entry_size(&self) -> usize {
        self.size / self.entries
    }

    /// Returns the number of coordinates in which the input moves as an unknown: 3 for a rotation, else its size.
    #[must_use]
    pub const fn increments(&self) -> usize {
        match self.kind {
            FieldKind::Rotation => 3,
            FieldKind::Motion => 6,
            FieldKind::Numbers | FieldKind::Point | FieldKind::TimeStep => self.size,
        }
    }
}

/// Operation counts of one routine, after simplification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OperationCount {
    /// Additions, subtractions, multiplications, negations, minima, maxima, absolute values, comparisons and
    /// selections.
    pub basic: usize,
    /// Products that fuse with a sum: one instruction if the processor has fused operations, else two.
    pub fused: usize,
    /// Count of divisions and square roots.
    pub divisions_and_roots: usize,
    /// Count of sin, cos, exp, log, atan2 and pow.
    pub transcendental: usize,
    /// Rounding-error terms (tails of 2Sum and of products). Their cost depends on the target: with fused multiply-add,
    /// a product's tail is one instruction and a sum's tail is five.
    pub error_terms: usize,
}

impl OperationCount {
    /// Returns the total. A fused multiply-add counts as two operations, an error term as one.
    #[must_use]
    pub const fn total(&self) -> usize {
        self.instructions() + self.fused
    }

    /// Returns the cost in instructions. A division or root counts as five, a transcendental as twenty, and an error
    /// term as three (one with fused operations, up to six without).
    #[must_use]
    pub const fn cost(&self) -> usize {
        self.instructions() + 4 * self.divisions_and_roots + 19 * self.transcendental + 2 * self.error_terms
    }

    /// Returns the number of instructions. A fused multiply-add counts as one.
    #[must_use]
    pub const fn instructions(&self) -> usize {
        self.basic + self.fused + self.divisions_and_roots + self.transcendental + self.error_terms
    }

    /// Returns the count of as many runs.
    #[must_use]
    pub const fn times(self, runs: usize) -> Self {
        Self {
            basic: self.basic * runs,
            fused: self.fused * runs,
            divisions_and_roots: self.divisions_and_roots * runs,
            transcendental: self.transcendental * runs,
            error_terms: self.error_terms * runs,
        }
    }
}

/// One generated routine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Routine {
    /// Name: `value`, `gradient`, `hessian`, `force`, `jacobians`, ….
    pub name: &'static str,
    /// Cost in reduced coordinates, before the expansion to points.
    pub reduced: OperationCount,
    /// Cost of the whole routine.
    pub full: OperationCount,
}

/// Points of a sum, with their weights.
pub type WeightedPoints = Cow<'static, [(usize, f64)]>;

/// Self-description of an element. Generated code borrows its texts and lists; elements that are read at run time own
/// them.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// Name of the generated type.
    pub name: Cow<'static, str>,
    /// Kind of the declaration.
    pub kind: Kind,
    /// Doc comment of the declaration.
    pub docs: Cow<'static, str>,
    /// Body as written, on one line.
    pub formula: Cow<'static, str>,
    /// Source of the declaration with everything it uses. It parses to the same program.
    pub source: Cow<'static, str>,
    /// The unknowns, in declared order: points, or any others if the declaration is [mixed](Self::is_mixed).
    pub points: Cow<'static, [Field]>,
    /// Inputs of the rest shape.
    pub rest: Cow<'static, [Field]>,
    /// Parameters, without the stiffness and damping that every constraint has.
    pub parameters: Cow<'static, [Field]>,
    /// The state that an element keeps from step to step. It follows the parameters, and is read in the same way.
    pub state: Cow<'static, [Field]>,
    /// Number of rows: 1 for an energy, the length of C or r, one per increment for a force.
    pub rows: usize,
    /// Claimed properties.
    pub properties: Cow<'static, [Property]>,
    /// Whether points enter only as differences. Proved on the expression graph, as are the next four fields and
    /// `dihedral`.
    pub translation_invariant: bool,
    /// Whether some second derivative of the energy, or some position derivative of the force, is not identically zero.
    /// `false` for gravity.
    pub curved: bool,
    /// Whether the second derivatives of the energy, or the derivatives of the force, are constant. Then they are
    /// computed only once.
    pub quadratic: bool,
    /// Whether the force depends on velocities.
    pub velocity_dependent: bool,
    /// Whether all Jacobians of the force are symmetric, entry by entry the same expression.
    pub symmetric: bool,
    /// Number of reduced coordinates.
    pub reduced_coordinates: usize,
    /// Each vector of the reduced coordinates, a sum of points. Empty for residuals.
    pub reduced_vectors: Cow<'static, [WeightedPoints]>,
    /// Points x₁, x₂, x₃ and x₄ if the energy depends on points only through the dihedral angle of the triangles
    /// x₁x₃x₄ and x₂x₃x₄. `reduced_vectors` are then x₄ − x₃, x₁ − x₃ and x₂ − x₃, in this order. `None` for all other
    /// formulas.
    pub dihedral: Option<[usize; 4]>,
    /// Robust primitives that the formula was compiled to.
    pub primitives: Cow<'static, [&'static str]>,
    /// Routines and their costs.
    pub routines: Cow<'static, [Routine]>,
}

impl Declaration {
    /// Returns the place of the time step, which integrators set, among the numbers of the parameters; `None` without
    /// `#[time_step(…)]`.
    #[must_use]
    pub fn time_step(&self) -> Option<usize> {
        let place = self.parameters.iter().position(|field| field.kind == FieldKind::TimeStep)?;
        Some(self.parameters[..place].iter().map(|field| field.size).sum())
    }

    /// Returns whether some unknowns are shared by all elements or are not points in space. Such an energy, constraint
    /// or force has the traits of mixed unknowns. Residuals are not mixed: they have any unknowns.
    #[must_use]
    pub fn is_mixed(&self) -> bool {
        let is_own_point = |field: &Field| field.kind == FieldKind::Point && field.size == 3 && !field.shared;
        self.kind != Kind::Residual && !self.points.iter().all(is_own_point)
    }

    /// Returns dimension and number of the points that the rest shape consists of, in the plane or in space; `None` if it
    /// has other inputs.
    #[must_use]
    pub fn rest_points(&self) -> Option<(usize, usize)> {
        let dimension = self.rest.first()?.entry_size();
        let are_points = (2..=3).contains(&dimension) && self.rest.iter().all(|field| field.entry_size() == dimension);
        are_points.then(|| (dimension, self.rest.iter().map(|field| field.entries).sum()))
    }

    /// Returns the count of numbers that hold the unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.points.iter().map(|field| field.size).sum()
    }

    /// Returns the count of coordinates in which the unknowns move: the columns of derivatives.
    #[must_use]
    pub fn increments(&self) -> usize {
        self.points.iter().map(Field::increments).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::OperationCount;

    #[test]
    fn counts_add_up() {
        let count = OperationCount {
            basic: 1,
            fused: 20,
            divisions_and_roots: 300,
            transcendental: 4_000,
            error_terms: 50_000,
        };
        assert_eq!(count.instructions(), 54_321);
        assert_eq!(count.total(), 54_341);
        assert_eq!(count.cost(), 1 + 20 + 5 * 300 + 20 * 4_000 + 3 * 50_000);
        let OperationCount { basic, fused, divisions_and_roots, transcendental, error_terms } = count.times(3);
        assert_eq!((basic, fused, divisions_and_roots, transcendental, error_terms), (3, 60, 900, 12_000, 150_000));
    }
}
