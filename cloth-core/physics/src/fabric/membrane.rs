//! Membranes: triangles, and nodal averages of their strain.

use energy_dsl::{PackedPotential, RestError};
use energy_elements::OrthotropicStVK;

use super::error::FabricError;
use super::locking::{Folds, Locking};
use super::nodal::{self, NodalMembrane, RestShapes};
use super::plasticity::PlasticMembrane;
use super::plate::ThreadError;
use super::terms::{FabricTerms, Surroundings, rigidity_along_grid};
use super::{Bending, Fabric, Material, Plasticity, Strain};
use crate::geometry::norm;
use crate::mesh::{MaterialTriangle, TriangleMesh, Warp, material_triangle};

/// A mesh with its triangles in material coordinates.
pub(super) struct MaterialMesh<'a> {
    pub mesh: &'a TriangleMesh,
    pub triangles: Vec<MaterialTriangle>,
    /// Whether the first axis of each triangle is its warp.
    is_woven: bool,
    pub warp: Warp,
    pub plasticity: Plasticity,
    strain: Strain,
    /// The folds that the membrane should not lock.
    folds: Folds,
}

impl<'a> MaterialMesh<'a> {
    pub fn new(mesh: &'a TriangleMesh, fabric: &Fabric, surroundings: &Surroundings) -> Result<Self, FabricError> {
        let (triangles, is_woven) = material_triangles(mesh, fabric)?;
        Ok(Self {
            mesh,
            triangles,
            is_woven,
            warp: fabric.warp,
            plasticity: fabric.plasticity.unwrap_or_default(),
            strain: fabric.strain,
            folds: folds(fabric, surroundings)?,
        })
    }
}

/// Returns the folds that the membrane should not lock.
fn folds(fabric: &Fabric, surroundings: &Surroundings) -> Result<Folds, FabricError> {
    let rigidity = match fabric.material.bending() {
        Some(Bending::Plate(plate)) => {
            let [[along_warp, ..], [_, along_weft, _], _] = plate.matrix()?;
            along_warp.min(along_weft)
        }
        bending => rigidity_along_grid(bending.unwrap_or(&Bending::None))?,
    };
    // Folds without gravity are judged as if there were some.
    let gravity = Some(norm(surroundings.gravity)).filter(|&gravity| gravity > 0.0).unwrap_or(9.81);
    Ok(Folds { rigidity, weight: gravity * fabric.density })
}

/// Maps every triangle to its plane; with the first axis along the warp if the fabric depends on it. Returns whether it
/// does.
fn material_triangles(mesh: &TriangleMesh, fabric: &Fabric) -> Result<(Vec<MaterialTriangle>, bool), ThreadError> {
    let woven = matches!(
        fabric.material,
        Material::BaraffWitkin(_) | Material::OrthotropicStvk(_) | Material::Yarns(_) | Material::File(_)
    );
    let all = 0..mesh.triangles().len();
    if !woven && fabric.strain_limit.is_none() {
        return Ok((all.map(|triangle| material_triangle(mesh.corners(triangle))).collect(), false));
    }
    let warp = fabric.warp;
    let triangles: Result<_, _> =
        all.map(|triangle| mesh.thread_triangle(triangle, warp).ok_or(ThreadError { triangle, warp })).collect();
    triangles.map(|triangles| (triangles, true))
}

impl FabricTerms {
    /// Adds triangles; if they would lock, softer ones and nodal averages.
    pub(super) fn add_membrane<E>(
        &mut self,
        name: &str,
        is_zero: bool,
        cloth: &MaterialMesh<'_>,
        element: impl Fn(MaterialTriangle) -> Result<E, RestError> + Send + Sync + 'static,
    ) -> Result<(), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
    {
        if self.leave_out(name, is_zero, cloth.triangles.len()) {
            return Ok(());
        }
        let at_rest = |source| FabricError::Rest { triangle: 0, source };
        let moduli = nodal::moduli_at_rest(&element).map_err(at_rest)?;
        let (stiffness, edge) = (nodal::tensile_stiffness(&moduli), nodal::mean_edge(cloth.triangles.iter()));
        let locking = Locking::new(&cloth.folds, stiffness, edge, cloth.strain);
        if self.locking.is_none_or(|known| known.stiffness < stiffness) && locking.wasted.is_normal() {
            self.locking = Some(locking);
        }
        if cloth.strain == Strain::PerTriangle || !locking.would_lock() {
            return self.add_triangles(name, cloth, move |_, rest| element(rest));
        }
        let shapes = RestShapes::new(cloth.mesh, &cloth.triangles, cloth.is_woven);
        let Some(plain) = nodal::plain_moduli(&shapes, &cloth.folds, &moduli) else {
            return self.add_triangles(name, cloth, move |_, rest| element(rest));
        };
        let of_triangles = shapes.means_of_corners(&plain);
        self.add_triangles(name, cloth, move |triangle, [u0, u1, u2]| {
            let [[c_uu, c_uv, _], [_, c_vv, _], [_, _, c_ss]] = of_triangles[triangle];
            OrthotropicStVK::new(u0, u1, u2, c_uu - c_uv, c_vv - c_uv, c_uv, c_ss)
        })?;
        let (name, limit) = (self.named(&format!("nodal {name}")), cloth.plasticity.stretch);
        let term = NodalMembrane::new(name, self.part.first, shapes, plain, element, limit).map_err(at_rest)?;
        self.terms.push(Box::new(term));
        Ok(())
    }

    /// Adds an element for each triangle.
    fn add_triangles<E>(
        &mut self,
        name: &str,
        cloth: &MaterialMesh<'_>,
        element: impl Fn(usize, MaterialTriangle) -> Result<E, RestError> + Send + Sync + 'static,
    ) -> Result<(), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
    {
        let elements = elements(cloth, &element)?;
        let Some(limit) = cloth.plasticity.stretch else {
            return self.add_potential(name, cloth.mesh.triangles(), elements);
        };
        let law = PlasticMembrane::new(cloth.triangles.clone(), elements, Box::new(element), limit);
        self.add_driven(name, cloth.mesh.triangles(), law);
        Ok(())
    }

    /// Adds a membrane and returns its λ and μ.
    pub(super) fn add_isotropic<E>(
        &mut self,
        cloth: &MaterialMesh<'_>,
        (lambda, mu): (f64, f64),
        element: impl Fn([f64; 2], [f64; 2], [f64; 2], f64, f64) -> Result<E, RestError> + Send + Sync + 'static,
    ) -> Result<(f64, f64), FabricError>
    where
        E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
    {
        self.add_membrane("membrane", mu == 0.0, cloth, move |[u0, u1, u2]| element(u0, u1, u2, lambda, mu))?;
        Ok((lambda, mu))
    }
}

/// Creates an element for each triangle.
fn elements<E>(
    cloth: &MaterialMesh<'_>,
    element: impl Fn(usize, MaterialTriangle) -> Result<E, RestError>,
) -> Result<Vec<E>, FabricError> {
    let one = |(triangle, material_triangles): (usize, &MaterialTriangle)| {
        element(triangle, *material_triangles).map_err(|source| FabricError::Rest { triangle, source })
    };
    cloth.triangles.iter().enumerate().map(one).collect()
}
