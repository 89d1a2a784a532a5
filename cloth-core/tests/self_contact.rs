//! Cloth and hair that collide with themselves: no crossing in any state, conserved momentum, the same bits on any
//! number of threads and after a resumed run, and refusals that name the cause.

use cloth_core::Simulation;
use cloth_core::scene::Scene;

const FABRIC: &str = "fabric = { density = 0.2, thickness = 1e-3, material.stvk = { stretch_stiffness = 40.0, \
                      poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 } }\n";

fn head(contact: &str, rest: &str) -> String {
    format!("dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"{contact}\"\n{rest}\n")
}

fn sheet(name: &str, cells: usize, size: f64, at: [f64; 3], rest: &str) -> String {
    format!(
        "[[garment]]\nname = \"{name}\"\nplacement.translate = {at:?}\n\
         mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n{rest}\n{FABRIC}"
    )
}

fn simulation(text: &str) -> Simulation {
    let scene = Scene::parse(text, "test.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"));
    Simulation::new(&scene).unwrap_or_else(|error| panic!("{error}"))
}

/// Steps, and returns the largest number of crossings after any step.
fn crossings(simulation: &mut Simulation, steps: u64) -> usize {
    let step = |_| {
        simulation.step().unwrap_or_else(|error| panic!("{error}"));
        simulation.crossings().len()
    };
    (0..steps).map(step).max().unwrap_or(0)
}

const HELD: &str = "[[pins]]\nof = \"net\"\nboundary = true\n";

/// A small sheet falls onto a net that is held at its edge.
fn falling(contact: &str) -> String {
    let net = sheet("net", 6, 0.4, [0.0; 3], "");
    let cloth = sheet("cloth", 5, 0.2, [0.013, 0.02, 0.02], "spin = [1.0, 0.0, 3.0]");
    head(contact, "drag = 0.5") + &net + &cloth + HELD
}

#[test]
fn a_falling_sheet_rests_on_another() {
    let mut free = simulation(&falling("obstacles"));
    assert!(crossings(&mut free, 30) > 0, "without contact they cross");
    let mut held = simulation(&falling("on"));
    assert_eq!(crossings(&mut held, 60), 0);
    let summary = held.summary().unwrap();
    assert!(summary.totals.contact.active > 0 && summary.crossings == 0);
    let cloth = &held.parts()[1].vertices;
    let above = |&vertex: &usize| held.positions()[vertex][2] > -0.15;
    assert!(cloth.clone().filter(above).count() == cloth.len(), "the net carries the cloth");
}

/// A sheet lies on a pinned one, which is tilted by an angle: gravity has the slope tan α. Returns its way in m after
/// half a second, and that without friction.
fn slide(friction: f64, slope: f64) -> [f64; 2] {
    let angle = slope.atan();
    let gravity = format!("gravity = [{:?}, 0.0, {:?}]\n", 9.81 * angle.sin(), -9.81 * angle.cos());
    let ground = sheet("ground", 8, 0.8, [0.0; 3], "");
    // At rest, the barriers carry the sheet at this height.
    let cloth = sheet("cloth", 5, 0.2, [-0.213, 0.02, 0.0027], "");
    let head = gravity + &head("on", "tolerances.velocity = 1e-5");
    let fabric = format!("fabric = {{ friction = {friction:?}, ");
    let text = (head + &ground + &cloth).replace("fabric = { ", &fabric);
    let mut simulation = simulation(&format!("{text}[[pins]]\nof = \"ground\"\nall = true\n"));
    let middle = |simulation: &Simulation| {
        let cloth = simulation.parts()[1].vertices.clone();
        simulation.positions()[cloth].iter().map(|x| x[0]).sum::<f64>() / 36.0
    };
    let start = middle(&simulation);
    assert_eq!(crossings(&mut simulation, 50), 0);
    let free = 0.5 * 9.81 * angle.sin() * 0.5 * 0.5;
    [middle(&simulation) - start, free]
}

#[test]
fn a_sheet_on_an_incline_sticks_or_slides_by_coulombs_law() {
    let [way, free] = slide(0.5, 0.3);
    assert!(way < 2e-3 && way < 0.01 * free, "sticks: {way} of {free}");
    for (friction, slope) in [(0.0, 0.3), (0.15, 0.3), (0.3, 0.5)] {
        let [way, free] = slide(friction, slope);
        let expected = free * (1.0 - friction / slope);
        assert!((way / expected - 1.0).abs() < 0.08, "μ {friction}, tan α {slope}: {way} instead of {expected}");
    }
}

/// At 30 m/s a sheet moves by 0.3 m in a step, three hundred times the thickness.
#[test]
fn a_fast_sheet_does_not_pass_through_a_thin_one() {
    let net = sheet("net", 6, 0.4, [0.0; 3], "");
    let shot = sheet("shot", 3, 0.05, [0.011, 0.007, 0.1], "velocity = [0.0, 0.0, -30.0]");
    let mut simulation = simulation(&(head("on", "adaptive = true\ntolerances.velocity = 1e-3") + &net + &shot + HELD));
    assert_eq!(crossings(&mut simulation, 20), 0);
    let shot = &simulation.parts()[1].vertices;
    let lowest = shot.clone().map(|vertex| simulation.positions()[vertex][2]).fold(f64::INFINITY, f64::min);
    assert!(lowest > -0.3, "it went on to {lowest} m");
}

/// Contact pushes two bodies apart by opposite forces.
#[test]
fn an_impact_conserves_momentum() {
    let left = sheet("left", 3, 0.1, [0.0; 3], "velocity = [0.0, 0.0, 1.0]");
    let right = sheet("right", 3, 0.1, [0.013, 0.021, 0.03], "velocity = [0.1, 0.0, -1.0]\nspin = [0.0, 1.0, 0.0]");
    let free = "gravity = [0.0, 0.0, 0.0]\ntolerances.velocity = 1e-9";
    let mut simulation = simulation(&(head("on", free) + &left + &right));
    let before = simulation.summary().unwrap().momentum;
    assert_eq!(crossings(&mut simulation, 12), 0);
    let after = simulation.summary().unwrap();
    assert!(after.totals.contact.shortened > 0, "they meet");
    // Each sheet has 1 mg; Newton's method leaves a residual impulse.
    for (after, before) in after.momentum.iter().zip(before) {
        assert!((after - before).abs() < 1e-10, "{after} {before}");
    }
}

/// Implicit Euler loses energy. Without the energy of contact, and the work of choosing new barriers, the rebound would
/// look like a gain.
#[test]
fn the_ledger_knows_the_energy_of_contact() {
    let left = sheet("left", 3, 0.1, [0.0; 3], "velocity = [0.0, 0.0, 1.0]");
    let right = sheet("right", 3, 0.1, [0.013, 0.021, 0.012], "velocity = [0.0, 0.0, -1.0]");
    let free = "gravity = [0.0, 0.0, 0.0]\ntolerances.velocity = 1e-9";
    let mut simulation = simulation(&(head("on", free).replace("0.01", "0.001") + &left + &right));
    simulation.keep_ledger().unwrap();
    assert_eq!(crossings(&mut simulation, 20), 0);
    let ledger = simulation.ledger().unwrap();
    let entries = ledger.entries();
    let contact = ledger.potentials().iter().position(|name| name == "contact").unwrap();
    let stored = entries.iter().map(|entry| entry.potential[contact]).fold(0.0, f64::max);
    assert!(stored > 1e-2 * entries[0].kinetic, "{stored} J of {} J", entries[0].kinetic);
    for pair in entries.windows(2) {
        let gain = pair[1].unaccounted(&entries[0]) - pair[0].unaccounted(&entries[0]);
        assert!(gain < 1e-9 * entries[0].kinetic, "{gain} J appear at {} s", pair[1].time);
    }
}

#[test]
fn hair_lies_on_cloth_and_does_not_sink_in() {
    let net = sheet("net", 6, 0.4, [0.0; 3], "");
    let hair = "[[hair]]\ncount = 3\nsegments = 6\nlength = 0.15\nroot = [-0.05, 0.01, 0.01]\n\
                last_root = [-0.05, 0.03, 0.012]\ndirection = [1.0, 0.3, 0.0]\ndensity = 1e-4\n\
                stretch_stiffness = 5.0\nbend_stiffness = 1e-7\nrooted = false\n";
    let mut simulation = simulation(&(head("on", "drag = 0.5") + &net + hair + HELD));
    assert_eq!(crossings(&mut simulation, 40), 0);
}

/// The lower pins of a strip turn and press it against itself.
#[test]
fn moving_pins_wait_until_the_cloth_makes_way() {
    let strip = format!(
        "[[garment]]\nname = \"strip\"\nmesh.strip = {{ length = 0.3, width = 0.1, segments = 12 }}\n{FABRIC}\
         [[pins]]\nbox = {{ min = [-1.0, -1.0, -1.0], max = [-0.149, 1.0, 1.0] }}\n\
         [[pins]]\nbox = {{ min = [0.149, -1.0, -1.0], max = [1.0, 1.0, 1.0] }}\n\
         motion = {{ axis = [1.0, 0.0, 0.0], keys = [{{ time = 0.0 }}, {{ time = 0.4, angle = 900.0, \
         translate = [-0.1, 0.0, 0.0] }}] }}\n"
    );
    let free = "gravity = [0.0, 0.0, 0.0]\ndrag = 5.0\nadaptive = true\ntolerances.velocity = 1e-3";
    let mut crossed = simulation(&(head("obstacles", free) + &strip));
    assert!(crossings(&mut crossed, 40) > 0, "without contact it crosses");
    let mut simulation = simulation(&(head("on", free) + &strip));
    assert_eq!(crossings(&mut simulation, 40), 0);
}

#[test]
fn threads_and_resumed_runs_change_no_bit() {
    let scene = Scene::parse(&falling("on"), "test.toml".as_ref()).unwrap();
    let new = |threads| Simulation::new(&scene).unwrap().with_threads(threads);
    let (mut one, mut two, mut resumed) = (new(1), new(2), new(1));
    crossings(&mut one, 14);
    resumed.restore(one.save()).unwrap();
    for simulation in [&mut one, &mut resumed] {
        crossings(simulation, 10);
    }
    crossings(&mut two, 24);
    assert!(one.positions() == two.positions(), "one thread and two");
    assert!(one.positions() == resumed.positions(), "resumed");
}

/// A run that resumes after its last step writes its summary again.
#[test]
fn the_summary_after_a_restoration_has_the_energy_of_contact() {
    let (mut stepped, mut restored) = (simulation(&falling("on")), simulation(&falling("on")));
    crossings(&mut stepped, 14);
    restored.restore(stepped.save()).unwrap();
    let [one, other] = [&mut stepped, &mut restored].map(|simulation| {
        let terms = simulation.summary().unwrap().terms;
        terms.iter().find(|term| term.name == "contact").unwrap().energy.unwrap()
    });
    assert!(one > 0.0 && one == other, "{one} J and {other} J");
}

/// Two sheets and a ball that cross: nothing collides, or all vertices are pinned.
#[test]
fn warnings_of_crossings_say_why_contact_did_not_prevent_them() {
    let upright = "placement.rotate = { axis = [0.0, 1.0, 0.0], angle = 90.0 }";
    let crossed = |contact: &str, pins: &str| {
        let sheets = sheet("a", 2, 0.1, [0.0; 3], "") + &sheet("b", 2, 0.1, [0.01, 0.02, 0.0], upright);
        let ball = "[[obstacles]]\nname = \"ball\"\nsphere = { radius = 0.01, centre = [0.03, 0.0, 0.015] }\n\
                    motion.keys = [{ time = 0.0 }, { time = 0.02, translate = [0.0, 0.0, -0.015] }]\n";
        let mut simulation = simulation(&(head(contact, "") + &sheets + ball + pins));
        assert!(crossings(&mut simulation, 2) > 0);
        simulation.summary().unwrap().warnings
    };
    for (contact, pins, cause) in [
        ("off", "", "Nothing collides with `contact = \"off\"`"),
        ("on", "[[pins]]\nall = true\n", "vertices there are pinned"),
    ] {
        let warnings = crossed(contact, pins);
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings.iter().all(|warning| warning.contains(cause)), "{warnings:?}");
    }
}

/// The first step of each scene of contact: nothing crosses, nothing is too close.
#[test]
fn scenes_of_contact_start() {
    for name in ["drape", "twist", "sheets", "knot", "funnel", "sphere"] {
        let path = format!("{}/../scenes/contact/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::read(path.as_ref()).unwrap_or_else(|error| panic!("{error}"));
        let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(crossings(&mut simulation, 1), 0, "{name}");
        assert_eq!(simulation.obstacle_crossings(), 0, "{name}");
    }
}

#[test]
fn impossible_contact_is_refused_with_the_cause() {
    let euler = falling("on").replace("newton", "implicit-euler");
    let message = Scene::parse(&euler, "test.toml".as_ref()).unwrap_err().to_string();
    assert!(
        message.ends_with("`contact = \"on\"` needs `integrator = \"newton\"`, which certifies its moves"),
        "{message}"
    );
    let crossed = head("on", "")
        + &sheet("a", 2, 0.1, [0.0; 3], "")
        + &sheet("b", 2, 0.1, [0.01, 0.02, 0.0], "placement.rotate = { axis = [0.0, 1.0, 0.0], angle = 90.0 }");
    let scene = Scene::parse(&crossed, "test.toml".as_ref()).unwrap();
    let message = Simulation::new(&scene).unwrap_err().to_string();
    assert!(message.starts_with("the cloth crosses itself in ") && message.contains("the edge "), "{message}");
    let close = head("on", "") + &sheet("a", 2, 0.1, [0.0; 3], "") + &sheet("b", 2, 0.1, [0.01, 0.02, 5e-4], "");
    let scene = Scene::parse(&close, "test.toml".as_ref()).unwrap();
    let message = Simulation::new(&scene).unwrap_err().to_string();
    assert!(message.contains("closer than the thickness at the start"), "{message}");
}

/// A sheet at rest on a floor: forces of contact carry its weight, each vertex its own, and the floor feels all of it.
#[test]
fn forces_of_contact_carry_the_weight() {
    let cloth = sheet("cloth", 5, 0.2, [0.0, 0.0, 0.0044], "");
    let floor = "[[obstacles]]\nplane = {}\n";
    let mut simulation = simulation(&(head("on", "tolerances.velocity = 1e-7") + &cloth + floor));
    assert!(simulation.contact_forces().iter().all(|force| *force == [0.0; 3]), "nothing has happened yet");
    simulation.keep_ledger().unwrap();
    assert_eq!(crossings(&mut simulation, 60), 0);
    let weight = 9.81 * simulation.masses().iter().sum::<f64>();
    let forces = simulation.contact_forces();
    for (force, mass) in forces.iter().zip(simulation.masses()) {
        assert!((force[2] / (9.81 * mass) - 1.0).abs() < 1e-3, "{force:?}");
    }
    let largest = forces.iter().map(|force| force[2]).fold(0.0, f64::max);
    let entry = simulation.ledger().unwrap().entries().last().unwrap();
    assert!((entry.force_on_obstacles[2] / -weight - 1.0).abs() < 1e-4, "{:?}", entry.force_on_obstacles);
    assert!((entry.contact_force / largest - 1.0).abs() < 1e-6, "{} {largest}", entry.contact_force);
    let total = forces.iter().fold([0.0; 3], |sum, force| [0, 1, 2].map(|axis| sum[axis] + force[axis]));
    for axis in 0..3 {
        let error = entry.force_on_obstacles[axis] + total[axis];
        assert!(error.abs() < 1e-12 * weight, "{:?} {total:?}", entry.force_on_obstacles);
    }
}

/// Friction holds a sheet on a slope, and the slope feels it.
#[test]
fn fixed_obstacles_feel_friction() {
    let cloth = sheet("cloth", 5, 0.2, [0.0, 0.0, 0.0044], "");
    let floor = "[[obstacles]]\nplane = {}\nfriction = 0.5\n";
    let mut simulation = simulation(&(head("on", "gravity = [2.0, 0.0, -9.6]") + &cloth + floor));
    simulation.keep_ledger().unwrap();
    assert_eq!(crossings(&mut simulation, 60), 0);
    let mass: f64 = simulation.masses().iter().sum();
    let force = simulation.ledger().unwrap().entries().last().unwrap().force_on_obstacles;
    assert!((force[0] / (2.0 * mass) - 1.0).abs() < 1e-2 && (force[2] / (-9.6 * mass) - 1.0).abs() < 1e-2, "{force:?}");
}

/// The summary says if contact pushes cloth away at the start, and if it makes fabrics thinner.
#[test]
fn notes_tell_what_contact_does_to_the_start() {
    let notes = |text: &str| simulation(text).summary().unwrap().notes.join("\n");
    let above = |height: f64, dt: f64| {
        let cloth = sheet("cloth", 5, 0.2, [0.0, 0.0, height], "");
        notes(&(head("on", "").replace("0.01", &dt.to_string()) + &cloth + "[[obstacles]]\nplane = {}\n"))
    };
    let (far, near) = (above(0.006, 0.001), above(0.003, 0.001));
    assert!(far.is_empty() && above(0.0045, 0.01).is_empty(), "{far}");
    let expected = "cloth and plane 0 start 3.000 mm apart, within the reach of contact, 5.000 mm";
    assert!(near.starts_with(expected) && near.ends_with("or reduce the `thickness` of plane 0"), "{near}");
    let fine = notes(&(head("on", "") + &sheet("cloth", 5, 0.005, [0.0; 3], "")));
    assert!(fine.starts_with("contact gives 36 of 36 vertices less ") && fine.contains("of 1.000 mm"), "{fine}");
    // Fine cloth does not thin coarse cloth next to it.
    let coarse = sheet("coarse", 5, 0.2, [1.0, 0.0, 0.0], "");
    let both = notes(&(head("on", "") + &sheet("cloth", 5, 0.005, [0.0; 3], "") + &coarse));
    assert!(both.starts_with("contact gives 36 of 72 vertices less "), "{both}");
}
