use std::collections::BTreeSet;
use std::ops::Range;

use clap::ValueEnum;
use energy_dsl::Vector3;
use plotters::style::colors::colormaps::ViridisRGB;

use crate::geometry::{dot, norm, subtract};
use crate::mesh::material_triangle;
use crate::model::PartKind;
use crate::simulation::Simulation;

/// The quantity that colours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Colouring {
    /// None: each side of the cloth has its own colour.
    #[default]
    Plain,
    /// Largest strain |σ − 1|, with the principal stretches σ; for hair, the strain of the segments.
    Strain,
    /// Stored deformation energy, in J/kg: of all elements with at least two vertices.
    Energy,
    /// Speed ‖v‖, in m/s.
    Speed,
    /// Force of certified contact on each vertex, in N, while a scene is simulated; zero in frames of a run.
    Contact,
}

impl Colouring {
    /// Returns the next colouring.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Plain => Self::Strain,
            Self::Strain => Self::Energy,
            Self::Energy => Self::Speed,
            Self::Speed => Self::Contact,
            Self::Contact => Self::Plain,
        }
    }

    /// Describes the colours from 0 to `most`, with a unit.
    #[must_use]
    pub fn legend(self, most: f64) -> String {
        match self {
            Self::Plain => "plain".to_owned(),
            Self::Strain => format!("strain from 0 to {:.3} %", 100.0 * most),
            Self::Energy => format!("stored energy from 0 to {most:.3e} J/kg"),
            Self::Speed => format!("speed from 0 to {most:.3} m/s"),
            Self::Contact => format!("force of contact from 0 to {most:.3e} N"),
        }
    }
}

/// Maps a number from 0 to `most` to viridis, from dark blue to yellow, as sRGB from 0 to 1.
#[must_use]
pub fn colour(value: f64, most: f64) -> [f32; 3] {
    let part = if most > 0.0 { (value / most).clamp(0.0, 1.0) } else { 0.0 };
    // NaN, from a failed state, is drawn as 0.
    let rgb = ViridisRGB::get_color(if part.is_nan() { 0.0 } else { part });
    [rgb.0, rgb.1, rgb.2].map(|channel| f32::from(channel) / 255.0)
}

/// Returns the 98th percentile as the upper end of the colour scale, so that a single vertex at a pin does not make all
/// others dark.
#[must_use]
pub fn upper_end(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() * 98 / 100).min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// The rest shape, which strains refer to.
#[derive(Clone, Debug)]
pub struct RestShape {
    /// For each triangle: its corners, and (l, x, y) such that in its plane they lie at 0, (l, 0) and (x, y), in m.
    triangles: Vec<([usize; 3], [f64; 3])>,
    /// For each hair segment: its ends, and its length in m.
    segments: Vec<([usize; 2], f64)>,
}

impl RestShape {
    /// Creates the rest shape of a simulation that has not started; hair is at rest then.
    #[must_use]
    pub fn of(simulation: &Simulation) -> Self {
        let flat = |corners: [Vector3<f64>; 3]| {
            let [_, [l, _], [x, y]] = material_triangle(corners);
            [l, x, y]
        };
        let cloths = simulation.parts().iter().filter_map(|part| match &part.kind {
            PartKind::Cloth(mesh) => Some((part.vertices.start, mesh)),
            PartKind::Hair { .. } => None,
        });
        let triangles = cloths.flat_map(|(first, mesh)| {
            let corners = mesh.triangles().iter().map(move |corners| corners.map(|corner| first + corner));
            corners.zip((0..mesh.triangles().len()).map(move |triangle| flat(mesh.corners(triangle))))
        });
        let x = simulation.positions();
        let joints = |strand: &Range<usize>| strand.clone().skip(1).map(|end| [end - 1, end]).collect::<Vec<_>>();
        let segments = simulation.strands().iter().flat_map(joints);
        let segments = segments.map(|[a, b]| ([a, b], norm(subtract(x[b], x[a])))).collect();
        Self { triangles: triangles.collect(), segments }
    }

    /// Returns the strain at each vertex: the area-weighted mean of its triangles, or the mean of its segments.
    #[must_use]
    pub fn strains(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        let (mut sums, mut weights) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        let mut add = |vertices: &[usize], strain: f64, weight: f64| {
            for &vertex in vertices {
                sums[vertex] += weight * strain;
                weights[vertex] += weight;
            }
        };
        for (corners, [l, along, across]) in &self.triangles {
            let [a, b, c] = corners.map(|corner| x[corner]);
            let first = subtract(b, a).map(|component| component / l);
            let side = subtract(c, a);
            let second = std::array::from_fn(|axis| (side[axis] - along * first[axis]) / across);
            add(corners, largest_strain(first, second), l * across);
        }
        for (ends, length) in &self.segments {
            let [a, b] = ends.map(|end| x[end]);
            add(ends, (norm(subtract(b, a)) / length - 1.0).abs(), *length);
        }
        sums.iter().zip(weights).map(|(sum, weight)| if weight > 0.0 { sum / weight } else { 0.0 }).collect()
    }
}

/// Returns max |σ − 1| of the deformation gradient F with these columns; σ² are the eigenvalues of FᵀF.
fn largest_strain(first: Vector3<f64>, second: Vector3<f64>) -> f64 {
    let (a, b, c) = (dot(first, first), dot(first, second), dot(second, second));
    let (middle, apart) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
    [middle + apart, (middle - apart).max(0.0)]
        .map(|square| (square.sqrt() - 1.0).abs())
        .into_iter()
        .fold(0.0, f64::max)
}

/// Returns the stored energy at each vertex over its mass, in J/kg. The energy of an element is divided evenly among
/// its vertices.
#[must_use]
pub fn stored_energies(simulation: &Simulation, x: &[Vector3<f64>]) -> Vec<f64> {
    let mut energies = vec![0.0; x.len()];
    for island in simulation.islands() {
        let vertices = island.vertices();
        let within: Vec<Vector3<f64>> = vertices.iter().map(|&vertex| x[vertex]).collect();
        for (term, _) in island.body().system.terms().filter(|(term, _)| term.stencils().arity() > 1) {
            let stencils = term.stencils();
            for (number, energy) in term.element_energies(&within).unwrap_or_default() {
                for (vertex, share) in shares(stencils.stencil(number), energy) {
                    energies[vertices[vertex]] += share;
                }
            }
        }
    }
    energies.iter().zip(simulation.masses()).map(|(energy, mass)| energy / mass).collect()
}

/// Divides an element's energy evenly among its vertices. Stencils padded by repeating a vertex count it once.
fn shares(stencil: impl Iterator<Item = u32>, energy: f64) -> impl Iterator<Item = (usize, f64)> {
    let vertices: BTreeSet<usize> = stencil.map(|vertex| vertex as usize).collect();
    let share = energy / vertices.len() as f64;
    vertices.into_iter().map(move |vertex| (vertex, share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    fn simulation(material: &str) -> Simulation {
        let scene = format!(
            "dt = 0.01\nduration = 1.0\n[mesh.sheet]\ncells = [4, 3]\nsize = [1.0, 0.6]\n[fabric]\ndensity = 0.2\n\
             [fabric.material.stvk]\nstretch_stiffness = 50.0\npoisson_ratio = 0.3\n{material}\n\
             [[hair]]\ncount = 1\nsegments = 3\nlength = 0.3\nroot = [0.0, 5.0, 0.0]\ndensity = 1e-4\n\
             stretch_stiffness = 5.0\nbend_stiffness = 1e-7\n"
        );
        Simulation::new(&Scene::parse(&scene, "s.toml".as_ref()).unwrap()).unwrap()
    }

    #[test]
    fn strain_is_the_largest_change_of_length() {
        let simulation = simulation("");
        let rest = RestShape::of(&simulation);
        let x = simulation.positions();
        assert!(rest.strains(x).iter().all(|strain| strain.abs() < 1e-14));
        // Rotated, stretched by 10 % along x and compressed by 30 % along y: the strain is 30 %. Hair is 25 % longer.
        let stretched: Vec<Vector3<f64>> = x.iter().map(|&[x, y, z]| [0.7 * y, -1.1 * x, 1.25 * z]).collect();
        for (vertex, strain) in rest.strains(&stretched).into_iter().enumerate() {
            let expected = if vertex < 20 { 0.3 } else { 0.25 };
            assert!((strain - expected).abs() < 1e-12, "{vertex}: {strain}");
        }
    }

    #[test]
    fn stored_energy_excludes_gravity_and_contact() {
        for bending in
            ["bending.flat.stiffness = 1e-3", "bending.plate.flexural = { rigidity = 1e-3, poisson_ratio = 0.2 }"]
        {
            let simulation = simulation(bending);
            let x: Vec<Vector3<f64>> = simulation
                .positions()
                .iter()
                .map(|&[x, y, z]| [1.02 * x, y, z + 0.1 * (7.0 * x).sin() * (y + 0.2)])
                .collect();
            let shown: f64 = stored_energies(&simulation, &x).iter().zip(simulation.masses()).map(|(e, m)| e * m).sum();
            let stored: f64 = simulation
                .islands()
                .iter()
                .flat_map(|island| {
                    let x: Vec<Vector3<f64>> = island.vertices().iter().map(|&vertex| x[vertex]).collect();
                    let terms = island.body().system.terms().filter(|(term, _)| term.stencils().arity() > 1);
                    terms.filter_map(|(term, _)| Some(term.energy(&x)?.0)).collect::<Vec<_>>()
                })
                .sum();
            assert!(stored > 0.0 && (shown / stored - 1.0).abs() < 1e-12, "{shown} {stored}");
        }
    }

    #[test]
    fn padding_of_a_stencil_counts_once() {
        assert_eq!(shares([3, 5, 3, 3].into_iter(), 1.0).collect::<Vec<_>>(), [(3, 0.5), (5, 0.5)]);
    }

    #[test]
    fn colours_go_from_dark_to_bright_and_ignore_peaks() {
        let brightness = |value: f64| colour(value, 2.0).iter().sum::<f32>();
        assert!(brightness(0.0) < brightness(1.0) && brightness(1.0) < brightness(2.0));
        assert_eq!(colour(3.0, 2.0), colour(2.0, 2.0));
        assert_eq!(colour(f64::NAN, 2.0), colour(0.0, 2.0));
        assert_eq!(colour(1.0, 0.0), colour(0.0, 1.0));
        let mut values = vec![1.0; 199];
        values.push(1e9);
        assert_eq!(upper_end(&values), 1.0);
        assert_eq!((upper_end(&[3.0]), upper_end(&[])), (3.0, 0.0));
        let all = [Colouring::Strain, Colouring::Energy, Colouring::Speed, Colouring::Plain];
        assert_eq!(all.map(Colouring::next)[3], Colouring::Strain);
        assert!(Colouring::Strain.legend(0.0213).contains("2.130 %"));
    }
}
