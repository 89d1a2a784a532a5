//! Parts that the scene excludes from contact pass through each other; all others still collide.

use cloth_core::Simulation;
use cloth_core::scene::Scene;

/// A small sheet falls onto a net that is held at its edge.
fn falling(exclude: &str) -> String {
    let fabric = "fabric = { density = 0.2, thickness = 1e-3, material.stvk = { stretch_stiffness = 40.0, \
                  poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 } }";
    let sheet = |name: &str, cells: usize, size: f64, height: f64| {
        format!(
            "[[garment]]\nname = \"{name}\"\nplacement.translate = [0.013, 0.02, {height:?}]\n\
             mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n{fabric}\n"
        )
    };
    format!(
        "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\n{}{}[[pins]]\nof = \"net\"\nboundary = true\n\
         [[obstacles]]\nname = \"floor\"\nplane.point = [0.0, 0.0, -0.3]\n{exclude}",
        sheet("net", 6, 0.4, 0.0),
        sheet("cloth", 5, 0.2, 0.0045)
    )
}

fn simulation(text: &str) -> Result<Simulation, String> {
    let scene = Scene::parse(text, "test.toml".as_ref()).map_err(|error| format!("{error}"))?;
    Simulation::new(&scene).map_err(|error| format!("{error}"))
}

/// Steps, and returns the height of the lowest vertex of the falling sheet, in m. Nothing that counts may cross.
fn lowest(exclude: &str, steps: usize) -> f64 {
    let mut simulation = simulation(&falling(exclude)).unwrap();
    for _ in 0..steps {
        simulation.step().unwrap();
        assert_eq!((simulation.crossings().len(), simulation.obstacle_crossings()), (0, 0));
    }
    let cloth = simulation.parts()[1].vertices.clone();
    simulation.positions()[cloth].iter().map(|x| x[2]).fold(f64::INFINITY, f64::min)
}

#[test]
fn excluded_garments_pass_through_each_other_and_still_meet_the_floor() {
    let (caught, through) = (lowest("", 40), lowest("[[exclude]]\nbetween = [\"cloth\", \"net\"]\n", 40));
    assert!(caught > -0.15, "the net carries the cloth: {caught} m");
    assert!(through < -0.29 && through > -0.3, "the floor carries the cloth: {through} m");
}

#[test]
fn an_excluded_obstacle_is_passed_and_others_are_not() {
    let through =
        lowest("[[exclude]]\nbetween = [\"floor\", \"cloth\"]\n[[exclude]]\nbetween = [\"net\", \"cloth\"]\n", 40);
    assert!(through < -0.4, "{through} m");
    let caught = lowest("[[exclude]]\nbetween = [\"floor\", \"cloth\"]\n", 40);
    assert!(caught > -0.15, "the net carries the cloth: {caught} m");
}

#[test]
fn parts_that_start_closer_than_a_distance_are_excluded() {
    // Nearest vertices of the two sheets are at least 4.5 mm apart; edges in the sheets are longer than 30 mm.
    assert_eq!(lowest("[[exclude]]\ncloser_than = 0.004\n", 10), lowest("", 10), "nothing is that close");
    let text = falling("[[exclude]]\ncloser_than = 0.05\n").replace("0.0045]", "0.0]");
    let mut both = simulation(&text).expect("layers in one place are excluded");
    both.step().unwrap();
    let refused = simulation(&text.replace("closer_than = 0.05", "closer_than = 1e-9")).unwrap_err();
    assert!(refused.contains("crosses itself"), "{refused}");
}

#[test]
fn seams_exclude_what_is_near_them() {
    let seam = "[[seams]]\ngarments = [\"net\", \"cloth\"]\npairs = [[0, 0]]\nstiffness = 10.0\n";
    let near = "[[exclude]]\nnear_seams = 0.05\n";
    assert!(simulation(&falling(&format!("{seam}{near}"))).is_ok());
    let refused = simulation(&falling(near)).unwrap_err();
    assert!(refused.contains("exclude[0]: `near_seams` needs a seam"), "{refused}");
}

#[test]
fn exclusions_of_what_does_not_collide_give_a_warning() {
    let exclude = "[[exclude]]\nbetween = [\"floor\", \"cloth\"]\n[[exclude]]\nbetween = [\"net\", \"cloth\"]\n\
                   [[exclude]]\ncloser_than = 1e-3\n";
    let warnings = |contact: &str| {
        let text = falling(exclude).replacen("dt", &format!("contact = \"{contact}\"\ndt"), 1);
        simulation(&text).unwrap().warnings().to_vec()
    };
    assert!(warnings("on").is_empty());
    let of_obstacles = warnings("obstacles");
    assert!(of_obstacles.len() == 2 && of_obstacles[0].starts_with("exclude[1] has no effect: "), "{of_obstacles:?}");
    assert_eq!(warnings("off").len(), 3);
}

#[test]
fn exclusions_that_mean_nothing_are_refused() {
    for (exclude, expected) in [
        ("between = [\"cloth\", \"body\"]", "exclude[0]: nothing is called `body`; there are net, cloth, floor"),
        ("between = [\"cloth\", \"net\"]\ncloser_than = 0.1", "test.toml:20:1: expected exactly one of `between`"),
        ("", "test.toml:20:1: expected exactly one of `between`"),
        ("closer_than = 0.0", "expected a finite number greater than 0"),
    ] {
        let message = simulation(&falling(&format!("[[exclude]]\n{exclude}\n"))).unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
    let euler = falling("[[exclude]]\ncloser_than = 0.1\n").replace("\"newton\"", "\"implicit-euler\"");
    assert!(simulation(&euler).unwrap_err().contains("`exclude` needs `integrator = \"newton\"`"));
}
