//! Random scenes of what collides less often than cloth does: hair, seams, exclusions, meshes that turn, and pins that
//! let go. They are checked as those of `random_contact.rs`.
//!
//! `PROPTEST_CASES=8000 cargo test --release -p cloth-core --test all random_mixtures::` runs a hundred thousand steps.

use proptest::prelude::*;

use super::random_contact::{check_run, fabric, scenes, sheet, vector};

/// Strands of hair, fixed at their roots or loose.
fn hair(rooted: bool) -> impl Strategy<Value = String> {
    let (stiffness, bending) = (0.0..1.5_f64, -9.0..-7.0_f64);
    (2..6_usize, 2..7_usize, vector(0.03), vector(0.01), vector(0.5), stiffness, bending).prop_map(
        move |(count, segments, root, aside, direction, stiffness, bending)| {
            // Strands are parallel, and at least 5 mm apart.
            let root = [root[0], root[1] - 0.025, root[2] + 0.05];
            let last = [root[0] + aside[0], root[1] + 0.05 + aside[1], root[2] + aside[2]];
            let direction = [direction[0], direction[1], direction[2] - 1.0];
            format!(
                "[[hair]]\ncount = {count}\nsegments = {segments}\nlength = 0.1\nroot = {root:?}\n\
                 last_root = {last:?}\ndirection = {direction:?}\ndensity = 1e-5\nstretch_stiffness = {:?}\n\
                 bend_stiffness = {:?}\nrooted = {rooted}\n",
                10_f64.powf(stiffness),
                10_f64.powf(bending)
            )
        },
    )
}

/// A sheet of cloth that flies down.
fn flying(name: &'static str, cells: usize) -> impl Strategy<Value = String> {
    (fabric(), vector(0.02), vector(1.0), vector(20.0), 0.0..8.0_f64).prop_map(
        move |(fabric, offset, drift, spin, speed)| {
            let motion = format!("velocity = {:?}\nspin = {spin:?}\n", [drift[0], drift[1], -speed]);
            sheet(name, cells, [offset[0], offset[1], 0.2], &motion, &fabric)
        },
    )
}

/// A small torus that turns.
fn torus() -> impl Strategy<Value = String> {
    (0.0..0.8_f64, -300.0..300.0_f64, vector(1.0), vector(0.01)).prop_map(|(friction, angle, axis, way)| {
        format!(
            "[[obstacles]]\nname = \"torus\"\nfriction = {friction:?}\nthickness = 0.001\n\
             mesh = {{ path = \"torus.obj\", placement = {{ scale = 0.2, translate = [0.0, 0.0, -0.12] }} }}\n\
             [obstacles.motion]\naxis = {axis:?}\ncentre = [0.0, 0.0, -0.12]\n\
             keys = [{{ time = 0.0 }}, {{ time = 1.0, angle = {angle:?}, translate = {way:?} }}]\n"
        )
    })
}

/// Cloth flies onto hair, and both fall onto a torus. Where roots are fixed, it may press hair against them.
fn hair_and_cloth() -> impl Strategy<Value = (String, bool)> {
    any::<bool>().prop_flat_map(|rooted| {
        (hair(rooted), flying("cloth", 4), torus()).prop_map(|(hair, cloth, torus)| (hair + &cloth + &torus, true))
    })
}

/// Two sheets are drawn together along their nearest edges, and fall onto a net. What is near the seam may be excluded.
fn sewn() -> impl Strategy<Value = (String, bool)> {
    let distance = prop::option::of(0.01..0.04_f64);
    (fabric(), fabric(), fabric(), vector(0.01), 0.01..0.2_f64, 1.0..100.0_f64, distance).prop_map(
        |(net, left, right, offset, duration, stiffness, distance)| {
            let at = |side: f64| [0.06 * side, side * offset[1], 0.02 + offset[2].abs() * (1.0 + side)];
            let near = distance.map_or(String::new(), |near| format!("[[exclude]]\nnear_seams = {near:?}\n"));
            let text = sheet("net", 8, [0.0; 3], "", &net)
                + &sheet("left", 4, at(-1.0), "", &left)
                + &sheet("right", 4, at(1.0), "velocity = [0.0, 0.0, -1.0]\n", &right)
                + "[[pins]]\nof = \"net\"\nboundary = true\n"
                + &format!(
                    "[[seams]]\ngarments = [\"left\", \"right\"]\nwithin = 0.05\nstiffness = {stiffness:?}\n\
                     close = {{ duration = {duration:?} }}\n{near}"
                );
            (text, false)
        },
    )
}

/// Two sheets fly onto a third. Some pairs of them, or all that start close to each other, pass through each other.
fn excluded() -> impl Strategy<Value = (String, bool)> {
    let names = prop::sample::subsequence(vec!["net", "one", "other"], 2);
    let exclude = prop_oneof![
        names.prop_map(|names| format!("between = {names:?}")),
        prop::sample::select(vec!["net", "one", "other"]).prop_map(|name| format!("between = {:?}", [name, name])),
        (0.002..0.06_f64).prop_map(|distance| format!("closer_than = {distance:?}")),
    ];
    (fabric(), flying("one", 4), flying("other", 3), exclude).prop_map(|(net, one, other, exclude)| {
        let held = "[[pins]]\nof = \"net\"\nboundary = true\n";
        let other = other.replace("0.2]\nmesh", "0.24]\nmesh");
        (sheet("net", 8, [0.0; 3], "", &net) + &one + &other + held + &format!("[[exclude]]\n{exclude}\n"), false)
    })
}

/// A sheet is let go at one corner after the other, above a torus and a floor.
fn released() -> impl Strategy<Value = (String, bool)> {
    (fabric(), prop::array::uniform4(0.0..0.3_f64), torus()).prop_map(|(fabric, times, torus)| {
        let corners = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]];
        let pin = |(corner, time): (&[f64; 3], f64)| format!("[[pins]]\nnearest = {corner:?}\nrelease = {time:?}\n");
        let pins: String = corners.iter().zip(times).map(pin).collect();
        let floor = "[[obstacles]]\nplane.point = [0.0, 0.0, -0.2]\n";
        (sheet("cloth", 8, [0.0; 3], "", &fabric) + &pins + &torus + floor, false)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: scenes() / 2, ..ProptestConfig::default() })]

    #[test]
    fn no_random_mixture_has_a_crossing_or_a_nan(
        dt in 0.001..0.033_f64,
        (text, may_be_impossible) in prop_oneof![hair_and_cloth(), sewn(), excluded(), released()],
    ) {
        check_run(dt, &text, may_be_impossible)?;
    }
}
