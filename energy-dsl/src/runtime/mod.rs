//! What generated code calls, and what calls generated code: number types, element traits and the
//! self-description that every generated element carries.

mod array;
mod declaration;
mod element;
mod evaluate;
mod flags;
mod real;

pub use array::Array;
pub use declaration::{Declaration, Field, Kind, OperationCount, Property, Routine};
pub use element::{
    Block, Constraint, ConstraintHessian, ConstraintJacobian, Element, ForceJacobians, ForceLaw, ForceValue, Gradient,
    Hessian, Inputs, Outputs, Potential, Residual, ResidualJacobian, ResidualValue, RestError, Value, Vector3,
    triangle_index,
};
pub use evaluate::{evaluate_constraint, evaluate_force_law, evaluate_potential, evaluate_residual};
pub use flags::{Flag, Flags};
pub use real::{Mask, Number, Real};
