use energy_dsl::{Declaration, Element};

/// Calls a macro with the names of all elements of this crate, in alphabetical order.
///
/// ```
/// macro_rules! count {
///     ($($name:ident),* $(,)?) => { [$(stringify!($name)),*].len() };
/// }
/// assert_eq!(energy_elements::for_each_element!(count), energy_elements::DECLARATIONS.len());
/// ```
#[macro_export]
macro_rules! for_each_element {
    ($callback:ident) => {
        $callback! {
            ArcAngle,
            AsRigidAsPossible,
            BaraffWitkinShear,
            BaraffWitkinStretch,
            Binding,
            BlendedMotion4,
            BlendedPoint1,
            BlendedPoint4,
            BlendedPoint8,
            BoneBinding,
            BoxContact,
            BridsonBending,
            BridsonForce,
            BridsonForceDamped,
            CapsuleContact,
            Distance,
            DistanceBarrier,
            DistanceSquared,
            EdgeEdgeDistance,
            FlatBending,
            FrozenPlane1,
            FrozenPlane4,
            FrozenPlane8,
            GraphEdge,
            Gravity,
            HairBend,
            HingeAngle,
            HingeCos,
            HingeCosHalf,
            HingeDamping,
            HingeSinHalf,
            HookeSpring,
            HuberLoss,
            NeoHookean,
            NonrigidPlane1,
            NonrigidPlane4,
            NonrigidPlane8,
            OrthotropicStVK,
            ParallelEdges,
            PlaneContact,
            PlateBending,
            PointEdgeDistance,
            PointToPlane,
            PointTriangleDistance,
            PowerLaw,
            QuadraticHinge,
            SkeletonPlane,
            SkeletonPoint,
            SlidingFriction,
            SphereContact,
            Spring,
            SquaredDistanceBarrier,
            StVK,
            StableNeoHookean,
            StableNeoHookeanLog,
            StrainRateDamping,
            TetAsRigidAsPossible,
            TetCorotational,
            TetStVK,
            TetStableNeoHookean,
            ThreadLimit,
            TukeyLoss,
            TwistMotion,
            ViscousDrag,
            WindDrag,
            ZeroLengthSpring,
        }
    };
}

macro_rules! declarations {
    ($($name:ident),* $(,)?) => { &[$(<crate::$name<f64> as Element>::DECLARATION),*] };
}

/// The declarations of all elements of this crate, in alphabetical order. A crate that only reads them compiles no
/// routine of the elements; `energy_catalogue::catalogue` has these, too.
///
/// ```
/// let spring = energy_elements::DECLARATIONS.iter().find(|declaration| declaration.name == "Spring").unwrap();
/// assert!(spring.translation_invariant);
/// ```
pub const DECLARATIONS: &[&Declaration] = for_each_element!(declarations);
