use energy_elements::HookeSpring;
use energy_solve::DrivenLaw;

use crate::scene::Closing;

/// Stitches whose rest lengths shrink to 0.
#[derive(Debug)]
pub(super) struct ClosingSeam {
    /// Stiffness of a stitch, in N/m.
    pub stiffness: f64,
    /// Length of each stitch at the start, in m.
    pub gaps: Vec<f64>,
    pub closing: Closing,
}

impl DrivenLaw for ClosingSeam {
    type Element = HookeSpring;

    fn element(&self, stitch: usize, time: f64) -> HookeSpring {
        HookeSpring::new(self.stiffness, self.gaps[stitch] * self.closing.open_part(time))
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        self.closing.open_part(from) != self.closing.open_part(to)
    }
}

#[cfg(test)]
mod tests {
    use crate::Simulation;
    use crate::scene::Scene;

    const SCENE: &str = r#"
dt = 0.002
duration = 1.0
integrator = "implicit-midpoint"
contact = "off"
gravity = [0.0, 0.0, 0.0]
drag = 5.0
[[garment]]
name = "left"
placement.translate = [-0.2, 0.0, 0.0]
mesh.sheet = { cells = [2, 2], size = [0.3, 0.3] }
fabric.density = 0.2
fabric.material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }
[[garment]]
name = "right"
placement.translate = [0.2, 0.0, 0.0]
mesh.sheet = { cells = [2, 2], size = [0.3, 0.3] }
fabric.density = 0.2
fabric.material.stvk = { stretch_stiffness = 40.0, poisson_ratio = 0.3 }
[[seams]]
garments = ["left", "right"]
within = 0.11
stiffness = 100.0
damping = 0.1
close = { start = 0.1, duration = 0.6 }
"#;

    /// The gap in the middle of the seam, in m.
    fn gap(simulation: &Simulation) -> f64 {
        simulation.positions()[9 + 3][0] - simulation.positions()[5][0]
    }

    #[test]
    fn a_seam_closes_in_its_time_and_its_work_is_accounted_for() {
        let scene = Scene::parse(SCENE, "seam.toml".as_ref()).unwrap();
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.keep_ledger().unwrap();
        let mut gaps = vec![gap(&simulation)];
        while !simulation.is_finished() {
            simulation.step().unwrap_or_else(|error| panic!("{error}"));
            gaps.push(gap(&simulation));
        }
        assert!((gaps[0] - 0.1).abs() < 1e-12 && (gaps[50] - 0.1).abs() < 1e-9, "{gaps:?}");
        assert!((gaps[200] - 0.05).abs() < 0.01, "half closed: {}", gaps[200]);
        assert!(gaps[500].abs() < 1e-3, "closed: {}", gaps[500]);
        let ledger = simulation.ledger().unwrap();
        let [first, last] = [0, 500].map(|entry| &ledger.entries()[entry]);
        let seam = ledger.works().iter().position(|name| name == "seam 0").unwrap();
        assert!(last.work[seam] > 0.0, "closing does work");
        let unaccounted = last.unaccounted(first);
        assert!(unaccounted.abs() < 0.05 * last.work[seam], "{unaccounted} J of {}", last.work[seam]);
    }
}
