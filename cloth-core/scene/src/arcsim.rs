//! Fabric files of the program ARCSim (Narain, Samii and O'Brien 2012), in the form of Wang, O'Brien and Ramamoorthi
//! 2011.
//!
//! The factors are those with which ARCSim reads its files: stretching moduli are set to 0 if negative and then
//! doubled; the shear modulus for the angle of shear is c₃₃ as printed; a plate has a quarter of the bending stiffness
//! that is printed. The first row of `bending` is a fold along u, so it is the strip along v that bends.

use std::fmt::Write as _;

use serde::Deserialize;

/// The largest file that is read, in bytes. Files have a few kilobytes.
pub const LARGEST_FILE: u64 = 1_000_000;

/// The strain at which rows 1 to 5 of `stretching` were measured.
const LARGE_STRAIN: f64 = 1.0 / 6.0;
/// The largest number of a file: no fabric is that heavy or stiff in SI units.
const LARGEST: f64 = 1e9;

/// A fabric file, as printed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Fabric {
    /// Mass per area, in kg/m².
    density: f64,
    /// c₁₁, c₁₂, c₂₂, c₃₃ in N/m at small strain; then, if present, at a stretch of 1 + 1/6 along 0, 22.5, 45, 67.5
    /// and 90° from u.
    stretching: Vec<[f64; 4]>,
    /// Bending stiffness in N m along 0°, 45° and 90° from u, each at some curvatures.
    bending: Vec<Vec<f64>>,
}

/// A file that is not a fabric of ARCSim.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArcsimError {
    /// The file is not JSON, or lacks keys.
    #[error("expected a fabric file of ARCSim, with `density`, `stretching` and `bending`: {0}")]
    Json(#[from] serde_json::Error),
    /// A key does not have the expected numbers.
    #[error("`{key}`: expected {wanted}")]
    Numbers {
        /// Name of the key in the file.
        key: &'static str,
        /// The expected numbers.
        wanted: &'static str,
    },
}

impl Fabric {
    /// Reads a file.
    ///
    /// # Errors
    /// Returns an error if the text is not JSON, a key is missing, or a stiffness that must be positive is not.
    ///
    /// ```
    /// let text = r#"{ "density": 0.2, "stretching": [[50, 5, 40, 30]], "bending": [[4e-5], [3e-5], [2e-5]] }"#;
    /// let table = cloth_scene::arcsim::Fabric::parse(text)?.table("made-up");
    /// assert!(table.contains("warp.modulus = 80.0")); // 2 c₂₂
    /// # Ok::<(), cloth_scene::arcsim::ArcsimError>(())
    /// ```
    pub fn parse(text: &str) -> Result<Self, ArcsimError> {
        let fabric: Self = serde_json::from_str(text)?;
        let positive = |number: f64| number > 0.0 && number <= LARGEST;
        let refuse = |key, wanted| Err(ArcsimError::Numbers { key, wanted });
        if !positive(fabric.density) {
            return refuse("density", "a mass per area greater than 0, in kg/m²");
        }
        let first = fabric.stretching.first();
        if !first.is_some_and(|&[c11, _, c22, c33]| [c11, c22, c33].into_iter().all(positive)) {
            return refuse("stretching", "a first row of four numbers c₁₁, c₁₂, c₂₂, c₃₃ in N/m, c₁₂ of any sign");
        }
        if fabric.bending.len() != 3 || !fabric.bending.iter().all(|row| row.first().is_some_and(|k| positive(*k))) {
            return refuse("bending", "three rows, for 0, 45 and 90°, that begin with a number greater than 0, in N m");
        }
        Ok(fabric)
    }

    /// Returns the table of the fabric for scene files.
    #[must_use]
    pub fn table(&self, name: &str) -> String {
        // `parse` has seen the first row of both.
        let [c11, c12, c22, c33] = self.stretching.first().copied().unwrap_or_default();
        let rigidity = |row: usize| 0.25 * self.bending.get(row).and_then(|row| row.first()).copied().unwrap_or(0.0);
        let [weft, bias, warp] = [rigidity(2), rigidity(1), rigidity(0)];
        // Twist must have a positive stiffness.
        let most = 0.99 * 4.0 / (1.0 / warp + 1.0 / weft);
        let large = |row: usize, entry: usize| self.stretching.get(row).map(|row| row[entry]);
        let poisson = (c12.max(0.0) / (c11 * c22).sqrt()).min(0.99);
        let title = name.replace(|letter: char| letter.is_control(), " ");
        let mut table = format!(
            "# {title}, from a file of ARCSim, with the factors of that program. Its axis v is taken as the warp.\n"
        );
        let lines = [
            String::new(),
            "[fabric]".to_owned(),
            format!("density = {:?} # kg/m²", self.density),
            "friction = 0.4 # *assumed*".to_owned(),
            String::new(),
            "[fabric.material.yarns]".to_owned(),
            format!("warp.{} # N/m", tension(2.0 * c22, large(5, 2))),
            format!("weft.{} # N/m", tension(2.0 * c11, large(1, 0))),
            format!("shear.modulus = {c33:?} # N/m"),
            format!("poisson_ratio = {poisson:?}"),
            String::new(),
            "[fabric.material.yarns.bending.plate.orthotropic] # N m, at the smallest curvature".to_owned(),
            format!("warp = {warp:?}"),
            format!("weft = {weft:?}"),
            match bias <= most {
                true => format!("bias = {bias:?}"),
                false => format!("bias = {most:?} # the file has {bias:?}, at which twist would have no stiffness"),
            },
        ];
        for line in lines {
            // Writing to a string cannot fail.
            let _ = writeln!(table, "{line}");
        }
        table
    }
}

/// Returns a key of the yarn law: the modulus at small strain, and the tension (1 + ε) 2c E of the modulus c at the
/// strain ε = 1/6, where E is the Green strain. A fabric that softens gets the secant.
fn tension(modulus: f64, large: Option<f64>) -> String {
    let green = LARGE_STRAIN + 0.5 * LARGE_STRAIN * LARGE_STRAIN;
    match large.map(|c| (1.0 + LARGE_STRAIN) * 2.0 * c.clamp(0.0, LARGEST) * green) {
        Some(end) if end >= modulus * LARGE_STRAIN => {
            format!("law = {{ modulus = {modulus:?}, strain = {LARGE_STRAIN:?}, tension = {end:?} }}")
        }
        Some(end) if end > 0.0 => format!("modulus = {:?}", end / LARGE_STRAIN),
        _ => format!("modulus = {modulus:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use cloth_physics::fabric::{Bending, Material, Rigidity};

    // Synthetic numbers: no fabric has them.
    const TEXT: &str = r#"{ "density": 0.25, "damping": 0, "stretching": [
        [100, -9, 64, 30], [200, 0, 70, 30], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1], [90, 2, 320, 1]
    ], "bending": [[4e-5, 3e-5], [8e-5, 2e-5], [2e-5, 1e-5]] }"#;

    fn read(text: &str) -> cloth_physics::fabric::Fabric {
        let table = Fabric::parse(text).unwrap().table("made up");
        let scene = format!("dt = 0.01\nduration = 0.1\n[mesh.disc]\nradius = 1.0\nrings = 2\n{table}");
        let scene = Scene::parse(&scene, "scene.toml".as_ref()).unwrap_or_else(|error| panic!("{error}\n{table}"));
        scene.garments[0].fabric.clone()
    }

    #[test]
    fn a_file_is_read_with_the_factors_of_arcsim() {
        let fabric = read(TEXT);
        let Material::Yarns(yarns) = &fabric.material else { panic!("{fabric:?}") };
        let law = yarns.law().unwrap();
        // u is the weft. Moduli are doubled, the negative coupling is dropped, the shear modulus is as printed.
        assert_eq!((law.weft.k, law.warp.k, law.coupling, law.shear.k), (200.0, 128.0, 0.0, 30.0));
        let end = 7.0 / 6.0 * 2.0 * 320.0 * 0.5 * ((7.0_f64 / 6.0).powi(2) - 1.0);
        assert!((law.warp.tension(1.0 / 6.0) / end - 1.0).abs() < 1e-12, "{law:?}");
        let Bending::Plate(Rigidity::Orthotropic { warp, weft, bias, .. }) = yarns.bending else { panic!("{yarns:?}") };
        // The strip along v bends about the fold along u, the first row. The bias of the file is impossible.
        assert_eq!((warp, weft), (1e-5, 5e-6));
        assert!(bias < 4.0 / (1.0 / warp + 1.0 / weft), "{bias}");
    }

    #[test]
    fn a_file_with_one_row_is_linear_and_one_that_softens_gets_its_secant() {
        let linear =
            read(r#"{ "density": 0.2, "stretching": [[50, 5, 40, 30]], "bending": [[4e-5], [3e-5], [2e-5]] }"#);
        let Material::Yarns(yarns) = &linear.material else { panic!("{linear:?}") };
        let law = yarns.law().unwrap();
        assert_eq!((law.weft.a, law.warp.a), (0.0, 0.0));
        assert!((law.coupling - 2.0 * 5.0).abs() < 1e-12, "2 c₁₂ couples the directions: {}", law.coupling);
        let soft = tension(100.0, Some(10.0));
        let secant = 7.0 / 6.0 * 20.0 * (1.0 + 1.0 / 12.0);
        let found: f64 = soft.strip_prefix("modulus = ").unwrap().parse().unwrap();
        assert!((found / secant - 1.0).abs() < 1e-12, "{soft}");
    }

    #[test]
    fn other_files_are_refused_by_what_they_lack() {
        for (from, to, message) in [
            ("0.25", "-1", "`density`: expected a mass per area greater than 0"),
            ("\"bending\"", "\"bend\"", "missing field `bending`"),
            ("[100, -9", "[0, -9", "`stretching`: expected a first row"),
            ("[4e-5, 3e-5]", "[]", "`bending`: expected three rows"),
            ("{", "", "expected a fabric file of ARCSim"),
            ("64", "\"64\"", "expected a fabric file of ARCSim"),
        ] {
            let error = Fabric::parse(&TEXT.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
