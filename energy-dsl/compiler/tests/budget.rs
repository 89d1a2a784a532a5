//! Short texts that describe long computations: each compiles or is refused within 5 seconds and 500 MB, in the macro
//! and at run time. The tests have a program of their own, so that its peak of memory is theirs.
#![allow(missing_docs)]

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use energy_compiler::{Budget, Interpreted, Limits, Phase, Textbook, compile, compile_file};
use proc_macro2::Span;
use random::Random;

mod random;

/// Longest time of a text. Processors differ by a factor of two: most take half of it.
const LONGEST: Duration = Duration::from_secs(10);

/// Returns the time that this thread has run, without what other processes took; else the time of the clock.
fn now() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let nanoseconds = || -> Option<u64> {
        let schedule = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        schedule.split_whitespace().next()?.parse().ok()
    };
    nanoseconds().map_or_else(|| START.elapsed(), Duration::from_nanos)
}
/// Largest memory of the whole test in MB.
const MOST_MEMORY: usize = 500;

/// Returns the peak of memory of this process in MB; `None` where the system does not tell.
fn peak() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<usize>().ok()? / 1024)
}

fn joined(count: usize, separator: &str, part: impl Fn(usize) -> String) -> String {
    (0..count).map(part).collect::<Vec<_>>().join(separator)
}

fn nested_gradients(depth: usize) -> String {
    let point = |level: usize| ["p", "q"][level % 2];
    let formula = (0..depth).fold("norm(p - q) * exp(k * dot(p, q))".to_owned(), |formula, level| {
        format!("norm_squared(gradient({formula}, {}))", point(level))
    });
    format!("energy A(p, q: Point; k: Scalar) {{ {formula} }}")
}

fn dense_hessian(points: usize) -> String {
    format!(
        "energy A(p: [Point; {points}]; k: Scalar) {{
            let s = sum(i in 0..{points}, sum(j in 0..3, sin(p[i][j] * k)));
            sum(i in 0..{points}, sum(j in 0..3, exp(p[i][j] * s)))
        }}"
    )
}

/// Texts that took minutes and gigabytes, or caused a panic, without a budget.
fn hostile_texts() -> Vec<(&'static str, String)> {
    let rotations = "energy A(p, q, r, s: Point) {
        let F = outer(p, q) + outer(r, s) + identity(3);
        sum(i in 0..16, norm_squared(rotation_of(i * F + outer(r, q) + outer(s, s)) * p))
    }";
    let polars = "energy A(p, q, r, s: Point) {
        let F = columns(p - s, q - s, r - s);
        norm_squared(rotation_of(rotation_of(rotation_of(F) + F) + F) * p)
    }";
    let sines = "fn f(x) { sin(x) + x * x }
        energy A(p: Point; k: Scalar) { sum(i in 0..1000, f(i * k * p.x) + f(i * p.y) + f(p.z + i)) }";
    let nested_functions = "fn f(x) { x * x - 2 * x } fn g(x) { f(f(f(f(x)))) } fn h(x) { g(g(g(g(x)))) }
        fn i(x) { h(h(h(h(x)))) } fn j(x) { i(i(i(i(x)))) } fn l(x) { j(j(j(j(x)))) }
        energy A(p, q, r: Point; k: Scalar) { l(k * dot(p, q) + dot(q, r)) }";
    let long_functions = format!(
        "fn f(x) {{ {} }} energy A(p: Point) {{ {} }}",
        joined(480, " + ", |i| format!("sin({i} * x)")),
        joined(480, " + ", |i| format!("f({i} * norm(p))"))
    );
    let long_arrays = format!(
        "energy A(p: Point) {{ let a = [{}]; sum(i in 0..1000, a[i] * a[i]) }}",
        joined(20_000, ", ", |_| "norm(p)".into())
    );
    let dense_force = format!(
        "force F(p: [Point; 85]; k: Scalar) {{ let s = sum(i in 0..85, norm(p[i]) * k); [{}] }}",
        joined(85, ", ", |i| format!("s * p[{i}]"))
    );
    let many_rows = format!(
        "constraint C(p: [Point; 85]; k: Scalar) {{ [{}] }}",
        joined(84, ", ", |i| format!("k * norm(p[{i}] - p[{}])", i + 1))
    );
    let declarations = joined(2000, " ", |i| format!("energy A{i}(p, q: Point; k: Scalar) {{ k * sin(norm(p - q)) }}"));
    vec![
        ("nested gradients", nested_gradients(6)),
        ("dense Hessian", dense_hessian(80)),
        ("dense Hessian of half the points", dense_hessian(30)),
        ("rotations", rotations.into()),
        ("rotations of rotations", polars.into()),
        ("sines", sines.into()),
        ("functions in functions", nested_functions.into()),
        ("long functions", long_functions),
        ("long arrays", long_arrays),
        ("dense force", dense_force),
        ("constraint of many rows", many_rows),
        ("many declarations", declarations),
    ]
}

/// Texts whose parts were compared or copied too often.
fn repetitive_texts() -> Vec<(&'static str, String)> {
    let doubled = |count: usize| joined(count, " ", |i| format!("let a{} = a{i} + a{i};", i + 1));
    let wide = |count: usize| joined(count, " * ", |i| format!("k{i}"));
    vec![
        ("a long sum", format!("energy A(p: Point) {{ {} }}", joined(25_000, " + ", |_| "norm(p)".into()))),
        ("a very long sum", format!("energy A(p: Point) {{ {} }}", joined(1_500_000, " + ", |_| "norm(p)".into()))),
        ("doubled constants", format!("energy A(p: Point) {{ let a0 = 1; {} norm(p) * a60 }}", doubled(60))),
        (
            "doubled parameters",
            format!(
                "energy A(p: Point; k: Scalar; rest L: Scalar) {{ rest {{ let r = L; }} let a0 = k; {}
                    (norm(p) * r + norm(2 * p) * r) * a60 }}",
                doubled(60)
            ),
        ),
        ("a long number", format!("energy A(p: Point) {{ norm(p) * {} }}", "1".repeat(200_000))),
        ("a long name", format!("energy A(p: Point) {{ norm(p) * {} }}", "x".repeat(200_000))),
        (
            "many inputs",
            format!("energy A(p: Point; {}: Scalar) {{ {} }}", wide(30_000).replace(" * ", ", "), wide(400)),
        ),
        ("many statements", format!("energy A(p: Point) {{ let a0 = 1; {} norm(p) }}", doubled(10_000))),
        (
            "functions that call each other",
            format!(
                "fn _f0(x) {{ x }} {} energy A(p: Point) {{ _f2000(norm(p)) }}",
                joined(2000, " ", |i| format!("fn _f{}(x) {{ 1 + _f{i}(x) }}", i + 1))
            ),
        ),
        (
            "statements that need each other",
            format!("energy A(p: Point) {{ let a0 = norm(p); {} a4000 }}", doubled(4000).replace("+ a", "* a")),
        ),
        ("many comments", format!("{} energy A(p: Point) {{ norm(p) }}", "/// a\n".repeat(40_000))),
        (
            "a chain of specialisations",
            format!(
                "energy A0(p: Point; k: Scalar) {{ norm(p) * k }} {}",
                joined(3000, " ", |i| format!("energy A{} = A{i}();", i + 1))
            ),
        ),
    ]
}

#[test]
fn hostile_texts_end_within_seconds_and_half_a_gigabyte() {
    for (name, text) in hostile_texts().into_iter().chain(repetitive_texts()) {
        let mut times = Vec::new();
        let mut timed = |compile: &dyn Fn() -> String| {
            let start = now();
            let ending = compile();
            times.push(now() - start);
            ending
        };
        let ending = |result: Result<usize, energy_compiler::Diagnostics>| match result {
            Ok(_) => "compiles".to_owned(),
            Err(errors) => errors.to_string(),
        };
        let endings = [
            timed(&|| ending(Interpreted::from_file(&text, "a.energy").map(|all| all.len()))),
            timed(&|| ending(Textbook::from_source(&text).map(|_| 1))),
            timed(&|| compile_file(&text, "a.energy", Span::call_site()).is_empty().to_string()),
        ];
        println!("{name}: {times:.2?}, peak {:?} MB; {:.100}", peak(), endings[0]);
        assert!(times.iter().all(|&time| time < LONGEST), "{name}: {times:?}");
        assert!(peak().is_none_or(|peak| peak < MOST_MEMORY), "{name}: {:?} MB", peak());
        assert!(endings.iter().all(|ending| ending.len() < 100_000), "{name}: long messages");
    }
}

#[test]
fn the_error_names_statement_amount_and_limit() {
    let message = Interpreted::from_file(&nested_gradients(6), "a.energy").unwrap_err().to_string();
    assert!(message.starts_with("a.energy:1:8: this takes more than 400,000,000 bytes of memory"), "{message}");
    assert!(message.contains("while `A` was differentiated"), "{message}");
    assert!(message.contains("#[limits(bytes = 2e9)]"), "{message}");

    let tight = Budget::new(Limits::new(40_000, Limits::default().bytes));
    let text = "energy A(p, q: Point; k: Scalar) {
        let a = norm(p - q) + 1;
        let b = sum(i in 0..500, sin(i * k * norm(p)) * cos(i * norm(q))) * a;
        let c = a * b;
        a + c
    }";
    let message = Interpreted::from_file_within(text, "a.energy", &tight).unwrap_err().to_string();
    assert!(message.starts_with("a.energy:3:75: this takes more than 40,000 steps"), "{message}");
    assert!(message.contains("while `A` was lowered to a graph"), "{message}");
}

#[test]
fn a_declaration_in_rust_may_raise_its_limits() {
    let text = nested_gradients(4);
    let refused = compile(text.parse().unwrap()).to_string();
    assert!(refused.contains("compile_error") && refused.contains("steps to compile"), "it compiles within the limits");
    // A stub keeps code that uses the declaration free of further errors.
    assert!(refused.contains("pub struct A") || refused.contains("struct A"), "no stub");

    let little = "#[limits(steps = 1000)] energy A(p, q: Point) { norm(p - q) }";
    let refused = compile(little.parse().unwrap()).to_string();
    assert!(refused.contains("more than 1,000 steps"), "{refused}");
    let enough = "#[limits(steps = 1e8, bytes = 1e9)] energy A(p, q: Point) { norm(p - q) }";
    assert!(!compile(enough.parse().unwrap()).to_string().contains("compile_error"));
    // At run time, the program decides: a stranger's text cannot raise its own limits.
    assert!(Interpreted::from_source(little).is_ok());
    assert!(Interpreted::from_source_within(little, &Budget::default().trusting()).is_err());
}

#[test]
fn a_compilation_is_watched_and_cancelled() {
    let flag = Arc::new(AtomicBool::new(true));
    let budget = Budget::default().cancelled_by(Arc::clone(&flag));
    let text = dense_hessian(8);
    let message = Interpreted::from_file_within(&text, "a.energy", &budget).unwrap_err().to_string();
    assert!(message.contains("cancelled while `A` was checked"), "{message}");
    assert_eq!(message.matches("help").count() + message.matches("energy:").count(), 1, "{message}");

    let calls = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&calls);
    let budget = Budget::default().watched_by(move |progress| {
        counted.fetch_add(1, Ordering::Relaxed);
        if progress.phase == Phase::Differentiating { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let message = Interpreted::from_file_within(&text, "a.energy", &budget).unwrap_err().to_string();
    assert!(message.contains("cancelled while `A` was differentiated"), "{message}");
    assert!(calls.load(Ordering::Relaxed) > 2);
    let progress = budget.progress();
    assert!(progress.steps > 0 && progress.steps < progress.limits.steps);
}

/// Random texts.
impl Random {
    fn scalar(&mut self, depth: usize) -> String {
        if depth == 0 {
            return ["k", "p.x / L", "2", "norm(p - q) / L", "dot(q, r) / L^2"][self.below(5)].to_owned();
        }
        let (a, b) = (self.scalar(depth - 1), self.scalar(depth - 1));
        match self.below(14) {
            0 => format!("({a} + {b})"),
            1 => format!("{a} * {b}"),
            2 => format!("({a} - {b})"),
            3 => format!("sin({a})"),
            4 => format!("exp({a} / (1 + ({b})^2))"),
            5 => format!("sqrt(1 + ({a})^2)"),
            6 => format!("_f{}({a})", self.below(4)),
            7 => format!("sum(i{depth} in 0..{}, {a} * i{depth} + {b})", 1 + self.below(40)),
            8 => format!("gradient({a}, k)"),
            9 => format!("L^2 * norm_squared(gradient({a}, {}))", ["p", "q", "r"][self.below(3)]),
            10 => format!("(if {a} < {b} {{ {a} }} else {{ {b} }})"),
            11 => format!("trace({})", self.matrix(depth - 1)),
            12 => format!("det({})", self.matrix(depth - 1)),
            _ => format!("norm({} * (p - r)) / L", self.matrix(depth - 1)),
        }
    }

    fn matrix(&mut self, depth: usize) -> String {
        if depth == 0 {
            return ["columns((p - q) / L, (r - q) / L, (s - q) / L)", "outer(p, q) / L^2", "identity(3)"]
                [self.below(3)]
            .to_owned();
        }
        let (a, b) = (self.matrix(depth - 1), self.matrix(depth - 1));
        match self.below(7) {
            0 => format!("({a} + {b})"),
            1 => format!("{a} * {b}"),
            2 => format!("rotation_of({a} + {b})"),
            3 => format!("stretch_of({a})"),
            4 => format!("inverse({a} + identity(3))"),
            5 => format!("transpose({a})"),
            _ => format!("({}) * {b}", self.scalar(depth - 1)),
        }
    }

    fn text(&mut self) -> String {
        let mut text = String::new();
        for number in 0..4 {
            let inner =
                if number == 0 { "x * x".to_owned() } else { format!("_f{0}(x) * sin(_f{0}(2 * x))", number - 1) };
            write!(text, "fn _f{number}(x) {{ {inner} }} ").expect("writing to a string succeeds");
        }
        let depth = 2 + self.below(4);
        format!(
            "{text} energy A(p, q, r, s: Point; k, L: Scalar) {{ {} + k * dot(p - q, r - s) / L^2 }}",
            self.scalar(depth)
        )
    }
}

/// Work that is not counted would show as time beyond the budget.
#[test]
fn random_texts_keep_to_a_small_budget() {
    let limits = Limits::new(200_000, 30_000_000);
    let (mut compiled, mut refused, mut wrong) = (0, 0, 0);
    for seed in 1..=60_u64 {
        let text = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)).text();
        let start = now();
        match Interpreted::from_file_within(&text, "a.energy", &Budget::new(limits)) {
            Ok(_) => compiled += 1,
            Err(errors) if errors.to_string().contains("to compile") => refused += 1,
            Err(errors) => {
                println!("{errors}");
                wrong += 1;
            }
        }
        let time = now() - start;
        assert!(time < Duration::from_secs(1), "{time:?} for {text}");
    }
    println!("{compiled} compiled, {refused} beyond the budget, {wrong} with other errors");
    assert!(compiled > 3 && refused > 3, "{compiled} compiled, {refused} refused");
}
