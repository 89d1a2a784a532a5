use schemars::JsonSchema;
use serde::Deserialize;

use super::garment::{Garment, Mesh, Placement};
use super::{ContactChoice, Exclusion, Hair, ObstacleDescription, OutputChoice, PairFriction, Pin, Scene, Seam, Sleep};
use cloth_physics::bounded::{Count, MaybeReal, NonNegative, Number, Positive, Real, Reals};
use cloth_physics::fabric::Fabric;
use cloth_physics::integrator::{LinearSolverChoice, Scheme, Tolerances};
use cloth_physics::wind::Wind;

/// The version of scene files that this program reads.
const VERSION: usize = 1;

/// The keys of a scene file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "A scene of `cloth run`")]
#[schemars(extend("dependentRequired" = { "mesh": ["fabric"], "fabric": ["mesh"] }))]
#[schemars(extend("anyOf" = [
    { "required": ["mesh"] },
    { "required": ["garment"], "properties": { "garment": { "minItems": 1 } } },
    { "required": ["hair"], "properties": { "hair": { "minItems": 1 } } },
]))]
#[schemars(extend("if" = { "anyOf": [
    { "properties": { "contact": { "const": "on" } }, "required": ["contact"] },
    { "properties": { "exclude": { "minItems": 1 } }, "required": ["exclude"] },
    { "properties": { "friction": { "minItems": 1 } }, "required": ["friction"] },
] }))]
#[schemars(extend("then" = { "properties": { "integrator": { "const": "newton" } }, "required": ["integrator"] }))]
pub(super) struct File {
    /// Version of the format. Default 1.
    #[serde(default = "newest", with = "Count::<0, 1_000_000>")]
    #[schemars(range(min = 1, max = 1))]
    version: usize,
    /// The mesh of a single garment, with `fabric`. For several garments use `[[garment]]`.
    #[serde(default)]
    mesh: Option<Mesh>,
    /// The fabric of the single garment: a table, or the name of a fabric of the library.
    #[serde(default, deserialize_with = "some_fabric")]
    #[schemars(with = "Option<crate::fabric_choice::FabricChoice>")]
    fabric: Option<Fabric>,
    /// Garments, each with its mesh and fabric.
    #[serde(default)]
    garment: Vec<Garment>,
    /// Strands of hair.
    #[serde(default)]
    hair: Vec<Hair>,
    /// Stitches between garments. Default none.
    #[serde(default)]
    seams: Vec<Seam>,
    /// Pinned vertices, fixed or moving. Default none.
    #[serde(default)]
    pins: Vec<Pin>,
    /// Obstacles that the cloth cannot enter. Default none.
    #[serde(default)]
    obstacles: Vec<ObstacleDescription>,
    /// Wind and its drag. Default still air.
    wind: Option<Wind>,
    /// Acceleration of gravity, in m/s². Default [0, 0, −9.81].
    #[serde(default = "standard_gravity", with = "Reals::<Number, 3>")]
    gravity: [f64; 3],
    /// Drag per mass, in 1/s: the force −drag m v on every vertex. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    drag: f64,
    /// `implicit-euler` (the default), `newton`, `bdf2`, `implicit-midpoint`, `trapezoid`, `symplectic-euler`,
    /// `verlet`, `explicit-euler` or `explicit-euler-as-printed`.
    #[serde(default)]
    integrator: Scheme,
    /// Convergence criteria of Newton's method, for the integrators that use it. Default depends on the integrator.
    #[serde(default)]
    tolerances: Tolerances,
    /// Which contacts are resolved: `on`, `obstacles` or `off`. `on` includes contact of cloth and hair with themselves
    /// and with each other, and needs the integrator `newton`. Default: `on` for cloth with `newton` and without
    /// `sleep`, otherwise `obstacles`.
    #[serde(default)]
    contact: Option<ContactChoice>,
    /// Parts that do not collide with each other. Needs the integrator `newton`. Default none.
    #[serde(default)]
    exclude: Vec<Exclusion>,
    /// Friction of pairs of parts, in place of that of their fabrics or obstacles. Needs the integrator `newton`. Default
    /// none.
    #[serde(default)]
    friction: Vec<PairFriction>,
    /// Repair shallow crossings at the start: move vertices until nothing crosses, by at most three times the thickness
    /// and gap of contact. Needs certified contact. Default false.
    #[serde(default)]
    untangle: bool,
    /// Linear solver of implicit integrators, for symmetric systems: `auto` (the default), `over-relaxation`,
    /// `multigrid` or `cholesky`.
    #[serde(default)]
    linear_solver: LinearSolverChoice,
    /// Retry a failed step with half its size, and so on. Default false.
    #[serde(default)]
    adaptive: bool,
    /// Let islands that are still fall asleep, which costs nothing per step: `true`, or a table. Default `false`,
    /// because sleep discards slow residual motion.
    #[serde(default, deserialize_with = "crate::sleep::sleep")]
    #[schemars(with = "crate::sleep::SleepChoice")]
    sleep: Option<Sleep>,
    /// The largest time step h, in s.
    #[serde(with = "Real::<Positive>")]
    dt: f64,
    /// Simulated time, in s; rounded to whole steps.
    #[serde(with = "Real::<NonNegative>")]
    duration: f64,
    /// Frames written per simulated second. Steps are shortened so that a whole number of equal steps ends with each
    /// frame. Default: the rate nearest to 25 whose frames are whole steps of `dt`.
    #[serde(default, with = "MaybeReal::<Positive>")]
    frames_per_second: Option<f64>,
    /// The files to write.
    #[serde(default)]
    output: OutputChoice,
}

fn newest() -> usize {
    VERSION
}

fn standard_gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

fn some_fabric<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Fabric>, D::Error> {
    crate::fabric_choice::fabric(deserializer).map(Some)
}

/// The largest number of steps.
const MOST_STEPS: f64 = 1e9;

fn check_times(dt: f64, duration: f64) -> Result<(), String> {
    if duration > 0.0 && dt > duration * (1.0 + 1e-9) {
        return Err(format!("`dt` = {dt} s exceeds `duration` = {duration} s; give a `dt` of at most the duration"));
    }
    if duration / dt > MOST_STEPS {
        let steps = duration / dt;
        return Err(format!(
            "`duration` takes {steps:.1e} steps of `dt`, more than {MOST_STEPS:e}; give a larger `dt`"
        ));
    }
    Ok(())
}

impl TryFrom<File> for Scene {
    type Error = String;

    fn try_from(file: File) -> Result<Self, String> {
        if file.version != VERSION {
            let found = file.version;
            return Err(format!("the scene has version {found}, but this program reads version {VERSION}"));
        }
        if file.contact == Some(ContactChoice::On) && file.integrator != Scheme::Newton {
            return Err("`contact = \"on\"` needs `integrator = \"newton\"`, which certifies its moves".to_owned());
        }
        check_times(file.dt, file.duration)?;
        if let Some(seam) = file.seams.iter().position(|seam| seam.pairs.is_some() == seam.within.is_some()) {
            return Err(format!("seams[{seam}]: expected either `pairs` or `within`"));
        }
        if !file.exclude.is_empty() && file.integrator != Scheme::Newton {
            return Err("`exclude` needs `integrator = \"newton\"`, whose contact is between features".to_owned());
        }
        if !file.friction.is_empty() && file.integrator != Scheme::Newton {
            return Err("`[[friction]]` needs `integrator = \"newton\"`, whose contact is between features".to_owned());
        }
        if file.untangle && (file.integrator != Scheme::Newton || file.contact == Some(ContactChoice::Off)) {
            return Err("`untangle` needs `integrator = \"newton\"` with contact, which is certified".to_owned());
        }
        let is_certified = file.integrator == Scheme::Newton && file.contact != Some(ContactChoice::Off);
        if let Some(number) = file.obstacles.iter().position(|one| one.deforms()).filter(|_| !is_certified) {
            let needed = "needs `integrator = \"newton\"` with contact, which is certified";
            return Err(format!("obstacles[{number}].mesh: `frames_per_second` {needed}"));
        }
        let mut garments = file.garment;
        match (file.mesh, file.fabric) {
            (Some(mesh), Some(fabric)) => {
                let placement = Placement::default();
                let (velocity, spin) = ([0.0; 3], [0.0; 3]);
                let (warp, rest, rest_scale, inflation) = (None, None, Vec::new(), None);
                let name = None;
                let only = Garment { name, mesh, fabric, warp, rest, rest_scale, inflation, placement, velocity, spin };
                garments.insert(0, only);
            }
            (Some(_), None) => return Err("missing field `fabric`, the material of the mesh".to_owned()),
            (None, Some(_)) => return Err("missing field `mesh`, the shape of the fabric".to_owned()),
            (None, None) => {}
        }
        if garments.is_empty() && file.hair.is_empty() {
            return Err("nothing to simulate: give `mesh` and `fabric`, `[[garment]]` or `[[hair]]`".to_owned());
        }
        for garment in &mut garments {
            garment.fabric.warp = garment.warp.unwrap_or(garment.fabric.warp);
        }
        let usual = ContactChoice::usual(file.integrator, file.sleep.is_some(), !garments.is_empty());
        Ok(Self {
            garments,
            hair: file.hair,
            seams: file.seams,
            pins: file.pins,
            obstacles: file.obstacles,
            wind: file.wind,
            gravity: file.gravity,
            drag: file.drag,
            integrator: file.integrator,
            tolerances: file.tolerances,
            contact: file.contact.unwrap_or(usual),
            exclusions: file.exclude,
            pair_friction: file.friction,
            untangle: file.untangle,
            linear_solver: file.linear_solver,
            adaptive: file.adaptive,
            sleep: file.sleep,
            dt: file.dt,
            duration: file.duration,
            frames_per_second: file.frames_per_second,
            output: file.output,
            folder: std::path::PathBuf::new(),
        })
    }
}
