//! Where energy comes from and goes to, step by step.

mod account;

use std::fmt::Write as _;

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, PlacedTerm};
use plotters::prelude::*;
use serde::{Deserialize, Serialize};

use crate::body::Body;
pub(crate) use account::Account;
use account::works;

/// Energies, work and momenta at the start and after each step.
///
/// Energy is what free vertices have in their motion, and what the terms have as potential. What enters or leaves is the work of everything else:
/// of each force that is no gradient (drag, damping, friction, wind), of pins that move, and of obstacles that move; and what little motion is left where
/// something falls asleep. Work is the integral of power by the trapezoidal rule over each step. What is left, [`Entry::unaccounted`], is the error of the integrator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    potentials: Vec<String>,
    works: Vec<String>,
    entries: Vec<Entry>,
    /// Of each island.
    accounts: Vec<Account>,
    /// Of islands in the step that is under way.
    changed: Vec<(usize, Account)>,
}

/// One line of the ledger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// When, in s.
    pub time: f64,
    /// ½ Σ m v², in J.
    pub kinetic: f64,
    /// Of each term that has one, in J.
    pub potential: Vec<f64>,
    /// Done so far by each force that is no gradient, in J; negative where it dissipates.
    pub work: Vec<f64>,
    /// Done so far by pins that move, in J.
    pub pins: f64,
    /// Done so far by obstacles that move, in J.
    pub obstacles: f64,
    /// Taken so far by falling asleep, in J; negative.
    pub sleep: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
}

impl Entry {
    fn add(&mut self, account: &Account) {
        self.kinetic += account.kinetic;
        account.potential.iter().for_each(|&(column, energy)| self.potential[column] += energy);
        account.work.iter().for_each(|&(column, work)| self.work[column] += work);
        self.pins += account.pins;
        self.obstacles += account.obstacles;
        self.sleep += account.sleep;
        for axis in 0..3 {
            self.momentum[axis] += account.momentum[axis];
            self.angular_momentum[axis] += account.angular_momentum[axis];
        }
    }

    /// Kinetic and potential energy, in J.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.kinetic + self.potential.iter().sum::<f64>()
    }

    /// All work so far, in J.
    #[must_use]
    pub fn total_work(&self) -> f64 {
        self.work.iter().sum::<f64>() + self.pins + self.obstacles + self.sleep
    }

    /// The energy since the first entry that no work accounts for, in J.
    #[must_use]
    pub fn unaccounted(&self, first: &Self) -> f64 {
        self.energy() - first.energy() - (self.total_work() - first.total_work())
    }
}

impl Ledger {
    /// The part of the largest energy exchanged that may be unaccounted for before there is a warning.
    pub const TOLERANCE: f64 = 0.02;

    /// A ledger whose first entry is the bodies as they are, each with the label of each of its terms; `names` are those of labels.
    ///
    /// # Errors
    /// When an energy is not finite.
    pub(crate) fn new(bodies: &[(&Body, &[usize])], names: &[&str], time: f64) -> Result<Self, EvaluationError> {
        // The columns of labels.
        let columns = |keep: fn(&dyn PlacedTerm) -> bool| -> Vec<Option<usize>> {
            let mut kept = vec![false; names.len()];
            for (body, labels) in bodies {
                let terms = body.system.terms().zip(*labels);
                terms.for_each(|((term, _), &label)| kept[label] |= keep(term));
            }
            let mut count = 0..;
            kept.into_iter().map(|kept| if kept { count.next() } else { None }).collect()
        };
        let columns = [columns(|term| term.has_energy()), columns(works)];
        let [potentials, works] = columns.each_ref().map(|columns| {
            let named = names.iter().zip(columns).filter(|(_, column)| column.is_some());
            named.map(|(name, _)| (*name).to_owned()).collect()
        });
        let account = |(body, labels): &(&Body, &[usize])| {
            let [potentials, works] =
                columns.each_ref().map(|columns| labels.iter().filter_map(|&label| columns[label]).collect());
            Account::open(body, potentials, works)
        };
        let accounts = bodies.iter().map(account).collect::<Result<_, _>>()?;
        let mut ledger = Self { potentials, works, entries: Vec::new(), accounts, changed: Vec::new() };
        ledger.enter(time);
        Ok(ledger)
    }

    /// The entries: the start, then each step.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The names of the terms with potentials.
    #[must_use]
    pub fn potentials(&self) -> &[String] {
        &self.potentials
    }

    /// The names of the forces that do work.
    #[must_use]
    pub fn works(&self) -> &[String] {
        &self.works
    }

    /// What an island has and received before the step that is under way.
    pub(crate) fn account(&self, island: usize) -> &Account {
        &self.accounts[island]
    }

    /// What an island has and received after it.
    pub(crate) fn note(&mut self, island: usize, account: Account) {
        self.changed.push((island, account));
    }

    /// An island whose step was noted falls asleep.
    pub(crate) fn note_sleep(&mut self, island: usize) {
        let last = self.changed.iter_mut().rfind(|(number, _)| *number == island);
        last.into_iter().for_each(|(_, account)| *account = std::mem::take(account).asleep());
    }

    /// The step is done: enters it.
    pub(crate) fn enter(&mut self, time: f64) {
        for (island, account) in self.changed.drain(..) {
            self.accounts[island] = account;
        }
        let (potential, work) = (vec![0.0; self.potentials.len()], vec![0.0; self.works.len()]);
        let mut entry = Entry { time, potential, work, ..Entry::default() };
        self.accounts.iter().for_each(|account| entry.add(account));
        self.entries.push(entry);
    }

    /// The step failed: as if it had not begun.
    pub(crate) fn forget(&mut self) {
        self.changed.clear();
    }

    /// The largest energy that was exchanged, in J: the most that kinetic energy, potentials and work changed since the start, added up without signs.
    #[must_use]
    pub fn exchanged(&self) -> f64 {
        let first = &self.entries[0];
        let changes = |now: &[f64], then: &[f64]| now.iter().zip(then).map(|(a, b)| (a - b).abs()).sum::<f64>();
        let size = |entry: &Entry| {
            let moved = (entry.kinetic - first.kinetic).abs() + first.kinetic;
            let driven =
                (entry.pins - first.pins).abs() + (entry.obstacles - first.obstacles).abs() + entry.sleep.abs();
            moved + driven + changes(&entry.potential, &first.potential) + changes(&entry.work, &first.work)
        };
        self.entries.iter().map(size).fold(0.0, f64::max)
    }

    /// The largest energy that was unaccounted for, in J.
    #[must_use]
    pub fn largest_unaccounted(&self) -> f64 {
        self.entries.iter().map(|entry| entry.unaccounted(&self.entries[0]).abs()).fold(0.0, f64::max)
    }

    /// A warning when the balance does not close although the integrator should keep it: when more than [`Ledger::TOLERANCE`] of the largest energy
    /// exchanged is unaccounted for. Other integrators dissipate by themselves.
    #[must_use]
    pub fn imbalance(&self, integrator: &str) -> Option<String> {
        let conserving = ["implicit-midpoint", "trapezoid", "verlet", "symplectic-euler"].contains(&integrator);
        let (lost, all) = (self.largest_unaccounted(), self.exchanged());
        (conserving && lost > Self::TOLERANCE * all).then(|| {
            format!(
                "the balance of energy does not close: {lost:.3e} J of {all:.3e} J exchanged are unaccounted for, more than {} %, \
                 although {integrator} should keep it. Try a smaller dt",
                100.0 * Self::TOLERANCE
            )
        })
    }

    /// As a table of comma-separated values, one line for each entry.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "time [s],kinetic [J]".to_owned();
        let mut line = |arguments: std::fmt::Arguments<'_>| {
            text.write_fmt(arguments).expect("writing to a string succeeds");
        };
        let quoted = |name: &str| name.replace(['"', ',', '\n'], " ");
        self.potentials.iter().for_each(|name| line(format_args!(",potential {} [J]", quoted(name))));
        self.works.iter().for_each(|name| line(format_args!(",work {} [J]", quoted(name))));
        line(format_args!(",work pins [J],work obstacles [J],work sleep [J],energy [J],unaccounted [J]"));
        line(format_args!(",Px [kg m/s],Py [kg m/s],Pz [kg m/s],Lx [kg m^2/s],Ly [kg m^2/s],Lz [kg m^2/s]\n"));
        for entry in &self.entries {
            let numbers = [entry.time, entry.kinetic].into_iter().chain(entry.potential.iter().copied());
            let numbers = numbers.chain(entry.work.iter().copied()).chain([entry.pins, entry.obstacles, entry.sleep]);
            let numbers = numbers.chain([entry.energy(), entry.unaccounted(&self.entries[0])]);
            let numbers = numbers.chain(entry.momentum).chain(entry.angular_momentum);
            let row: Vec<String> = numbers.map(|number| format!("{number:e}")).collect();
            line(format_args!("{}\n", row.join(",")));
        }
        text
    }

    /// As a plot over time.
    ///
    /// # Errors
    /// When it cannot be drawn.
    pub fn svg(&self) -> Result<String, String> {
        let first = &self.entries[0];
        let mut curves: Vec<(String, Vec<f64>)> = Vec::new();
        let mut add = |name: &str, value: &dyn Fn(&Entry) -> f64| {
            let values: Vec<f64> = self.entries.iter().map(value).collect();
            if values.iter().any(|value| *value != 0.0) {
                curves.push((name.to_owned(), values));
            }
        };
        add("kinetic", &|entry| entry.kinetic);
        for (place, name) in self.potentials.iter().enumerate() {
            add(name, &|entry| entry.potential[place] - first.potential[place]);
        }
        for (place, name) in self.works.iter().enumerate() {
            add(&format!("work of {name}"), &|entry| entry.work[place] - first.work[place]);
        }
        add("work of pins", &|entry| entry.pins - first.pins);
        add("work of obstacles", &|entry| entry.obstacles - first.obstacles);
        add("sleep", &|entry| entry.sleep - first.sleep);
        add("unaccounted", &|entry| entry.unaccounted(first));
        let times: Vec<f64> = self.entries.iter().map(|entry| entry.time).collect();
        plot(&times, &curves).map_err(|error| error.to_string())
    }
}

/// Lines over time with their names.
fn plot(times: &[f64], curves: &[(String, Vec<f64>)]) -> Result<String, Box<dyn std::error::Error>> {
    let all = || curves.iter().flat_map(|(_, values)| values).copied();
    let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
    let margin = 0.05 * (high - low).max(f64::MIN_POSITIVE);
    let end = times.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 520)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(14)
            .x_label_area_size(42)
            .y_label_area_size(74)
            .build_cartesian_2d(times.first().copied().unwrap_or(0.0)..end, low - margin..high + margin)?;
        chart
            .configure_mesh()
            .max_light_lines(2)
            .light_line_style(BLACK.mix(0.05))
            .x_desc("time, s")
            .y_desc("energy since the start, J")
            .y_label_formatter(&|value| format!("{value:.3e}"))
            .draw()?;
        for (number, (name, values)) in curves.iter().enumerate() {
            let colour = Palette99::pick(number).to_rgba();
            let points = times.iter().copied().zip(values.iter().copied());
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        let mut labels = chart.configure_series_labels();
        let labels = labels.position(SeriesLabelPosition::UpperRight);
        labels.background_style(WHITE.mix(0.85)).border_style(BLACK.mix(0.3)).draw()?;
        area.present()?;
    }
    Ok(text)
}
