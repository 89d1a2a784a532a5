use energy_dsl::{Element, ForceLaw, PackedPotential, RestError, Vector3};
use energy_elements::{
    AsRigidAsPossible, BaraffWitkinShear, BaraffWitkinStretch, BridsonBending, BridsonForce, BridsonForceDamped,
    FlatBending, Gravity, HookeSpring, NeoHookean, OrthotropicStVK, Spring, StVK, StableNeoHookean,
    StableNeoHookeanLog, ThreadLimit, ViscousDrag,
};
use energy_solve::{DissipationTerm, DrivenTerm, ElementList, ForceTerm, ListError, PotentialTerm, Term};

use super::damping::{HingeDamping, MembraneDamping};
use super::declared::{Declared, TargetMesh};
use super::error::FabricError;
use super::locking::Locking;
use super::membrane::MaterialMesh;
use super::plasticity::{PlasticHinges, angle_of_curvature};
use super::plate::{PlateTerm, Rigidity};
use super::{Bending, Fabric, Hysteresis, MassSpring, Material, Plasticity, Rayleigh, StrainLimit};
use crate::geometry::{cross, norm, subtract};
use crate::mesh::{Hinge, MaterialTriangle, SpringNetwork, Topology, TriangleMesh, lumped_masses, rest_angle};

/// External forces on every cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Acceleration of gravity, in m/s².
    pub gravity: Vector3<f64>,
    /// Drag per mass, in 1/s: the force −drag m v.
    pub drag: f64,
}

/// The part of a system that a mesh takes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SystemPart {
    /// Offset of its vertices in the system.
    pub first: usize,
    /// Prefix of its terms' names.
    pub prefix: String,
}

/// The terms of a fabric on a mesh, or of hair.
#[derive(Debug)]
pub struct FabricTerms {
    /// The mass of each vertex, in kg.
    pub masses: Vec<f64>,
    /// The forces of the fabric and its surroundings.
    pub terms: Vec<Box<dyn Term>>,
    /// Terms that were left out, because their stiffness is zero or they have no elements.
    pub left_out: Vec<String>,
    /// Warnings about the fabric.
    pub warnings: Vec<String>,
    /// An estimate of locking; `None` without a membrane or bending resistance, and for springs and declared elements.
    pub locking: Option<Locking>,
    pub(super) part: SystemPart,
}

/// Creates the terms of a fabric on a mesh. Only mass–spring fabrics use `springs`.
///
/// # Errors
/// Returns an error if the fabric is invalid, or an element rejects its rest shape.
pub fn terms(
    fabric: &Fabric,
    mesh: &TriangleMesh,
    springs: &SpringNetwork,
    surroundings: &Surroundings,
) -> Result<FabricTerms, FabricError> {
    terms_at(fabric, mesh, springs, surroundings, SystemPart::default())
}

/// Creates the terms of a fabric on one of several meshes in a system.
///
/// # Errors
/// Returns an error if the fabric is invalid, or an element rejects its rest shape.
pub fn terms_at(
    fabric: &Fabric,
    mesh: &TriangleMesh,
    springs: &SpringNetwork,
    surroundings: &Surroundings,
    part: SystemPart,
) -> Result<FabricTerms, FabricError> {
    let masses = lumped_masses(mesh, fabric.density);
    let mut terms = FabricTerms::new(masses, part);
    let cloth = MaterialMesh::new(mesh, fabric, surroundings)?;
    check_plasticity(fabric)?;
    // λ and μ for small strains; damping is proportional to them.
    let stiffness = match &fabric.material {
        Material::MassSpring(material) => {
            terms.add_springs(material, mesh, springs)?;
            (0.0, 0.0)
        }
        Material::Stvk(material) => terms.add_isotropic(&cloth, material.lame(), StVK::new)?,
        Material::NeoHookean(material) => terms.add_isotropic(&cloth, material.lame(), NeoHookean::new)?,
        Material::StableNeoHookean(material) => terms.add_isotropic(&cloth, material.lame(), stable_neo_hookean)?,
        Material::StableNeoHookeanLog(material) => {
            terms.add_isotropic(&cloth, material.lame(), stable_neo_hookean_log)?
        }
        Material::Arap(material) => {
            let mu = material.stretch_stiffness;
            terms.add_membrane("membrane", mu == 0.0, &cloth, move |[u0, u1, u2]| {
                AsRigidAsPossible::new(u0, u1, u2, mu)
            })?;
            (0.0, 0.5 * mu)
        }
        Material::BaraffWitkin(material) => {
            let ([b_u, b_v], stretch, shear) = (material.rest_stretch, material.stretch, material.shear);
            terms.add_membrane("stretch", stretch == 0.0, &cloth, move |[u0, u1, u2]| {
                BaraffWitkinStretch::new(u0, u1, u2, stretch / area([u0, u1, u2]), b_u, b_v)
            })?;
            terms.add_membrane("shear", shear == 0.0, &cloth, move |[u0, u1, u2]| {
                BaraffWitkinShear::new(u0, u1, u2, shear / area([u0, u1, u2]))
            })?;
            (0.0, 0.5 * stretch)
        }
        Material::OrthotropicStvk(material) => {
            let strips = Rigidity::Orthotropic {
                warp: material.warp,
                weft: material.weft,
                bias: material.bias,
                poisson_ratio: material.poisson_ratio,
            };
            let [[c_uu, c_uv, _], [_, c_vv, _], [_, _, c_ss]] = strips.matrix()?;
            terms.add_membrane("membrane", false, &cloth, move |[u0, u1, u2]| {
                OrthotropicStVK::new(u0, u1, u2, c_uu - c_uv, c_vv - c_uv, c_uv, c_ss)
            })?;
            (c_uv, c_ss)
        }
        Material::Yarns(material) => {
            let law = material.law()?;
            terms.warnings.extend(law.warnings(&terms.part.prefix));
            terms.add_membrane("membrane", false, &cloth, move |triangle| law.element(triangle))?;
            (law.coupling, law.shear.k)
        }
        Material::File(declared) => {
            terms.add_declared(declared, &cloth, fabric.density)?;
            (0.0, 0.0)
        }
    };
    let bending = fabric.material.bending();
    if let Some(limit) = &fabric.strain_limit {
        terms.add_strain_limit(limit, &cloth)?;
    }
    if let Some(bending) = bending {
        terms.add_bending(bending, fabric.hysteresis.as_ref(), &cloth)?;
    }
    if let Some(hysteresis) = fabric.hysteresis.as_ref().filter(|_| !bending.is_some_and(is_plate)) {
        terms.add_hysteresis(hysteresis, &cloth)?;
    }
    if let Some(rayleigh) = &fabric.rayleigh {
        terms.add_rayleigh(rayleigh, stiffness, bending.unwrap_or(&Bending::None), &cloth)?;
    }
    terms.add_surroundings(surroundings)?;
    Ok(terms)
}

/// Returns an error if something would have to yield that cannot.
fn check_plasticity(fabric: &Fabric) -> Result<(), FabricError> {
    let Some(Plasticity { stretch, curvature }) = fabric.plasticity else { return Ok(()) };
    if stretch.is_some() && matches!(fabric.material, Material::MassSpring(_) | Material::File(_)) {
        return Err(FabricError::CannotStretch);
    }
    let can_fold = matches!(fabric.material.bending(), Some(Bending::Plate(_) | Bending::Bridson { .. }));
    if curvature.is_some() && !can_fold { Err(FabricError::CannotFold) } else { Ok(()) }
}

/// Whether bending is that of a plate with a rigidity, which hysteresis joins.
fn is_plate(bending: &Bending) -> bool {
    matches!(bending, Bending::Plate(rigidity) if rigidity.matrix().is_ok_and(|d| d[0][0] > 0.0))
}

pub(super) fn area([a, b, c]: MaterialTriangle) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}

/// For small strains ε, the density of the declared element is ½ μ (ε₁ − ε₂)² + ½ λ (ε₁ + ε₂)². Hooke's law has λ + μ
/// in place of λ.
fn stable_neo_hookean(
    u0: [f64; 2],
    u1: [f64; 2],
    u2: [f64; 2],
    lambda: f64,
    mu: f64,
) -> Result<StableNeoHookean, RestError> {
    StableNeoHookean::new(u0, u1, u2, lambda + mu, mu)
}

/// For small strains ε, the density of the declared element is ⅓ μ (ε₁ − ε₂)² + (μ/9 + λ/2) (ε₁ + ε₂)². Hooke's law has
/// ½ μ (ε₁ − ε₂)² + ½ (λ + μ) (ε₁ + ε₂)².
fn stable_neo_hookean_log(
    u0: [f64; 2],
    u1: [f64; 2],
    u2: [f64; 2],
    lambda: f64,
    mu: f64,
) -> Result<StableNeoHookeanLog, RestError> {
    StableNeoHookeanLog::new(u0, u1, u2, lambda + 2.0 / 3.0 * mu, 1.5 * mu)
}

impl FabricTerms {
    pub(super) fn new(masses: Vec<f64>, part: SystemPart) -> Self {
        Self { masses, terms: Vec::new(), left_out: Vec::new(), warnings: Vec::new(), locking: None, part }
    }

    fn add_springs(
        &mut self,
        material: &MassSpring,
        mesh: &TriangleMesh,
        springs: &SpringNetwork,
    ) -> Result<(), FabricError> {
        if mesh.has_patterns() {
            return Err(FabricError::SpringsOfPatterns);
        }
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
                let list = self.list(name, damped, pairs)?;
                self.terms.push(Box::new(ForceTerm::new(list).with_energy()));
            }
        }
        Ok(())
    }

    pub(super) fn add_driven<L: energy_solve::DrivenLaw + 'static, const N: usize>(
        &mut self,
        name: &str,
        stencils: &[[usize; N]],
        law: L,
    ) {
        let (name, stencils) = (self.named(name), self.in_system(stencils));
        self.terms.push(Box::new(DrivenTerm::new(name, law, &stencils)));
    }

    /// Prefixes the name of a term.
    pub(super) fn named(&self, name: &str) -> String {
        format!("{}{name}", self.part.prefix)
    }

    /// Numbers vertices as in the system.
    fn in_system<const N: usize>(&self, stencils: &[[usize; N]]) -> Vec<[usize; N]> {
        stencils.iter().map(|stencil| stencil.map(|vertex| self.part.first + vertex)).collect()
    }

    fn add_declared(&mut self, declared: &Declared, cloth: &MaterialMesh<'_>, density: f64) -> Result<(), FabricError> {
        let SystemPart { first, prefix } = &self.part;
        let (mesh, triangles) = (cloth.mesh, cloth.triangles.as_slice());
        let terms = declared.terms(&TargetMesh { mesh, triangles, density, first: *first, prefix })?;
        self.terms.extend(terms.into_iter().map(|term| -> Box<dyn Term> { Box::new(term) }));
        Ok(())
    }

    fn add_strain_limit(&mut self, limit: &StrainLimit, cloth: &MaterialMesh<'_>) -> Result<(), FabricError> {
        let StrainLimit { stretch, stiffness } = *limit;
        if stretch <= 1.0 {
            return Err(FabricError::Limit { stretch });
        }
        self.add_membrane("strain limit", stiffness == 0.0, cloth, move |[u0, u1, u2]| {
            ThreadLimit::new(u0, u1, u2, stiffness, stretch)
        })
    }

    fn add_rayleigh(
        &mut self,
        rayleigh: &Rayleigh,
        (lambda, mu): (f64, f64),
        bending: &Bending,
        cloth: &MaterialMesh<'_>,
    ) -> Result<(), FabricError> {
        let (beta, triangles) = (rayleigh.stretching, cloth.mesh.triangles());
        if !self.leave_out("membrane damping", beta * mu == 0.0, triangles.len()) {
            let (triangles, rest) = (self.in_system(triangles), cloth.triangles.clone());
            let law = MembraneDamping { triangles: triangles.clone(), rest, viscosities: [beta * lambda, beta * mu] };
            self.terms.push(Box::new(DissipationTerm::new(self.named("membrane damping"), law, &triangles)));
        }
        let (beta, rigidity) = (rayleigh.bending, rigidity_along_grid(bending)?);
        let hinges = Topology::of(cloth.mesh).hinges;
        if !self.leave_out("bending damping", beta * rigidity == 0.0, hinges.len()) {
            let stencils: Vec<[usize; 4]> = hinges.iter().map(|hinge| hinge.vertices).collect();
            let stencils = self.in_system(&stencils);
            // c ‖e‖²/(A₁ + A₂) θ² gives a sheet with regular diagonals the rigidity 2c along its grid.
            let viscosity = |hinge| 2.0 * beta * rigidity * shape_factor(cloth.mesh, hinge);
            let law = HingeDamping { hinges: stencils.clone(), viscosities: hinges.iter().map(viscosity).collect() };
            self.terms.push(Box::new(DissipationTerm::new(self.named("bending damping"), law, &stencils)));
        }
        Ok(())
    }

    fn add_plate(
        &mut self,
        rigidity: &Rigidity,
        hysteresis: Option<&Hysteresis>,
        cloth: &MaterialMesh<'_>,
    ) -> Result<(), FabricError> {
        let is_zero = !is_plate(&Bending::Plate(*rigidity));
        let mut plate = PlateTerm::new(self.named("bending"), cloth.mesh, rigidity, cloth.warp)?;
        if self.leave_out("bending", is_zero, plate.triangles()) {
            return Ok(());
        }
        if let Some(curvature) = cloth.plasticity.curvature {
            plate = plate.yielding(cloth.mesh, curvature);
        }
        if let Some(hysteresis) = hysteresis {
            plate = plate.with_friction(&hysteresis.rigidity(), hysteresis.moment)?;
        }
        self.terms.push(Box::new(plate.on_vertices_from(self.part.first)));
        Ok(())
    }

    fn add_bending(
        &mut self,
        bending: &Bending,
        hysteresis: Option<&Hysteresis>,
        cloth: &MaterialMesh<'_>,
    ) -> Result<(), FabricError> {
        let mesh = cloth.mesh;
        if let Bending::Plate(rigidity) = bending {
            return self.add_plate(rigidity, hysteresis, cloth);
        }
        let hinges = Topology::of(mesh).hinges;
        let stencils: Vec<[usize; 4]> = hinges.iter().map(|hinge| hinge.vertices).collect();
        let angle = |hinge| rest_angle(mesh, hinge);
        let stiffness = match *bending {
            Bending::None | Bending::Plate(_) => 0.0,
            Bending::Bridson { stiffness } | Bending::BridsonForce { stiffness, .. } | Bending::Flat { stiffness } => {
                stiffness
            }
        };
        let damping = if let Bending::BridsonForce { damping, .. } = bending { *damping } else { 0.0 };
        if self.leave_out("bending", stiffness == 0.0 && damping == 0.0, hinges.len()) {
            return Ok(());
        }
        match bending {
            Bending::None | Bending::Plate(_) => Ok(()),
            Bending::Bridson { .. } => {
                let stiffness = |hinge| stiffness * shape_factor(mesh, hinge);
                let Some(curvature) = cloth.plasticity.curvature else {
                    let element = |hinge| BridsonBending::new(stiffness(hinge), angle(hinge));
                    return self.add_potential("bending", &stencils, hinges.iter().map(element).collect());
                };
                let limit = |hinge| angle_of_curvature(mesh, hinge, curvature);
                let law = PlasticHinges {
                    stiffness: hinges.iter().map(stiffness).collect(),
                    rest: hinges.iter().map(angle).collect(),
                    limits: hinges.iter().map(limit).collect(),
                };
                self.add_driven("bending", &stencils, law);
                Ok(())
            }
            Bending::Flat { .. } => {
                let element = |hinge: &Hinge| {
                    let [x1, x2, x3, x4] = mesh.hinge_at_rest(hinge);
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

    fn add_hysteresis(&mut self, hysteresis: &Hysteresis, cloth: &MaterialMesh<'_>) -> Result<(), FabricError> {
        let name = self.named("bending hysteresis");
        let plate = PlateTerm::new(name, cloth.mesh, &hysteresis.rigidity(), cloth.warp)?;
        if !self.leave_out("bending hysteresis", false, plate.triangles()) {
            let plate = plate.with_plastic_curvature(hysteresis.moment);
            self.terms.push(Box::new(plate.on_vertices_from(self.part.first)));
        }
        Ok(())
    }

    pub(super) fn add_surroundings(&mut self, surroundings: &Surroundings) -> Result<(), FabricError> {
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

    pub(super) fn add_potential<E, const N: usize>(
        &mut self,
        name: &str,
        stencils: &[[usize; N]],
        elements: Vec<E>,
    ) -> Result<(), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
    {
        self.terms.push(Box::new(PotentialTerm::new(self.list(name, elements, stencils)?)));
        Ok(())
    }

    fn add_force<E, const N: usize>(
        &mut self,
        name: &str,
        stencils: &[[usize; N]],
        elements: Vec<E>,
    ) -> Result<(), FabricError>
    where
        E: ForceLaw<f64> + std::fmt::Debug + Send + Sync + 'static,
    {
        self.terms.push(Box::new(ForceTerm::new(self.list(name, elements, stencils)?)));
        Ok(())
    }

    /// Creates a list of elements on vertices of the mesh.
    fn list<E: Element, const N: usize>(
        &self,
        name: &str,
        mut elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<ElementList<E>, ListError> {
        // The list lives as long as the cloth: release spare capacity.
        elements.shrink_to_fit();
        ElementList::new(self.named(name), elements, &self.in_system(stencils))
    }

    /// Records a term to be left out. Returns whether it is: its stiffness is zero, or it has no elements.
    pub(super) fn leave_out(&mut self, name: &str, is_zero: bool, elements: usize) -> bool {
        match (is_zero, elements) {
            (true, _) => self.left_out.push(format!("{}{name}: zero", self.part.prefix)),
            (false, 0) => self.left_out.push(format!("{}{name}: nothing to act on", self.part.prefix)),
            (false, _) => return false,
        }
        true
    }
}

/// Returns the flexural rigidity along the warp, in N m. For hinges, that of a sheet with regular diagonals.
pub(super) fn rigidity_along_grid(bending: &Bending) -> Result<f64, FabricError> {
    Ok(match bending {
        Bending::None => 0.0,
        Bending::Plate(rigidity) => rigidity.matrix()?[0][0],
        Bending::Bridson { stiffness } | Bending::BridsonForce { stiffness, .. } => 0.25 * stiffness,
        Bending::Flat { stiffness } => 1.5 * stiffness,
    })
}

/// Returns ‖Ē‖²/(‖N̄₁‖ + ‖N̄₂‖) of a hinge at rest.
fn shape_factor(mesh: &TriangleMesh, hinge: &Hinge) -> f64 {
    let [x1, x2, x3, x4] = mesh.hinge_at_rest(hinge);
    let edge = subtract(x4, x3);
    let normals = norm(cross(edge, subtract(x1, x3))) + norm(cross(edge, subtract(x2, x3)));
    crate::geometry::dot(edge, edge) / normals
}
