//! Cusick's drape: a specimen of 30 cm between discs of 18 cm.

use std::f64::consts::TAU;

use energy_dsl::Vector3;

use super::scene::SceneText;
use crate::measure::{Drape, DrapeError, DrapeOptions};
use crate::mesh::{Disc, MeshError, TriangleMesh};

/// Radius of the specimen, in m.
const SPECIMEN: f64 = 0.15;
/// Radius of the discs, in m.
const DISC: f64 = 0.09;
/// Rings of the mesh; the rim of the discs lies on one.
const RINGS: usize = 25;
/// Displacement of free vertices relative to the width of a ring. A regular mesh would prefer six folds.
const JITTER: f64 = 0.25;

/// Returns the specimen: a disc whose free vertices are displaced at random, always the same.
pub(super) fn specimen() -> Result<TriangleMesh, MeshError> {
    let mesh = Disc { radius: SPECIMEN, rings: RINGS }.mesh()?;
    let width = SPECIMEN / RINGS as f64;
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    // SplitMix64 (Steele, Lea and Flood 2014).
    let mut random = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) as f64 / u64::MAX as f64
    };
    let place = |x: &Vector3<f64>| {
        let radius = x[0].hypot(x[1]);
        let is_free = radius > DISC + 0.5 * width && radius < SPECIMEN - 0.5 * width;
        let (length, angle) = (JITTER * width * random().sqrt(), TAU * random());
        if is_free { [x[0] + length * angle.cos(), x[1] + length * angle.sin(), 0.0] } else { *x }
    };
    TriangleMesh::new(mesh.vertices().iter().map(place).collect(), mesh.triangles().to_vec())
}

/// The table below the specimen starts this far under it, and goes down by `TABLE_WAY` in `TABLE_TIME`: in m and s.
const TABLE: f64 = 0.005;
const TABLE_WAY: f64 = 0.15;
const TABLE_TIME: f64 = 3.0;

/// Returns the test; `mesh` is the name of the file of the specimen. It lies on a table that is lowered, as on the
/// drapemeter: cloth that falls at once has more folds.
pub(super) fn scene(mesh: &str) -> SceneText {
    let inside = RINGS * 3 / 5;
    let held: Vec<usize> = (0..1 + 3 * inside * (inside + 1)).collect();
    SceneText {
        head: "dt = 0.02\nduration = 5.0\nframes_per_second = 10\ndrag = 3.0\nintegrator = \"newton\"\n\
               contact = \"on\"\n"
            .to_owned(),
        mesh: format!("warp = [1.0, 0.0, 0.0]\nmesh.obj.path = \"{mesh}\"\n"),
        tail: format!(
            "[[pins]]\nname = \"discs\"\nvertices = {held:?}\n[[obstacles]]\nname = \"table\"\n\
             plane = {{ point = [0.0, 0.0, -{TABLE:?}], normal = [0.0, 0.0, 1.0] }}\n\
             motion.keys = [{{ time = 0.0 }}, {{ time = {TABLE_TIME:?}, translate = [0.0, 0.0, -{TABLE_WAY:?}] }}]\n"
        ),
    }
}

/// Measures the drape of a specimen at positions in m.
pub(super) fn measure(x: &[Vector3<f64>], rest: &TriangleMesh) -> Result<Drape, DrapeError> {
    let area = crate::mesh::lumped_masses(rest, 1.0).iter().sum();
    let mut options = DrapeOptions::default();
    (options.disc, options.centre) = (Some(DISC), Some([0.0; 3]));
    Drape::measure(x, rest.triangles(), area, &options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specimen_is_irregular_and_flat_but_for_the_discs() {
        let mesh = specimen().unwrap();
        let drape = measure(mesh.vertices(), &mesh).unwrap();
        assert!((drape.coefficient - 100.0).abs() < 1e-3 && drape.nodes == 0, "{drape:?}");
        let regular = Disc { radius: SPECIMEN, rings: RINGS }.mesh().unwrap();
        let moved = mesh.vertices().iter().zip(regular.vertices()).filter(|(one, other)| one != other).count();
        assert_eq!(moved, (16..25).map(|ring| 6 * ring).sum::<usize>());
        let held = 1 + 3 * 15 * 16;
        assert!(mesh.vertices()[..held].iter().all(|x| x[0].hypot(x[1]) < DISC + 1e-9));
    }
}
