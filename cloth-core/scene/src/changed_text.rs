//! Changes the text of a scene, as options of the command line ask.

use std::path::Path;

use toml::{Table, Value};

use cloth_physics::fabric::in_library;

/// Returns the text of a scene with the material of every fabric replaced by the elements of a `.energy` file.
/// Densities stay; bending that is part of a material goes with it. Text that is not TOML is returned unchanged:
/// parsing it will report the error.
#[must_use]
pub fn with_material(scene: &str, file: &Path, parameters: &[(String, f64)]) -> String {
    let Ok(mut table) = scene.parse::<Table>() else { return scene.to_owned() };
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    let parameters: Table = parameters.iter().map(|(name, value)| (name.clone(), Value::Float(*value))).collect();
    let mut declared = Table::new();
    declared.insert("path".to_owned(), Value::String(path.display().to_string()));
    declared.insert("parameters".to_owned(), Value::Table(parameters));
    let material = Value::Table(Table::from_iter([("file".to_owned(), Value::Table(declared))]));
    replace(&mut table, &material);
    if let Some(Value::Array(garments)) = table.get_mut("garment") {
        garments.iter_mut().filter_map(Value::as_table_mut).for_each(|garment| replace(garment, &material));
    }
    table.to_string()
}

/// Returns the text of a scene with shallow crossings at the start repaired. Text that is not TOML stays unchanged.
#[must_use]
pub fn with_untangling(scene: &str) -> String {
    let Ok(mut table) = scene.parse::<Table>() else { return scene.to_owned() };
    table.insert("untangle".to_owned(), Value::Boolean(true));
    table.to_string()
}

/// Replaces the material of `fabric`, if the table has one.
fn replace(holder: &mut Table, material: &Value) {
    let Some(fabric) = holder.get_mut("fabric") else { return };
    let named = fabric.as_str().and_then(|name| in_library(name).ok());
    if let Some(mut described) = named.and_then(|one| one.table.parse::<Table>().ok()) {
        *fabric = described.remove("fabric").unwrap_or(Value::Table(Table::new()));
    }
    if let Some(fabric) = fabric.as_table_mut() {
        fabric.insert("material".to_owned(), material.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use cloth_physics::fabric::Material;

    #[test]
    fn every_fabric_gets_the_material_and_keeps_its_density() {
        let text = "dt = 0.01\nduration = 1.0\n[[garment]]\nfabric = \"denim\"\n\
                    mesh.disc = { radius = 1.0, rings = 2 }\n\
                    [[garment]]\nmesh.disc = { radius = 1.0, rings = 2 }\n[garment.fabric]\ndensity = 0.5\n\
                    material.arap.stretch_stiffness = 3.0\n";
        let changed = with_material(text, "own.energy".as_ref(), &[("k".to_owned(), 2.5)]);
        let scene = Scene::parse(&changed, "scene.toml".as_ref()).unwrap_or_else(|error| panic!("{error}\n{changed}"));
        let densities: Vec<f64> = scene.garments.iter().map(|garment| garment.fabric.density).collect();
        assert_eq!(densities, [0.4, 0.5]);
        for garment in &scene.garments {
            let Material::File(declared) = &garment.fabric.material else { panic!("{garment:?}") };
            assert!(declared.path.is_absolute() && declared.parameters["k"] == 2.5);
        }
    }
}
