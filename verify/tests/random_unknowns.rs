//! Random declarations over all types of unknowns, with states, velocities and shared unknowns: their audits.

use std::fmt::Write;

use fastrand::Rng;
use verify::audit::{Options, Target, audit_all, describe_failure};

/// An unknown: its type, its name.
struct Unknown(&'static str, String);

/// Returns a random 3-vector that moves with this unknown.
fn vector(rng: &mut Rng, Unknown(of, name): &Unknown, by: &str) -> String {
    match *of {
        "Point" => name.clone(),
        "Point2" => format!("vector({name}.x, {name}.y, 0.3)"),
        "Scalar" => format!("(c + d + {name} * {by})"),
        "Rotation" if by == "c" => format!("rotate({name}, c)"),
        // The product of two vectors that one rotation turns does not depend on it: its derivatives are rounding errors.
        "Rotation" => format!("(rotate({name}, {by}) + 0.5 * c)"),
        "Motion" => format!("transform({name}, {by})"),
        "Mat3x3" => format!("({name} * {by} + c)"),
        "Quat" => format!("(imaginary({name}) + {name}.w * {by} + d)"),
        "Twist" => format!("(angular({name}) + 0.5 * linear({name}) + {by})"),
        "[Rotation; 2]" => format!("(rotate({name}[1], rotate({name}[0], {by})) + 0.5 * d)"),
        _ => format!("({name}[{}] - 0.2 * {name}[{}])", rng.usize(0..3), rng.usize(0..3)),
    }
}

/// Returns a random rotation or motion that some unknown gives.
fn turn(rng: &mut Rng, unknowns: &[Unknown]) -> Option<String> {
    let found: Vec<String> = unknowns
        .iter()
        .filter_map(|Unknown(of, name)| match *of {
            "Rotation" => Some(name.clone()),
            "Motion" => Some(format!("rotation({name})")),
            "[Rotation; 2]" => Some(format!("{name}[{}]", rng.usize(0..2))),
            _ => None,
        })
        .collect();
    (!found.is_empty()).then(|| found[rng.usize(0..found.len())].clone())
}

/// Returns `back` and `there` as a product; without the latter if they are of one unknown. What is left of that does not
/// move: its derivatives are rounding errors.
fn between(of: [&str; 2], back: &str, there: &str) -> String {
    if of[0] == of[1] { back.to_owned() } else { format!("{back} * {there}") }
}

/// Returns a scalar of relative rotations or motions, if there are any.
fn relative(rng: &mut Rng, unknowns: &[Unknown]) -> Option<String> {
    let motions: Vec<&String> = unknowns.iter().filter(|one| one.0 == "Motion").map(|one| &one.1).collect();
    if !motions.is_empty() && rng.bool() {
        let [a, b] = [(); 2].map(|()| motions[rng.usize(0..motions.len())]);
        let relative = between([a, b], &format!("inverse({a})"), b);
        let terms = [
            format!("norm(transform({relative} * s, c) - 2 * d)"),
            format!("dot(position({a} * s * {b}), rotate(s * {b}, d))"),
        ];
        return Some(terms[rng.usize(0..2)].clone());
    }
    let (a, b) = (turn(rng, unknowns)?, turn(rng, unknowns)?);
    let relative = between([&a, &b], &format!("conjugate({a})"), &b);
    let terms = [
        format!("k * norm_squared(log({relative} * g))"),
        format!("cos(norm_squared(log(conjugate(g) * {b})))"),
        // At half a turn the rotation vector jumps, but this does not.
        format!("dot(log({a} * g), d)^2 * (π^2 - norm_squared(log({a} * g)))^3 / 1000"),
    ];
    Some(terms[rng.usize(0..3)].clone())
}

/// Returns a random smooth scalar of the unknowns. Edges of domains and of absolute values are inside of the range.
fn scalar(rng: &mut Rng, unknowns: &[Unknown]) -> String {
    if rng.u8(0..4) == 0
        && let Some(term) = relative(rng, unknowns)
    {
        return term;
    }
    let [a, b] = ["c", "d"].map(|by| {
        let unknown = &unknowns[rng.usize(0..unknowns.len())];
        vector(rng, unknown, by)
    });
    let terms = [
        format!("dot({a}, {b})"),
        format!("norm({a} - 1.7 * d)"),
        format!("sin(dot({a}, d)) * k"),
        format!("exp(0.3 * tanh(dot({a}, {b})))"),
        format!("norm_squared({a} + 0.3 * cross({b}, d))"),
        format!("log(1 + norm_squared({b}))"),
        format!("sqrt(1 + norm_squared({a} - {b}))"),
        format!("sqrt(4 + dot({a}, d))"),
        format!("log(3 + sin(dot({a}, d)))"),
        format!("interpolate([0, k, 2, 1.5], dot({a}, d))"),
        format!("abs(dot({a}, {b}) - k)"),
        format!("max(dot({a}, d), 0.3 * k)"),
        format!("(2 + dot({a}, d)^2)^1.3"),
        format!("asin(0.5 * tanh(dot({a}, {b})))"),
        format!("angle({a}, d)"),
        format!("atan2(dot({a}, d), 2 + norm({b}))"),
        format!("acos(dot({a}, d) / (1 + norm({a}) * norm(d) + norm({b})))"),
        format!("norm(unit({a}) - unit({b} + 2 * d))"),
    ];
    terms[rng.usize(0..terms.len())].clone()
}

/// Returns the force on an unknown: its resistance to a velocity, and a part that no potential has.
fn force(rng: &mut Rng, unknowns: &[Unknown], on: &Unknown, velocity: &str) -> String {
    let strength = scalar(rng, unknowns);
    match on.0 {
        "Scalar" => format!("{strength} - k^2 * {velocity}"),
        "Point2" => format!("{strength} * vector(d.x, d.y) - k^2 * {velocity}"),
        "Motion" => {
            format!("{strength} * d - k * linear({velocity}), rotate({}, c) - k^2 * angular({velocity})", on.1)
        }
        _ => format!("{strength} * cross(c, d) - k^2 * {velocity}"),
    }
}

fn declaration(rng: &mut Rng, number: usize) -> String {
    const TYPES: [&str; 11] = [
        "Scalar",
        "Rotation",
        "Point",
        "Point2",
        "Motion",
        "[Point; 3]",
        "Mat3x3",
        "Quat",
        "Twist",
        "[Rotation; 2]",
        "[Vec3; 3]",
    ];
    let kind = ["energy", "energy", "energy", "constraint", "residual", "force"][rng.usize(0..6)];
    let types = match kind {
        "force" => 5,
        _ => TYPES.len(),
    };
    let mut inputs = Vec::new();
    let unknowns: Vec<Unknown> = (0..rng.usize(1..4))
        .map(|i| {
            let unknown = Unknown(TYPES[rng.usize(0..types)], format!("u{i}"));
            let shared = kind == "energy" && !unknown.0.starts_with('[') && rng.u8(0..4) == 0;
            inputs.push(format!("{}{}: {}", if shared { "shared " } else { "" }, unknown.1, unknown.0));
            unknown
        })
        .collect();
    if kind == "force" {
        inputs.extend((0..unknowns.len()).map(|i| format!("v{i}: Velocity")));
    }
    // Each input is used.
    let mut value = format!(
        "{} + {} + 0.1 * k * dot(transform(s, c), rotate(g, d))",
        scalar(rng, &unknowns),
        scalar(rng, &unknowns)
    );
    for unknown in &unknowns {
        write!(value, " * (2 + dot({}, c))", vector(rng, unknown, "d")).unwrap();
        if unknown.0.ends_with("; 3]") {
            write!(value, " + norm_squared({0}[0] + {0}[1] + {0}[2] - c)", unknown.1).unwrap();
        }
    }
    let (mut state, mut next) = (String::new(), String::new());
    if rng.bool() {
        state = "state m: Scalar, w: Vec3, a: [Vec3; 3]; ".into();
        let moved = vector(rng, &unknowns[0], "c");
        let direction = [format!("unit(2 * w + {moved})"), format!("w + 0.1 * m * {moved}")];
        let m = scalar(rng, &unknowns);
        next = format!(
            "next {{ m = 0.5 * m + {m}; w = {}; for i in 1..3 {{ a[i] = a[i - 1]; }} a[0] = w; }} ",
            direction[rng.usize(0..2)]
        );
        write!(value, " + m * dot(w, {}) + m^2", vector(rng, &unknowns[0], "c")).unwrap();
        write!(value, " + sum(i in 0..3, dot([2 * a[j] for j in 0..3][i], d) * norm_squared(a[i]))").unwrap();
    }
    let result = match kind {
        "residual" => {
            let [second, third] = [scalar(rng, &unknowns), vector(rng, &unknowns[0], "c")];
            format!("[{value}, {second}, [dot({third}, d) + f for f in 0..2][1]]")
        }
        "force" => {
            let mut forces: Vec<String> =
                unknowns.iter().enumerate().map(|(i, on)| force(rng, &unknowns, on, &format!("v{i}"))).collect();
            let first = ["1", "vector(1, 1, 1)", "vector(1, 1)"]
                [usize::from(unknowns[0].0 != "Scalar") + usize::from(unknowns[0].0 == "Point2")];
            write!(forces[0], " + 0.01 * ({value}) * {first}").unwrap();
            format!("[{}]", forces.join(", "))
        }
        _ => value,
    };
    format!(
        "{kind} F{number}({}; {state}c, d: Vec3, k: Scalar, g: Rotation, s: Motion) {{ {next}{result} }}\n",
        inputs.join(", ")
    )
}

/// Every block equals multi-precision, dual numbers and differences.
#[test]
fn audits_of_random_declarations_pass() {
    let seed = std::env::var("SEED").map_or(20_261_129, |seed| seed.parse().expect("SEED is a number"));
    let mut rng = Rng::with_seed(seed);
    let texts: Vec<String> = (0..24).map(|number| declaration(&mut rng, number)).collect();
    // Each has the compiler's whole budget.
    let targets = |text: &String| Target::of_text(text, "random.energy").unwrap_or_else(|errors| panic!("{errors}"));
    let (targets, text): (Vec<Target>, String) = (texts.iter().flat_map(targets).collect(), texts.concat());
    let report = audit_all(&targets, None, Options::quick());
    let failures: Vec<String> = report.failures().map(describe_failure).collect();
    assert!(failures.is_empty() && report.refused.is_empty(), "{text}\n{}\n{:?}", failures.join("\n"), report.refused);
}
