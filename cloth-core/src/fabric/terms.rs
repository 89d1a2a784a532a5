use energy_dsl::{ForceLaw, PackedPotential, RestError, Vector3};
use energy_elements::{
    BridsonBending, BridsonForce, BridsonForceDamped, FlatBending, Gravity, HookeSpring, NeoHookean, Spring, StVK,
    ViscousDrag,
};
use energy_solve::{ElementList, ForceTerm, ListError, PotentialTerm, Term};

use super::{Bending, Fabric, MassSpring, Material, Membrane};
use crate::mesh::{
    Hinge, SpringNetwork, Topology, TriangleMesh, cross, lumped_masses, material_triangle, norm, rest_angle, subtract,
};

/// A fabric that cannot be laid on a mesh.
#[derive(Debug, thiserror::Error)]
pub enum FabricError {
    /// An element refused its rest shape.
    #[error("triangle {triangle}: {source}")]
    Rest {
        /// The triangle.
        triangle: usize,
        /// What is wrong.
        source: RestError,
    },
    /// A hinge refused its rest shape.
    #[error("the hinge on vertices {vertices:?}: {source}")]
    RestHinge {
        /// Its vertices.
        vertices: [usize; 4],
        /// What is wrong.
        source: RestError,
    },
    /// Elements and stencils do not fit.
    #[error(transparent)]
    List(#[from] ListError),
}

/// What acts on every cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Acceleration of gravity, in m/s².
    pub gravity: Vector3<f64>,
    /// Drag per mass, in 1/s: the force −drag m v.
    pub drag: f64,
}

/// The terms of a fabric on a mesh.
#[derive(Debug)]
pub struct Garment {
    /// The mass of each vertex, in kg.
    pub masses: Vec<f64>,
    /// Everything that acts.
    pub terms: Vec<Box<dyn Term>>,
    /// What was left out because its stiffness is zero, or there is nothing for it to act on.
    pub left_out: Vec<String>,
}

/// Lays a fabric on a mesh. `springs` is used by mass–spring fabrics only.
///
/// # Errors
/// When an element refuses its rest shape.
pub fn terms(
    fabric: &Fabric,
    mesh: &TriangleMesh,
    springs: &SpringNetwork,
    surroundings: &Surroundings,
) -> Result<Garment, FabricError> {
    let masses = lumped_masses(mesh, fabric.density);
    let mut garment = Garment { masses, terms: Vec::new(), left_out: Vec::new() };
    match &fabric.material {
        Material::MassSpring(material) => garment.add_springs(material, mesh, springs)?,
        Material::Stvk(material) => garment.add_membrane(material, mesh, StVK::new)?,
        Material::NeoHookean(material) => garment.add_membrane(material, mesh, NeoHookean::new)?,
    }
    garment.add_surroundings(surroundings)?;
    Ok(garment)
}

impl Garment {
    fn add_springs(
        &mut self,
        material: &MassSpring,
        mesh: &TriangleMesh,
        springs: &SpringNetwork,
    ) -> Result<(), FabricError> {
        let MassSpring { structural, shear, bending, damping } = *material;
        let lengths = |pairs: &[[usize; 2]]| -> Vec<f64> {
            pairs.iter().map(|&[p, q]| norm(subtract(mesh.vertices()[p], mesh.vertices()[q]))).collect()
        };
        for (name, stiffness, pairs) in [
            ("structural springs", structural, &springs.structural),
            ("shear springs", shear, &springs.shear),
            ("bending springs", bending, &springs.bending),
        ] {
            if self.leave_out(name, stiffness == 0.0, pairs.len()) {
                continue;
            }
            let lengths = lengths(pairs).into_iter();
            if damping == 0.0 {
                self.add_potential(name, pairs, lengths.map(|length| HookeSpring::new(stiffness, length)).collect())?;
            } else {
                let damped = lengths.map(|length| Spring::new(length, stiffness, damping)).collect();
                let list = ElementList::new(name, damped, pairs)?;
                self.terms.push(Box::new(ForceTerm::new(list).with_energy()));
            }
        }
        Ok(())
    }

    fn add_membrane<E>(
        &mut self,
        material: &Membrane,
        mesh: &TriangleMesh,
        element: impl Fn([f64; 2], [f64; 2], [f64; 2], f64, f64) -> Result<E, RestError>,
    ) -> Result<(), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + 'static,
    {
        if !self.leave_out("membrane", material.stretch_stiffness == 0.0, mesh.triangles().len()) {
            let (lambda, mu) = material.lame();
            let element = |triangle: usize| {
                let [u0, u1, u2] = material_triangle(mesh.corners(triangle));
                element(u0, u1, u2, lambda, mu).map_err(|source| FabricError::Rest { triangle, source })
            };
            let elements = (0..mesh.triangles().len()).map(element).collect::<Result<Vec<_>, _>>()?;
            self.add_potential("membrane", mesh.triangles(), elements)?;
        }
        self.add_bending(&material.bending, mesh)
    }

    fn add_bending(&mut self, bending: &Bending, mesh: &TriangleMesh) -> Result<(), FabricError> {
        let hinges = Topology::of(mesh).hinges;
        let stencils: Vec<[usize; 4]> = hinges.iter().map(|hinge| hinge.vertices).collect();
        let angle = |hinge| rest_angle(mesh, hinge);
        let stiffness = match *bending {
            Bending::None => 0.0,
            Bending::Bridson { stiffness } | Bending::BridsonForce { stiffness, .. } | Bending::Flat { stiffness } => {
                stiffness
            }
        };
        let damping = if let Bending::BridsonForce { damping, .. } = bending { *damping } else { 0.0 };
        if self.leave_out("bending", stiffness == 0.0 && damping == 0.0, hinges.len()) {
            return Ok(());
        }
        match bending {
            Bending::None => Ok(()),
            Bending::Bridson { .. } => {
                let element = |hinge| BridsonBending::new(stiffness * shape_factor(mesh, hinge), angle(hinge));
                self.add_potential("bending", &stencils, hinges.iter().map(element).collect())
            }
            Bending::Flat { .. } => {
                let element = |hinge: &Hinge| {
                    let [x1, x2, x3, x4] = hinge.vertices.map(|vertex| mesh.vertices()[vertex]);
                    FlatBending::new(x1, x2, x3, x4, stiffness)
                        .map_err(|source| FabricError::RestHinge { vertices: hinge.vertices, source })
                };
                self.add_potential("bending", &stencils, hinges.iter().map(element).collect::<Result<_, _>>()?)
            }
            Bending::BridsonForce { .. } if damping == 0.0 => {
                let element = |hinge| BridsonForce::new(stiffness, angle(hinge));
                self.add_force("bending", &stencils, hinges.iter().map(element).collect())
            }
            Bending::BridsonForce { .. } => {
                let element = |hinge| BridsonForceDamped::new(stiffness, damping, angle(hinge));
                self.add_force("bending", &stencils, hinges.iter().map(element).collect())
            }
        }
    }

    fn add_surroundings(&mut self, surroundings: &Surroundings) -> Result<(), FabricError> {
        let vertices: Vec<[usize; 1]> = (0..self.masses.len()).map(|vertex| [vertex]).collect();
        if !self.leave_out("gravity", surroundings.gravity == [0.0; 3], vertices.len()) {
            let elements = self.masses.iter().map(|&mass| Gravity::new(mass, surroundings.gravity)).collect();
            self.add_potential("gravity", &vertices, elements)?;
        }
        if !self.leave_out("drag", surroundings.drag == 0.0, vertices.len()) {
            let elements = self.masses.iter().map(|&mass| ViscousDrag::new(surroundings.drag * mass)).collect();
            self.add_force("drag", &vertices, elements)?;
        }
        Ok(())
    }

    fn add_potential<E, const N: usize>(
        &mut self,
        name: &str,
        stencils: &[[usize; N]],
        elements: Vec<E>,
    ) -> Result<(), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + 'static,
    {
        self.terms.push(Box::new(PotentialTerm::new(ElementList::new(name, elements, stencils)?)));
        Ok(())
    }

    fn add_force<E, const N: usize>(
        &mut self,
        name: &str,
        stencils: &[[usize; N]],
        elements: Vec<E>,
    ) -> Result<(), FabricError>
    where
        E: ForceLaw<f64> + std::fmt::Debug + 'static,
    {
        self.terms.push(Box::new(ForceTerm::new(ElementList::new(name, elements, stencils)?)));
        Ok(())
    }

    /// Whether a term acts on nothing or with nothing; notes it if so.
    fn leave_out(&mut self, name: &str, is_zero: bool, elements: usize) -> bool {
        match (is_zero, elements) {
            (true, _) => self.left_out.push(format!("{name}: zero")),
            (false, 0) => self.left_out.push(format!("{name}: nothing to act on")),
            (false, _) => return false,
        }
        true
    }
}

/// ‖Ē‖²/(‖N̄₁‖ + ‖N̄₂‖) of a hinge at rest.
fn shape_factor(mesh: &TriangleMesh, hinge: &Hinge) -> f64 {
    let [x1, x2, x3, x4] = hinge.vertices.map(|vertex| mesh.vertices()[vertex]);
    let edge = subtract(x4, x3);
    let normals = norm(cross(edge, subtract(x1, x3))) + norm(cross(edge, subtract(x2, x3)));
    crate::mesh::dot(edge, edge) / normals
}
