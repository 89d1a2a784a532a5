//! The traits that generated elements implement. An element's value holds its parameters and whatever its rest shape
//! alone determines; its methods take the moving points.
//!
//! Storage: a block is 3×3, row = component of the first point. A *triangle* of an N-point element holds the blocks
//! (i, j) with i ≤ j in the order (0,0), (0,1), …, (0,N−1), (1,1), …; see [`triangle_index`]. A *square* holds all
//! N×N blocks row by row.

use super::array::Array;
use super::call::{HessianCall, ResidualJacobianCall, WrittenTo};
use super::cpu::Level;
use super::declaration::Declaration;
use super::flags::Flags;
use super::real::{Number, Real};
use super::results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    ReducedHessian, ResidualJacobian, ResidualValue, Value,
};

/// A point or vector.
pub type Vector3<T> = [T; 3];
/// A 3×3 block, row by row.
pub type Block<T> = [[T; 3]; 3];

/// The place of block (i, j), i ≤ j < `points`, in a triangle.
///
/// ```
/// use energy_runtime::triangle_index;
/// assert_eq!((triangle_index(4, 0, 3), triangle_index(4, 1, 1), triangle_index(4, 3, 3)), (3, 4, 9));
/// ```
#[must_use]
pub const fn triangle_index(points: usize, i: usize, j: usize) -> usize {
    i * points - i * (i + 1) / 2 + j
}

/// A rest shape from which an element cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestError {
    /// The element's name.
    pub element: &'static str,
}

impl std::fmt::Display for RestError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: the rest shape is degenerate (zero length or area, or not finite)", self.element)
    }
}

impl std::error::Error for RestError {}

/// The numbers an element is evaluated on, flattened in declared order: the way in for tools that handle every element
/// alike. The typed traits are the fast way.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a, T> {
    /// Parameters; of a constraint, its stiffness k_s and damping k_d follow the declared ones.
    pub parameters: &'a [T],
    /// Rest shape.
    pub rest: &'a [T],
    /// Positions, three to a point, or a residual's unknowns.
    pub positions: &'a [T],
    /// Velocities, three to a point; empty means zero.
    pub velocities: &'a [T],
}

/// Every block of an element, flattened row-major over all coordinates (no triangle, nothing left out).
#[derive(Clone, Debug)]
pub struct Outputs<T: Number> {
    /// Block name and its numbers. Energies: `energy`, `grad`, `hess`. Forces: `force`, `dfdx`, `dfdv`. Constraints: all six and
    /// `constraint`, `jacobian`. Residuals: `residual`, `jacobian`.
    pub blocks: Vec<(&'static str, Vec<T>)>,
    /// What routines return beside the block they are for: the routine, which block it is, and its numbers, to be held against that.
    pub repeats: Vec<(&'static str, &'static str, Vec<T>)>,
    /// Conditions met, by order of derivative: value, first, second.
    pub flags: [Flags<T>; 3],
}

/// What every generated element offers, whatever its kind.
pub trait Element: Copy {
    /// What was declared, and what it costs.
    const DECLARATION: &'static Declaration;

    /// The same element over another number type.
    type Over<T: Real>: Element;

    /// Evaluates every block on flattened inputs.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError>;
}

/// A potential energy U(x).
pub trait Potential<T: Real>: Element {
    /// One vector per point: `[Vector3<T>; N]`.
    type Points: Array<Vector3<T>>;
    /// The blocks on and above the diagonal: `[Block<T>; N (N + 1) / 2]`.
    type Triangle: Array<Block<T>>;

    /// U.
    fn value(&self, x: &Self::Points) -> Value<T>;
    /// [`Self::value`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn value_at<L: Level>(&self, x: &Self::Points) -> Value<T> {
        self.value(x)
    }
    /// U and ∇U.
    fn gradient(&self, x: &Self::Points) -> Gradient<T, Self::Points>;
    /// [`Self::gradient`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn gradient_at<L: Level>(&self, x: &Self::Points) -> Gradient<T, Self::Points> {
        self.gradient(x)
    }
    /// U, ∇U and ∇²U.
    fn hessian(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle>;
    /// [`Self::hessian`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn hessian_at<L: Level>(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        self.hessian(x)
    }

    /// [`Self::hessian`], written to `result` where it is: `*result = element.hessian(x)` would first make it elsewhere and copy some hundred
    /// numbers, at about the cost of computing them.
    #[inline]
    fn hessian_into(&self, x: &Self::Points, result: &mut Hessian<T, Self::Points, Self::Triangle>) {
        T::dispatch(WrittenTo(HessianCall(self, x), result));
    }

    /// ∇²U v, for one vector per point in `v`, without forming ∇²U where that is cheaper.
    fn hessian_vector(&self, x: &Self::Points, v: &Self::Points) -> HessianVector<T, Self::Points> {
        let Hessian { hessian, flags, .. } = self.hessian(x);
        let n = Self::Points::LEN;
        let (triangle, v) = (hessian.as_ref(), v.as_ref());
        let product = Self::Points::from_fn(|i| {
            std::array::from_fn(|row| {
                let mut sum = T::from_f64(0.0);
                for j in 0..n {
                    for column in 0..3 {
                        let entry = if i <= j {
                            triangle[triangle_index(n, i, j)][row][column]
                        } else {
                            triangle[triangle_index(n, j, i)][column][row]
                        };
                        sum = sum + entry * v[j][column];
                    }
                }
                sum
            })
        });
        HessianVector { product, flags }
    }
    /// [`Self::hessian_vector`] compiled into a caller that runs at level `L`.
    #[inline(always)]
    fn hessian_vector_at<L: Level>(&self, x: &Self::Points, v: &Self::Points) -> HessianVector<T, Self::Points> {
        self.hessian_vector(x, v)
    }
}

/// A potential whose derivatives can be had before their expansion to points: there the Hessian is smaller, and cheaper to
/// make positive semi-definite.
pub trait ReducedPotential<T: Real>: Potential<T> {
    /// One number per coordinate: `[T; n]`.
    type Coordinates: Array<T>;
    /// The upper triangle: `[T; n (n + 1) / 2]`.
    type Upper: Array<T>;

    /// U, ∂U/∂q and ∂²U/∂q².
    fn reduced_hessian(&self, x: &Self::Points) -> ReducedHessian<T, Self::Coordinates, Self::Upper>;
    /// [`Self::reduced_hessian`] compiled into a caller that runs at level `L`.
    #[inline(always)]
    fn reduced_hessian_at<L: Level>(&self, x: &Self::Points) -> ReducedHessian<T, Self::Coordinates, Self::Upper> {
        self.reduced_hessian(x)
    }
    /// The derivatives by the points: sums of those by the coordinates with signs. Blocks of points whose bit in `FREE` is not
    /// set are left out, that is, 0: what only they need is not computed.
    fn expand<const FREE: u32>(
        reduced: &ReducedHessian<T, Self::Coordinates, Self::Upper>,
    ) -> Hessian<T, Self::Points, Self::Triangle>;
    /// [`Potential::hessian_at`] with the blocks of free points only: point i is free where bit i of `FREE` is set.
    #[inline(always)]
    fn hessian_free_at<L: Level, const FREE: u32>(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        Self::expand::<FREE>(&self.reduced_hessian_at::<L>(x))
    }
}

/// A force f(x, v), not necessarily the gradient of anything.
pub trait ForceLaw<T: Real>: Element {
    /// One vector per point: `[Vector3<T>; N]`.
    type Points: Array<Vector3<T>>;
    /// All blocks: `[Block<T>; N * N]`.
    type Square: Array<Block<T>>;

    /// f.
    fn force(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<T, Self::Points>;
    /// [`Self::force`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn force_at<L: Level>(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<T, Self::Points> {
        self.force(x, v)
    }
    /// f, ∂f/∂x and ∂f/∂v.
    fn jacobians(&self, x: &Self::Points, v: &Self::Points) -> ForceJacobians<T, Self::Points, Self::Square>;
    /// [`Self::jacobians`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn jacobians_at<L: Level>(
        &self,
        x: &Self::Points,
        v: &Self::Points,
    ) -> ForceJacobians<T, Self::Points, Self::Square> {
        self.jacobians(x, v)
    }
}

/// A constraint C(x) with its compliant forms: as a [`Potential`] it is ½ k_s CᵀC, as a [`ForceLaw`] the force
/// −Jᵀ (k_s C + k_d Ċ), Ċ = J v (Witkin).
pub trait Constraint<T: Real>: Potential<T> + ForceLaw<T> {
    /// One number per row of C: `[T; M]`.
    type Rows: Array<T>;
    /// One vector per row and point: `[Vector3<T>; M * N]`.
    type Jacobian: Array<Vector3<T>>;
    /// One triangle per row: `[Block<T>; M * N (N + 1) / 2]`.
    type Triangles: Array<Block<T>>;

    /// C and J.
    fn constraint_jacobian(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintJacobian<T, Self::Rows, Self::Jacobian>;
    /// [`Self::constraint_jacobian`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn constraint_jacobian_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintJacobian<T, Self::Rows, Self::Jacobian> {
        self.constraint_jacobian(x)
    }
    /// C, J and ∂²C.
    fn constraint_hessian(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles>;
    /// [`Self::constraint_hessian`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn constraint_hessian_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles> {
        self.constraint_hessian(x)
    }
    /// The always positive semi-definite part k_s JᵀJ of the Hessian of ½ k_s CᵀC, with value and gradient.
    fn gauss_newton(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> Hessian<T, <Self as Potential<T>>::Points, <Self as Potential<T>>::Triangle>;
    /// [`Self::gauss_newton`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn gauss_newton_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> Hessian<T, <Self as Potential<T>>::Points, <Self as Potential<T>>::Triangle> {
        self.gauss_newton(x)
    }
}

/// A residual r(u) of unknowns that need not be points.
pub trait Residual<T: Real>: Element {
    /// All unknowns, in declared order: `[T; U]`.
    type Unknowns: Array<T>;
    /// One number per row: `[T; M]`.
    type Rows: Array<T>;
    /// Row-major: `[T; M * U]`.
    type Jacobian: Array<T>;

    /// r.
    fn residual(&self, u: &Self::Unknowns) -> ResidualValue<T, Self::Rows>;
    /// [`Self::residual`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn residual_at<L: Level>(&self, u: &Self::Unknowns) -> ResidualValue<T, Self::Rows> {
        self.residual(u)
    }
    /// r and J.
    fn jacobian(&self, u: &Self::Unknowns) -> ResidualJacobian<T, Self::Rows, Self::Jacobian>;
    /// [`Self::jacobian`] compiled into a caller that runs at level `L`, so that a loop over elements is one kernel.
    #[inline(always)]
    fn jacobian_at<L: Level>(&self, u: &Self::Unknowns) -> ResidualJacobian<T, Self::Rows, Self::Jacobian> {
        self.jacobian(u)
    }

    /// [`Self::jacobian`], written to `result` where it is and not made elsewhere and copied.
    #[inline]
    fn jacobian_into(&self, u: &Self::Unknowns, result: &mut ResidualJacobian<T, Self::Rows, Self::Jacobian>) {
        T::dispatch(WrittenTo(ResidualJacobianCall(self, u), result));
    }
}
