//! How the stiffness of a membrane is divided between plain triangles and nodal averages.

use energy_dsl::{PackedPotential, RestError};

use super::law::{Order, StrainLaw, TriangleLaw};
use super::symmetric::with_eigenvalues;
use super::term::{Moduli, RestShapes};
use crate::fabric::locking::Folds;
use crate::mesh::MaterialTriangle;

/// Returns the moduli of a membrane at rest.
pub(in super::super) fn moduli_at_rest<E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static>(
    element: &dyn Fn(MaterialTriangle) -> Result<E, RestError>,
) -> Result<Moduli, RestError> {
    Ok(TriangleLaw::new(&[1.0], element)?.respond(&[[0.0; 3]], Order::Hessian).0[0].moduli)
}

/// Returns the tensile stiffness of a narrow strip along the stiffest of warp, weft and, in pure shear, the diagonals.
pub(in super::super) fn tensile_stiffness(&[[uu, uv, _], [_, vv, _], [_, _, shear]]: &Moduli) -> f64 {
    let narrow = |along: f64, across: f64| if across > 0.0 { along - uv * uv / across } else { along };
    narrow(uu, vv).max(narrow(vv, uu)).max(2.0 * shear)
}

/// Returns C_v of each fan: the moduli at rest, with eigenvalues cut to what plain triangles carry without locking.
/// `None` if nothing was cut, so that plain triangles serve as well.
pub(in super::super) fn plain_moduli(shapes: &RestShapes<'_>, folds: &Folds, moduli: &Moduli) -> Option<Vec<Moduli>> {
    let mut is_cut = false;
    let cut = |edge: &f64| {
        let (cut, changed) = cut(moduli, folds.plain_stiffness(*edge));
        is_cut |= changed;
        cut
    };
    let plain: Vec<Moduli> = shapes.edge_lengths().iter().map(cut).collect();
    is_cut.then_some(plain)
}

/// Cuts the eigenvalues of moduli to at most `largest`, in N/m, and drops negative ones. Returns whether any was cut.
///
/// Eigenvalues refer to the strain (E_uu, E_vv, √2 E_uv), which turns with the frame like a vector. Couplings of stretch
/// with shear are dropped.
fn cut(moduli: &Moduli, largest: f64) -> (Moduli, bool) {
    let [[uu, uv, _], [_, vv, _], [_, _, shear]] = *moduli;
    let [a, d, b] = with_eigenvalues([uu, vv, uv], |eigenvalue| eigenvalue.clamp(0.0, largest));
    let is_cut = 0.5 * (uu + vv) + (0.5 * (uu - vv)).hypot(uv) > largest || shear > 0.5 * largest;
    ([[a, b, 0.0], [b, d, 0.0], [0.0, 0.0, shear.clamp(0.0, 0.5 * largest)]], is_cut)
}
