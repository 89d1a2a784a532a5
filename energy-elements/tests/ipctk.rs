//! Elements of contact agree with the functions of ipc-toolkit, written by others. Skipped without the Python package
//! ipctk.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use energy_dsl::{Potential, Vector3};
use energy_elements::{
    Distance, DistanceBarrier, EdgeEdgeDistance, ParallelEdges, PointEdgeDistance, PointTriangleDistance,
    SquaredDistanceBarrier,
};

const COUNT: usize = 50;

/// Numbers in (−1, 1).
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move || 2.0 * random.f64() - 1.0
}

/// Adds lines with inputs and results at random points. `element` draws an element and returns its parameters, too.
fn add<E, const N: usize>(text: &mut String, mut element: impl FnMut(&[Vector3<f64>; N]) -> (E, Vec<f64>))
where
    E: Potential<f64, Points = [Vector3<f64>; N]>,
{
    let mut draw = numbers(3);
    for _ in 0..COUNT {
        let x: [Vector3<f64>; N] = std::array::from_fn(|_| std::array::from_fn(|_| draw()));
        let (element, parameters) = element(&x);
        let at = element.hessian(&x);
        assert!(!at.flags.any(), "{}: {x:?}", E::DECLARATION.name);
        write!(text, "{} {}", E::DECLARATION.name, 3 * N).unwrap();
        let size = 3 * N;
        // The Hessian is a triangle of blocks.
        let blocks = at.hessian.as_ref();
        let entry = |row: usize, column: usize| {
            let (a, b) = (row / 3, column / 3);
            let place = |a: usize, b: usize| a * N - a * (a + 1) / 2 + b;
            if a <= b { blocks[place(a, b)][row % 3][column % 3] } else { blocks[place(b, a)][column % 3][row % 3] }
        };
        let hessian = (0..size * size).map(|place| entry(place / size, place % size));
        let gradient = at.gradient.as_ref().as_flattened().iter().copied();
        let all = x.into_iter().flatten().chain(parameters).chain([at.value]).chain(gradient).chain(hessian);
        all.for_each(|number| write!(text, " {number:e}").unwrap());
        text.push('\n');
    }
}

#[test]
fn elements_of_contact_agree_with_ipc_toolkit() {
    let mut text = String::new();
    add(&mut text, |_| (Distance::new(), vec![]));
    add(&mut text, |_| (PointEdgeDistance::new(), vec![]));
    add(&mut text, |_| (PointTriangleDistance::new(), vec![]));
    add(&mut text, |_| (EdgeEdgeDistance::new(), vec![]));
    let distance = |x: &[Vector3<f64>; 2]| (0..3).map(|axis| (x[0][axis] - x[1][axis]).powi(2)).sum::<f64>().sqrt();
    let mut draw = numbers(5);
    // Active and inactive barriers.
    let mut around = move |x: &[Vector3<f64>; 2]| (2.0 + draw(), distance(x) * (1.3 + draw()));
    add(&mut text, |x| {
        let (κ, dhat) = around(x);
        (DistanceBarrier { κ, dhat }, vec![κ, dhat])
    });
    add(&mut text, |x| {
        let (κ, dhat) = around(x);
        (SquaredDistanceBarrier { κ, dhat }, vec![κ, dhat])
    });
    let mut draw = numbers(6);
    add(&mut text, |_| {
        let (energy, ε) = (2.0 + draw(), 1.0 + draw());
        (ParallelEdges { K: energy, ε }, vec![energy, ε])
    });
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compare_with_ipctk.py");
    let python = Command::new("python3").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let Ok(mut python) = python.map_err(|error| eprintln!("skipped: no python3 ({error})")) else { return };
    // Without the package the script ends before it reads.
    let _ = python.stdin.take().map(|mut input| input.write_all(text.as_bytes()));
    let told = python.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&told.stdout);
    if told.status.code() == Some(77) {
        eprintln!("skipped: {said}");
        return;
    }
    assert!(told.status.success(), "{said}");
    assert_eq!(said.matches(&format!(" {COUNT}")).count(), 7, "{said}");
}
