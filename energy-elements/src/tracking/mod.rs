//! Residuals that track a deforming body, whose nodes each move rigidly: E = λ_n E_nonrigid + λ_s E_skeleton + λ_g
//! E_graph + λ_b E_binding (Yu et al., *BodyFusion*, 2017; Newcombe et al., *DynamicFusion*, 2015).
//!
//! A node moves by exp(ξ), ξ = (θ, t): a rotation about θ, then a translation by t. The angle of rotation is 2 `turn`
//! ‖θ‖. With `turn` = 1, θ is half the rotation vector, as in the papers' formulas. With `turn` = ½, θ is the rotation
//! vector itself.
//!
//! Energies are sums of squared residuals without a factor ½: E = Σ λ ‖r‖², ∇E = 2 λ Jᵀ r.

mod binding;
mod graph;
mod loss;
mod motion;
mod nonrigid;
mod point_to_plane;
mod skeleton;

pub use binding::{BoneBinding, Binding};
pub use graph::GraphEdge;
pub use loss::{HuberLoss, TukeyLoss};
pub use motion::{BlendedMotion4, BlendedPoint1, BlendedPoint4, BlendedPoint8, TwistMotion};
pub use nonrigid::{
    FrozenPlane1, FrozenPlane4, FrozenPlane8, NonrigidPlane1, NonrigidPlane4, NonrigidPlane8,
};
pub use point_to_plane::PointToPlane;
pub use skeleton::{SkeletonPlane, SkeletonPoint};
