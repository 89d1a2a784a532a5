//! Exported matrices have the entries of the assembled one.

use energy_dsl::Block;
use energy_solve::{BlockMatrix, Pattern, Precision, Storage};
use nalgebra_sparse::{CooMatrix, CsrMatrix};

const ROWS: usize = 7;

/// A matrix with different numbers everywhere. A symmetric one has symmetric diagonal blocks.
fn matrix<T: Precision>(storage: Storage) -> BlockMatrix<T> {
    let stencils: [&[u32]; 4] = [&[0, 3, 5], &[1, 2], &[2, 6, 0], &[5, 6]];
    let mut matrix = BlockMatrix::zeros(Pattern::from_stencils(storage, ROWS, stencils).into());
    for (slot, block) in matrix.values_mut().iter_mut().enumerate() {
        *block = std::array::from_fn(|i| std::array::from_fn(|j| T::from_f64((9 * slot + 3 * i + j) as f64 + 1.0)));
    }
    for row in 0..ROWS {
        let block = matrix.diagonal_mut(row);
        for i in 0..3 {
            for j in 0..i {
                block[i][j] = block[j][i];
            }
        }
    }
    matrix
}

fn entry<T: Precision>(matrix: &BlockMatrix<T>, row: usize, column: usize) -> f64 {
    let block: Block<f64> = matrix.block(row / 3, column / 3);
    block[row % 3][column % 3]
}

fn check<T: Precision + nalgebra::RealField>(storage: Storage, part: Storage) {
    let (matrix, n) = (matrix::<T>(storage), 3 * ROWS);
    let (triplets, csr, bsr) = (matrix.to_triplets(part), matrix.to_csr(part), matrix.to_bsr(part));
    assert!(csr.rows() == n && bsr.rows() == ROWS && csr.values.len() == triplets.len());
    assert!(triplets.is_sorted_by_key(|&(row, column, _)| (row, column)));
    // nalgebra-sparse checks offsets, ranges and the order of columns.
    let sparse = CsrMatrix::try_from_csr_data(n, n, csr.offsets, csr.columns, csr.values).expect("valid rows");
    let mut sum = CooMatrix::new(n, n);
    triplets.iter().for_each(|&(row, column, value)| sum.push(row, column, value));
    assert_eq!(sum.nnz(), sparse.nnz());
    let mut stored = 0;
    for row in 0..n {
        for column in 0..n {
            let expected = if part == Storage::Upper && column < row { 0.0 } else { entry(&matrix, row, column) };
            let found = sparse.get_entry(row, column).expect("in range").into_value();
            assert_eq!(Into::<f64>::into(found), expected, "({row}, {column})");
            stored += usize::from(expected != 0.0);
        }
    }
    assert_eq!(stored, sparse.nnz());
    for row in 0..ROWS {
        for slot in bsr.offsets[row]..bsr.offsets[row + 1] {
            let column = bsr.columns[slot];
            assert!(part == Storage::Whole || column >= row);
            let found = bsr.blocks[slot].map(|numbers| numbers.map(Into::<f64>::into));
            assert_eq!(found, matrix.block(row, column), "block ({row}, {column})");
        }
    }
}

#[test]
fn every_storage_exports_both_parts() {
    for part in [Storage::Whole, Storage::Upper] {
        check::<f64>(Storage::Upper, part);
        check::<f64>(Storage::Whole, part);
        check::<f32>(Storage::Upper, part);
    }
}
