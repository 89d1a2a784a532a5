use super::critical_load::{Symmetry, critical_load};
use super::equilibrium::Equilibrium;
use super::strip::{MeshKind, Strip};
use super::{Finding, ValidateError};
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use crate::mesh::SpringNetwork;
use energy_solve::System;

/// A strip on edge, clamped at one end. Above the critical load Γ* = σ g L³/D it buckles sideways under its own weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateralBuckling {
    /// Poisson's ratio ν of the plate.
    pub poisson_ratio: f64,
    /// Width over length.
    pub aspect: f64,
    /// Kind of mesh.
    pub mesh: MeshKind,
    /// Angle between mesh and strip, in degrees.
    pub orientation: f64,
    /// Edges along the strip.
    pub segments: usize,
}

/// E h of the membrane over the strip's weight per width: the strip must not bend in its plane.
const MEMBRANE: f64 = 1e6;

/// Γ* of Kirchhoff plates, ± 10⁻³: b/L, for ν = 0, for ν = 0.3.
const PLATES: [(f64, f64, f64); 3] = [(0.1, 19.35, 15.67), (0.2, 20.64, 17.00), (0.5, 24.96, 21.60)];

impl LateralBuckling {
    /// Returns Γ* of a slender beam, 12.853763 √(2 (1 − ν) (1 − ν²)).
    #[must_use]
    pub fn slender(poisson_ratio: f64) -> f64 {
        12.853_763 * (2.0 * (1.0 - poisson_ratio) * (1.0 - poisson_ratio * poisson_ratio)).sqrt()
    }

    /// Returns the load at which the lowest mode of the flat strip loses its stiffness. A strip upside down is equally
    /// stable, so ω² falls with Γ² near Γ*.
    ///
    /// # Errors
    /// Returns an error if the strip cannot be meshed or does not buckle.
    pub fn critical(&self) -> Result<f64, ValidateError> {
        critical_load("the strip", Symmetry::Even, 10.0, |gamma| self.stiffness(gamma))
    }

    /// Returns ω² of the lowest mode of the flat strip, scaled by D; `None` above Γ*.
    fn stiffness(&self, gamma: f64) -> Result<Option<f64>, ValidateError> {
        let spacing = 1.0 / (self.segments as f64 - 0.5);
        let strip = Strip {
            kind: self.mesh,
            orientation: self.orientation,
            length: 1.0 + 0.5 * spacing,
            width: self.aspect,
            spacing,
            clamped: true,
        };
        let mesh = strip.mesh()?;
        // Larger Γ by a softer plate under the same weight.
        let plate = Rigidity::Flexural { rigidity: 1.0 / gamma, poisson_ratio: self.poisson_ratio };
        let membrane =
            Membrane { stretch_stiffness: MEMBRANE, poisson_ratio: self.poisson_ratio, bending: Bending::Plate(plate) };
        let fabric = Fabric::new(1.0, Material::Stvk(membrane));
        let surroundings = Surroundings { gravity: [0.0, -1.0, 0.0], drag: 0.0 };
        let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
        let rest = mesh.vertices();
        let clamped: Vec<bool> = rest.iter().map(|p| p[0] < 1.2 * spacing).collect();
        let system = System::new(garment.terms, &clamped)?;
        let start = rest.to_vec();
        let mut found = Equilibrium::find(system, start, garment.masses, self.aspect)?;
        Ok(found.lowest_mode().map(|squared| gamma * squared))
    }

    /// Compares the critical load with that of a plate.
    ///
    /// # Errors
    /// Same as [`Self::critical`].
    pub fn ask(&self) -> Result<Finding, ValidateError> {
        let known = PLATES.iter().find(|(aspect, ..)| (aspect / self.aspect - 1.0).abs() < 1e-9);
        let (exact, limit) = match known {
            Some(&(_, none, usual)) if self.poisson_ratio == 0.0 || self.poisson_ratio == 0.3 => {
                (if self.poisson_ratio == 0.0 { none } else { usual }, 0.01)
            }
            // Other widths: only the slender limit and its slope are known.
            _ => (Self::slender(self.poisson_ratio), 0.1 + 1.5 * self.aspect),
        };
        let case = format!(
            "{} {}°, b/L = {}, ν = {}, {} segments",
            self.mesh.name(),
            self.orientation,
            self.aspect,
            self.poisson_ratio,
            self.segments
        );
        Ok(Finding::relative("lateral buckling", case, self.critical()?, exact, limit))
    }
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let case = |poisson_ratio, aspect, mesh, orientation, segments| LateralBuckling {
        poisson_ratio,
        aspect,
        mesh,
        orientation,
        segments,
    };
    if quick {
        report(case(0.3, 0.2, MeshKind::Diagonal, 0.0, 30).ask()?);
        return Ok(());
    }
    for (aspect, segments) in [(0.1, 80), (0.2, 50), (0.5, 30)] {
        for poisson_ratio in [0.0, 0.3] {
            report(case(poisson_ratio, aspect, MeshKind::Diagonal, 0.0, segments).ask()?);
        }
    }
    for mesh in [MeshKind::Equilateral, MeshKind::Alternating, MeshKind::Random] {
        report(case(0.3, 0.2, mesh, 30.0, 50).ask()?);
    }
    Ok(())
}
