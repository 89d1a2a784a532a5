//! Contact: forces between features while they are close.
//!
//! A [`Term`](crate::Term) has fixed stencils and a fixed matrix pattern. Pairs in contact change from iteration to
//! iteration, so contact is not a term. A [`ContactStep`] lists the stiffness of the pairs in contact as [`Contact`]s
//! instead. Their blocks are added to the matrix where its pattern has them. Solvers take the other blocks separately
//! ([`CrossBlocks`](crate::CrossBlocks)).

mod block;
mod in_matrix;
mod model;
mod pressed;

pub use block::Contact;
pub use in_matrix::ContactsInMatrix;
pub use model::{
    ContactCounts, ContactForces, ContactMemory, ContactModel, ContactStep, Resistance, SlidingStiffness, Touching,
};
pub use pressed::{Pressed, Presser};
