//! Code that generated elements call, and code that calls them: number types, SIMD lanes and levels, element traits,
//! batches, and the self-description of every generated element.

mod aligned;
mod array;
mod batch;
mod call;
mod choose;
mod cpu;
mod declaration;
mod element;
mod elementary;
mod evaluate;
mod flags;
mod real;
mod results;
mod unbounded;

pub use aligned::Aligned;
pub use array::Array;
pub use batch::{
    BLOCK, Batch, BatchWork, Batches, Hessians, Packed, PackedForce, PackedPotential, PackedResidual, Stored,
    WidePoints, for_each_batch, for_each_batch_in,
};
#[doc(hidden)]
pub use call::{
    ConstraintHessianCall, ConstraintJacobianCall, ForceCall, GaussNewtonCall, GradientCall, HessianCall,
    HessianVectorCall, JacobiansCall, ReducedHessianCall, ResidualCall, ResidualJacobianCall, ValueCall,
};
#[doc(hidden)]
pub use choose::Choose;
pub use cpu::{
    BLOCK_NUMBERS, Baseline, BlockSum, Kernel, Lane, Level, LevelName, UnknownLevel, available, dispatch, dispatch_at,
    level,
};
pub use declaration::{Declaration, Field, Kind, OperationCount, Property, Routine};
pub use element::{
    AnyElement, Block, Constraint, Element, ForceLaw, Inputs, Outputs, Potential, ReducedPotential, Residual,
    RestError, Vector3, triangle_index,
};
pub use evaluate::{evaluate_constraint, evaluate_force_law, evaluate_potential, evaluate_residual};
pub use flags::{Flag, Flags};
pub use real::{Mask, Number, Real};
pub use results::{
    ConstraintHessian, ConstraintJacobian, ForceJacobians, ForceValue, Gradient, Hessian, HessianVector,
    ReducedHessian, ResidualJacobian, ResidualValue, Value,
};
pub use unbounded::Unbounded;
#[doc(hidden)]
pub use unbounded::settle;
#[doc(hidden)]
pub use unbounded::{Precautions, WithCare, with_care};
