//! The specimen of the tensile and the shear tester of KES-F: 20 cm wide between clamps that are 5 cm apart.

use energy_dsl::Vector3;

use super::curve::Curve;
use super::scene::{Keys, SceneText, key, pin};
use super::{TesterError, Threads};
use crate::measure::Measurements;
use crate::simulation::Simulation;

/// Distance of the clamps, in m.
const LENGTH: f64 = 0.05;
/// Width along the clamps, in m.
const WIDTH: f64 = 0.2;
/// The largest tensile load per width: 500 gf/cm, in N/m.
pub(super) const TENSILE_LOAD: f64 = 490.3325;
/// Tension per width during shear: 10 gf/cm, in N/m.
const SHEAR_TENSION: f64 = 9.80665;
/// Largest shear angle, in degrees.
const SHEAR: f64 = 8.0;
/// Steps from 0 to the largest shear angle.
const SHEAR_STEPS: u32 = 16;
/// Steps of the tensile test.
const TENSILE_STEPS: u32 = 100;
/// The tensile test ends at this multiple of the strain at which the declared material reaches the load: the sides of
/// the specimen are free, and it is softer.
const BEYOND: f64 = 1.06;
/// Strain at which a fabric that does not reach the load is given up.
const MOST: f64 = 2.0;
/// Time of a step, in s.
const STEP: f64 = 0.1;

/// Returns the scene without motion, with threads along the pull.
fn scene(threads: Threads, motion: &Keys, duration: f64) -> SceneText {
    let warp = threads.across_clamps();
    let half = [0.5 * LENGTH, 0.5 * WIDTH];
    let jaw = |name: &str, x: f64, motion: &str| pin(name, [x - 1e-4, x + 1e-4], half[1] + 1e-3, motion);
    let pins = [jaw("fixed jaw", -half[0], ""), jaw("moving jaw", half[0], &motion.toml())].concat();
    SceneText {
        head: format!(
            "dt = {STEP:?}\nduration = {duration:?}\nframes_per_second = 10\ngravity = [0.0, 0.0, 0.0]\n\
             integrator = \"newton\"\ncontact = \"off\"\ntolerances.velocity = 1e-8\n"
        ),
        mesh: format!(
            "warp = {warp:?}\n[garment.mesh.sheet]\ncells = [10, 40]\nsize = [{LENGTH:?}, {WIDTH:?}]\n\
             diagonals = \"alternating\"\n"
        ),
        tail: pins,
    }
}

/// Force per width on the moving jaw, in N/m: along the pull, and along the clamp.
fn pull(forces: Vector3<f64>) -> [f64; 2] {
    [-forces[0] / WIDTH, -forces[1] / WIDTH]
}

/// A declared material on the specimen, strained uniformly.
pub(super) struct Uniform {
    simulation: Simulation,
    rest: Vec<Vector3<f64>>,
}

impl Uniform {
    pub(super) fn new(fabric: &super::TestedFabric, threads: Threads) -> Result<Self, TesterError> {
        let scene = fabric.scene(&scene(threads, &Keys::default(), STEP))?;
        let simulation = Simulation::new(&scene)?;
        Ok(Self { rest: simulation.positions().to_vec(), simulation })
    }

    /// Returns the force per width if the threads between the clamps are stretched and turned by an angle in rad: the
    /// deformation gradient is (1 + ε)(cos γ, sin γ), (0, 1).
    fn pull(&mut self, strain: f64, angle: f64) -> Result<[f64; 2], TesterError> {
        let (sine, cosine) = angle.sin_cos();
        let along = [(1.0 + strain) * cosine, (1.0 + strain) * sine];
        let place = |x: &Vector3<f64>| [along[0] * x[0], along[1] * x[0] + x[1], x[2]];
        let x: Vec<_> = self.rest.iter().map(place).collect();
        self.simulation.set_positions(&x)?;
        Ok(pull(self.simulation.reading().pins[1].force))
    }

    /// Returns the smallest strain with a load per width, in N/m, by bisection; `None` if the material does not reach
    /// it.
    pub(super) fn strain_at(&mut self, load: f64) -> Result<Option<f64>, TesterError> {
        let (mut low, mut high) = (0.0, MOST);
        // The first of some strains beyond the load brackets it, also if the curve is not monotone.
        for step in 1..=200 {
            let strain = MOST * f64::from(step) / 200.0;
            if self.pull(strain, 0.0)?[0] >= load {
                high = strain;
                break;
            }
            low = strain;
        }
        if low >= MOST {
            return Ok(None);
        }
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            *(if self.pull(middle, 0.0)?[0] < load { &mut low } else { &mut high }) = middle;
        }
        Ok(Some(high))
    }

    /// Returns strain and force per width in N/m up to a strain.
    pub(super) fn tensile(&mut self, most: f64) -> Result<Curve, TesterError> {
        let point = |step: u32| {
            let strain = most * f64::from(step) / f64::from(TENSILE_STEPS);
            Ok([strain, self.pull(strain, 0.0)?[0]])
        };
        (0..=TENSILE_STEPS).map(point).collect()
    }

    /// Returns shear angle in degrees and shear force per width in N/m, at a strain of the threads between the clamps.
    pub(super) fn shear(&mut self, strain: f64) -> Result<Curve, TesterError> {
        let half = SHEAR_STEPS as i32;
        let point = |step: i32| {
            let angle = SHEAR * f64::from(step) / f64::from(SHEAR_STEPS);
            let [across, along] = self.pull(strain, angle.to_radians())?;
            Ok([angle, along - across * angle.to_radians().tan()])
        };
        (-half..=half).map(point).collect()
    }
}

/// Strains of the tensile test: up to the load, and a little beyond.
pub(super) fn tensile_end(uniform: &mut Uniform) -> Result<f64, TesterError> {
    Ok(uniform.strain_at(TENSILE_LOAD)?.map_or(MOST, |strain| BEYOND * strain))
}

/// Strain at the tension of the shear test; 0 for a material that does not reach it.
pub(super) fn shear_strain(uniform: &mut Uniform) -> Result<f64, TesterError> {
    Ok(uniform.strain_at(SHEAR_TENSION)?.unwrap_or(0.0))
}

/// Returns the tensile test up to a strain.
pub(super) fn tensile_scene(threads: Threads, most: f64) -> SceneText {
    let end = STEP * f64::from(TENSILE_STEPS);
    scene(threads, &Keys::of(vec![key(0.0, [0.0; 3]), key(end, [most * LENGTH, 0.0, 0.0])]), end)
}

/// Returns the shear test: the moving jaw goes along arcs, on which the threads keep the length that their tension gave
/// them, to both sides and back.
pub(super) fn shear_scene(strain: f64) -> SceneText {
    let length = (1.0 + strain) * LENGTH;
    let mut keys = vec![key(0.0, [0.0; 3])];
    let quarter = SHEAR_STEPS as i32;
    for step in 0..=4 * quarter {
        let angle = shear_angle(step).to_radians();
        let time = STEP * f64::from(step + PRELOAD_STEPS);
        keys.push(key(time, [length * angle.cos() - LENGTH, length * angle.sin(), 0.0]));
    }
    scene(Threads::Warp, &Keys::of(keys), STEP * f64::from(4 * quarter + PRELOAD_STEPS))
}

/// Steps in which the tension is applied.
const PRELOAD_STEPS: i32 = 4;

/// The shear angle after a number of steps, in degrees: 0, 8, −8, 0.
fn shear_angle(step: i32) -> f64 {
    let quarter = SHEAR_STEPS as i32;
    let place = if step <= quarter { step } else { (2 * quarter - step).max(step - 4 * quarter) };
    SHEAR * f64::from(place) / f64::from(quarter)
}

/// Returns strain and force per width in N/m of a tensile test.
pub(super) fn tensile_curve(measured: &Measurements) -> Curve {
    let start = measured.readings.first().map_or(0.0, |reading| reading.pins[1].position[0]);
    let point = |reading: &crate::measure::Reading| {
        let pin = reading.pins[1];
        [(pin.position[0] - start) / LENGTH, pull(pin.force)[0]]
    };
    measured.readings.iter().map(point).collect()
}

/// Returns shear angle in degrees and shear force per width in N/m of a shear test. The part of the tension along the
/// clamp, W tan γ, is taken off, as the tester does.
pub(super) fn shear_curve(measured: &Measurements) -> Curve {
    let readings = measured.readings.iter().skip(PRELOAD_STEPS as usize);
    let point = |(step, reading): (usize, &crate::measure::Reading)| {
        let angle = shear_angle(step as i32);
        let [across, along] = pull(reading.pins[1].force);
        [angle, along - across * angle.to_radians().tan()]
    };
    readings.enumerate().map(point).collect()
}
