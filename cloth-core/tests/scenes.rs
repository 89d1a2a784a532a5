//! Scenes with several parts: contact, friction, wind, moving pins, seams, hair, and the energy ledger.

use cloth_core::Simulation;
use cloth_core::materials::element;
use cloth_core::physics::fabric::LIBRARY;
use cloth_core::scene::Scene;

const SOFT: &str = "[garment.fabric]\ndensity = 0.2\n[garment.fabric.material.stvk]\nstretch_stiffness = 40.0\n\
                    poisson_ratio = 0.3\n\
                    bending.flat.stiffness = 1e-5\n";

fn started(text: &str) -> Simulation {
    let scene = Scene::parse(text, "test.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{error}"));
    simulation.keep_ledger().unwrap();
    simulation
}

fn finished(text: &str) -> Simulation {
    let mut simulation = started(text);
    while !simulation.is_finished() {
        simulation.step().unwrap_or_else(|error| panic!("{error}"));
    }
    simulation
}

fn refused(text: &str) -> String {
    match Scene::parse(text, "test.toml".as_ref()) {
        Ok(scene) => Simulation::new(&scene).unwrap_err().to_string(),
        Err(error) => error.to_string(),
    }
}

fn sheet(head: &str, cells: usize, size: f64) -> String {
    format!("{head}\n[[garment]]\nmesh.sheet = {{ cells = [{cells}, {cells}], size = [{size}, {size}] }}\n{SOFT}")
}

/// A sheet on the plane z = 0, under gravity tilted as on a slope.
fn slope(friction: f64, integrator: &str) -> Simulation {
    let (sine, cosine) = 0.4_f64.sin_cos();
    let gravity = [9.81 * sine, 0.0, -9.81 * cosine];
    let head = format!("dt = 0.005\nduration = 0.5\nintegrator = \"{integrator}\"\ngravity = {gravity:?}");
    let lying = format!("{}placement.translate = [0.0, 0.0, 0.0049]\n", "");
    let text = sheet(&head, 4, 0.2).replace("[garment.fabric]\n", &format!("{lying}[garment.fabric]\n"));
    finished(&format!("{text}[[obstacles]]\nplane = {{}}\nfriction = {friction}\n"))
}

#[test]
fn cloth_on_a_slope_obeys_coulomb_friction() {
    for integrator in ["newton", "implicit-euler"] {
        let mean = |simulation: &Simulation| {
            simulation.velocities().iter().map(|v| v[0]).sum::<f64>() / simulation.velocities().len() as f64
        };
        // tan 0.4 = 0.4228.
        let held = slope(0.6, integrator);
        assert!(mean(&held) < 2e-3, "{integrator}: it creeps with {} m/s", mean(&held));
        let sliding = slope(0.2, integrator);
        let (sine, cosine) = 0.4_f64.sin_cos();
        let expected = 9.81 * (sine - 0.2 * cosine) * 0.5;
        assert!((mean(&sliding) / expected - 1.0).abs() < 0.03, "{integrator}: {} of {expected}", mean(&sliding));
        let free = slope(0.0, integrator);
        assert!((mean(&free) / (9.81 * sine * 0.5) - 1.0).abs() < 0.01, "{integrator}: {}", mean(&free));
    }
}

/// A sheet that is pushed uphill comes to rest, and static friction holds it; one that slides downhill has the kinetic
/// friction and goes on.
#[test]
fn cloth_on_a_slope_is_held_by_static_friction_and_slides_with_the_kinetic_one() {
    let mean = |velocity: f64, friction: &str| {
        let (sine, cosine) = 0.4_f64.sin_cos();
        let gravity = [9.81 * sine, 0.0, -9.81 * cosine];
        let head = format!("dt = 0.005\nduration = 0.5\nintegrator = \"newton\"\ngravity = {gravity:?}");
        let start = format!("placement.translate = [0.0, 0.0, 0.0049]\nvelocity = [{velocity:?}, 0.0, 0.0]\n");
        let text = sheet(&head, 4, 0.2).replace("[garment.fabric]\n", &format!("{start}[garment.fabric]\n"));
        let simulation = finished(&format!("{text}[[obstacles]]\nplane = {{}}\nfriction = {friction}\n"));
        simulation.velocities().iter().map(|v| v[0]).sum::<f64>() / simulation.velocities().len() as f64
    };
    // tan 0.4 = 0.4228 lies between the two.
    let both = "{ static = 0.6, kinetic = 0.2 }";
    let held = mean(-0.2, both);
    assert!(held.abs() < 2e-3, "it moves with {held} m/s");
    let (sine, cosine) = 0.4_f64.sin_cos();
    let expected = 0.1 + 9.81 * (sine - 0.2 * cosine) * 0.5;
    let sliding = mean(0.1, both);
    assert!((sliding / expected - 1.0).abs() < 0.03, "{sliding} of {expected}");
    // With the kinetic coefficient alone, it turns round.
    assert!(mean(-0.2, "0.2") > 0.3);
}

/// The friction of a pair replaces that of the obstacle.
#[test]
fn a_pair_of_parts_has_its_own_friction() {
    let (sine, cosine) = 0.4_f64.sin_cos();
    let gravity = [9.81 * sine, 0.0, -9.81 * cosine];
    let head = format!("dt = 0.005\nduration = 0.5\nintegrator = \"newton\"\ngravity = {gravity:?}");
    let lying = "placement.translate = [0.0, 0.0, 0.0049]\n[garment.fabric]\n";
    let text = sheet(&head, 4, 0.2).replace("[garment.fabric]\n", lying);
    let text = format!("{text}[[obstacles]]\nname = \"skin\"\nplane = {{}}\nfriction = 0.0\n");
    let pair = "[[friction]]\nbetween = [\"skin\", \"garment 0\"]\ncoefficient = 0.6\n";
    let fastest = |text: &str| finished(text).velocities().iter().map(|v| v[0]).fold(0.0, f64::max);
    let (free, held) = (fastest(&text), fastest(&format!("{text}{pair}")));
    assert!(free > 1.5 && held < 2e-3, "{free} {held}");
    let unknown = refused(&format!("{text}{}", pair.replace("skin", "skim")));
    assert!(unknown.contains("friction[0]: nothing is called `skim`; there are garment 0, skin"), "{unknown}");
    let twice = refused(&format!("{text}{pair}{}", pair.replace("0.6", "0.5")));
    assert!(twice.contains("friction[1]: friction[0] is of the same two parts"), "{twice}");
    let other = refused(&format!("{text}{pair}").replace("newton", "implicit-euler"));
    assert!(other.contains("`[[friction]]` needs `integrator = \"newton\"`"), "{other}");
}

#[test]
fn cloth_stays_outside_obstacles_and_distant_vertices_are_skipped() {
    let obstacles = [
        "sphere = { radius = 0.2, centre = [0.0, 0.0, -0.25] }",
        "capsule = { from = [-0.1, 0.0, -0.2], to = [0.1, 0.0, -0.2], radius = 0.15 }",
        "box = { centre = [0.0, 0.0, -0.2], size = [0.3, 0.3, 0.3], rounding = 0.03, \
         rotate = { axis = [0.0, 0.0, 1.0], angle = 30.0 } }",
        "plane = { point = [0.0, 0.0, -0.1], normal = [0.2, 0.0, 1.0] }",
    ];
    for (obstacle, integrator) in obstacles.iter().flat_map(|one| [(one, "newton"), (one, "implicit-euler")]) {
        let dt = if integrator == "newton" { 0.01 } else { 0.002 };
        let head = format!(
            "dt = {dt}\nduration = 0.5\nintegrator = \"{integrator}\"\nadaptive = true\n\
             tolerances.velocity = 1e-3\ndrag = 0.5"
        );
        let text = format!("{}[[obstacles]]\n{obstacle}\nfriction = 0.3\n", sheet(&head, 16, 0.5));
        let mut simulation = finished(&text);
        let solid = simulation.obstacles()[0].at(0.0);
        let deepest = simulation.positions().iter().map(|&x| solid.signed_distance(x)).fold(f64::INFINITY, f64::min);
        let summary = simulation.summary().unwrap();
        if integrator == "newton" {
            // Triangles rest on the solid, so vertices may be a little higher than contact reaches.
            assert!(deepest > 0.002 && deepest < 0.007, "{obstacle}: {deepest}");
            assert!(summary.totals.contact.active > 0 && simulation.obstacle_crossings() == 0);
            continue;
        }
        assert!(deepest > 0.0 && deepest < 0.005, "{obstacle}: {deepest}");
        let contact = summary.terms.iter().find(|term| term.element.ends_with("Contact")).unwrap();
        let hessian = contact.counts.unwrap().hessian;
        assert!(hessian.evaluated > 0 && hessian.skipped > 0, "{contact:?}");
    }
}

#[test]
fn a_level_sheet_reaches_its_terminal_velocity() {
    let undamped = "stvk]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3\nbending.flat.stiffness = 1e-5\n";
    let springs = "mass-spring]\nstructural = 40.0\nshear = 20.0\nbending = 1.0\ndamping = 0.01\n";
    // Damped springs make the matrix unsymmetric.
    for (integrator, fabric) in [
        ("newton", undamped),
        ("implicit-euler", undamped),
        ("implicit-euler", springs),
        ("implicit-midpoint", undamped),
    ] {
        let head = format!("dt = 0.01\nduration = 2.0\nintegrator = \"{integrator}\"");
        let garment = sheet(&head, 3, 0.3).replace(undamped, fabric);
        let text = format!("{garment}[wind]\nvelocity = [0.0, 0.0, 0.5]\n");
        let simulation = finished(&text);
        // σ g = ½ ρ C u², with u relative to the rising air.
        let speed = (2.0_f64 * 0.2 * 9.81 / (1.2 * 1.2)).sqrt() - 0.5;
        for v in simulation.velocities() {
            assert!((v[2] / -speed - 1.0).abs() < 0.01, "{integrator}: {} of {speed}", v[2]);
        }
    }
}

#[test]
fn pins_follow_their_motion_with_every_integrator() {
    let keys = "keys = [{ time = 0.0 }, { time = 0.1, angle = 90.0, translate = [0.0, 0.0, 0.3] }]";
    for integrator in
        ["implicit-euler", "newton", "bdf2", "implicit-midpoint", "trapezoid", "symplectic-euler", "verlet"]
    {
        let head = format!("dt = 0.002\nduration = 0.12\nintegrator = \"{integrator}\"");
        let pin = format!("[[pins]]\nnearest = [0.1, 0.1, 0.0]\n[pins.motion]\n{keys}\n");
        let simulation = finished(&format!("{}{pin}", sheet(&head, 2, 0.2)));
        let x = simulation.positions()[8];
        let expected = [-0.1, 0.1, 0.3];
        assert!((0..3).all(|axis| (x[axis] - expected[axis]).abs() < 1e-12), "{integrator}: {x:?}");
        assert!(simulation.positions()[0] != [-0.1, -0.1, 0.0]);
    }
}

#[test]
fn the_ledger_closes_for_conserving_integrators() {
    let head =
        |integrator: &str, dt: f64| format!("dt = {dt}\nduration = 0.3\nintegrator = \"{integrator}\"\ndrag = 1.0");
    let rest = "[[pins]]\nbox = { min = [-1.0, 0.099, -1.0], max = [1.0, 0.101, 1.0] }\n[pins.motion]\n\
                keys = [{ time = 0.0 }, { time = 0.3, translate = [0.0, 0.0, 0.15] }]\n[wind]\n\
                velocity = [0.0, 2.0, 1.0]\n";
    let balance = |integrator: &str, dt: f64| {
        let mut simulation = finished(&format!("{}{rest}", sheet(&head(integrator, dt), 4, 0.2)));
        let ledger = simulation.ledger().unwrap().clone();
        let last = ledger.entries().last().unwrap();
        let contact: &[&str] = if integrator == "newton" { &["friction and new barriers of contact"] } else { &[] };
        assert_eq!(ledger.works(), [&["drag", "wind"], contact].concat());
        assert!(last.pins > 1e-3 && last.work[0] < 0.0, "{last:?}");
        assert_eq!(ledger.csv().lines().count(), ledger.entries().len() + 1);
        (ledger.largest_unaccounted() / ledger.exchanged(), simulation.summary().unwrap().warnings)
    };
    let (coarse, _) = balance("implicit-midpoint", 2e-3);
    let (fine, warnings) = balance("implicit-midpoint", 1e-3);
    assert!(fine < 0.01 && warnings.is_empty(), "{fine} {warnings:?}");
    assert!(fine < 0.5 * coarse, "{coarse} {fine}");
    // Implicit Euler dissipates more, which is expected.
    let (lost, warnings) = balance("newton", 2e-3);
    assert!(lost > fine && warnings.is_empty(), "{lost}");
}

#[test]
fn an_integrator_that_loses_a_tenth_of_the_energy_gives_a_warning() {
    // A pendulum: gravity puts energy in, and implicit Euler damps it by the size of its steps.
    let warnings = |integrator: &str, dt: f64| {
        let head = format!("dt = {dt}\nduration = 0.6\nintegrator = \"{integrator}\"");
        let pin = "[[pins]]\nbox = { min = [-1.0, 0.099, -1.0], max = [1.0, 0.101, 1.0] }\n";
        finished(&format!("{}{pin}", sheet(&head, 4, 0.2))).summary().unwrap().warnings
    };
    let coarse = warnings("implicit-euler", 0.02);
    assert!(coarse.iter().any(|warning| warning.starts_with("implicit-euler lost ")), "{coarse:?}");
    assert!(coarse.iter().any(|warning| warning.contains("A smaller dt loses less")), "{coarse:?}");
    assert!(!warnings("implicit-midpoint", 0.002).iter().any(|warning| warning.contains(" lost ")));
}

#[test]
fn energy_that_appears_gives_a_warning() {
    let head = "dt = 0.02\nduration = 0.4\nintegrator = \"implicit-euler\"";
    let ball = "[[obstacles]]\nsphere = { centre = [0.0, 0.0, -0.1], radius = 0.08 }\nstiffness = 5e9\n";
    let warnings = finished(&(sheet(head, 6, 0.2) + ball)).summary().unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.starts_with("implicit-euler gained ")), "{warnings:?}");
}

#[test]
fn an_energy_balance_that_does_not_close_gives_a_warning() {
    // A strong pull within one and a half steps.
    let head = "dt = 0.02\nduration = 0.3\nintegrator = \"implicit-midpoint\"";
    let pin = "[[pins]]\nbox = { min = [-1.0, 0.099, -1.0], max = [1.0, 0.101, 1.0] }\n[pins.motion]\n\
               keys = [{ time = 0.0 }, { time = 0.03, translate = [0.0, 0.02, 0.02] }]\n";
    let warnings = finished(&format!("{}{pin}", sheet(head, 4, 0.2))).summary().unwrap().warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("the balance of energy does not close"), "{warnings:?}");
    assert!(warnings[0].contains("although implicit-midpoint should keep it. Try a smaller dt"), "{warnings:?}");
}

#[test]
fn vertices_that_start_inside_an_obstacle_give_a_warning() {
    let text = sheet("dt = 0.01\nduration = 0.1", 4, 0.2);
    let simulation = started(&format!("{text}[[obstacles]]\nname = \"ball\"\nsphere = {{ radius = 0.06 }}\n"));
    assert_eq!(simulation.warnings(), ["5 vertices start inside ball; contact will throw them out"]);
}

#[test]
fn a_passage_through_an_obstacle_is_reported() {
    let head = "dt = 0.01\nduration = 0.1\ngravity = [0.0, 0.0, 0.0]";
    let shot = |speed: f64| {
        let motion = format!("keys = [{{ time = 0.0 }}, {{ time = 1.0, translate = [0.0, 0.0, {speed}] }}]");
        let ball = "name = \"shot\"\nsphere = { centre = [0.0, 0.0, -0.35], radius = 0.1 }\n";
        let text = format!("{}[[obstacles]]\n{ball}[obstacles.motion]\n{motion}\n", sheet(head, 8, 0.5));
        finished(&text).summary().unwrap()
    };
    // 70 cm in a step, through the sheet from its front to its back.
    let summary = shot(70.0);
    let [passage] = &summary.totals.passages[..] else { panic!("{:?}", summary.totals.passages) };
    assert!(passage.vertices > 0 && (passage.speed - 70.0).abs() < 1.0, "{passage:?}");
    assert!(summary.warnings.iter().any(|warning| warning.contains("passed through shot")), "{:?}", summary.warnings);
    assert!(shot(0.5).totals.passages.is_empty());
}

#[test]
fn moving_obstacles_do_work_and_carry_cloth_along() {
    let head = "dt = 0.005\nduration = 0.6\nintegrator = \"newton\"";
    let lying = sheet(head, 4, 0.2)
        .replace("[garment.fabric]\n", "placement.translate = [0.0, 0.0, 0.0049]\n[garment.fabric]\n");
    let motion = "keys = [{ time = 0.0 }, { time = 0.6, translate = [0.18, 0.0, 0.12] }]";
    let simulation =
        finished(&format!("{lying}[[obstacles]]\nplane = {{}}\nfriction = 1.0\n[obstacles.motion]\n{motion}\n"));
    let (mass, last) = (0.2 * 0.04, simulation.ledger().unwrap().entries().last().unwrap());
    let carried = simulation.positions().iter().map(|x| x[0]).sum::<f64>() / 25.0;
    assert!((carried - 0.18).abs() < 0.02, "{carried}");
    // Lifted by 12 cm, and taken from rest to 0.36 m/s at once: the plane puts in m v², of which half is lost.
    let expected = mass * (9.81 * 0.12 + 0.3 * 0.3 + 0.2 * 0.2);
    assert!((last.obstacles / expected - 1.0).abs() < 1e-2, "{} of {expected}", last.obstacles);
}

#[test]
fn seams_pull_garments_together_and_conserve_momentum() {
    let head = "dt = 0.005\nduration = 1.5\nintegrator = \"newton\"\ngravity = [0.0, 0.0, 0.0]\ndrag = 2.0";
    let piece = |name: &str, x: f64| {
        format!(
            "[[garment]]\nname = \"{name}\"\nplacement.translate = [{x}, 0.0, 0.0]\n\
             mesh.sheet = {{ cells = [3, 3], size = [0.3, 0.3] }}\n{SOFT}"
        )
    };
    let seam = "[[seams]]\ngarments = [\"left\", \"right\"]\nwithin = 0.05\nstiffness = 5.0\ndamping = 0.01\n";
    let text = format!("{head}\n{}{}{seam}", piece("left", -0.17), piece("right", 0.17));
    let text = text.replace("newton", "implicit-euler");
    let simulation = finished(&text);
    let x = simulation.positions();
    for row in 0..4 {
        let (p, q) = (x[4 * row + 3], x[16 + 4 * row]);
        let apart: f64 = (0..3).map(|axis| (p[axis] - q[axis]).powi(2)).sum::<f64>().sqrt();
        assert!(apart < 2e-3, "row {row}: {apart}");
    }
    let middle = x.iter().map(|x| x[0]).sum::<f64>() / 32.0;
    assert!(middle.abs() < 1e-4, "{middle}");
    let message = refused(&text.replace("\"right\"]", "\"rihgt\"]"));
    assert!(message.contains("seams[0]") && message.contains("called `rihgt`; there are left, right"), "{message}");
    let message = refused(&text.replace("within = 0.05", "within = 0.01"));
    assert!(message.contains("the nearest are 4.000e-2 m apart"), "{message}");
}

#[test]
fn hair_bends_under_its_weight_like_a_beam() {
    let text = "dt = 0.01\nduration = 4.0\nintegrator = \"newton\"\ndrag = 6.0\n[[hair]]\ncount = 2\nsegments = 40\n\
                length = 0.1\n\
                last_root = [0.0, 0.1, 0.0]\ndirection = [1.0, 0.0, 0.0]\ndensity = 1e-4\nstretch_stiffness = 50.0\n\
                bend_stiffness = 4e-6\n";
    let simulation = finished(text);
    assert_eq!(simulation.positions().len(), 82);
    // The clamp ends midway between the two held vertices.
    let length: f64 = 0.1 - 0.5 * 0.1 / 40.0;
    let exact = 1e-4 * 9.81 * length.powi(4) / (8.0 * 4e-6);
    for strand in simulation.strands() {
        let tip = -simulation.positions()[strand.end - 1][2];
        assert!((tip / exact - 1.0).abs() < 0.02, "{tip} of {exact}");
    }
}

#[test]
fn garments_fall_from_their_placements() {
    let text = format!(
        "dt = 0.01\nduration = 0.1\ngravity = [0.0, 0.0, 0.0]\n[[garment]]\nfabric = \"denim\"\n\
         mesh.disc = {{ radius = 1.0, rings = 3 }}\n\
         placement = {{ scale = 0.5, \
         rotate = {{ axis = [1.0, 0.0, 0.0], angle = 90.0 }}, translate = [1.0, 2.0, 3.0] }}\n\
         velocity = [0.0, 0.5, 0.0]\n[[garment]]\nmesh.strip = {{ length = 0.4, width = 0.1, segments = 8 }}\n{SOFT}"
    );
    let simulation = finished(&text);
    let first = &simulation.positions()[..37];
    let (top, middle) = (first.iter().map(|p| p[2]).fold(0.0, f64::max), first[0]);
    assert!(
        (top - (3.0 + 0.5 * 80.0_f64.to_radians().sin())).abs() < 1e-3 && (middle[1] - 2.05).abs() < 1e-9,
        "{top} {middle:?}"
    );
    assert!(simulation.positions()[37..].iter().all(|p| p[2] == 0.0));
}

#[test]
fn contradictory_scenes_are_rejected_with_a_remedy() {
    let good = sheet("dt = 0.01\nduration = 0.1", 2, 0.2);
    let expect = |text: &str, parts: &[&str]| {
        let message = refused(text);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    expect(&format!("version = 2\n{good}"), &["has version 2, but this program reads version 1"]);
    expect("dt = 0.01\nduration = 0.1\n", &["nothing to simulate", "[[garment]]"]);
    expect(&format!("{good}[[pins]]\nvertex = 0\nall = true\n"), &["test.toml:11:1", "exactly one of `vertex`"]);
    expect(&format!("{good}[[pins]]\nvertex = 0\nof = \"coat\"\n"), &["pins[0]", "called `coat`; there are garment 0"]);
    expect(&format!("{good}[[obstacles]]\nfriction = 0.1\n"), &["test.toml:11:1", "exactly one of `plane`"]);
    expect(
        &format!("{good}[[obstacles]]\nsphere = {{ raduis = 1.0 }}\n"),
        &["test.toml:12:", "did you mean `radius`?"],
    );
    expect(
        &format!("{good}[[obstacles]]\nbox = {{ size = [1.0, 1.0, 0.1], rounding = 0.1 }}\n"),
        &["cannot be rounded by 0.1"],
    );
    let fabric = format!(
        "fabric = \"demin\"\n{}",
        good.split("[garment.fabric]").next().unwrap().replace("[[garment]]\n", "[[garment]]\nfabric = \"demin\"\n")
    );
    expect(fabric.split_once('\n').unwrap().1, &["unknown fabric `demin`", "did you mean `denim`?"]);
    let keys = "[pins.motion]\nkeys = [{ time = 1.0 }, { time = 0.5 }]\n";
    expect(&format!("{good}[[pins]]\nvertex = 0\n{keys}"), &["test.toml:14:8", "times of keys must increase"]);
    let twice = "[[pins]]\nvertex = 0\n[[pins]]\nall = true\nmotion = { keys = [{ time = 0.0, angle = 5.0 }] }\n";
    expect(&format!("{good}{twice}"), &["pins[1]: vertex 0 already belongs to a pin"]);
    expect(&format!("{good}[wind]\nvelocity = [1.0, 0.0, inf]\n"), &["test.toml:12:12", "finite numbers only"]);
}

#[test]
fn the_scenes_of_the_gallery_are_valid() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let gallery = std::fs::read_to_string(folder.join("../docs/scenes.md")).unwrap();
    let mut count = 0;
    let folders = [folder.clone(), folder.join("garment"), folder.join("contact")];
    let folders = folders.map(|folder| std::fs::read_dir(folder).unwrap());
    for entry in folders.into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let scene = Scene::read(&path).unwrap_or_else(|error| panic!("{error}"));
            let simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            let name = path.strip_prefix(&folder).unwrap().with_extension("").display().to_string();
            let entries = [format!("### {name}\n"), format!("| `{name}` |")];
            assert!(entries.iter().any(|entry| gallery.contains(entry)), "{name} is not in docs/scenes.md");
            assert!(simulation.warnings().is_empty(), "{}: {:?}", path.display(), simulation.warnings());
            for term in simulation.terms() {
                let name = &term.declaration().name;
                assert!(element(name).is_some(), "{}: `{name}` is not in `materials::ELEMENTS`", path.display());
            }
            count += 1;
        }
    }
    assert!(count >= 16, "{count}");
}

#[test]
fn every_fabric_of_the_library_makes_a_simulation() {
    for fabric in LIBRARY {
        let text =
            format!("dt = 0.01\nduration = 0.1\n[mesh.sheet]\ncells = [2, 2]\nsize = [1.0, 1.0]\n{}", fabric.table);
        let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
        // Strips that contradict each other are refused when the fabric is applied.
        Simulation::new(&scene).unwrap_or_else(|error| panic!("{}: {error}", fabric.name));
    }
}
