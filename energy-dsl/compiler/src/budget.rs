//! Bounds the work of the compiler. A short text can describe a long computation: derivatives of derivatives, dense
//! Hessians, functions that call functions. Work and memory are counted while they are spent.
//!
//! Thousands of constructors of nodes would have to pass on an error that almost never occurs. A stop therefore unwinds
//! to [`Budget::within`], as cancelled queries of rust-analyzer do, and is a value from there on. No message is printed
//! and no other code runs.

use std::fmt;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, AtomicUsize, Ordering};

use crate::diagnostic::{Diagnostic, Span};

/// The largest amounts that a text may spend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Steps of the compiler. One step checks, creates, copies or writes one operation.
    pub steps: u64,
    /// Bytes of memory, estimated.
    pub bytes: u64,
}

impl Limits {
    /// No limits, for texts that are trusted.
    pub const NONE: Self = Self { steps: u64::MAX, bytes: u64::MAX };

    /// Creates limits of steps and bytes.
    #[must_use]
    pub const fn new(steps: u64, bytes: u64) -> Self {
        Self { steps, bytes }
    }

    /// Returns the attribute that sets these limits.
    pub(crate) fn attribute(self) -> String {
        format!("#[limits(steps = {}, bytes = {})]", self.steps, self.bytes)
    }
}

impl Default for Limits {
    /// Returns limits for texts of strangers: a few seconds, and less than 500 MB.
    fn default() -> Self {
        Self { steps: 10_000_000, bytes: 400_000_000 }
    }
}

/// A part of the compiler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Names, shapes and units are checked, and sums and functions written out.
    Checking,
    /// The formula becomes a graph.
    Lowering,
    /// The graph is differentiated.
    Differentiating,
    /// Code or tapes are written.
    Writing,
}

impl Phase {
    /// Names what the phase does to a declaration.
    #[must_use]
    pub fn participle(self) -> &'static str {
        match self {
            Self::Checking => "checked",
            Self::Lowering => "lowered to a graph",
            Self::Differentiating => "differentiated",
            Self::Writing => "written as code",
        }
    }

    const ALL: [Self; 4] = [Self::Checking, Self::Lowering, Self::Differentiating, Self::Writing];
}

/// The state of a compilation.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Progress {
    /// The part of the compiler that runs.
    pub phase: Phase,
    /// Steps so far.
    pub steps: u64,
    /// Bytes so far, estimated.
    pub bytes: u64,
    /// The limits of both.
    pub limits: Limits,
}

/// The reason why a compilation ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    Steps,
    Bytes,
    /// More than [`u16::MAX`] numbers in one list.
    Numbers,
    Cancelled,
}

impl Stop {
    /// Returns the error at a place of a declaration.
    pub(crate) fn diagnostic(self, budget: &Budget, span: &Span, name: &str) -> Diagnostic {
        let Progress { phase, limits, .. } = budget.progress();
        let (limit, unit, option) = match self {
            Self::Steps => (limits.steps, "steps", "steps = 1e9"),
            Self::Bytes => (limits.bytes, "bytes of memory", "bytes = 2e9"),
            Self::Numbers => {
                let message = format!("`{name}` has a list of more than 65,535 numbers for each element");
                return Diagnostic::new(span, message).help("declare a term of fewer points, rows or stored values");
            }
            Self::Cancelled => {
                let message = format!("cancelled while `{name}` was {}", phase.participle());
                return Diagnostic { is_end: true, ..Diagnostic::new(span, message) };
            }
        };
        let (limit, done) = (grouped(limit), phase.participle());
        let message =
            format!("this takes more than {limit} {unit} to compile: the limit was reached while `{name}` was {done}");
        let help = format!(
            "sums over many terms, functions in functions and derivatives of derivatives multiply; use fewer, or raise \
             the limit: #[limits({option})] in `energy!`, and an option of programs that read texts"
        );
        Diagnostic { is_end: true, ..Diagnostic::new(span, message) }.help(help)
    }
}

/// Writes a number with commas.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let comma = |at: usize| if at > 0 && (digits.len() - at).is_multiple_of(3) { "," } else { "" };
    digits.char_indices().map(|(at, digit)| format!("{}{digit}", comma(at))).collect()
}

/// Watches a compilation. `Break` ends it.
type Watch = Arc<dyn Fn(&Progress) -> ControlFlow<()> + Send + Sync>;

/// The budget of one text, and a way to watch and to end its compilation. Clones share what they spend.
///
/// ```
/// use energy_compiler::{Budget, Interpreted, Limits};
/// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
/// assert!(Interpreted::from_source_within(source, &Budget::default()).is_ok());
/// let tight = Budget::new(Limits::new(1000, Limits::default().bytes));
/// let refused = Interpreted::from_source_within(source, &tight).unwrap_err();
/// assert!(refused.to_string().contains("more than 1,000 steps"));
/// ```
#[derive(Clone)]
pub struct Budget(Arc<Account>);

struct Account {
    limits: Limits,
    /// Whether declarations may set limits of their own.
    trusting: bool,
    steps: AtomicU64,
    bytes: AtomicU64,
    /// The limit of steps, or that of an attempt.
    most_steps: AtomicU64,
    /// Number of steps at which the limits and the watch are asked next.
    next: AtomicU64,
    phase: AtomicU8,
    /// Number of the binding that is lowered, from 1; 0 for the result.
    binding: AtomicUsize,
    /// The binding with the most operations, and their number.
    largest: [AtomicUsize; 2],
    cancelled: Option<Arc<AtomicBool>>,
    watch: Option<Watch>,
}

/// Number of steps between two looks at limits and watch: well below a millisecond.
const LOOK: u64 = 4096;

impl Budget {
    /// Creates a budget.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self(Arc::new(Account {
            limits,
            trusting: false,
            steps: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            most_steps: AtomicU64::new(limits.steps),
            next: AtomicU64::new(0),
            phase: AtomicU8::new(0),
            binding: AtomicUsize::new(0),
            largest: [AtomicUsize::new(0), AtomicUsize::new(0)],
            cancelled: None,
            watch: None,
        }))
    }

    /// Ends the compilation once `flag` is set, such as by a handler of signals. Call it before the budget is shared.
    #[must_use]
    pub fn cancelled_by(self, flag: Arc<AtomicBool>) -> Self {
        self.with(|account| account.cancelled = Some(flag))
    }

    /// Calls `watch` some hundred times per second, from the thread that compiles. `Break` ends the compilation. Call
    /// it before the budget is shared.
    #[must_use]
    pub fn watched_by(self, watch: impl Fn(&Progress) -> ControlFlow<()> + Send + Sync + 'static) -> Self {
        self.with(|account| account.watch = Some(Arc::new(watch)))
    }

    /// Lets declarations set limits of their own with `#[limits(…)]`, as `energy!` does. Otherwise the attribute has no
    /// effect. Call it before the budget is shared.
    #[must_use]
    pub fn trusting(self) -> Self {
        self.with(|account| account.trusting = true)
    }

    fn with(mut self, change: impl FnOnce(&mut Account)) -> Self {
        if let Some(account) = Arc::get_mut(&mut self.0) {
            change(account);
        }
        self
    }

    /// Returns the budget of a declaration that may have its own limits.
    pub(crate) fn of_declaration(&self, limits: Option<Limits>) -> Self {
        let Some(limits) = limits.filter(|_| self.0.trusting) else { return self.clone() };
        let Account { cancelled, watch, .. } = &*self.0;
        Self::new(limits).with(|account| (account.cancelled, account.watch) = (cancelled.clone(), watch.clone()))
    }

    /// Returns the limits.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.0.limits
    }

    /// Returns the state of the compilation.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let Account { limits, steps, bytes, phase, .. } = &*self.0;
        let phase = Phase::ALL[usize::from(phase.load(Ordering::Relaxed))];
        Progress { phase, steps: steps.load(Ordering::Relaxed), bytes: bytes.load(Ordering::Relaxed), limits: *limits }
    }

    /// Notes the part of the compiler that runs.
    pub(crate) fn enter(&self, phase: Phase) {
        self.0.phase.store(phase as u8, Ordering::Relaxed);
        self.at_binding(None);
        if phase == Phase::Checking {
            self.0.largest.iter().for_each(|number| number.store(0, Ordering::Relaxed));
        }
    }

    /// Notes the binding that is lowered, and returns the one before.
    pub(crate) fn at_binding(&self, binding: Option<usize>) -> Option<usize> {
        self.0.binding.swap(binding.map_or(0, |number| number + 1), Ordering::Relaxed).checked_sub(1)
    }

    /// Returns the binding that is lowered; `None` for the result, or in another phase.
    pub(crate) fn binding(&self) -> Option<usize> {
        self.0.binding.load(Ordering::Relaxed).checked_sub(1)
    }

    /// Notes how many operations a binding has become.
    pub(crate) fn note(&self, binding: usize, operations: usize) {
        let [largest, most] = &self.0.largest;
        if operations > most.load(Ordering::Relaxed) {
            most.store(operations, Ordering::Relaxed);
            largest.store(binding, Ordering::Relaxed);
        }
    }

    /// Returns the binding with the most operations, and their number; `None` without bindings.
    pub(crate) fn largest(&self) -> Option<(usize, usize)> {
        let [largest, most] = self.0.largest.each_ref().map(|number| number.load(Ordering::Relaxed));
        (most > 0).then_some((largest, most))
    }

    /// Counts steps and bytes. Returns the reason to stop, if there is one.
    pub(crate) fn try_spend(&self, steps: u64, bytes: u64) -> Result<(), Stop> {
        // One thread compiles a text, so that a load and a store suffice. They are cheaper than an addition.
        let add = |counter: &AtomicU64, amount: u64| {
            let sum = counter.load(Ordering::Relaxed).saturating_add(amount);
            counter.store(sum, Ordering::Relaxed);
            sum
        };
        let (steps, bytes) = (add(&self.0.steps, steps), add(&self.0.bytes, bytes));
        if steps >= self.0.next.load(Ordering::Relaxed) || bytes > self.0.limits.bytes {
            return self.look(steps, bytes);
        }
        Ok(())
    }

    /// Counts steps and bytes, and unwinds to [`Self::within`] if they exceed a limit.
    pub(crate) fn spend(&self, steps: u64, bytes: u64) {
        if let Err(stop) = self.try_spend(steps, bytes) {
            Self::stop(stop);
        }
    }

    /// Unwinds to [`Self::within`].
    pub(crate) fn stop(stop: Stop) -> ! {
        resume_unwind(Box::new(stop))
    }

    /// Returns the number of an input, and stops if there are too many.
    pub(crate) fn input_number(number: usize) -> u16 {
        u16::try_from(number).unwrap_or_else(|_| Self::stop(Stop::Numbers))
    }

    #[cold]
    fn look(&self, steps: u64, bytes: u64) -> Result<(), Stop> {
        let Account { limits, most_steps, next, cancelled, watch, .. } = &*self.0;
        let most = most_steps.load(Ordering::Relaxed);
        if steps > most {
            return Err(Stop::Steps);
        }
        if bytes > limits.bytes {
            return Err(Stop::Bytes);
        }
        next.store(steps.saturating_add(LOOK).min(most.saturating_add(1)), Ordering::Relaxed);
        let is_cancelled = cancelled.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed));
        let ends = watch.as_ref().is_some_and(|watch| watch(&self.progress()).is_break());
        if is_cancelled || ends { Err(Stop::Cancelled) } else { Ok(()) }
    }

    /// Runs a part of the compiler. Returns the reason if it was stopped.
    pub(crate) fn within<T>(&self, part: impl FnOnce() -> T) -> Result<T, Stop> {
        // Changes that the part has made are dropped with it, apart from diagnostics, which are complete after each
        // push.
        catch_unwind(AssertUnwindSafe(part)).map_err(|reason| match reason.downcast::<Stop>() {
            Ok(stop) => *stop,
            Err(panic) => resume_unwind(panic),
        })
    }

    /// Runs a part that may be given up: `None` if it takes more than `most` steps, or half of those that are left, or
    /// more memory than is left. What it spends is returned, and not counted.
    pub(crate) fn attempt<T>(&self, most: u64, part: impl FnOnce() -> T) -> Option<(T, [u64; 2])> {
        let Progress { steps, bytes, limits, .. } = self.progress();
        let most = steps.saturating_add(most.min(limits.steps.saturating_sub(steps) / 2));
        let limit = self.0.most_steps.swap(most, Ordering::Relaxed);
        // The limits are asked at the first step.
        self.0.next.store(steps, Ordering::Relaxed);
        let outcome = self.within(part);
        let after = self.progress();
        self.0.most_steps.store(limit, Ordering::Relaxed);
        let counters = [(&self.0.steps, steps), (&self.0.bytes, bytes), (&self.0.next, steps)];
        counters.into_iter().for_each(|(counter, before)| counter.store(before, Ordering::Relaxed));
        match outcome {
            Ok(done) => Some((done, [after.steps - steps, after.bytes - bytes])),
            Err(Stop::Cancelled) => Self::stop(Stop::Cancelled),
            Err(_) => None,
        }
    }
}

impl Default for Budget {
    /// Creates a budget with the default [`Limits`].
    fn default() -> Self {
        Self::new(Limits::default())
    }
}

impl fmt::Debug for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.progress().fmt(f)
    }
}
