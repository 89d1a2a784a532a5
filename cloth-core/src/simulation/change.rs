//! Other parameters of a scene, while it is simulated. The scene is assembled again, and its state is carried over.

use super::saved::masses_checksum;
use super::{ControlError, Island, Simulation, SimulationError};
use crate::scene::Scene;

impl Simulation {
    /// Goes on with other parameters of the scene, such as densities and stiffnesses, between two steps. Meshes, rest
    /// shapes and materials are read again. Positions, velocities, plastic strains, friction and all controls stay.
    /// Snapshots of earlier parameters can still be restored; the parameters then stay those of the last change.
    ///
    /// # Errors
    /// Returns an error if [`Simulation::controlled`] would, or if the scene has other time steps, vertices, triangles,
    /// terms or sets of vertices that move together. Nothing changes then.
    pub fn change_scene(&mut self, scene: &Scene) -> Result<(), SimulationError> {
        let mut fresh = Self::controlled(scene, &self.controlled.controls)?;
        if let Some(what) = self.difference_to(&fresh) {
            return Err(ControlError::OtherScene { what }.into());
        }
        fresh.controlled.earlier_masses.clone_from(&self.controlled.earlier_masses);
        let checksum = masses_checksum(&self.masses);
        if !fresh.controlled.earlier_masses.contains(&checksum) {
            fresh.controlled.earlier_masses.push(checksum);
        }
        if let Some(threads) = self.threads {
            fresh.set_threads(threads);
        }
        fresh.return_to(&self.snapshot())?;
        fresh.islands.iter_mut().for_each(Island::wake);
        let bodies = fresh.islands.iter().map(Island::body);
        fresh.ledger.iter_mut().try_for_each(|ledger| ledger.reopen(bodies.clone()))?;
        *self = fresh;
        Ok(())
    }

    /// Returns what the state of another simulation cannot be carried over for; `None` if it can.
    fn difference_to(&self, other: &Self) -> Option<&'static str> {
        let together = |simulation: &Self| -> Vec<Vec<usize>> {
            simulation.islands.iter().map(|island| island.vertices().to_vec()).collect()
        };
        let names =
            |simulation: &Self| -> Vec<String> { simulation.labels.iter().map(|label| label.name.clone()).collect() };
        match () {
            () if self.dt != other.dt => Some("another time step"),
            () if self.x.len() != other.x.len() => Some("another number of vertices"),
            () if self.triangles != other.triangles => Some("other triangles"),
            () if names(self) != names(other) => Some("other terms"),
            () if together(self) != together(other) => Some("other vertices that move together"),
            () => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::RestoreError;

    fn scene(stiffness: f64, density: f64, more: &str) -> Scene {
        let text = format!(
            "dt = 0.01\nduration = 0.5\nintegrator = \"newton\"\ncontact = \"off\"\n{more}\
             pins = [{{ vertex = 0 }}, {{ vertex = 4 }}]\nmesh.sheet = {{ cells = [4, 4], size = [0.4, 0.4] }}\n\
             fabric = {{ density = {density}, plasticity.curvature = 3.0, material.stvk = \
             {{ stretch_stiffness = {stiffness}, poisson_ratio = 0.3, \
             bending.plate.flexural = {{ rigidity = 1e-4, poisson_ratio = 0.2 }} }} }}\n"
        );
        Scene::parse(&text, "s.toml".as_ref()).unwrap()
    }

    fn started(stiffness: f64, density: f64) -> Simulation {
        let mut simulation = Simulation::new(&scene(stiffness, density, "")).unwrap();
        simulation.keep_ledger().unwrap();
        simulation
    }

    fn stepped(simulation: &mut Simulation, steps: usize) {
        for _ in 0..steps {
            simulation.step().unwrap();
        }
    }

    #[test]
    fn changed_parameters_act_as_those_of_a_scene_that_always_had_them() {
        let mut changed = started(40.0, 0.2);
        changed.change_scene(&scene(80.0, 0.3, "")).unwrap();
        let mut always = started(80.0, 0.3);
        stepped(&mut changed, 5);
        stepped(&mut always, 5);
        assert_eq!(changed.positions(), always.positions());
    }

    #[test]
    fn a_change_keeps_the_state_and_the_way_back() {
        let mut simulation = started(40.0, 0.2);
        let start = simulation.snapshot();
        stepped(&mut simulation, 5);
        let (x, v) = (simulation.positions().to_vec(), simulation.velocities().to_vec());
        simulation.change_scene(&scene(80.0, 0.3, "")).unwrap();
        assert_eq!((simulation.positions(), simulation.velocities()), (&x[..], &v[..]));
        assert_eq!((simulation.steps_done(), simulation.ledger().unwrap().entries().len()), (5, 6));
        stepped(&mut simulation, 3);
        let once = simulation.positions().to_vec();
        simulation.return_to(&start).unwrap();
        stepped(&mut simulation, 5);
        assert_ne!(simulation.positions(), x, "the parameters stay those of the change");
        let other = started(40.0, 0.25).snapshot();
        assert!(matches!(simulation.return_to(&other), Err(RestoreError::OtherScene { .. })));
        assert_ne!(once, x);
    }

    #[test]
    fn a_scene_that_the_state_does_not_fit_is_refused() {
        let mut simulation = started(40.0, 0.2);
        stepped(&mut simulation, 2);
        let x = simulation.positions().to_vec();
        let windy = scene(40.0, 0.2, "wind = { velocity = [1.0, 0.0, 0.0] }\n");
        let message = simulation.change_scene(&windy).unwrap_err().to_string();
        assert!(message.contains("other terms"), "{message}");
        assert_eq!(simulation.positions(), x);
        simulation.change_scene(&scene(40.0, 0.2, "")).unwrap();
    }
}
