//! Contacts in over-relaxation and multigrid: the same solution as a factorisation that has them in its pattern.

use std::sync::Arc;

use energy_dsl::{Block, Vector3};
use energy_solve::{
    BlockCholesky, BlockMatrix, Contact, Multigrid, OverRelaxation, Pattern, SolveOptions, SolveReport, Storage,
};

/// Rows of a chain whose neighbours are coupled.
fn chain(rows: u32, contacts: &[Contact]) -> BlockMatrix {
    let links: Vec<[u32; 2]> = (1..rows).map(|row| [row - 1, row]).collect();
    let together: Vec<Vec<u32>> = contacts.iter().map(free).collect();
    let stencils = links.iter().map(|link| &link[..]).chain(together.iter().map(Vec::as_slice)).collect::<Vec<_>>();
    let pattern = Arc::new(Pattern::from_stencils(Storage::Upper, rows as usize, stencils));
    let mut matrix = BlockMatrix::zeros(pattern);
    for &[a, b] in &links {
        let link = [[3.0, 0.2, 0.1], [0.2, 2.0, 0.0], [0.1, 0.0, 1.0 + 0.5 * f64::from(a % 7)]];
        add(&mut matrix, a, a, 1.0, &link);
        add(&mut matrix, b, b, 1.0, &link);
        add(&mut matrix, a, b, -1.0, &link);
    }
    (0..rows).for_each(|row| add(&mut matrix, row, row, 0.1, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]));
    matrix
}

fn free(contact: &Contact) -> Vec<u32> {
    contact.rows.iter().copied().filter(|&row| row != Contact::FIXED).collect()
}

fn add(matrix: &mut BlockMatrix, row: u32, column: u32, scale: f64, block: &Block<f64>) {
    let (slot, _) = matrix.pattern().slot(row as usize, column as usize).unwrap();
    for i in 0..3 {
        for j in 0..3 {
            matrix.values_mut()[slot][i][j] += scale * block[i][j];
        }
    }
}

/// Contacts between rows far from each other: along a normal, with friction, and with pinned vertices.
fn contacts(rows: u32, count: u32) -> Vec<Contact> {
    let contact = |number: u32| {
        let first = 37 * number % (rows / 2);
        let second = rows / 2 + 53 * number % (rows / 2 - 2);
        let angle = f64::from(number);
        let n = [angle.cos(), angle.sin() * 0.6, angle.sin() * 0.8];
        let t = [-angle.sin(), angle.cos() * 0.6, angle.cos() * 0.8];
        let tangential = if number.is_multiple_of(3) { 4.0 } else { 0.0 };
        let block = std::array::from_fn(|i| std::array::from_fn(|j| 20.0 * n[i] * n[j] + tangential * t[i] * t[j]));
        let third = if number.is_multiple_of(5) { Contact::FIXED } else { second + 2 };
        Contact { rows: [first, second, second + 1, third], weights: [1.0, -0.5, -0.2, -0.3], block }
    };
    (0..count).map(contact).collect()
}

fn right_hand_side(rows: u32) -> Vec<Vector3<f64>> {
    (0..rows).map(|row| [1.0, f64::from(row).sin(), f64::from(row % 11)]).collect()
}

fn solve(rows: u32, contacts: &[Contact], threads: usize, tolerance: f64) -> (Vec<Vector3<f64>>, SolveReport) {
    let mut matrix = chain(rows, &[]);
    let mut solver = OverRelaxation::<f64>::with_threads(matrix.pattern(), threads);
    let added = matrix.add_contacts(&[contacts.to_vec()], 1.0, threads);
    solver.scale_with(&matrix, &added.cross).unwrap();
    let mut x = vec![[0.0; 3]; rows as usize];
    let options = SolveOptions::new(tolerance);
    let report = solver.solve(&right_hand_side(rows), &mut x, &options);
    assert!(report.converged(), "{report:?}");
    (x, report)
}

fn solve_by_multigrid(rows: u32, contacts: &[Contact], threads: usize) -> (Vec<Vector3<f64>>, SolveReport) {
    let mut matrix = chain(rows, &[]);
    let mut solver = Multigrid::<f64>::with_threads(matrix.pattern(), threads);
    let added = matrix.add_contacts(&[contacts.to_vec()], 1.0, threads);
    solver.take_over_with(&matrix, &added.cross).unwrap();
    let mut x = vec![[0.0; 3]; rows as usize];
    let report = solver.solve(&right_hand_side(rows), &mut x, &SolveOptions::new(1e-12));
    assert!(report.converged(), "{report:?}");
    (x, report)
}

fn expected(rows: u32, contacts: &[Contact]) -> Vec<Vector3<f64>> {
    let mut matrix = chain(rows, contacts);
    for contact in contacts {
        for (&row, weight) in contact.rows.iter().zip(contact.weights) {
            for (&column, other) in contact.rows.iter().zip(contact.weights) {
                if row <= column && row != Contact::FIXED && column != Contact::FIXED {
                    add(&mut matrix, row, column, weight * other, &contact.block);
                }
            }
        }
    }
    let mut solver = BlockCholesky::new(matrix.pattern()).unwrap();
    solver.factor(&matrix).unwrap();
    let mut x = vec![[0.0; 3]; rows as usize];
    solver.solve(&right_hand_side(rows), &mut x);
    x
}

fn assert_equal(found: &[Vector3<f64>], expected: &[Vector3<f64>]) {
    let largest = expected.iter().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-9 * largest, "{found} {expected}");
    }
}

#[test]
fn contacts_are_part_of_the_sum() {
    let contacts = contacts(120, 40);
    let (found, _) = solve(120, &contacts, 1, 1e-12);
    assert_equal(&found, &expected(120, &contacts));
    // Without contacts the solution differs, and a solver forgets them.
    let mut matrix = chain(120, &[]);
    let mut solver = OverRelaxation::<f64>::new(matrix.pattern());
    let added = matrix.add_contacts(&[contacts], 1.0, 1);
    solver.scale_with(&matrix, &added.cross).unwrap();
    matrix.remove_contacts(added);
    solver.scale(&matrix).unwrap();
    let mut x = vec![[0.0; 3]; 120];
    let options = SolveOptions::new(1e-12);
    assert!(solver.solve(&right_hand_side(120), &mut x, &options).converged());
    assert_equal(&x, &expected(120, &[]));
    assert!((x[5][0] - found[5][0]).abs() > 1e-3 * found[5][0].abs());
}

#[test]
fn multigrid_takes_contacts_and_forgets_them() {
    for stiffness in [1.0, 1e4] {
        let contacts: Vec<_> = contacts(120, 40).into_iter().map(|contact| stiffer(contact, stiffness)).collect();
        let (found, _) = solve_by_multigrid(120, &contacts, 1);
        assert_equal(&found, &expected(120, &contacts));
    }
    let mut matrix = chain(120, &[]);
    let mut solver = Multigrid::<f64>::new(matrix.pattern());
    let added = matrix.add_contacts(&[contacts(120, 40)], 1.0, 1);
    solver.take_over_with(&matrix, &added.cross).unwrap();
    matrix.remove_contacts(added);
    solver.take_over(&matrix).unwrap();
    let mut x = vec![[0.0; 3]; 120];
    assert!(solver.solve(&right_hand_side(120), &mut x, &SolveOptions::new(1e-12)).converged());
    assert_equal(&x, &expected(120, &[]));
}

fn stiffer(contact: Contact, factor: f64) -> Contact {
    Contact { block: contact.block.map(|row| row.map(|entry| factor * entry)), ..contact }
}

/// Enough rows for two domains, so that contacts act between them.
#[test]
fn contacts_between_domains_are_bit_identical_on_any_number_of_threads() {
    const ROWS: u32 = 16_500;
    let contacts = contacts(ROWS, 2_000);
    let (one, report) = solve(ROWS, &contacts, 1, 1e-11);
    for threads in [2, 3] {
        let (many, again) = solve(ROWS, &contacts, threads, 1e-11);
        assert!(one == many && report == again, "{threads} threads");
    }
    assert_equal(&one, &expected(ROWS, &contacts));
    let (one, report) = solve_by_multigrid(ROWS, &contacts, 1);
    let (many, again) = solve_by_multigrid(ROWS, &contacts, 3);
    assert!(one == many && report == again);
    assert_equal(&one, &expected(ROWS, &contacts));
}
