//! Obstacles with the integrator `newton`: cloth and hair never pass through them, however thin or fast, and not only
//! vertices touch them.

use cloth_core::Simulation;
use cloth_core::scene::Scene;

const FABRIC: &str = "fabric = { density = 0.2, thickness = 1e-3, material.stvk = { stretch_stiffness = 40.0, \
                      poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 } }\n";

fn head(rest: &str) -> String {
    format!("dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ntolerances.velocity = 1e-3\n{rest}\n")
}

fn sheet(cells: usize, size: f64, at: [f64; 3], rest: &str) -> String {
    format!(
        "[[garment]]\nname = \"cloth\"\nplacement.translate = {at:?}\n\
         mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n{rest}\n{FABRIC}"
    )
}

fn scene(text: &str) -> Scene {
    Scene::parse(text, "test.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn simulation(text: &str) -> Simulation {
    Simulation::new(&scene(text)).unwrap_or_else(|error| panic!("{error}"))
}

/// Steps, and asserts after each step that nothing crosses an obstacle.
fn run(simulation: &mut Simulation, steps: u64) {
    for step in 0..steps {
        simulation.step().unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(simulation.obstacle_crossings(), 0, "step {step}");
    }
}

/// The extremes of a coordinate.
fn range(simulation: &Simulation, axis: usize) -> [f64; 2] {
    let all = || simulation.positions().iter().map(|x| x[axis]);
    [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)]
}

/// The cells of the cloth are larger than the obstacles: vertices alone would never touch them.
#[test]
fn coarse_cloth_is_carried_by_small_obstacles() {
    let obstacles = [
        "sphere = { radius = 0.01, centre = [0.021, 0.017, -0.03] }",
        "capsule = { from = [0.02, -0.3, -0.03], to = [0.02, 0.3, -0.03], radius = 0.01 }",
        "box = { centre = [0.02, 0.017, -0.035], size = [0.02, 0.02, 0.03] }",
        "box = { centre = [0.02, 0.0, -0.04], size = [0.02, 0.6, 0.02], rounding = 0.003, \
         rotate = { axis = [0.0, 1.0, 0.0], angle = 45.0 } }",
    ];
    for obstacle in obstacles {
        let held = "[[pins]]\nbox = { min = [-0.21, -1.0, -1.0], max = [-0.19, 1.0, 1.0] }\n\
                    [[pins]]\nbox = { min = [0.19, -1.0, -1.0], max = [0.21, 1.0, 1.0] }\n";
        let text = head("drag = 2.0\ncontact = \"obstacles\"") + &sheet(4, 0.4, [0.0; 3], "") + held;
        let lowest = |text: &str| {
            let mut simulation = simulation(text);
            run(&mut simulation, 40);
            // The middle of the sheet: its cells are 10 cm wide.
            simulation.positions()[12][2]
        };
        let (free, carried) = (lowest(&text), lowest(&format!("{text}[[obstacles]]\n{obstacle}\n")));
        assert!(carried > free + 0.008, "{obstacle}: {carried} {free}");
    }
}

/// At 30 m/s a sheet moves by 0.3 m in a step, three hundred times the thickness of the plate.
#[test]
fn fast_cloth_does_not_pass_through_a_thin_plate() {
    let plate = "[[obstacles]]\nbox = { size = [0.4, 0.4, 0.001] }\nthickness = 0.001\n";
    let shot = sheet(4, 0.1, [0.011, 0.007, 0.1], "velocity = [0.0, 0.0, -30.0]");
    let mut simulation = simulation(&(head("adaptive = true") + &shot + plate));
    run(&mut simulation, 20);
    assert!(range(&simulation, 2)[0] > 0.0, "{:?}", range(&simulation, 2));
}

#[test]
fn a_fast_obstacle_does_not_pass_through_cloth() {
    let held = "[[pins]]\nboundary = true\n";
    for (solid, at) in [("sphere = { radius = 0.03 }", 0.1), ("box = { size = [0.05, 0.04, 0.001] }", 0.08)] {
        let motion = "motion.keys = [{ time = 0.0 }, { time = 1.0, translate = [0.0, 0.0, -20.0] }]\n";
        let shot = format!("[[obstacles]]\nname = \"shot\"\n{solid}\n{motion}thickness = 0.001\n");
        let cloth = sheet(8, 0.5, [0.01, 0.02, -at], "");
        let mut simulation = simulation(&(head("adaptive = true\ngravity = [0.0, 0.0, 0.0]") + &cloth + held + &shot));
        // The sheet stretches like a net, and follows the shot.
        run(&mut simulation, 3);
        let lowest = range(&simulation, 2)[0];
        assert!(lowest < -0.6, "{solid}: {lowest}");
        assert!(simulation.summary().unwrap().totals.passages.is_empty());
    }
}

/// A ball turns about the vertical and takes the cloth on it along. Its centre does not move.
#[test]
fn the_surface_of_a_turning_ball_drags_cloth_along() {
    let spin = |friction: f64| {
        let ball = format!(
            "[[obstacles]]\nsphere = {{ radius = 0.2, centre = [0.0, 0.0, -0.2] }}\nfriction = {friction:?}\n\
             motion.keys = [{{ time = 0.0 }}, {{ time = 1.0, angle = 60.0 }}]\n"
        );
        let mut simulation = simulation(&(head("drag = 0.2") + &sheet(6, 0.2, [0.0, 0.0, 0.005], "") + &ball));
        simulation.keep_ledger().unwrap();
        run(&mut simulation, 60);
        let corner = simulation.positions()[6];
        let start = [0.1_f64, -0.1];
        let work = simulation.ledger().unwrap().entries().last().unwrap().obstacles;
        // Friction drives the cloth. Without it, the ball only turns under it.
        assert_eq!(work > 1e-6, friction > 0.0, "{work} J");
        (corner[1].atan2(corner[0]) - start[1].atan2(start[0])).to_degrees()
    };
    let (rough, smooth) = (spin(1.0), spin(0.0));
    assert!((25.0..37.0).contains(&rough) && smooth.abs() < 5.0, "{rough}° {smooth}°");
}

/// Cloth lies on a plane that lifts it: the work of the obstacle is the weight times the way.
#[test]
fn moving_obstacles_do_work() {
    let plane =
        "[[obstacles]]\nplane = {}\nmotion.keys = [{ time = 0.0 }, { time = 0.6, translate = [0.0, 0.0, 0.12] }]\n";
    let mut simulation = simulation(&(head("") + &sheet(4, 0.2, [0.0, 0.0, 0.0045], "") + plane));
    simulation.keep_ledger().unwrap();
    run(&mut simulation, 60);
    let (weight, last) = (0.2 * 0.04 * 9.81, simulation.ledger().unwrap().entries().last().unwrap());
    assert!((last.obstacles / (weight * 0.12) - 1.0).abs() < 0.05, "{} of {}", last.obstacles, weight * 0.12);
}

#[test]
fn a_turning_plane_tips_cloth_off() {
    let plane = "[[obstacles]]\nplane = {}\nmotion = { axis = [0.0, 1.0, 0.0], keys = [{ time = 0.0 }, \
                 { time = 0.5, angle = 30.0 }] }\n";
    let mut simulation = simulation(&(head("") + &sheet(4, 0.2, [0.0, 0.0, 0.0045], "") + plane));
    run(&mut simulation, 80);
    assert!(range(&simulation, 0)[0] > 0.1 && range(&simulation, 2)[1] < 0.0, "{:?}", simulation.positions()[0]);
}

/// With `contact = "obstacles"` cloth passes through itself, but not through obstacles.
#[test]
fn obstacles_alone_leave_the_cloth_free_to_cross_itself() {
    let second = sheet(5, 0.2, [0.013, 0.02, 0.05], "velocity = [0.0, 0.0, -0.3]").replace("\"cloth\"", "\"second\"");
    let both = sheet(5, 0.2, [0.0, 0.0, 0.02], "velocity = [0.0, 0.0, 0.3]") + &second;
    let floor = "[[obstacles]]\nplane = {}\n";
    let mut simulation = simulation(&(head("contact = \"obstacles\"\nadaptive = true") + &both + floor));
    let mut crossed = 0;
    for _ in 0..40 {
        run(&mut simulation, 1);
        crossed += simulation.crossings().len();
    }
    assert!(crossed > 0);
    assert_eq!(simulation.islands().len(), 2, "each garment is solved on its own");
}

#[test]
fn hair_swings_over_a_ball_and_hangs_from_a_scalp() {
    let hair = "[[hair]]\ncount = 4\nsegments = 8\nlength = 0.2\nroot = [0.0, -0.03, 0.05]\n\
                last_root = [0.0, 0.03, 0.05]\ndirection = [1.0, 0.0, 0.4]\ndensity = 1e-4\n\
                stretch_stiffness = 5.0\nbend_stiffness = 1e-7\n";
    // The roots are inside the scalp.
    let solids = "[[obstacles]]\nname = \"scalp\"\nsphere = { radius = 0.03, centre = [-0.01, 0.0, 0.04] }\n\
                  [[obstacles]]\nsphere = { radius = 0.04, centre = [0.1, 0.0, -0.02] }\nthickness = 0.002\n\
                  friction = 0.2\n";
    let mut simulation = simulation(&(head("drag = 0.5\nadaptive = true") + hair + solids));
    run(&mut simulation, 60);
    let work = simulation.summary().unwrap().totals.contact;
    assert!(work.active > 0, "{work}");
}

#[test]
fn threads_and_resumed_runs_change_no_bit() {
    let solids = "[[obstacles]]\nbox = { centre = [0.0, 0.0, -0.1], size = [0.1, 0.1, 0.1] }\nfriction = 0.3\n\
                  motion.keys = [{ time = 0.05 }, { time = 0.3, angle = 40.0, translate = [0.0, 0.02, 0.03] }]\n\
                  [[obstacles]]\nplane = { point = [0.0, 0.0, -0.1], normal = [0.1, 0.2, 1.0] }\nfriction = 0.5\n";
    let text = head("adaptive = true") + &sheet(8, 0.3, [0.01, 0.02, -0.02], "spin = [0.5, 0.0, 2.0]") + solids;
    let scene = scene(&text);
    let new = |threads| {
        let mut simulation = Simulation::new(&scene).unwrap().with_threads(threads);
        simulation.keep_ledger().unwrap();
        simulation
    };
    let (mut one, mut two, mut resumed) = (new(1), new(2), new(1));
    run(&mut one, 14);
    resumed.restore(one.save()).unwrap();
    run(&mut one, 10);
    run(&mut resumed, 10);
    run(&mut two, 24);
    assert!(one.positions() == two.positions(), "one thread and two");
    assert!(one.positions() == resumed.positions(), "resumed");
    assert_eq!(one.ledger(), resumed.ledger());
}

#[test]
fn obstacles_of_one_name_are_refused() {
    let sheet = sheet(1, 0.2, [0.0; 3], "");
    let new = |names: [&str; 2]| {
        let ball = "sphere = { radius = 0.1, centre = [0.0, 0.0, -1.0] }";
        let balls = names.map(|name| format!("[[obstacles]]\n{name}\n{ball}\n")).concat();
        Simulation::new(&scene(&(head("") + &sheet + &balls))).map_err(|error| error.to_string())
    };
    let expected = "two obstacles are called `ball`; give one of them another `name`";
    assert_eq!(new(["name = \"ball\""; 2]).unwrap_err(), expected);
    assert!(
        new(["name = \"sphere 1\"", ""]).unwrap_err().contains("called `sphere 1`"),
        "the other one has this name by default"
    );
    assert!(new(["", ""]).is_ok(), "names by default differ");
}

#[test]
fn impossible_starts_are_refused_with_the_cause() {
    let refused = |cloth: &str, obstacle: &str| {
        Simulation::new(&scene(&(head("") + cloth + "[[obstacles]]\n" + obstacle))).unwrap_err().to_string()
    };
    let flat = sheet(4, 0.2, [0.0; 3], "");
    let message = refused(&flat, "name = \"ball\"\nsphere = { radius = 0.06 }\n");
    assert!(
        message.starts_with("5 vertices start inside ball, the deepest is vertex 12 of cloth, 60.000 mm below"),
        "{message}"
    );
    let message = refused(&flat, "name = \"pea\"\nsphere = { radius = 0.01, centre = [0.02, 0.03, 0.002] }\n");
    assert!(message.starts_with("the cloth touches pea at the start: the vertices "), "{message}");
    let message = refused(&flat, "name = \"stick\"\nbox = { size = [0.01, 0.01, 0.2], centre = [0.02, 0.03, 0.0] }\n");
    assert!(message.starts_with("the cloth crosses stick in ") && message.contains("vertices 12, "), "{message}");
    let message = refused(&flat, "plane = {}\n");
    assert!(message.contains("plane 0 "), "{message}");
    // A little above the plane is enough, and the obstacle's skin is thinner then.
    let mut close = simulation(&(head("") + &sheet(4, 0.2, [0.0, 0.0, 1e-4], "") + "[[obstacles]]\nplane = {}\n"));
    run(&mut close, 5);
}
