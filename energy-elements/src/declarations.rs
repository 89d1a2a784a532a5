use energy_dsl::{Declaration, Element};

/// Calls a macro with the names of all elements of points, and of all residuals, in alphabetical order. With `with kinds`, the name of
/// what their lanes evaluate comes first: `potential` (energies, and constraints as energies), `force` or `residual`.
///
/// ```
/// macro_rules! count {
///     ($($name:ident),* $(,)?) => { [$(stringify!($name)),*].len() };
/// }
/// macro_rules! forces {
///     ($($kind:ident $name:ident),* $(,)?) => { [$((stringify!($kind), stringify!($name))),*] };
/// }
/// assert_eq!(energy_elements::for_each_element!(count), energy_elements::DECLARATIONS.len());
/// assert!(energy_elements::for_each_element!(with kinds forces).contains(&("force", "ViscousDrag")));
/// ```
#[macro_export]
macro_rules! for_each_element {
    ($callback:ident) => {
        $crate::for_each_element! { @list names $callback }
    };
    (with kinds $callback:ident) => {
        $crate::for_each_element! { @list kinds $callback }
    };
    (@names $callback:ident $($kind:ident $name:ident,)*) => {
        $callback! { $($name),* }
    };
    (@kinds $callback:ident $($kind:ident $name:ident,)*) => {
        $callback! { $($kind $name),* }
    };
    (@list $pass:ident $callback:ident) => {
        $crate::for_each_element! { @$pass $callback
            potential ArcAngle,
            potential AsRigidAsPossible,
            potential BaraffWitkinShear,
            potential BaraffWitkinStretch,
            residual Binding,
            residual BlendedMotion4,
            residual BlendedPoint1,
            residual BlendedPoint4,
            residual BlendedPoint8,
            residual BoneBinding,
            potential BoxContact,
            potential BridsonBending,
            force BridsonForce,
            force BridsonForceDamped,
            potential CapsuleContact,
            potential Distance,
            potential DistanceBarrier,
            potential DistanceSquared,
            potential EdgeEdgeDistance,
            potential FlatBending,
            residual FrozenPlane1,
            residual FrozenPlane4,
            residual FrozenPlane8,
            residual GraphEdge,
            potential Gravity,
            potential HairBend,
            potential HingeAngle,
            potential HingeCos,
            potential HingeCosHalf,
            force HingeDamping,
            potential HingeRateDissipation,
            potential HingeSinHalf,
            potential HookeSpring,
            residual HuberLoss,
            potential NeoHookean,
            residual NonrigidPlane1,
            residual NonrigidPlane4,
            residual NonrigidPlane8,
            potential OrthotropicStVK,
            potential ParallelEdges,
            potential PlaneContact,
            potential PlateBending,
            potential PointEdgeDistance,
            residual PointToPlane,
            potential PointTriangleDistance,
            potential PowerLaw,
            potential Pressure,
            potential QuadraticHinge,
            potential RodBend,
            residual SkeletonPlane,
            residual SkeletonPoint,
            potential SlidingFriction,
            potential SphereContact,
            potential Spring,
            potential SquaredDistanceBarrier,
            potential StVK,
            potential StableNeoHookean,
            potential StableNeoHookeanLog,
            force StrainRateDamping,
            potential StrainRateDissipation,
            potential TetAsRigidAsPossible,
            potential TetCorotational,
            potential TetStVK,
            potential TetStableNeoHookean,
            potential ThreadLimit,
            residual TukeyLoss,
            residual TwistMotion,
            force ViscousDrag,
            potential WindDrag,
            potential YarnMembrane,
            potential ZeroLengthSpring,
        }
    };
}

/// Calls a macro with the names of all elements whose unknowns are not only points of their own, or which have a state, in
/// alphabetical order.
///
/// ```
/// macro_rules! count {
///     ($($name:ident),* $(,)?) => { [$(stringify!($name)),*].len() };
/// }
/// assert_eq!(energy_elements::for_each_mixed_element!(count), energy_elements::MIXED.len());
/// ```
#[macro_export]
macro_rules! for_each_mixed_element {
    ($callback:ident) => {
        $callback! {
            BallJoint,
            BodyAnchor,
            CurledHair,
            EnclosedVolume,
            GasReservoir,
            HingeAxis,
            MidEdgeShell,
            RodBendAnisotropic,
            RodTwist,
        }
    };
}

macro_rules! declarations {
    ($($name:ident),* $(,)?) => { &[$(<crate::$name<f64> as Element>::DECLARATION),*] };
}

/// The declarations of all elements of points, and of all residuals, of this crate, in alphabetical order. A crate that only reads them compiles no
/// routine of the elements.
///
/// ```
/// let spring = energy_elements::DECLARATIONS.iter().find(|declaration| declaration.name == "Spring").unwrap();
/// assert!(spring.translation_invariant);
/// ```
pub const DECLARATIONS: &[&Declaration] = for_each_element!(declarations);

/// The declarations of all elements whose unknowns are not only points of their own, or which have a state, in alphabetical
/// order.
pub const MIXED: &[&Declaration] = for_each_mixed_element!(declarations);
