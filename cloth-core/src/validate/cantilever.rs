use super::elastica::Elastica;
use super::equilibrium::Equilibrium;
use super::strip::{MeshKind, Strip};
use super::{Finding, ValidateError};
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use crate::mesh::SpringNetwork;
use energy_solve::System;

/// A strip clamped horizontally at one end that bends under its own weight, with the load Γ = σ g L³/D.
///
/// Two columns of vertices are clamped. The length L counts from midway between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cantilever {
    /// Load Γ.
    pub gamma: f64,
    /// Poisson's ratio ν of the plate. The rigidity of a strip with free edges lies between (1 − ν²) D (narrow) and D
    /// (wide).
    pub poisson_ratio: f64,
    /// Width over length.
    pub aspect: f64,
    /// Kind of mesh.
    pub mesh: MeshKind,
    /// Angle between mesh and strip, in degrees.
    pub orientation: f64,
    /// Edges along the strip, starting at the first clamped column.
    pub segments: usize,
}

/// E h of the membrane over the strip's weight per width: stiff enough not to stretch, soft enough for flat triangles
/// to bend across their edges.
const MEMBRANE: f64 = 1e3;

impl Cantilever {
    /// Returns the Γ of the elastica with the same ratio of drop and reach.
    ///
    /// # Errors
    /// Returns an error if the strip cannot be meshed or finds no equilibrium.
    pub fn fit(&self) -> Result<f64, ValidateError> {
        // Units: the strip's length, its density and gravity are 1.
        let spacing = 1.0 / (self.segments as f64 - 0.5);
        let origin = 0.5 * spacing;
        let strip = Strip {
            kind: self.mesh,
            orientation: self.orientation,
            length: 1.0 + origin,
            width: self.aspect,
            spacing,
            clamped: true,
        };
        let mesh = strip.mesh()?;
        let plate = Rigidity::Flexural { rigidity: 1.0 / self.gamma, poisson_ratio: self.poisson_ratio };
        let membrane = Membrane { stretch_stiffness: MEMBRANE, poisson_ratio: 0.0, bending: Bending::Plate(plate) };
        let fabric = Fabric::new(1.0, Material::Stvk(membrane));
        let surroundings = Surroundings { gravity: [0.0, 0.0, -1.0], drag: 0.0 };
        let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
        let rest = mesh.vertices();
        let clamped: Vec<bool> = rest.iter().map(|p| p[0] < 1.2 * spacing).collect();
        let system = System::new(garment.terms, &clamped)?;
        let shape = Elastica::new(self.gamma);
        let start = rest.iter().zip(&clamped).map(|(p, &clamped)| {
            let [reach, drop] = if clamped { [p[0] - origin, 0.0] } else { shape.at(p[0] - origin) };
            [reach + origin, p[1], -drop]
        });
        let weight = self.aspect;
        let found = Equilibrium::find(system, start.collect(), garment.masses, weight)?;
        let tip: Vec<&[f64; 3]> =
            rest.iter().zip(&found.x).filter(|(p, _)| p[0] > strip.length - 1e-9).map(|(_, x)| x).collect();
        let mean = |axis: usize| tip.iter().map(|x| x[axis]).sum::<f64>() / tip.len() as f64;
        Ok(Elastica::fit(-mean(2) / (mean(0) - origin)))
    }

    /// Compares the fitted Γ with the load; for ν ≠ 0, relative to the rigidity of a narrow strip.
    ///
    /// # Errors
    /// Same as [`Self::fit`].
    pub fn ask(&self) -> Result<Finding, ValidateError> {
        let limit = if self.gamma > 100.0 { 0.02 } else { 0.01 };
        let measured = self.fit()?;
        let mut case =
            format!("{} {}°, {} segments, Γ = {}", self.mesh.name(), self.orientation, self.segments, self.gamma);
        if self.poisson_ratio == 0.0 {
            return Ok(Finding::relative("cantilever", case, measured, self.gamma, limit));
        }
        // Any value between those of a narrow and a wide strip is correct.
        let narrow = self.gamma / (1.0 - self.poisson_ratio * self.poisson_ratio);
        case += &format!(", ν = {}, b/L = {}", self.poisson_ratio, self.aspect);
        let exact = measured.clamp(self.gamma.min(narrow), self.gamma.max(narrow));
        Ok(Finding::relative("cantilever", case, measured, exact, limit))
    }
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let (segments, gammas): (_, &[f64]) =
        if quick { (40, &[1.0, 20.0]) } else { (80, &[0.1, 1.0, 10.0, 100.0, 1000.0]) };
    let orientations: &[f64] = if quick { &[0.0, 30.0] } else { &[0.0, 30.0, 45.0, 90.0] };
    for mesh in MeshKind::ALL {
        for &orientation in orientations {
            for &gamma in gammas {
                let aspect = 5.0 / segments as f64;
                let case = Cantilever { gamma, poisson_ratio: 0.0, aspect, mesh, orientation, segments };
                report(case.ask()?);
            }
        }
    }
    if quick {
        return Ok(());
    }
    report(order()?);
    let wide = |aspect| Cantilever {
        gamma: 5.0,
        poisson_ratio: 0.3,
        aspect,
        mesh: MeshKind::Random,
        orientation: 0.0,
        segments: 40,
    };
    for aspect in [0.15, 1.0] {
        report(wide(aspect).ask()?);
    }
    Ok(())
}

/// Measures the order of convergence: the error should fall with the square of the segment length.
fn order() -> Result<Finding, ValidateError> {
    let error = |segments: usize| -> Result<f64, ValidateError> {
        let aspect = 0.1;
        let case = Cantilever {
            gamma: 20.0,
            poisson_ratio: 0.0,
            aspect,
            mesh: MeshKind::Diagonal,
            orientation: 0.0,
            segments,
        };
        case.fit()
    };
    let [coarse, middle, fine] = [error(20)?, error(40)?, error(80)?];
    let order = ((coarse - middle) / (middle - fine)).abs().log2();
    Ok(Finding::absolute("cantilever", "diagonal 0°, Γ = 20: order from 20, 40, 80".into(), order, 2.0, 0.2))
}
