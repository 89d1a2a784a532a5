//! The traits of generated elements. An element stores its parameters and numbers that its rest shape determines; its
//! methods take the moving points.
//!
//! Storage of second derivatives:
//!
//! - A block is 3×3; its rows are the components of the first point.
//! - A *triangle* holds the blocks (i, j) with i ≤ j of an N-point element, in the order (0,0), (0,1), …, (0,N−1),
//!   (1,1), …; see [`triangle_index`].
//! - A *square* holds all N×N blocks, row by row.

mod call;
mod mixed;

use std::borrow::Cow;

use crate::array::Array;
use crate::declaration::Declaration;
use crate::numbers::Flags;
use crate::numbers::Level;
use crate::numbers::{Number, Real};
use crate::results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    ReducedHessian, ResidualJacobian, ResidualValue, Value, Vertex,
};
use call::WrittenTo;
#[doc(hidden)]
pub use call::*;
pub use mixed::{MixedConstraint, MixedForce, MixedPotential, StateSensitivity, Stateful};

/// A point or vector in space.
pub type Vector3<T> = [T; 3];
/// A 3×3 block, row by row.
pub type Block<T> = [[T; 3]; 3];

/// Returns the index of block (i, j), i ≤ j < `points`, in a triangle.
///
/// ```
/// use energy_runtime::triangle_index;
/// assert_eq!((triangle_index(4, 0, 3), triangle_index(4, 1, 1), triangle_index(4, 3, 3)), (3, 4, 9));
/// ```
#[must_use]
pub const fn triangle_index(points: usize, i: usize, j: usize) -> usize {
    i * points - i * (i + 1) / 2 + j
}

/// The rest shape is degenerate: no element can be made from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RestError {
    /// Name of the element.
    pub element: Cow<'static, str>,
}

impl std::fmt::Display for RestError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: the rest shape is degenerate (zero length or area, inverted, or not finite)", self.element)
    }
}

impl std::error::Error for RestError {}

/// The inputs of an element, flattened in declared order. Tools use them to treat all elements in the same way; the
/// typed traits are faster.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a, T> {
    /// Parameters, flattened, in the order of the declaration. For a constraint, its stiffness k_s and damping k_d
    /// follow. The state of an element comes last.
    pub parameters: &'a [T],
    /// Rest-shape inputs.
    pub rest: &'a [T],
    /// The unknowns: three numbers per point, four per rotation.
    pub positions: &'a [T],
    /// Velocities, one number per increment of the unknowns; empty means zero.
    pub velocities: &'a [T],
}

/// All blocks of an element as full matrices, row by row.
#[derive(Clone, Debug)]
pub struct Outputs<T: Number> {
    /// Names and numbers of the blocks:
    ///
    /// - energies: `energy`, `grad`, `hess`
    /// - forces: `force`, `dfdx`, `dfdv`
    /// - constraints: all six, `constraint` and `jacobian`
    /// - residuals: `residual` and `jacobian`
    /// - with a state: `next`, `next_by_unknowns`, `next_by_state` and, but for forces, `slopes_by_state`: ∂²U/∂u∂(state),
    ///   or ∂r/∂(state)
    pub blocks: Vec<(&'static str, Vec<T>)>,
    /// Lower-order results that a routine also returns: routine, name of the block, numbers. They must equal that
    /// block.
    pub repeats: Vec<(&'static str, &'static str, Vec<T>)>,
    /// Flags of the value, the first and the second derivatives.
    pub flags: [Flags<T>; 3],
}

/// The interface that all kinds of generated elements share.
pub trait Element: Copy {
    /// The declaration and the cost of its routines.
    const DECLARATION: &'static Declaration;

    /// The same element over another number type.
    type Over<T: Real>: Element;

    /// Evaluates all blocks on flattened inputs.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError>;
}

/// An element behind a function pointer, for tools that treat all elements in the same way.
#[derive(Clone, Copy, Debug)]
pub struct AnyElement {
    /// The declaration that it was compiled from.
    pub declaration: &'static Declaration,
    /// Evaluates all blocks in double precision, as [`Element::evaluate`] does.
    pub evaluate: fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>,
}

impl AnyElement {
    /// Creates the entry of a generated element.
    #[must_use]
    pub const fn of<E: Element>() -> Self {
        Self { declaration: E::DECLARATION, evaluate: E::evaluate::<f64> }
    }
}

/// A potential energy U(x).
///
/// Outside of the formula's domain, such as at the logarithm of a negative volume, U is +∞, its derivatives are 0, and
/// [`Flags::degenerate`] is set. A line search that compares energies rejects such positions.
pub trait Potential<T: Real>: Element {
    /// One vector per point: `[Vector3<T>; N]`.
    type Points: Array<Vector3<T>>;
    /// The blocks on and above the diagonal: `[Block<T>; N (N + 1) / 2]`.
    type Triangle: Array<Block<T>>;

    /// Returns U.
    fn value(&self, x: &Self::Points) -> Value<T>;
    /// [`Self::value`] for callers that run at SIMD level `L`: it is inlined, so a loop over elements is one kernel.
    #[inline(always)]
    fn value_at<L: Level>(&self, x: &Self::Points) -> Value<T> {
        self.value(x)
    }
    /// Returns U and ∇U.
    fn gradient(&self, x: &Self::Points) -> Gradient<T, Self::Points>;
    /// [`Self::gradient`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn gradient_at<L: Level>(&self, x: &Self::Points) -> Gradient<T, Self::Points> {
        self.gradient(x)
    }
    /// Returns U, ∇U and ∇²U.
    fn hessian(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle>;
    /// [`Self::hessian`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn hessian_at<L: Level>(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        self.hessian(x)
    }

    /// Writes [`Self::hessian`] to `result`. This avoids copying some hundred numbers, which costs about as much as
    /// computing them.
    #[inline]
    fn hessian_into(&self, x: &Self::Points, result: &mut Hessian<T, Self::Points, Self::Triangle>) {
        T::dispatch(WrittenTo(HessianCall(self, x), result));
    }

    /// Returns ∇²U v for one vector per point in `v`, without forming ∇²U where that is cheaper.
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
    /// [`Self::hessian_vector`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn hessian_vector_at<L: Level>(&self, x: &Self::Points, v: &Self::Points) -> HessianVector<T, Self::Points> {
        self.hessian_vector(x, v)
    }
}

/// A potential with derivatives in reduced coordinates: the differences of points that the formula forms. There the
/// Hessian is smaller and cheaper to make positive semi-definite.
pub trait ReducedPotential<T: Real>: Potential<T> {
    /// One number per coordinate: `[T; n]`.
    type Coordinates: Array<T>;
    /// The upper triangle: `[T; n (n + 1) / 2]`.
    type Upper: Array<T>;

    /// Returns U, ∂U/∂q and ∂²U/∂q².
    fn reduced_hessian(&self, x: &Self::Points) -> ReducedHessian<T, Self::Coordinates, Self::Upper>;
    /// [`Self::reduced_hessian`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn reduced_hessian_at<L: Level>(&self, x: &Self::Points) -> ReducedHessian<T, Self::Coordinates, Self::Upper> {
        self.reduced_hessian(x)
    }
    /// Expands reduced derivatives to points: weighted sums of the reduced ones. Bit i of `FREE` marks point i as free;
    /// blocks of other points are 0 and cost nothing.
    fn expand<L: Level, const FREE: u32>(
        reduced: &ReducedHessian<T, Self::Coordinates, Self::Upper>,
    ) -> Hessian<T, Self::Points, Self::Triangle>;
    /// [`Potential::hessian_at`] with blocks of free points only. Bit i of `FREE` marks point i as free.
    #[inline(always)]
    fn hessian_free_at<L: Level, const FREE: u32>(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        Self::expand::<L, FREE>(&self.reduced_hessian_at::<L>(x))
    }
}

/// A potential with routines for single vertices, as `#[vertex]` asks for. Solvers that move one vertex at a time (vertex
/// block descent) need no more than these.
pub trait VertexPotential<T: Real>: Potential<T> {
    /// Returns U, and its first and second derivatives by one point alone. This costs less than the Hessian.
    ///
    /// ```text
    /// let energy_dsl::Vertex { gradient, block, .. } = spring.vertex(1, &x);
    /// ```
    ///
    /// # Panics
    /// When the element does not have the point.
    fn vertex(&self, point: usize, x: &Self::Points) -> Vertex<T>;
    /// [`Self::vertex`] for callers that run at SIMD level `L`.
    ///
    /// # Panics
    /// When the element does not have the point.
    fn vertex_at<L: Level>(&self, point: usize, x: &Self::Points) -> Vertex<T>;
}

/// A force f(x, v), which need not be the gradient of an energy.
pub trait ForceLaw<T: Real>: Element {
    /// One vector per point: `[Vector3<T>; N]`.
    type Points: Array<Vector3<T>>;
    /// All blocks: `[Block<T>; N * N]`.
    type Square: Array<Block<T>>;

    /// Returns f.
    fn force(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<T, Self::Points>;
    /// [`Self::force`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn force_at<L: Level>(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<T, Self::Points> {
        self.force(x, v)
    }
    /// Returns f, ∂f/∂x and ∂f/∂v.
    fn jacobians(&self, x: &Self::Points, v: &Self::Points) -> ForceJacobians<T, Self::Points, Self::Square>;
    /// [`Self::jacobians`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn jacobians_at<L: Level>(
        &self,
        x: &Self::Points,
        v: &Self::Points,
    ) -> ForceJacobians<T, Self::Points, Self::Square> {
        self.jacobians(x, v)
    }
}

/// A constraint C(x) and its compliant forms: the [`Potential`] ½ k_s CᵀC and the [`ForceLaw`] −Jᵀ (k_s C + k_d Ċ) with
/// Ċ = J v (Witkin).
pub trait Constraint<T: Real>: Potential<T> + ForceLaw<T> {
    /// One number per row of C: `[T; M]`.
    type Rows: Array<T>;
    /// One vector per row and point: `[Vector3<T>; M * N]`.
    type Jacobian: Array<Vector3<T>>;
    /// One triangle per row: `[Block<T>; M * N (N + 1) / 2]`.
    type Triangles: Array<Block<T>>;

    /// Returns C and J.
    fn constraint_jacobian(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintJacobian<T, Self::Rows, Self::Jacobian>;
    /// [`Self::constraint_jacobian`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn constraint_jacobian_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintJacobian<T, Self::Rows, Self::Jacobian> {
        self.constraint_jacobian(x)
    }
    /// Returns C, J and ∂²C.
    fn constraint_hessian(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles>;
    /// [`Self::constraint_hessian`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn constraint_hessian_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> ConstraintHessian<T, Self::Rows, Self::Jacobian, Self::Triangles> {
        self.constraint_hessian(x)
    }
    /// Returns value, gradient and the Gauss–Newton Hessian k_s JᵀJ of ½ k_s CᵀC. It is always positive semi-definite.
    fn gauss_newton(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> Hessian<T, <Self as Potential<T>>::Points, <Self as Potential<T>>::Triangle>;
    /// [`Self::gauss_newton`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn gauss_newton_at<L: Level>(
        &self,
        x: &<Self as Potential<T>>::Points,
    ) -> Hessian<T, <Self as Potential<T>>::Points, <Self as Potential<T>>::Triangle> {
        self.gauss_newton(x)
    }
}

/// A residual r(u) of arbitrary unknowns.
pub trait Residual<T: Real>: Element {
    /// All unknowns in declared order: `[T; U]`.
    type Unknowns: Array<T>;
    /// One number per row: `[T; M]`.
    type Rows: Array<T>;
    /// All entries, row by row: `[T; M * U]`.
    type Jacobian: Array<T>;

    /// Returns r.
    fn residual(&self, u: &Self::Unknowns) -> ResidualValue<T, Self::Rows>;
    /// [`Self::residual`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn residual_at<L: Level>(&self, u: &Self::Unknowns) -> ResidualValue<T, Self::Rows> {
        self.residual(u)
    }
    /// Returns r and J.
    fn jacobian(&self, u: &Self::Unknowns) -> ResidualJacobian<T, Self::Rows, Self::Jacobian>;
    /// [`Self::jacobian`] for callers that run at SIMD level `L`.
    #[inline(always)]
    fn jacobian_at<L: Level>(&self, u: &Self::Unknowns) -> ResidualJacobian<T, Self::Rows, Self::Jacobian> {
        self.jacobian(u)
    }

    /// Writes [`Self::jacobian`] to `result`, which avoids a copy.
    #[inline]
    fn jacobian_into(&self, u: &Self::Unknowns, result: &mut ResidualJacobian<T, Self::Rows, Self::Jacobian>) {
        T::dispatch(WrittenTo(ResidualJacobianCall(self, u), result));
    }
}
