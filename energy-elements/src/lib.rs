//! The standard library of declared energies, constraints, forces and residuals, one file each.
//!
//! The audits that `#[audit]` asks for run in `verify/command/tests/elements.rs`, because `verify` depends on this
//! crate.
//!
//! ```
//! use energy_dsl::Potential;
//! use energy_elements::HairBend;
//!
//! // A right angle costs k/2.
//! let bend = HairBend::new(3.0);
//! let at = bend.value(&[[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
//! assert_eq!(at.value, 1.5);
//! ```
#![forbid(unsafe_code)]
// Formulas keep the symbols of their sources. Only a crate can allow these lints.
#![allow(confusable_idents, mixed_script_confusables, uncommon_codepoints)]

mod declarations;

pub use declarations::{DECLARATIONS, MIXED};

macro_rules! elements {
    ($($file:ident: $($name:ident),+;)*) => {
        $(mod $file; pub use $file::{$($name),+};)*
    };
}

elements! {
    arap: AsRigidAsPossible;
    arc_angle: ArcAngle;
    box_contact: BoxContact;
    bridson_bending: BridsonBending;
    bridson_force: BridsonForce;
    bridson_force_damped: BridsonForceDamped;
    bw_shear: BaraffWitkinShear;
    bw_stretch: BaraffWitkinStretch;
    capsule_contact: CapsuleContact;
    distance: Distance;
    distance_squared: DistanceSquared;
    edge_edge_distance: EdgeEdgeDistance;
    enclosed_gas: EnclosedVolume, GasReservoir;
    flat_bending: FlatBending;
    gravity: Gravity;
    hair_bend: HairBend;
    hinge_angle: HingeAngle;
    hinge_cos: HingeCos;
    hinge_cos_half: HingeCosHalf;
    hinge_damping: HingeDamping;
    hinge_rate_dissipation: HingeRateDissipation;
    hinge_sin_half: HingeSinHalf;
    hooke_spring: HookeSpring, StructuralSpring, ShearSpring, BendingSpring;
    ipc_barrier: DistanceBarrier;
    ipc_barrier_squared: SquaredDistanceBarrier;
    mid_edge_shell: MidEdgeShell;
    neo_hookean_log: NeoHookean, StableNeoHookeanLog;
    orthotropic_stvk: OrthotropicStVK;
    parallel_edges: ParallelEdges;
    plane_contact: PlaneContact;
    plate_bending: PlateBending;
    point_edge_distance: PointEdgeDistance;
    point_triangle_distance: PointTriangleDistance;
    power_law: PowerLaw;
    pressure: Pressure;
    quadratic_hinge: QuadraticHinge;
    rigid_joints: BallJoint, BodyAnchor, HingeAxis;
    rod: CurledHair, RodBend, RodBendAnisotropic, RodTwist;
    sliding_friction: SlidingFriction;
    sphere_contact: SphereContact;
    spring: Spring;
    stable_neo_hookean: StableNeoHookean;
    strain_rate_damping: StrainRateDamping;
    strain_rate_dissipation: StrainRateDissipation;
    stvk: StVK;
    tetrahedra: TetAsRigidAsPossible, TetCorotational, TetStVK, TetStableNeoHookean;
    thread_limit: ThreadLimit;
    tracking: BlendedMotion4, BlendedPoint1, BlendedPoint4, BlendedPoint8, Binding, BoneBinding, FrozenPlane1,
        FrozenPlane4, FrozenPlane8, GraphEdge, HuberLoss, NonrigidPlane1, NonrigidPlane4, NonrigidPlane8, PointToPlane,
        SkeletonPlane,
        SkeletonPoint, TukeyLoss, TwistMotion;
    viscous_drag: ViscousDrag;
    wind_drag: WindDrag;
    yarn_membrane: YarnMembrane;
    zero_length_spring: ZeroLengthSpring;
}

/// Runs the README's examples as tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
