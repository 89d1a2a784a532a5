//! The drape coefficient and the nodes of a specimen on a disc (Cusick 1968).

use std::f64::consts::PI;

use energy_dsl::Vector3;
use serde::Serialize;

use super::shadow::Floor;
use super::{Outline, Shadow};

/// Radius of Cusick's disc relative to that of the specimen: 18 cm on 30 cm.
const DISC: f64 = 0.6;
/// Default prominence of a node relative to the radius of the specimen: 3 mm of 15 cm.
const PROMINENCE: f64 = 0.02;

/// How to measure a drape. Lengths are in m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct DrapeOptions {
    /// Radius r of the disc; `None` for 0.6 R.
    pub disc: Option<f64>,
    /// Radius R of the flat specimen; `None` for √(A₀/π), with the area A₀ at rest.
    pub specimen: Option<f64>,
    /// Prominence from which a maximum of the outline is a node; `None` for 0.02 R.
    pub prominence: Option<f64>,
    /// A point on the axis of the disc; `None` for the centroid of the shadow.
    pub centre: Option<Vector3<f64>>,
    /// Direction up; zero for z.
    pub up: Vector3<f64>,
}

/// The drape of a specimen on a disc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drape {
    /// (A − πr²)/(πR² − πr²) in percent: 100 for a flat specimen, 0 for one that hangs down along the rim.
    pub coefficient: f64,
    /// Number of folds: maxima of the outline with at least the prominence.
    pub nodes: usize,
    /// Area A of the shadow, in m².
    pub area: f64,
    /// Radius r of the disc, in m.
    pub disc: f64,
    /// Radius R of the specimen, in m.
    pub specimen: f64,
    /// Least prominence of a node, in m.
    pub prominence: f64,
    /// Smallest, mean and largest radius of the outline, in m.
    pub radii: [f64; 3],
}

/// A drape that cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum DrapeError {
    /// The disc is not smaller than the specimen.
    #[error("the disc of radius {disc} m is not smaller than the specimen of radius {specimen} m; give both radii")]
    Radii { disc: f64, specimen: f64 },
    /// The mesh has no triangles.
    #[error("there are no triangles to measure the shadow of")]
    NoCloth,
}

impl Drape {
    /// Measures triangles at positions in m, with their area at rest in m².
    ///
    /// ```
    /// use cloth_core::measure::{Drape, DrapeOptions};
    /// use cloth_core::physics::mesh::Disc;
    /// let flat = Disc { radius: 0.15, rings: 20 }.mesh()?;
    /// let area = 3600.0 * 0.5 * 0.15_f64.powi(2) / 30.0 * (std::f64::consts::TAU / 120.0).sin();
    /// let drape = Drape::measure(flat.vertices(), flat.triangles(), area, &DrapeOptions::default())?;
    /// assert!((drape.coefficient - 100.0).abs() < 1e-3 && drape.nodes == 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the mesh has no triangles, or the disc is not smaller than the specimen.
    pub fn measure(
        x: &[Vector3<f64>],
        triangles: &[[usize; 3]],
        area_at_rest: f64,
        options: &DrapeOptions,
    ) -> Result<Self, DrapeError> {
        if triangles.is_empty() {
            return Err(DrapeError::NoCloth);
        }
        let specimen = options.specimen.unwrap_or((area_at_rest / PI).sqrt());
        let disc = options.disc.unwrap_or(DISC * specimen);
        if disc.is_nan() || specimen.is_nan() || disc >= specimen {
            return Err(DrapeError::Radii { disc, specimen });
        }
        let shadow = Shadow::new(x, triangles, options.up);
        let centre = options.centre.map_or(shadow.centroid(), |centre| Floor::across(options.up).project(centre));
        let outline = Outline::new(&shadow, centre);
        let prominence = options.prominence.unwrap_or(PROMINENCE * specimen);
        let coefficient = 100.0 * (shadow.area() / PI - disc * disc) / (specimen * specimen - disc * disc);
        let radii = outline.radii();
        let [smallest, largest] = [f64::min, f64::max].map(|pick| radii.iter().copied().reduce(pick).unwrap_or(0.0));
        let mean = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
        let (nodes, area) = (outline.nodes(prominence), shadow.area());
        Ok(Self { coefficient, nodes, area, disc, specimen, prominence, radii: [smallest, mean, largest] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Disc;

    /// Places the rings of a disc of radius 0.15 m by a map of radius and angle to radius and height.
    fn shaped(map: impl Fn(f64, f64) -> [f64; 2]) -> Drape {
        let disc = Disc { radius: 0.15, rings: 60 }.mesh().unwrap();
        let place = |&[x, y, _]: &Vector3<f64>| {
            let (r, phi) = (x.hypot(y), y.atan2(x));
            let [r, height] = map(r, phi);
            [0.4 + r * phi.cos(), -0.2 + r * phi.sin(), height]
        };
        let x: Vec<_> = disc.vertices().iter().map(place).collect();
        let area = PI * 0.15 * 0.15;
        Drape::measure(&x, disc.triangles(), area, &DrapeOptions::default()).unwrap()
    }

    #[test]
    fn a_cone_a_disc_and_waves_have_their_exact_drape() {
        let flat = shaped(|r, _| [r, 0.0]);
        assert!((flat.coefficient - 100.0).abs() < 0.1 && flat.nodes == 0, "{flat:?}");
        // The cloth falls at 60° outside the disc: its shadow ends at 0.09 + 0.06/2 m.
        let cone = shaped(|r, _| if r <= 0.09 { [r, 0.0] } else { [0.09 + 0.5 * (r - 0.09), -(r - 0.09)] });
        let expected = 100.0 * (0.12_f64.powi(2) - 0.0081) / (0.0225 - 0.0081);
        assert!((cone.coefficient - expected).abs() < 0.1 && cone.nodes == 0, "{cone:?}");
        // r = r0 + a cos nφ has the area π (r0² + a²/2).
        for folds in [4, 7] {
            let wave = |phi: f64| 0.12 + 0.01 * (f64::from(folds) * phi).cos();
            let waves = shaped(|r, phi| [r * wave(phi) / 0.15, -r]);
            let expected = 100.0 * (0.12_f64.powi(2) + 0.5e-4 - 0.0081) / (0.0225 - 0.0081);
            assert!((waves.coefficient - expected).abs() < 0.1, "{waves:?} {expected}");
            assert_eq!(waves.nodes, folds as usize);
            assert!((waves.radii[2] - 0.13).abs() < 1e-4 && (waves.radii[0] - 0.11).abs() < 1e-4);
        }
    }

    #[test]
    fn a_fold_below_the_disc_does_not_change_the_shadow() {
        // The rim is turned back under the cloth.
        let turned = shaped(|r, _| if r <= 0.12 { [r, 0.0] } else { [0.24 - r, -0.01] });
        let expected = 100.0 * (0.12_f64.powi(2) - 0.0081) / (0.0225 - 0.0081);
        assert!((turned.coefficient - expected).abs() < 0.1, "{turned:?}");
        let options = DrapeOptions { disc: Some(0.2), specimen: Some(0.15), ..DrapeOptions::default() };
        let error = Drape::measure(&[[0.0; 3]; 3], &[[0, 1, 2]], 1.0, &options).unwrap_err().to_string();
        assert!(error.contains("0.2 m is not smaller than the specimen of radius 0.15 m"), "{error}");
        assert_eq!(Drape::measure(&[], &[], 0.0, &DrapeOptions::default()), Err(DrapeError::NoCloth));
    }
}
