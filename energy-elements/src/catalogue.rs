use energy_dsl::{Declaration, Element, Inputs, Outputs, RestError};

/// A declared element, for tools that handle all alike.
#[derive(Clone, Copy, Debug)]
pub struct CatalogueEntry {
    /// What was declared.
    pub declaration: &'static Declaration,
    /// Every block in double precision.
    pub evaluate: fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>,
    /// Every block in single precision.
    pub evaluate_f32: fn(&Inputs<'_, f32>) -> Result<Outputs<f32>, RestError>,
}

impl CatalogueEntry {
    const fn of<E: Element>() -> Self {
        Self { declaration: E::DECLARATION, evaluate: E::evaluate::<f64>, evaluate_f32: E::evaluate::<f32> }
    }
}

macro_rules! catalogue {
    ($($name:ident),* $(,)?) => { &[$(CatalogueEntry::of::<crate::$name<f64>>()),*] };
}

/// All elements of this crate, by name.
#[must_use]
pub fn catalogue() -> &'static [CatalogueEntry] {
    const CATALOGUE: &[CatalogueEntry] = catalogue![
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
        PlaneContact,
        PlateBending,
        PointToPlane,
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
        ThreadLimit,
        TukeyLoss,
        TwistMotion,
        ViscousDrag,
        WindDrag,
        ZeroLengthSpring,
    ];
    CATALOGUE
}

/// The element of that name.
///
/// ```
/// let spring = energy_elements::find("Spring").unwrap();
/// assert!(spring.declaration.translation_invariant);
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static CatalogueEntry> {
    catalogue().iter().find(|entry| entry.declaration.name == name)
}
