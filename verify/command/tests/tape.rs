//! Elements that are read at run time have the bits of generated code: on every reference record, at every degenerate
//! input, in blocks and one by one.

use std::path::Path;

use energy_compiler::{InputKind, Interpreted};
use energy_dsl::tape::Column;
use energy_dsl::{AnyElement, Declaration, Inputs, Kind, Outputs};
use verify::sample::{Sample, Sampler};
use verify_command::catalogue;
use verify_command::reference::{Record, mapping};
use verify_command::stress::sweeps;

/// Returns the numbers and flags of all blocks as bits. All NaN are one.
fn bits(outputs: &Outputs<f64>) -> (Vec<u64>, Vec<bool>) {
    let canonical = |x: &f64| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
    let blocks = outputs.blocks.iter().map(|(_, numbers)| numbers);
    let repeats = outputs.repeats.iter().map(|(_, _, numbers)| numbers);
    let flags = outputs.flags.iter().flat_map(|flags| [flags.degenerate, flags.kink]).collect();
    (blocks.chain(repeats).flatten().map(canonical).collect(), flags)
}

fn assert_same(entry: &AnyElement, element: &Interpreted, sample: &Sample) {
    let inputs = sample.inputs();
    let (compiled, tape) = ((entry.evaluate)(&inputs), element.evaluate(&inputs));
    let name = &*entry.declaration.name;
    match (compiled, tape) {
        (Ok(compiled), Ok(tape)) => {
            let ((a, of_a), (b, of_b)) = (bits(&compiled), bits(&tape));
            let place = a.iter().zip(&b).position(|(a, b)| a != b);
            assert!(
                place.is_none() && a.len() == b.len(),
                "{name}, number {place:?}: {:?} and {:?} at {sample:?}",
                place.map(|i| f64::from_bits(a[i])),
                place.map(|i| f64::from_bits(b[i])),
            );
            assert_eq!(of_a, of_b, "{name}: flags at {sample:?}");
        }
        (compiled, tape) => assert_eq!(compiled.err(), tape.err(), "{name}: {sample:?}"),
    }
}

fn element(declaration: &Declaration) -> Interpreted {
    Interpreted::from_source(&declaration.source).expect("it compiles").pop().expect("it declares the element")
}

/// Ordinary inputs, inputs on a lattice, inputs with zeros, coincidences and extreme sizes, and sweeps to every
/// singularity.
fn samples(declaration: &'static Declaration) -> Vec<Sample> {
    let mut sampler = Sampler::new(declaration, 11);
    let mut list: Vec<Sample> = (0..8).map(|_| sampler.sample()).collect();
    list.extend((0..8).map(|_| sampler.lattice_sample()));
    list.extend((0..16).map(|_| sampler.odd_sample()));
    list.extend(sweeps(declaration).into_iter().flat_map(|sweep| sweep.inputs).map(|(_, sample)| sample));
    list
}

#[test]
fn every_element_has_the_bits_of_generated_code() {
    for entry in catalogue::elements() {
        let element = element(entry.declaration);
        for sample in samples(entry.declaration) {
            assert_same(entry, &element, &sample);
        }
    }
}

#[test]
fn every_reference_record_has_the_bits_of_generated_code() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/potentials");
    let mut records = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "json") {
            continue;
        }
        let file: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let Some(mapping) = file["potential"].as_str().and_then(mapping) else { continue };
        let element = element(mapping.entry.declaration);
        for record in file["records"].as_array().unwrap() {
            let record: Record = serde_json::from_value(record.clone()).unwrap();
            assert_same(mapping.entry, &element, &record.sample(&mapping).unwrap());
            records += 1;
        }
    }
    assert!(records > 700, "{records} records");
}

/// Evaluates all samples with sound rest shapes in blocks, where ordinary and degenerate elements are neighbours, and
/// compares with one at a time.
#[test]
fn blocks_have_the_bits_of_single_elements() {
    for entry in
        catalogue::elements().iter().filter(|entry| matches!(entry.declaration.kind, Kind::Energy | Kind::Residual))
    {
        let element = element(entry.declaration);
        let sound = |sample: &Sample| element.check_rest(&sample.inputs()).is_ok();
        let samples: Vec<Sample> = samples(entry.declaration).into_iter().filter(sound).collect();
        let count = samples.len();
        let columns = |kind: InputKind, own: &dyn Fn(&Sample) -> Vec<f64>| {
            let mut first = 0;
            let sizes = element.inputs().iter().filter(move |input| input.kind == kind).map(|input| input.size());
            let column = |size| {
                first += size;
                samples.iter().flat_map(|sample| own(sample)[first - size..first].to_vec()).collect::<Vec<f64>>()
            };
            sizes.map(column).collect::<Vec<_>>()
        };
        let (rest, parameters) =
            (columns(InputKind::Rest, &|s| s.rest.clone()), columns(InputKind::Parameter, &|s| s.parameters.clone()));
        let [rest, parameters] =
            [&rest, &parameters].map(|list| list.iter().map(|numbers| Column::Each(numbers)).collect::<Vec<_>>());
        let elements = element.elements(count, &rest, &parameters).unwrap();
        let x: Vec<f64> = samples.iter().flat_map(|sample| sample.positions.clone()).collect();
        let (n, rows) = (element.coordinates(), entry.declaration.rows);
        let (first, second) = if entry.declaration.kind == Kind::Energy { (1, n * n) } else { (rows, rows * n) };
        let (mut values, mut gradients, mut matrices) =
            (vec![0.0; count * first], vec![0.0; count * n], vec![0.0; count * second]);
        let flagged = match entry.declaration.kind {
            Kind::Energy => elements.hessians(0..count, &x, &mut values, &mut gradients, &mut matrices),
            _ => elements.jacobians(0..count, &x, &mut values, &mut matrices),
        };
        let flagged = flagged.unwrap();
        for (index, sample) in samples.iter().enumerate() {
            let alone = element.evaluate(&sample.inputs()).unwrap();
            let block = |name: &str| &alone.blocks.iter().find(|(other, _)| *other == name).unwrap().1;
            let names =
                if entry.declaration.kind == Kind::Energy { ["energy", "hess"] } else { ["residual", "jacobian"] };
            let same = |a: &[f64], b: &[f64]| {
                a.len() == b.len()
                    && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan())
            };
            let name = &*entry.declaration.name;
            assert!(same(block(names[0]), &values[index * first..][..first]), "{name}: values of {sample:?}");
            assert!(same(block(names[1]), &matrices[index * second..][..second]), "{name}: matrix of {sample:?}");
            let flags = alone.flags[if entry.declaration.kind == Kind::Energy { 2 } else { 1 }];
            let found =
                flagged.iter().find(|(other, _)| *other == index).map(|(_, flags)| (flags.degenerate, flags.kink));
            assert_eq!(found.unwrap_or_default(), (flags.degenerate, flags.kink), "{name}: flags of {sample:?}");
        }
    }
}

/// The first two tests again without fused operations, in a process of their own.
#[test]
fn the_baseline_has_the_bits_of_generated_code() {
    if std::env::var_os("ENERGY_LEVEL").is_some() {
        return;
    }
    let status = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["bits_of_generated_code", "--quiet"])
        .env("ENERGY_LEVEL", "baseline")
        .status();
    assert!(status.unwrap().success());
}

/// Single precision: the library's elements that are compiled for it here.
#[test]
fn single_precision_has_the_bits_of_generated_code() {
    fn compare<E: energy_dsl::Element>() {
        let element = element(E::DECLARATION);
        for sample in samples(E::DECLARATION) {
            let singles = |numbers: &[f64]| numbers.iter().map(|&x| x as f32).collect::<Vec<_>>();
            let [parameters, rest, positions, velocities] =
                [&sample.parameters, &sample.rest, &sample.positions, &sample.velocities].map(|list| singles(list));
            let inputs =
                Inputs { parameters: &parameters, rest: &rest, positions: &positions, velocities: &velocities };
            match (E::evaluate::<f32>(&inputs), element.evaluate(&inputs)) {
                (Ok(compiled), Ok(tape)) => {
                    let numbers = |outputs: Outputs<f32>| {
                        let flags = outputs.flags.map(|flags| (flags.degenerate, flags.kink));
                        let blocks = outputs.blocks.into_iter().flat_map(|(_, numbers)| numbers);
                        let bits = blocks.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() });
                        (bits.collect::<Vec<_>>(), flags)
                    };
                    assert_eq!(numbers(compiled), numbers(tape), "{}: {sample:?}", E::DECLARATION.name);
                }
                (compiled, tape) => assert_eq!(compiled.err(), tape.err(), "{}: {sample:?}", E::DECLARATION.name),
            }
        }
    }
    compare::<energy_elements::Spring<f32>>();
    compare::<energy_elements::QuadraticHinge<f32>>();
    compare::<energy_elements::StVK<f32>>();
    compare::<energy_elements::DistanceBarrier<f32>>();
    compare::<energy_elements::TwistMotion<f32>>();
}
