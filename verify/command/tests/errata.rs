//! Mistakes that the sources print, declared as printed. The audit notices each, by the check that the table in
//! `docs/audit.md` names, and passes the corrected formulas.

use std::panic::catch_unwind;
use std::path::Path;

use energy_dsl::{Declaration, Element, Inputs, Outputs, Real, RestError};
use energy_elements::Spring;
use verify::audit::{Check, Options, Report, Target, audit_all};

fn declared() -> Vec<Target> {
    Target::of_file(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/errata.energy")).unwrap()
}

/// Audits one declaration of the file against an energy of the file or the catalogue.
fn audited(name: &str, energy: Option<&str>) -> Report {
    let all = declared();
    let find = |name: &str| all.iter().find(|target| target.name() == name).cloned();
    let energy = energy.map(|energy| {
        find(energy)
            .unwrap_or_else(|| Target::of_element(verify_command::catalogue::find(energy).expect("a declared energy")))
    });
    let target = find(name).unwrap_or_else(|| panic!("{name} is not in the file"));
    audit_all(&[target], energy.as_ref(), Options { mutations: 0, ..Options::quick() })
}

fn failed(report: &Report) -> Vec<Check> {
    assert!(report.refused.is_empty(), "{:?}", report.refused);
    let mut checks: Vec<Check> = report.failures().map(|line| line.check).collect();
    checks.dedup();
    checks
}

/// Declaration, the energy that its force should derive from, and the check that fails.
const PRINTED: &[(&str, Option<&str>, Check)] = &[
    ("PrintedDotProduct", Some("DotProduct"), Check::MinusGradient),
    ("PrintedDistanceSquare", Some("Distance"), Check::MinusGradient),
    ("PrintedDistancePlain", Some("Distance"), Check::MinusGradient),
    ("PrintedPowerLaw", Some("PowerLaw"), Check::MinusGradient),
    ("PrintedForceIsGradient", Some("HookeSpring"), Check::MinusGradient),
    ("PrintedHooke", Some("HookeSpring"), Check::MinusGradient),
    ("PrintedNormOfSquare", Some("BridsonBending"), Check::MinusGradient),
    ("PrintedUnsignedSine", Some("BridsonBending"), Check::MinusGradient),
    ("PrintedAngleSign", Some("BridsonBending"), Check::MinusGradient),
    ("PrintedDampingSign", None, Check::Dissipation),
    ("DampingOfTheWhole", None, Check::Dissipation),
    ("SevenTimes", Some("BridsonBending"), Check::MinusGradient),
    ("PrintedBridsonWeight", Some("BridsonBending"), Check::MinusGradient),
];

#[test]
fn each_printed_mistake_is_noticed_by_its_check() {
    for &(name, energy, check) in PRINTED {
        let report = audited(name, energy);
        assert!(failed(&report).contains(&check), "{name}: {:?}", failed(&report));
    }
}

#[test]
fn correct_declarations_pass() {
    for (name, energy) in [("RightHooke", "HookeSpring"), ("RightNormSquared", "BridsonBending")] {
        let report = audited(name, Some(energy));
        assert!(report.passed(), "{name}: {:?}", report.failures().collect::<Vec<_>>());
    }
    assert!(failed(&audited("DotProduct", None)).is_empty());
    // Printed with 0/0 where a component vanishes. The language takes the limit.
    assert!(failed(&audited("PrintedLogTrick", None)).is_empty());
}

/// The laws alone do not notice it: they are necessary conditions only.
#[test]
fn seven_times_the_force_passes_everything_but_the_energy() {
    assert_eq!(failed(&audited("SevenTimes", Some("BridsonBending"))), [Check::MinusGradient]);
    assert!(audited("SevenTimes", None).passed());
}

/// r' = r + v adds a velocity to a length, which the language rejects.
#[test]
fn the_printed_euler_step_does_not_compile() {
    let step = |text: &str| {
        let source = format!("residual Step(r: Vec3[m]; r0: Vec3[m], v: Vec3[m/s], Δt: Scalar[s]) {{ {text} }}");
        Target::of_text(&source, "step.energy")
    };
    let message = step("r - (r0 + v)").unwrap_err().to_string();
    assert!(message.contains("m/s"), "{message}");
    assert!(step("r - (r0 + Δt * v)").is_ok());
}

/// Declares an element whose Jacobian is changed on the way.
macro_rules! jacobian {
    ($name:ident, |$n:ident, $numbers:ident| $change:expr) => {
        #[derive(Clone, Copy)]
        struct $name;

        impl Element for $name {
            const DECLARATION: &'static Declaration = <Spring<f64> as Element>::DECLARATION;
            type Over<T: Real> = Self;

            fn evaluate<T: Real>(inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
                let mut outputs = <Spring<f64> as Element>::evaluate(inputs)?;
                let found = outputs.blocks.iter_mut().find(|(name, _)| *name == "dfdx");
                let ($n, $numbers) = (6, &mut found.expect("a constraint has one").1);
                $change;
                Ok(outputs)
            }
        }
    };
}

// Damped springs have a non-symmetric Jacobian. Made symmetric it looks better, but is wrong.
jacobian!(Symmetrised, |n, numbers| for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
    let mean = (numbers[i * n + j] + numbers[j * n + i]) * T::from_f64(0.5);
    (numbers[i * n + j], numbers[j * n + i]) = (mean, mean);
});
// The Taylor step with ∂F_P/∂r_P only.
jacobian!(DiagonalOnly, |n, numbers| for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
    if i / 3 != j / 3 {
        numbers[i * n + j] = T::from_f64(0.0);
    }
});

#[test]
fn wrong_jacobians_are_noticed_even_if_symmetric() {
    for message in [
        catch_unwind(|| verify::assert_derivatives::<Symmetrised>(20)),
        catch_unwind(|| verify::assert_derivatives::<DiagonalOnly>(20)),
    ] {
        let panic = message.expect_err("the audit must fail");
        let message = panic.downcast_ref::<String>().cloned().unwrap_or_default();
        for part in ["multi-precision", "dual numbers", "finite differences", "`dfdx`", "wrong: generated code"] {
            assert!(message.contains(part), "no {part} in\n{message}");
        }
    }
}
