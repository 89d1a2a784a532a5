//! Fabrics that were measured: tables for scene files, each with its source.

/// A fabric that was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeasuredFabric {
    /// What it is called.
    pub name: &'static str,
    /// The table `[fabric]` of a scene file, with the source of its values.
    pub table: &'static str,
}

/// The measured fabrics.
///
/// ```
/// use cloth_core::fabric::MEASURED;
/// let denim = MEASURED.iter().find(|fabric| fabric.name == "denim").unwrap();
/// assert!(denim.table.contains("Wang, O'Brien and Ramamoorthi"));
/// ```
pub const MEASURED: [MeasuredFabric; 4] = [
    MeasuredFabric { name: "denim", table: include_str!("../../../scenes/fabrics/denim.toml") },
    MeasuredFabric { name: "interlock", table: include_str!("../../../scenes/fabrics/interlock.toml") },
    MeasuredFabric { name: "ribbon", table: include_str!("../../../scenes/fabrics/ribbon.toml") },
    MeasuredFabric { name: "dots", table: include_str!("../../../scenes/fabrics/dots.toml") },
];

#[cfg(test)]
mod tests {
    use super::MEASURED;
    use crate::fabric::{Bending, Material};
    use crate::scene::Scene;

    #[test]
    fn every_table_makes_a_scene_with_a_plate() {
        for fabric in MEASURED {
            let text =
                format!("dt = 0.01\nduration = 0.1\n[mesh.sheet]\ncells = [2, 2]\nsize = [1.0, 1.0]\n{}", fabric.table);
            let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
            let Material::Stvk(membrane) = &scene.garments[0].fabric.material else { panic!("{}", fabric.name) };
            let Bending::Plate(rigidity) = membrane.bending else { panic!("{}", fabric.name) };
            let d = rigidity.matrix().unwrap();
            assert!(d[0][0] > 1e-5 && d[2][2] > 1e-6, "{}: {d:?}", fabric.name);
        }
    }

    #[test]
    fn the_strip_of_denim_is_that_of_the_table() {
        let scene = Scene::parse(include_str!("../../../scenes/strip.toml"), "strip.toml".as_ref()).unwrap();
        let denim = MEASURED[0].table.split("[fabric]").nth(1).unwrap();
        let Material::Stvk(membrane) = &scene.garments[0].fabric.material else { panic!("another material") };
        let Bending::Plate(crate::fabric::Rigidity::Orthotropic { warp, .. }) = membrane.bending else {
            panic!("no plate")
        };
        assert!(
            denim.contains("density = 0.324")
                && scene.garments[0].fabric.density == 0.324
                && (warp - 64.196_457e-6).abs() < 1e-15
        );
        assert!(scene.adaptive);
    }
}
