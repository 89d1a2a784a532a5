//! Membranes by nodal averages of the strain, which do not lock.
//!
//! A linear triangle measures chords where a fold has arcs. On an irregular mesh the errors of neighbours differ, and
//! no displacement removes them: the triangles stretch, and a stiff cloth cannot fold. The mean of the Green strain E
//! over the triangles around a vertex, each weighted by its area, has less of this error. The energy is
//!
//! U = Σ_v A_v W(Ē_v) + Σ_v Σ_T ⅓ A_T ½ (E_T − Ē_v) : C_v : (E_T − Ē_v)
//!
//! with A_v = Σ ⅓ A_T. W is the energy per area of the material, evaluated by its declared triangle ([`law`]). The
//! second sum keeps neighbours from stretching against each other; a mean does not notice that. C_v is the part of the
//! moduli at rest that the mesh can carry without locking ([`super::locking`]). Since Ē is a mean, the second sum is
//! Σ_T ½ A_T E_T : C_T : E_T − Σ_v ½ A_v Ē_v : C_v : Ē_v with the mean C_T of the corners' C_v: plain triangles, and a
//! change of W.
//!
//! A constant strain has the energy of plain triangles. Means do not cross the edge of a garment, so neither seams nor
//! fabrics. Nodal averages of strain: Dohrmann, Heinstein, Jung, Key and Witkowski 2000; stabilised: Puso and Solberg
//! 2006.

mod assembly;
mod fan;
mod law;
mod patch;
mod shares;
mod split;
mod symmetric;
mod term;

pub(super) use split::{moduli_at_rest, plain_moduli, tensile_stiffness};
pub(super) use term::{NodalMembrane, RestShapes, mean_edge};
