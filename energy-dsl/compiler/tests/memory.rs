//! Texts that are compiled at run time leave no memory behind. The test has its own program, so that its memory is
//! that of the texts.
#![allow(missing_docs)]

use std::sync::Arc;

use energy_compiler::{Elements, Interpreted};
use energy_runtime::tape::Column;

/// Bytes of the comment of each text. Its declaration holds them twice: as docs and in its source.
const COMMENT: usize = 10_000;

fn text(number: usize) -> String {
    let comment = "x".repeat(COMMENT);
    format!(
        "/// {comment}\nenergy Pull{number}(p, q: Point; k{number}: Scalar[N/m]) {{ k{number} * norm_squared(p - q) }}"
    )
}

fn bound(element: &Interpreted) -> Elements {
    element.elements(1, &[], &[Column::Same(&[2.0])]).expect("one parameter")
}

/// Returns the resident memory of this process in bytes; `None` where the system does not tell.
fn memory() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS"))?;
    Some(1024 * line.split_whitespace().nth(1)?.parse::<usize>().ok()?)
}

#[test]
fn a_description_lives_as_long_as_its_users() {
    let element = Interpreted::from_file(&text(0), "pull.energy").expect("it compiles").remove(0);
    let description = Arc::downgrade(element.declaration());
    let elements = bound(&element);
    drop(element);
    assert_eq!(description.upgrade().expect("the elements hold it").name, "Pull0");
    drop(elements);
    assert!(description.upgrade().is_none());
}

#[test]
fn memory_does_not_grow_with_the_number_of_texts() {
    let compile = |numbers: std::ops::Range<usize>| {
        numbers.for_each(|number| {
            drop(bound(&Interpreted::from_file(&text(number), "pull.energy").expect("it compiles")[0]))
        });
    };
    compile(1..100);
    let Some(before) = memory() else { return };
    compile(100..600);
    let grown = memory().expect("it was known before").saturating_sub(before);
    assert!(grown < 500 * COMMENT / 2, "{grown} bytes more after 500 texts");
}
