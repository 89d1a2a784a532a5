//! Code that generated elements call, and code that calls them: number types, SIMD lanes and levels, element traits,
//! batches, and the self-description of every generated element.

mod accumulate;
mod aligned;
mod array;
mod batch;
mod choose;
mod declaration;
mod element;
mod evaluate;
#[cfg(feature = "nalgebra")]
pub mod interop;
mod numbers;
mod operations;
mod results;
mod routine;
pub mod tape;

#[doc(hidden)]
pub use accumulate::Accumulate;
pub use aligned::Aligned;
pub use array::Array;
pub use batch::{
    BLOCK, Batch, BatchError, BatchWork, Batches, Flagged, Hessians, Packed, PackedForce, PackedMixed, PackedPotential,
    PackedResidual, Stored, WidePoints, for_each_batch, for_each_batch_in,
};
#[doc(hidden)]
pub use choose::Choose;
pub use declaration::{Declaration, Field, FieldKind, Kind, OperationCount, Property, Routine, WeightedPoints};
pub use element::{
    AnyElement, Block, Constraint, Element, ForceLaw, Inputs, MixedConstraint, MixedForce, MixedPotential, Outputs,
    Potential, ReducedPotential, Residual, RestError, StateSensitivity, Stateful, Vector3, VertexPotential,
    triangle_index,
};
#[doc(hidden)]
pub use element::{
    ConstraintHessianCall, ConstraintJacobianCall, ForceCall, GaussNewtonCall, GradientCall, HessianCall,
    HessianVectorCall, JacobiansCall, MixedConstraintHessianCall, MixedConstraintJacobianCall, MixedForceCall,
    MixedGaussNewtonCall, MixedGradientCall, MixedHessianCall, MixedJacobiansCall, MixedProductCall, MixedValueCall,
    NextCall, NextJacobiansCall, ReducedHessianCall, ResidualCall, ResidualJacobianCall, StateJacobianCall, ValueCall,
    VertexCall,
};
pub use evaluate::{
    evaluate_constraint, evaluate_force_law, evaluate_mixed_constraint, evaluate_mixed_force, evaluate_mixed_potential,
    evaluate_next, evaluate_potential, evaluate_residual, evaluate_state,
};
pub use numbers::{
    BLOCK_NUMBERS, Baseline, BlockSum, Flag, Flags, Float, Kernel, Lane, Level, LevelName, Mask, Number, Real,
    Unbounded, UnknownLevel, available, dispatch, dispatch_at, level,
};
#[doc(hidden)]
pub use numbers::{MASKS, Ray, Settle, Settled, Trace, TraceStep, elementary_functions};
pub use results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    MixedConstraintHessian, MixedConstraintJacobian, MixedForceValue, MixedGradient, MixedHessian, MixedJacobians,
    MixedProduct, NextJacobians, NextState, ReducedHessian, ResidualJacobian, ResidualValue, StateJacobian, Value,
    Vertex,
};
pub use routine::RoutineKind;
