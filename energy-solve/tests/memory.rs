//! Elements with memory on points: generated ones and those that are read at run time advance in the same way.

use energy_compiler::Interpreted;
use energy_dsl::tape::Column;
use energy_dsl::{Element, Stateful, Vector3, energy};
use energy_solve::{DrivenTerm, ElementList, State, StepStart, System, TapeTerm, Term};

energy! {
    /// A spring that creeps with the time constant τ, and yields beyond the force Y.
    #[time_step(h)]
    energy Creeping(p, q: Point; state l: Scalar[m] = L, n: Scalar = 0; k: Scalar[N/m], L: Scalar[m], τ: Scalar[s],
                    Y: Scalar[N], h: Scalar[s]) {
        let e = norm(p - q) - l;
        next {
            let crept = l + e * h / (τ + h);
            l = if k * abs(e) > Y { crept + e / 2 } else { crept };
            n = n + h;
        }
        k / 2 * e^2 * τ / (τ + h)
    }
}

const LINKS: usize = 150;

fn positions(step: usize) -> Vec<Vector3<f64>> {
    let at = |i: usize| i as f64 * (1.0 + 0.01 * step as f64);
    (0..=LINKS).map(|i| [at(i), (at(i) * 0.3).sin(), 0.1 * step as f64 * (i % 3) as f64]).collect()
}

fn creeping(link: usize) -> Creeping<f64> {
    Creeping::at_rest(10.0 + link as f64, 1.0, 0.5, 3.0, 1.0)
}

/// A chain with pinned links at its start. States of tapes are bound as numbers that all elements share.
fn chain(read: bool) -> System {
    let stencils: Vec<[usize; 2]> = (0..LINKS).map(|i| [i, i + 1]).collect();
    let term: Box<dyn Term> = if read {
        let element = Interpreted::from_source(&<Creeping as Element>::DECLARATION.source).unwrap().remove(0);
        let k: Vec<f64> = (0..LINKS).map(|link| 10.0 + link as f64).collect();
        let own = [Column::Each(&k), Column::Same(&[1.0]), Column::Same(&[0.5]), Column::Same(&[3.0])];
        let own = [&own[..], &[Column::Same(&[1.0])]].concat();
        let at_rest = element.states_at_rest::<f64>(LINKS, &[], &own).unwrap().unwrap();
        assert_eq!(at_rest, [1.0, 0.0].repeat(LINKS));
        let states = [Column::Same(&at_rest[..1]), Column::Same(&at_rest[1..2])];
        let elements = element.elements(LINKS, &[], &[&own[..], &states].concat()).unwrap();
        let vertices = stencils.concat();
        Box::new(TapeTerm::new("chain".into(), element.declaration(), elements.tape().clone(), vertices))
    } else {
        let elements = (0..LINKS).map(creeping).collect();
        Box::new(DrivenTerm::with_memory(ElementList::new("chain", elements, &stencils).unwrap()))
    };
    let pinned: Vec<bool> = (0..=LINKS).map(|vertex| [0, 1, 2, 60].contains(&vertex)).collect();
    System::new(vec![term], &pinned).unwrap()
}

/// Steps of changing size; returns the bits of all energies and forces.
fn steps(system: &mut System, numbers: std::ops::Range<usize>) -> Vec<u64> {
    let still = vec![[0.0; 3]; LINKS + 1];
    let mut bits = Vec::new();
    for step in numbers {
        let x = positions(step);
        let dt = if step.is_multiple_of(2) { 0.1 } else { 0.25 };
        let state = State { x: &x, v: &still };
        system.begin_step(StepStart { time: 0.0, dt, state }).unwrap();
        let force = system.forces(state).unwrap();
        bits.push(system.energies(&x).unwrap()[0].energy.unwrap().to_bits());
        bits.extend(force.as_flattened().iter().map(|number| number.to_bits()));
        system.end_step(state).unwrap();
    }
    bits
}

/// The sum over plain elements, each advanced by hand.
#[test]
fn states_advance_at_the_end_of_each_step() {
    let mut elements: Vec<Creeping<f64>> = (0..LINKS).map(creeping).collect();
    let mut system = chain(false);
    let energies: Vec<f64> =
        steps(&mut system, 0..4).chunks(1 + 3 * (LINKS + 1)).map(|s| f64::from_bits(s[0])).collect();
    for (step, found) in energies.into_iter().enumerate() {
        let (x, mut sum) = (positions(step), 0.0);
        for (link, element) in elements.iter_mut().enumerate() {
            element.set_time_step(if step.is_multiple_of(2) { 0.1 } else { 0.25 });
            let points = [x[link], x[link + 1]];
            if ![[0, 1], [1, 2]].contains(&[link, link + 1]) {
                sum += energy_dsl::Potential::value(element, &points).value;
            }
            let u: [f64; 6] = std::array::from_fn(|i| points[i / 3][i % 3]);
            let next = element.next(&u).state;
            element.set_state(&next);
        }
        assert!((sum - found).abs() < 1e-12 * sum, "step {step}: {sum} {found}");
    }
    assert!(elements.iter().any(|element| element.state()[0] > 1.05));
    assert!((elements[0].state()[1] - 0.7).abs() < 1e-15, "the time steps add up");
}

#[test]
fn elements_that_are_read_advance_with_the_same_bits() {
    let [generated, read] = [false, true].map(|read| steps(&mut chain(read), 0..5));
    assert!(generated == read);
}

#[test]
fn a_restored_history_continues_with_the_same_bits() {
    for read in [false, true] {
        let (mut whole, mut first) = (chain(read), chain(read));
        steps(&mut whole, 0..3);
        steps(&mut first, 0..3);
        let history = first.histories();
        let mut second = chain(read);
        second.restore_histories(&history);
        assert!(steps(&mut whole, 3..6) == steps(&mut second, 3..6));
        assert!(steps(&mut chain(read), 3..6) != steps(&mut second, 3..6));
    }
}
