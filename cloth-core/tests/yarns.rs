//! Sheets of yarns in tensile and shear tests: the fabrics of the library have the curves of their sources.

use cloth_core::physics::fabric::{LIBRARY, Material, Surroundings, YarnLaw, terms};
use cloth_core::physics::mesh::{Disc, SpringNetwork, TriangleMesh};
use cloth_core::scene::Scene;
use energy_dsl::Vector3;
use energy_solve::System;

/// The membrane of a fabric of the library on a disc whose triangles have many directions, and its law.
struct Tester {
    mesh: TriangleMesh,
    system: System,
    law: YarnLaw,
}

impl Tester {
    fn of(name: &str) -> Self {
        let text = format!(
            "dt = 0.01\nduration = 0.1\n[[garment]]\nfabric = \"{name}\"\nmesh.disc = {{ radius = 0.1, rings = 3 }}\n"
        );
        let scene = Scene::parse(&text, "test.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"));
        let fabric = &scene.garments[0].fabric;
        let Material::Yarns(yarns) = &fabric.material else { panic!("{name}") };
        let law = yarns.law().unwrap();
        let mesh = Disc { radius: 0.1, rings: 3 }.mesh().unwrap();
        let air = Surroundings { gravity: [0.0; 3], drag: 0.0 };
        let made = terms(fabric, &mesh, &SpringNetwork::default(), &air).unwrap();
        let system = System::new(made.terms, &vec![false; mesh.vertices().len()]).unwrap();
        Self { mesh, system, law }
    }

    /// The energy of the membrane per area, in N/m, after a linear map.
    fn density(&mut self, map: [[f64; 2]; 2]) -> f64 {
        let at = |p: &Vector3<f64>| [map[0][0] * p[0] + map[0][1] * p[1], map[1][0] * p[0] + map[1][1] * p[1], 0.0];
        let x: Vec<Vector3<f64>> = self.mesh.vertices().iter().map(at).collect();
        let energies = self.system.energies(&x).unwrap();
        // Triangles and nodal averages.
        let membrane: f64 =
            energies.iter().filter(|one| one.term.ends_with("membrane")).filter_map(|one| one.energy).sum();
        let corner = |triangle: &[usize; 3], k: usize| self.mesh.vertices()[triangle[k]];
        let area = |triangle: &[usize; 3]| {
            let [a, b, c] = [0, 1, 2].map(|k| corner(triangle, k));
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        membrane / self.mesh.triangles().iter().map(area).sum::<f64>()
    }

    /// The tension per width along warp (0) or weft (1), with the sides held.
    fn tension(&mut self, direction: usize, strain: f64) -> f64 {
        let h = 1e-5;
        let mut energy = |strain: f64| {
            let mut map = [[1.0, 0.0], [0.0, 1.0]];
            map[direction][direction] += strain;
            self.density(map)
        };
        (energy(strain + h) - energy(strain - h)) / (2.0 * h)
    }
}

#[test]
fn simulated_tensile_and_shear_tests_are_the_curves_of_the_law() {
    for fabric in LIBRARY {
        let mut tester = Tester::of(fabric.name);
        let curves = [tester.law.warp, tester.law.weft];
        for (direction, curve) in curves.into_iter().enumerate() {
            for part in [0.05, 0.2, 0.5, 0.9, 1.2] {
                let (found, exact) = (tester.tension(direction, part * curve.m), curve.tension(part * curve.m));
                assert!((found / exact - 1.0).abs() < 1e-4, "{} {direction} {part}: {found} {exact}", fabric.name);
            }
        }
        // Simple shear by 5°, whose yarns of one direction get longer by 0.4 %.
        let (shear, h) = (5_f64.to_radians().tan(), 1e-5);
        let force = (tester.density([[1.0, shear + h], [0.0, 1.0]]) - tester.density([[1.0, shear - h], [0.0, 1.0]]))
            / (2.0 * h);
        let longer = (1.0 + shear * shear).sqrt() - 1.0;
        let exact = tester.law.shear.tension(shear) + tester.law.weft.tension(longer) * shear / (1.0 + longer);
        assert!((force / exact - 1.0).abs() < 1e-4, "{}: {force} {exact}", fabric.name);
    }
}

/// Strains in % at 4.9, 19.6, 49, 98.1 and 490 N/m, as their source prints them to 0.1 or 1.
const PRINTED: [(&str, [[f64; 5]; 2]); 5] = [
    ("cotton-shirting", [[0.1, 0.4, 1.1, 2.1, 7.1], [0.2, 0.7, 1.7, 3.2, 8.8]]),
    ("denim", [[0.1, 0.3, 0.8, 1.6, 6.9], [0.2, 0.6, 1.5, 2.9, 11.0]]),
    ("wool-coating", [[0.2, 0.7, 1.7, 3.3, 13.5], [0.2, 0.7, 1.7, 3.2, 12.9]]),
    ("silk-satin", [[0.3, 1.1, 2.7, 5.0, 16.0], [0.6, 2.5, 5.8, 10.2, 25.0]]),
    ("canvas", [[0.0, 0.2, 0.5, 0.9, 3.3], [0.2, 0.7, 1.7, 3.0, 7.6]]),
];

#[test]
fn woven_fabrics_have_the_strains_that_their_source_prints() {
    for (name, directions) in PRINTED {
        let mut tester = Tester::of(name);
        for (direction, printed) in directions.into_iter().enumerate() {
            for (load, printed) in [4.9033, 19.613, 49.033, 98.067, 490.33].into_iter().zip(printed) {
                let (mut low, mut high) = (0.0, 0.4);
                while high - low > 1e-6 {
                    let middle = 0.5 * (low + high);
                    if tester.tension(direction, middle) < load { low = middle } else { high = middle }
                }
                // Half of the last printed digit, and the error of the law between its two ends.
                assert!((100.0 * low - printed).abs() < 0.12, "{name} {direction}, {load} N/m: {low} {printed} %");
            }
        }
    }
}

/// A scene whose points a convex curve cannot follow has a warning; one that contradicts itself an error.
#[test]
fn yarns_of_scenes_are_checked() {
    let scene = |warp: &str| {
        let text = format!(
            "dt = 0.01\nduration = 0.1\n[[garment]]\nname = \"coat\"\nmesh.disc = {{ radius = 0.1, rings = 2 }}\n\
             [garment.fabric]\ndensity = 0.2\n[garment.fabric.material.yarns]\n{warp}\nweft.modulus = 900.0\n\
             shear.modulus = 30.0\n"
        );
        let scene = Scene::parse(&text, "test.toml".as_ref()).map_err(|error| error.to_string())?;
        let simulation = cloth_core::Simulation::new(&scene).map_err(|error| error.to_string())?;
        Ok::<_, String>(simulation.warnings().to_vec())
    };
    assert_eq!(scene("warp.curve = [[0.01, 20.0], [0.02, 45.0]]").unwrap(), [""; 0]);
    let missed = scene("warp.curve = [[0.01, 40.0], [0.02, 45.0]]").unwrap();
    assert!(
        missed.len() == 1 && missed[0].contains("material.yarns.warp: the curve misses its points by"),
        "{missed:?}"
    );
    for (warp, message) in [
        ("warp.kes = { emt = 0.05, lt = 0.2 }", "material.yarns.warp.kes.lt: expected a linearity above 1/3"),
        ("warp.kes = { emt = 5.0, lt = 0.6 }", "strains are no percentages, 7 % is 0.07"),
        ("warp.curve = [[0.02, 40.0], [0.01, 45.0]]", "material.yarns.warp.curve: point 2"),
        ("warp = 900.0", "expected one of `modulus`, `law`, `kes`, `fast`, `curve`"),
        ("warp.modulus = 0.0", "expected a finite number greater than 0"),
    ] {
        let error = scene(warp).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
}
