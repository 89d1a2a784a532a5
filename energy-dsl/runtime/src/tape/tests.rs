//! Tapes of an element that is written by hand.

use std::ops::Range;
use std::sync::Arc;

use super::*;
use crate::batch::BatchError;
use crate::routine::RoutineKind;

/// Numbers of points, in two points.
const COORDINATES: usize = 6;
/// Results of the force: more than are transposed together.
const RESULTS: usize = 11;
/// Enough elements for three blocks, of which the last is not full.
const COUNT: usize = 150;

fn instruction(operation: Operation, target: u16, operands: &[u16]) -> Instruction {
    let mut all = [0; 6];
    all[..operands.len()].copy_from_slice(operands);
    Instruction { operation, target, operands: all }
}

/// Result r is coordinate r mod 6 times parameter 0 plus the stored number, which is rest number 0 times parameter 1.
/// Shapes with a rest number of at most 0 are degenerate, as are elements with coordinate 0 below 0; those with
/// coordinate 1 below 0 are at a kink.
fn routines() -> Arc<Routines> {
    let rest = Routine {
        kind: RoutineKind::Rest,
        inputs: vec![Input::Rest(0), Input::Parameter(1)],
        tape: Tape {
            slots: 4,
            masks: 1,
            constants: vec![(2, Constant::Number(0.0))],
            truths: Vec::new(),
            instructions: vec![
                instruction(Operation::Mul, 3, &[0, 1]),
                instruction(Operation::LessOrEqual, 0, &[0, 2]),
            ],
        },
        groups: vec![vec![3]],
        flags: [Some(0), None],
        general: None,
    };
    let positions = (0..COORDINATES as u16).map(Input::Position);
    let (parameter, stored, zero) = (6, 7, 8);
    let first = 9;
    // The last result is coordinate 5 where coordinate 0 is below 0, and coordinate 1 elsewhere.
    let last = first + RESULTS as u16 - 1;
    let chosen = instruction(Operation::Select, last, &[0, 5, 1]);
    let result = |result: u16| instruction(Operation::MulAdd, first + result, &[result % 6, parameter, stored]);
    let flags = [0, 1].map(|flag| instruction(Operation::Less, flag, &[flag, zero]));
    let force = Routine {
        kind: RoutineKind::Force,
        inputs: positions.chain([Input::Parameter(0), Input::Precomputed(0)]).collect(),
        tape: Tape {
            slots: usize::from(first) + RESULTS,
            masks: 2,
            constants: vec![(zero, Constant::Number(0.0))],
            truths: Vec::new(),
            instructions: (0..RESULTS as u16).map(result).chain(flags).chain([chosen]).collect(),
        },
        groups: vec![(first..first + RESULTS as u16).collect()],
        flags: [Some(0), Some(1)],
        general: None,
    };
    let (expansion, repetition) = (None, None);
    let name = "Test".to_owned();
    Arc::new(Routines {
        name,
        coordinates: COORDINATES,
        increments: COORDINATES,
        parameters: 2,
        shape: 1,
        rest,
        at_rest: None,
        list: vec![force],
        expansion,
        repetition,
    })
}

/// Returns parameter 0 of an element.
fn parameter(element: usize) -> f64 {
    2.0 + element as f64
}

/// Returns the rest number of an element.
fn rest(element: usize) -> f64 {
    0.5 + (element % 7) as f64
}

fn elements() -> TapeElements {
    let (parameters, rests): (Vec<f64>, Vec<f64>) =
        (0..COUNT).map(|element| (parameter(element), rest(element))).unzip();
    let columns = [(Column::Each(&parameters[..]), 1), (Column::Same(&[8.0][..]), 1)];
    TapeElements::new(routines(), COUNT, &[(Column::Each(&rests), 1)], &columns).unwrap()
}

/// Returns the coordinates of an element: small whole numbers.
fn coordinates(element: usize) -> [f64; COORDINATES] {
    std::array::from_fn(|number| ((31 * element + 17 * number) % 101) as f64 - 3.0)
}

/// Returns the results of an element with the number of another one.
fn expected(number: usize, x: [f64; COORDINATES]) -> [f64; RESULTS] {
    let chosen = if x[0] < 0.0 { x[5] } else { x[1] };
    let product = |result: usize| x[result % 6] * parameter(number) + 8.0 * rest(number);
    std::array::from_fn(|result| if result == RESULTS - 1 { chosen } else { product(result) })
}

/// Numbers that differed become shared and the other way round, in full blocks and in the last one.
#[test]
fn replaced_parameters_are_read() {
    let mut elements = elements();
    let result = |elements: &TapeElements| {
        let rows: Vec<f64> = (0..COUNT).flat_map(coordinates).collect();
        let mut numbers = vec![0.0; COUNT];
        let output = Output { name: "numbers", layout: &[0], numbers: &mut numbers };
        elements.evaluate(RoutineKind::Force, 0..COUNT, Places::Rows(&rows), None, &mut [output]).unwrap();
        numbers
    };
    let wanted = |parameter: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..COUNT).map(|element| coordinates(element)[0] * parameter(element) + 8.0 * rest(element)).collect()
    };
    let backwards = |element: usize| parameter(COUNT - element);
    assert_eq!(result(&elements), wanted(&parameter));
    elements.set_parameters(0, 1, Column::Each(&(0..COUNT).map(backwards).collect::<Vec<_>>()));
    assert_eq!(result(&elements), wanted(&backwards));
    elements.set_parameters(0, 1, Column::Same(&[3.0]));
    assert_eq!(result(&elements), wanted(&|_| 3.0));
    let both: Vec<f64> = (0..COUNT).flat_map(|element| [parameter(element), backwards(element)]).collect();
    elements.set_parameters(0, 2, Column::Each(&both));
    assert_eq!(result(&elements), wanted(&parameter));
    assert_eq!(elements.numbers_of(COUNT - 1)[..2], [parameter(COUNT - 1), backwards(COUNT - 1)]);
}

const RANGES: [Range<usize>; 5] = [0..COUNT, 0..64, 64..128, 128..COUNT, 64..67];

#[test]
fn outputs_hold_the_chosen_results() {
    let elements = elements();
    let layouts: [Vec<u16>; 4] = [(0..RESULTS as u16).collect(), vec![3], vec![5, 1], (0..8).rev().collect()];
    let vectors: Vec<[f64; 3]> = (0..COUNT).flat_map(|element| coordinates(element).as_chunks().0.to_vec()).collect();
    let stencils = stencil_blocks(COUNT, 2, |element, point| (2 * element + point) as u32);
    for range in RANGES {
        let rows: Vec<f64> = range.clone().flat_map(coordinates).collect();
        for places in [Places::Rows(&rows), Places::Gathered { vectors: &vectors, stencils: &stencils }] {
            let mut numbers: Vec<Vec<f64>> =
                layouts.iter().map(|layout| vec![0.0; range.len() * layout.len()]).collect();
            let outputs = numbers.iter_mut().zip(&layouts);
            let outputs = outputs.map(|(numbers, layout)| Output { name: "numbers", layout, numbers });
            let mut outputs: Vec<_> = outputs.collect();
            let flagged = elements.evaluate(RoutineKind::Force, range.clone(), places, None, &mut outputs).unwrap();
            for (numbers, layout) in numbers.iter().zip(&layouts) {
                for (row, element) in numbers.chunks(layout.len()).zip(range.clone()) {
                    let all = expected(element, coordinates(element));
                    assert!(row.iter().zip(layout).all(|(&found, &result)| found == all[usize::from(result)]));
                }
            }
            let flags = |element: usize| [0, 1].map(|number| coordinates(element)[number] < 0.0);
            let wanted =
                range.clone().map(|element| (element, flags(element))).filter(|(_, flags)| *flags != [false; 2]);
            let found = flagged.into_iter().map(|(element, flags)| (element, [flags.degenerate, flags.kink]));
            assert!(found.eq(wanted));
        }
    }
}

#[test]
fn elements_keep_their_numbers() {
    let elements = elements();
    let numbers = |element: usize| vec![parameter(element), 8.0, 8.0 * rest(element)];
    assert!((0..COUNT).all(|element| elements.numbers_of(element) == numbers(element)));
    let some: Vec<usize> = (0..COUNT).rev().step_by(2).collect();
    let selected = elements.selected(&some);
    assert_eq!((selected.len(), selected.is_empty(), elements.selected(&[]).is_empty()), (75, false, true));
    assert!(some.iter().enumerate().all(|(place, &element)| selected.numbers_of(place) == numbers(element)));
    let one = |elements: &TapeElements, x: [f64; COORDINATES]| elements.one(RoutineKind::Force, Places::Rows(&x), None);
    assert_eq!(one(&elements, coordinates(9)), (vec![expected(0, coordinates(9)).to_vec()], [false; 2]));
    let below = [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    assert_eq!(one(&selected, below), (vec![expected(COUNT - 1, below).to_vec()], [true, false]));
}

#[test]
fn general_paths_replace_the_results_that_need_them() {
    let mut routines = Arc::unwrap_or_clone(routines());
    let force = &mut routines.list[0];
    // If coordinate 2 is 0, all results are 2 times coordinate 3, and coordinate 4 below 0 is out of the domain.
    force.tape.masks = 4;
    force.tape.instructions.extend([instruction(Operation::Equal, 2, &[2, 8]), instruction(Operation::Not, 3, &[2])]);
    let double = Tape {
        slots: 4,
        masks: 1,
        constants: vec![(2, Constant::Number(0.0))],
        truths: Vec::new(),
        instructions: vec![instruction(Operation::Add, 3, &[0, 0]), instruction(Operation::Less, 0, &[1, 2])],
    };
    force.general = Some(General {
        ordinary: 3,
        inputs: vec![3, 4],
        path: GeneralPath {
            moves: vec![true; 2],
            groups: vec![RESULTS],
            values_first: false,
            is_energy: false,
            tape: double,
            results: vec![3; RESULTS],
            flags: [None; 2],
            settled: [Some(0), None],
            outside: None,
            summed: RESULTS,
        },
    });
    let same = [(Column::Same(&[2.0, 8.0][..]), 2)];
    let elements = TapeElements::new(Arc::new(routines), COUNT, &[(Column::Same(&[0.5]), 1)], &same).unwrap();
    let is_general = |element: usize| element % 50 == 7;
    let coordinates = |element: usize| {
        let mut x = coordinates(element).map(|x| x.abs() + 1.0);
        x[2] = if is_general(element) { 0.0 } else { x[2] };
        x[4] = if element >= 100 { -x[4] } else { x[4] };
        x
    };
    let rows: Vec<f64> = (0..COUNT).flat_map(coordinates).collect();
    let layout: Vec<u16> = (0..RESULTS as u16).collect();
    let mut numbers = vec![0.0; COUNT * RESULTS];
    let mut outputs = [Output { name: "forces", layout: &layout, numbers: &mut numbers }];
    let flagged = elements.evaluate(RoutineKind::Force, 0..COUNT, Places::Rows(&rows), None, &mut outputs).unwrap();
    for (element, row) in numbers.chunks(RESULTS).enumerate() {
        let expected = match (is_general(element), coordinates(element)) {
            (false, x) => std::array::from_fn(|at| if at == RESULTS - 1 { x[1] } else { 2.0 * x[at % 6] + 4.0 }),
            (true, x) => [if x[4] < 0.0 { 0.0 } else { 2.0 * x[3] }; RESULTS],
        };
        assert_eq!(row, expected, "element {element}");
    }
    let flagged: Vec<usize> = flagged.into_iter().map(|(element, _)| element).collect();
    assert_eq!(flagged, [107]);
}

#[test]
fn the_first_degenerate_shape_is_named() {
    let made = |rests: &[f64], factor: f64| {
        let columns = [(Column::Same(&[1.0][..]), 1), (Column::Same(std::slice::from_ref(&factor)), 1)];
        TapeElements::new(routines(), COUNT, &[(Column::Each(rests), 1)], &columns).map_err(|(element, error)| {
            assert_eq!(error.element, "Test");
            element
        })
    };
    for wrong in [0, 1, 63, 64, 65, COUNT - 1] {
        for (value, factor) in [(0.0, 8.0), (-1.0, 8.0), (1e300, 1e10), (f64::NAN, 8.0)] {
            let mut rests = vec![1.0; COUNT];
            rests[wrong..].fill(value);
            assert_eq!(made(&rests, factor).err(), Some(wrong), "{value}");
        }
    }
    assert!(made(&[1.0; COUNT], 1e10).is_ok());
    let same = [(Column::Same(&[1.0, 2.0][..]), 2)];
    let shared = TapeElements::new(routines(), COUNT, &[(Column::Same(&[3.0]), 1)], &same).unwrap();
    assert_eq!(shared.numbers_of(COUNT - 1), [1.0, 2.0, 6.0]);
    let error = TapeElements::new(routines(), COUNT, &[(Column::Same(&[0.0]), 1)], &same).unwrap_err();
    assert_eq!(error.0, 0);
}

#[test]
fn arguments_that_do_not_fit_are_refused() {
    let elements = elements();
    let rows = vec![1.0; COORDINATES * COUNT];
    let evaluate = |range: Range<usize>, rows: &[f64], places: usize| {
        let mut numbers = vec![0.0; places];
        let mut outputs = [Output { name: "forces", layout: &[0, 1], numbers: &mut numbers }];
        elements.evaluate(RoutineKind::Force, range, Places::Rows(rows), None, &mut outputs).map(|_| ())
    };
    assert_eq!(evaluate(0..COUNT, &rows, 2 * COUNT), Ok(()));
    let wrong = |needed, given| Err(BatchError::Output { of: "forces", needed, given });
    assert_eq!(evaluate(0..COUNT, &rows, 2 * COUNT + 1), wrong(2 * COUNT, 2 * COUNT + 1));
    for range in [1..COUNT, 0..COUNT + 1, Range { start: 64, end: 0 }] {
        let expected = BatchError::Range { range: range.clone(), elements: COUNT, block: TAPE_BLOCK };
        assert_eq!(evaluate(range, &rows, 0), Err(expected));
    }
    assert!(matches!(evaluate(0..64, &rows, 128), Err(BatchError::Input { needed: 384, given: 900, .. })));
}
