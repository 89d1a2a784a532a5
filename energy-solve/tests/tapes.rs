//! Terms of elements that are read at run time do what terms of generated elements do, with the same bits: on several
//! threads, with pinned vertices, projected Hessians, constant blocks and degenerate elements.

use energy_compiler::Interpreted;
use energy_dsl::tape::Column;
use energy_dsl::{Block, Element, PackedPotential, Vector3};
use energy_elements::{Gravity, QuadraticHinge, StVK, ZeroLengthSpring};
use energy_solve::{
    Character, Counts, Curvature, ElementList, LinearisationOptions, Order, OwnLaw, OwnResults, OwnTerm, PotentialTerm,
    State, SteeredTapeTerm, SteeredTapes, Storage, System, TapeTerm, Term, Weights,
};

/// Cells per side: enough vertices for three threads.
const CELLS: usize = 140;

/// A list of elements, with the numbers that they are made from.
struct List<E, const N: usize> {
    name: &'static str,
    elements: Vec<E>,
    stencils: Vec<[usize; N]>,
    rest: Vec<Vec<f64>>,
    parameters: Vec<Vec<f64>>,
}

impl<E: PackedPotential<f64> + Element + std::fmt::Debug + Send + Sync + 'static, const N: usize> List<E, N> {
    fn compiled(self) -> Box<dyn Term> {
        Box::new(PotentialTerm::<E>::new(ElementList::new(self.name, self.elements, &self.stencils).unwrap()))
    }

    fn read(self) -> Box<dyn Term> {
        let element = Interpreted::from_source(&E::DECLARATION.source).unwrap().pop().unwrap();
        let [rest, parameters] = [&self.rest, &self.parameters]
            .map(|list| list.iter().map(|numbers| Column::Each(numbers)).collect::<Vec<_>>());
        let elements = element.elements(self.elements.len(), &rest, &parameters).unwrap();
        let vertices = self.stencils.into_iter().flatten();
        Box::new(TapeTerm::new(self.name.into(), element.declaration(), elements.tape().clone(), vertices))
    }

    fn term(self, read: bool) -> Box<dyn Term> {
        if read { self.read() } else { self.compiled() }
    }
}

/// A crumpled sheet with pinned vertices and a triangle without area.
fn sheet(read: bool) -> (System, Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let vertex = |i: usize, j: usize| j * (CELLS + 1) + i;
    let (mut triangles, mut hinges) = (Vec::new(), Vec::new());
    for (i, j) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (i, j))) {
        let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
        hinges.push([b, d, a, c]);
    }
    // Elements should not be in the order of the vertices.
    triangles.reverse();
    let u: Vec<[f64; 2]> =
        (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| [i as f64, j as f64].map(|k| k / CELLS as f64))).collect();
    let fold = |x: f64| 2e-3 * (97.0 * x).sin();
    let mut x: Vec<Vector3<f64>> = u.iter().map(|&[u, v]| [u + fold(v), v - fold(u), fold(u + 2.0 * v)]).collect();
    let v = u.iter().map(|&[u, v]| [v, u * v, (31.0 * u).cos()]).collect();
    let last = x.len() - 1;
    x[last] = x[last - 1];
    let corner = |which: usize| triangles.iter().flat_map(|t| u[t[which]]).collect::<Vec<f64>>();
    let membrane = List {
        name: "membrane",
        elements: triangles.iter().map(|t| StVK::new(u[t[0]], u[t[1]], u[t[2]], 40.0, 50.0).unwrap()).collect(),
        rest: vec![corner(0), corner(1), corner(2)],
        parameters: vec![vec![40.0; triangles.len()], vec![50.0; triangles.len()]],
        stencils: triangles,
    };
    let bending = List {
        name: "bending",
        elements: hinges.iter().map(|_| QuadraticHinge::new(1e-5, 0.1)).collect::<Vec<_>>(),
        rest: Vec::new(),
        parameters: vec![vec![1e-5; hinges.len()], vec![0.1; hinges.len()]],
        stencils: hinges.clone(),
    };
    let links = List {
        name: "links",
        elements: hinges.iter().map(|_| ZeroLengthSpring::new(0.5, 0.0)).collect::<Vec<_>>(),
        rest: Vec::new(),
        parameters: vec![vec![0.5; hinges.len()], vec![0.0; hinges.len()]],
        stencils: hinges.iter().map(|hinge| [hinge[0], hinge[1]]).collect(),
    };
    let points: Vec<[usize; 1]> = (0..u.len()).map(|point| [point]).collect();
    let gravity = List {
        name: "gravity",
        elements: points.iter().map(|_| Gravity::new(1e-3, [0.0, 0.0, -9.81])).collect::<Vec<_>>(),
        rest: Vec::new(),
        parameters: vec![vec![1e-3; points.len()], [0.0, 0.0, -9.81].repeat(points.len())],
        stencils: points,
    };
    let terms = vec![membrane.term(read), bending.term(read), links.term(read), gravity.term(read)];
    let pinned: Vec<bool> = (0..u.len()).map(|vertex| vertex % 11 == 0 || vertex < 200).collect();
    (System::new(terms, &pinned).unwrap(), x, v)
}

#[derive(Debug, PartialEq)]
struct Sums {
    energies: Vec<Option<u64>>,
    elements: Vec<(usize, f64)>,
    forces: Vec<Vector3<f64>>,
    linear: Vec<Vector3<f64>>,
    product: Vec<Vector3<f64>>,
    blocks: Vec<Block<f64>>,
    counts: Vec<Counts>,
}

/// Returns the sums of a sheet, or of the system restricted to some of its vertices.
fn sums(read: bool, threads: usize, curvature: Curvature, is_restricted: bool) -> Sums {
    let (mut system, x, v) = sheet(read);
    system.set_threads(threads);
    if is_restricted {
        let chosen: Vec<bool> = (0..x.len()).map(|vertex| vertex % 7 < 3 || vertex > 9000).collect();
        system = system.restricted(&chosen).unwrap();
    }
    let state = State { x: &x, v: &v };
    let energies = system.energies(&x).unwrap().into_iter().map(|term| term.energy.map(f64::to_bits)).collect();
    let elements = system.terms().next().and_then(|(term, _)| term.element_energies(&x)).unwrap_or_default();
    let forces = system.forces(state).unwrap();
    let mut matrix = system.matrix();
    let weights = Weights { position: -1e-4, velocity: -1e-2 };
    let options = LinearisationOptions::new(weights, curvature).with_stiffness_times_velocity(true);
    let product = system.linearise(state, options, &mut matrix).unwrap().stiffness_times_velocity;
    let options = options.with_stiffness_times_velocity(false);
    let linear = system.linearise(state, options, &mut matrix).unwrap().force;
    let counts = system.terms().map(|(_, counts)| counts).collect();
    Sums { energies, elements, forces, linear, product, blocks: matrix.values().to_vec(), counts }
}

#[test]
fn terms_that_are_read_have_the_bits_of_compiled_ones() {
    for (threads, curvature) in [(1, Curvature::Clamped), (3, Curvature::Clamped), (2, Curvature::Exact)] {
        let [compiled, read] = [false, true].map(|read| sums(read, threads, curvature, false));
        assert_eq!(compiled.counts, read.counts, "{threads} threads, {curvature:?}");
        assert!(compiled == read, "{threads} threads, {curvature:?}");
        let (membrane, bending) = (&compiled.counts[0], &compiled.counts[1]);
        assert!(bending.hessian.flagged > 0 && membrane.hessian.skipped > 0, "{bending:?}, {membrane:?}");
        assert_eq!(membrane.hessian.projected > 100, curvature == Curvature::Clamped, "{membrane:?}");
    }
}

#[test]
fn restricted_terms_that_are_read_have_the_bits_of_compiled_ones() {
    for (threads, curvature) in [(1, Curvature::Clamped), (3, Curvature::Clamped), (2, Curvature::Exact)] {
        let [compiled, read] = [false, true].map(|read| sums(read, threads, curvature, true));
        assert!(compiled == read, "{threads} threads, {curvature:?}");
        let one = sums(true, 1, curvature, true);
        assert!(one == read, "{threads} threads, {curvature:?}");
        let evaluated = |sums: &Sums| sums.counts[0].hessian.evaluated;
        assert!(evaluated(&read) < evaluated(&self::sums(true, 1, curvature, false)));
    }
}

/// Zero-length springs, evaluated by a function of the caller.
#[derive(Debug)]
struct OwnSprings(Vec<f64>);

impl OwnLaw for OwnSprings {
    fn declaration(&self) -> &'static energy_dsl::Declaration {
        <ZeroLengthSpring as Element>::DECLARATION
    }

    fn points(&self) -> usize {
        2
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: true, curved: true }
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn evaluate(&self, order: Order, x: &[f64], _v: &[f64], results: &mut OwnResults) {
        for (element, (k, x)) in self.0.iter().zip(x.chunks_exact(6)).enumerate() {
            for axis in 0..3 {
                let d = x[axis] - x[3 + axis];
                results.energies[element] += 0.5 * k * d * d;
                if order >= Order::Force {
                    results.forces[6 * element + axis] = -k * d;
                    results.forces[6 * element + 3 + axis] = k * d;
                }
                if order == Order::Jacobians {
                    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        let entry = 36 * element + 6 * (3 * i + axis) + 3 * j + axis;
                        results.by_position[entry] = if i == j { -k } else { *k };
                    }
                }
            }
        }
    }
}

/// Energy, force, and the whole matrix.
type Summed = (f64, Vec<Vector3<f64>>, Vec<(usize, usize, f64)>);

/// The sum of a term over five vertices, the second of them pinned.
fn summed(term: Box<dyn Term>, curvature: Curvature) -> Summed {
    let x: Vec<Vector3<f64>> = (0..5).map(|i| [0.3 * f64::from(i), f64::from(i * i), 0.1]).collect();
    let v = vec![[0.0; 3]; 5];
    let mut system = System::new(vec![term], &[false, true, false, false, false]).unwrap();
    let mut matrix = system.matrix();
    let weights = Weights { position: -1.0, velocity: 0.0 };
    let options = LinearisationOptions::new(weights, curvature);
    let force = system.linearise(State { x: &x, v: &v }, options, &mut matrix).unwrap().force;
    let energy = system.energies(&x).unwrap()[0].energy.unwrap();
    (energy, force, matrix.to_triplets(Storage::Whole))
}

#[test]
fn own_laws_and_steered_tapes_sum_as_declared_elements_do() {
    let stencils: [[usize; 2]; 4] = [[0, 1], [1, 2], [2, 4], [4, 0]];
    let vertices: Vec<u32> = stencils.concat().iter().map(|&vertex| vertex as u32).collect();
    let stiffness = vec![1.0, 2.0, 3.0, 4.0];
    let list = |stiffness: &[f64]| {
        let springs = stiffness.iter().map(|&k| ZeroLengthSpring::new(k, 0.0)).collect();
        Box::new(PotentialTerm::new(ElementList::new("springs", springs, &stencils).unwrap()))
    };
    let own = OwnTerm::new("own".to_owned(), OwnSprings(stiffness.clone()), vertices);
    let text = "energy S(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
    let element = Interpreted::from_source(text).unwrap().remove(0);
    let bound = |stiffness: &[f64]| element.elements(4, &[], &[Column::Each(stiffness)]).unwrap().tape().clone();
    let tapes = SteeredTapes::new(bound(&[9.0; 4]));
    let vertices = stencils.concat();
    let steered = SteeredTapeTerm::new("steered".to_owned(), element.declaration(), tapes.clone(), vertices);
    let expected = summed(list(&stiffness), Curvature::Clamped);
    // New parameters reach a term that is placed after the change at once, and others at the start of a step.
    tapes.replace(bound(&stiffness));
    for (found, name) in
        [(summed(Box::new(own), Curvature::Clamped), "own"), (summed(Box::new(steered), Curvature::Clamped), "steered")]
    {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
        assert!(close(found.0, expected.0), "{name}: {} J", found.0);
        let free = [0, 2, 3, 4];
        assert!(free.iter().all(|&i| (0..3).all(|a| close(found.1[i][a], expected.1[i][a]))), "{name}");
        let entry =
            |list: &[(usize, usize, f64)], at| list.iter().filter(|e| (e.0, e.1) == at).map(|e| e.2).sum::<f64>();
        for &(row, column, _) in expected.2.iter().chain(&found.2) {
            let at = (row, column);
            assert!(close(entry(&found.2, at), entry(&expected.2, at)), "{name} at {at:?}");
        }
    }
}

#[test]
fn hessians_of_own_laws_are_projected() {
    let vertices: Vec<u32> = vec![0, 1, 1, 2, 2, 4, 4, 0];
    let of = |stiffness: [f64; 4], curvature: Curvature| {
        let own = OwnTerm::new("own".to_owned(), OwnSprings(stiffness.to_vec()), vertices.clone());
        summed(Box::new(own), curvature).2
    };
    let total = |list: &[(usize, usize, f64)], at: (usize, usize)| -> f64 {
        list.iter().filter(|e| (e.0, e.1) == at).map(|e| e.2).sum()
    };
    // Two of the springs push. Absolute eigenvalues turn them into springs that pull; clamped ones leave them out.
    let mixed = [1.0, -2.0, 3.0, -4.0];
    for (curvature, equal) in [
        (Curvature::Absolute, [1.0, 2.0, 3.0, 4.0]),
        (Curvature::Clamped, [1.0, 0.0, 3.0, 0.0]),
        (Curvature::Exact, mixed),
    ] {
        let (found, expected) = (of(mixed, curvature), of(equal, Curvature::Exact));
        for at in (0..12).flat_map(|row| (0..12).map(move |column| (row, column))) {
            let [found, expected] = [total(&found, at), total(&expected, at)];
            assert!((found - expected).abs() < 1e-13, "{curvature:?}, entry {at:?}: {found}, expected {expected}");
        }
    }
}
