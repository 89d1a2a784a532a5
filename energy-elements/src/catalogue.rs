use energy_dsl::AnyElement;

/// Calls a macro with the names of all elements of this crate, in alphabetical order.
///
/// ```
/// macro_rules! count {
///     ($($name:ident),* $(,)?) => { [$(stringify!($name)),*].len() };
/// }
/// assert_eq!(energy_elements::for_each_element!(count), energy_elements::catalogue().len());
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

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<crate::$name<f64>>()),*] };
}

/// Returns all elements of this crate, in alphabetical order.
// `#[inline(never)]`: a crate that inlines this function compiles every element again.
#[inline(never)]
#[must_use]
pub fn catalogue() -> &'static [AnyElement] {
    const CATALOGUE: &[AnyElement] = for_each_element!(entries);
    CATALOGUE
}

/// Returns the element of this name; `None` if the crate has no such element.
///
/// ```
/// let spring = energy_elements::find("Spring").unwrap();
/// assert!(spring.declaration.translation_invariant);
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static AnyElement> {
    catalogue().iter().find(|entry| entry.declaration.name == name)
}
