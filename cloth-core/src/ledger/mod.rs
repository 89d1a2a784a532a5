//! The energy balance of a simulation, step by step.

mod account;
mod export;

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, PlacedTerm};
use serde::{Deserialize, Serialize};

use crate::Body;
pub(crate) use account::Account;
pub(crate) use account::DrivenEnergies;
use account::works;

/// Energies, work and momenta at the start and after each step.
///
/// The energy is the kinetic energy of the free vertices plus the potential energy of the terms. It changes by the work
/// of non-conservative forces (drag, damping, friction, wind), of moving pins and of moving obstacles, and by the
/// kinetic energy removed when an island falls asleep. Certified contact chooses new barriers in each step; the change
/// of its energy by that choice counts as work. Work is the time integral of power, by the trapezoidal rule. That of
/// certified contact on pins and obstacles is the force at the end of each step times the way.
/// The remainder, [`Entry::unaccounted`], is the error of the integrator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    potentials: Vec<String>,
    works: Vec<String>,
    entries: Vec<Entry>,
    /// Whether contact is certified.
    #[serde(default)]
    in_contact: bool,
    /// One account per island.
    accounts: Vec<Account>,
    /// Accounts that changed in the current step.
    changed: Vec<(usize, Account)>,
}

/// One row of the ledger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Time, in s.
    pub time: f64,
    /// ½ Σ m v², in J.
    pub kinetic: f64,
    /// Potential energy of each term that has one, in J.
    pub potential: Vec<f64>,
    /// Work of each non-conservative force, in J; negative if it dissipates.
    pub work: Vec<f64>,
    /// Work of moving pins, in J.
    pub pins: f64,
    /// Work of moving obstacles, in J.
    pub obstacles: f64,
    /// Energy removed by falling asleep, in J; negative.
    pub sleep: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
    /// The largest force of certified contact on a vertex, in N.
    #[serde(default)]
    pub contact_force: f64,
    /// The total force of certified contact on obstacles, in N.
    #[serde(default)]
    pub force_on_obstacles: Vector3<f64>,
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
            self.force_on_obstacles[axis] += account.force_on_obstacles[axis];
        }
        self.contact_force = self.contact_force.max(account.contact_force);
    }

    /// Kinetic and potential energy, in J.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.kinetic + self.potential.iter().sum::<f64>()
    }

    /// Total work, in J.
    #[must_use]
    pub fn total_work(&self) -> f64 {
        self.work.iter().sum::<f64>() + self.pins + self.obstacles + self.sleep
    }

    /// The change of energy since the first entry that no work explains, in J.
    #[must_use]
    pub fn unaccounted(&self, first: &Self) -> f64 {
        self.energy() - first.energy() - (self.total_work() - first.total_work())
    }
}

impl Ledger {
    /// The unexplained fraction of the largest exchanged energy above which a warning is given.
    pub const TOLERANCE: f64 = 0.02;

    /// The fraction of the energy put in that an integrator may lose without a warning.
    pub const LOSS: f64 = 0.1;

    /// The fraction of the energy put in that an integrator may gain without a warning.
    pub const GAIN: f64 = 1.0;

    /// Lost and gained energies up to this, in J, cause no warning.
    pub const NEGLIGIBLE: f64 = 1e-12;

    /// Creates a ledger with the current state as its first entry. Each body comes with the label of each of its terms;
    /// `names` holds the name of each label.
    ///
    /// # Errors
    /// Returns an error if an energy is not finite.
    pub(crate) fn new(bodies: &[(&Body, &[usize])], names: &[&str], time: f64) -> Result<Self, EvaluationError> {
        // Maps each label to its column; `None` for a label without a column.
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
        let [mut potentials, mut works] = columns.each_ref().map(|columns| {
            let named = names.iter().zip(columns).filter(|(_, column)| column.is_some());
            named.map(|(name, _)| (*name).to_owned()).collect::<Vec<String>>()
        });
        let of_contact = [potentials.len(), works.len()];
        let in_contact = bodies.iter().any(|(body, _)| body.system.has_contact());
        if in_contact {
            potentials.push("contact".to_owned());
            works.push("friction and new barriers of contact".to_owned());
        }
        let account = |(body, labels): &(&Body, &[usize])| {
            let [mut potentials, mut works] = columns
                .each_ref()
                .map(|columns| labels.iter().filter_map(|&label| columns[label]).collect::<Vec<usize>>());
            if body.system.has_contact() {
                potentials.push(of_contact[0]);
                works.push(of_contact[1]);
            }
            Account::open(body, potentials, works)
        };
        let accounts = bodies.iter().map(account).collect::<Result<_, _>>()?;
        let (entries, changed) = (Vec::new(), Vec::new());
        let mut ledger = Self { potentials, works, entries, in_contact, accounts, changed };
        ledger.enter(time);
        Ok(ledger)
    }

    /// The initial state, then one entry per step.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Names of the terms with a potential, in the order of [`Entry::potential`].
    #[must_use]
    pub fn potentials(&self) -> &[String] {
        &self.potentials
    }

    /// Names of the non-conservative forces, in the order of [`Entry::work`].
    #[must_use]
    pub fn works(&self) -> &[String] {
        &self.works
    }

    /// Whether a ledger from a file has one account per island, and columns for all their numbers.
    pub(crate) fn fits(&self, islands: usize) -> bool {
        let columns = [self.potentials.len(), self.works.len()];
        let has_columns = |account: &Account| {
            let within = |numbers: &[(usize, f64)], columns| numbers.iter().all(|(column, _)| *column < columns);
            within(&account.potential, columns[0]) && within(&account.work, columns[1])
        };
        self.changed.is_empty()
            && self.accounts.len() == islands
            && self.accounts.iter().all(has_columns)
            && !self.entries.is_empty()
            && self.entries.iter().all(|entry| [entry.potential.len(), entry.work.len()] == columns)
    }

    /// The account of an island before the current step.
    pub(crate) fn account(&self, island: usize) -> &Account {
        &self.accounts[island]
    }

    /// Records the account of an island after the current step.
    pub(crate) fn note(&mut self, island: usize, account: Account) {
        self.changed.push((island, account));
    }

    /// Records that an island falls asleep at the end of the current step.
    pub(crate) fn note_sleep(&mut self, island: usize) {
        let last = self.changed.iter_mut().rfind(|(number, _)| *number == island);
        last.into_iter().for_each(|(_, account)| *account = std::mem::take(account).asleep());
    }

    /// Completes the current step and appends its entry.
    pub(crate) fn enter(&mut self, time: f64) {
        for (island, account) in self.changed.drain(..) {
            self.accounts[island] = account;
        }
        let (potential, work) = (vec![0.0; self.potentials.len()], vec![0.0; self.works.len()]);
        let mut entry = Entry { time, potential, work, ..Entry::default() };
        self.accounts.iter().for_each(|account| entry.add(account));
        self.entries.push(entry);
    }

    /// Updates the accounts to bodies whose pins have let go; see [`Account::reopened`].
    ///
    /// # Errors
    /// Returns an error if an energy is not finite.
    pub(crate) fn reopen<'a>(&mut self, bodies: impl Iterator<Item = &'a Body>) -> Result<(), EvaluationError> {
        for (account, body) in self.accounts.iter_mut().zip(bodies) {
            *account = account.reopened(body)?;
        }
        Ok(())
    }

    /// Discards the current step.
    pub(crate) fn forget(&mut self) {
        self.changed.clear();
    }

    /// The largest exchanged energy, in J: the maximum over time of the summed absolute changes of kinetic energy,
    /// potentials and work.
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

    /// The largest absolute unexplained energy, in J.
    #[must_use]
    pub fn largest_unaccounted(&self) -> f64 {
        self.entries.iter().map(|entry| entry.unaccounted(&self.entries[0]).abs()).fold(0.0, f64::max)
    }

    /// The energy put in, in J: the maximum over time of the initial kinetic energy, the potential energies released,
    /// and the work done on the cloth.
    #[must_use]
    pub fn put_in(&self) -> f64 {
        let first = &self.entries[0];
        let gains = |now: &[f64], then: &[f64]| now.iter().zip(then).map(|(a, b)| (a - b).max(0.0)).sum::<f64>();
        let size = |entry: &Entry| {
            let driven = [[entry.pins, first.pins], [entry.obstacles, first.obstacles]];
            let driven: f64 = driven.iter().map(|[now, then]| (now - then).max(0.0)).sum();
            first.kinetic + driven + gains(&first.potential, &entry.potential) + gains(&entry.work, &first.work)
        };
        self.entries.iter().map(size).fold(0.0, f64::max)
    }

    /// The largest energy that disappeared without work, in J.
    #[must_use]
    pub fn largest_loss(&self) -> f64 {
        self.entries.iter().map(|entry| -entry.unaccounted(&self.entries[0])).fold(0.0, f64::max)
    }

    /// The largest energy that appeared without work, in J.
    #[must_use]
    pub fn largest_gain(&self) -> f64 {
        self.entries.iter().map(|entry| entry.unaccounted(&self.entries[0])).fold(0.0, f64::max)
    }

    /// Returns a warning if the integrator lost more than [`Ledger::LOSS`] of the energy put in; `None` otherwise.
    #[must_use]
    pub fn loss(&self, integrator: &str) -> Option<String> {
        let (lost, all) = (self.largest_loss(), self.put_in());
        (lost > Self::LOSS * all && lost > Self::NEGLIGIBLE).then(|| {
            format!(
                "{integrator} lost {lost:.2e} J of the {all:.2e} J put in ({:.0} %): the size of its steps damps the \
                 motion. A smaller dt loses less{}",
                100.0 * lost / all,
                self.less_damped(integrator)
            )
        })
    }

    /// Names integrators that lose less and can step the same scene. Certified contact needs `newton`.
    fn less_damped(&self, integrator: &str) -> &'static str {
        match integrator {
            "newton" | "implicit-euler" if !self.in_contact => {
                ", and so do the integrators `bdf2` and `implicit-midpoint`"
            }
            "bdf2" => ", and so does the integrator `implicit-midpoint`",
            _ => "",
        }
    }

    /// Returns a warning if the energy grew by more than [`Ledger::GAIN`] times the energy put in, without work; `None`
    /// otherwise.
    #[must_use]
    pub fn gain(&self, integrator: &str) -> Option<String> {
        let (gained, all) = (self.largest_gain(), self.put_in());
        (gained > Self::GAIN * all && gained > Self::NEGLIGIBLE).then(|| {
            let other = if integrator == "newton" { "" } else { ", or the integrator `newton`" };
            format!(
                "{integrator} gained {gained:.2e} J that no work explains, with {all:.2e} J put in: the motion is \
                 unstable. Try a smaller dt{other}"
            )
        })
    }

    /// Returns a warning if an integrator that should conserve energy leaves more than [`Ledger::TOLERANCE`] of the
    /// largest exchanged energy unexplained; `None` otherwise, and for dissipative integrators.
    #[must_use]
    pub fn imbalance(&self, integrator: &str) -> Option<String> {
        let conserving = ["implicit-midpoint", "trapezoid", "verlet", "symplectic-euler"].contains(&integrator);
        let (lost, all) = (self.largest_unaccounted(), self.exchanged());
        (conserving && lost > Self::TOLERANCE * all).then(|| {
            format!(
                "the balance of energy does not close: {lost:.3e} J of {all:.3e} J exchanged are unaccounted for, \
                 more than {} %, although {integrator} should keep it. Try a smaller dt",
                100.0 * Self::TOLERANCE
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ledger of a body that loses half of its kinetic energy, in J.
    fn losing(kinetic: f64, in_contact: bool) -> Ledger {
        let entries = [1.0, 0.5].map(|part| Entry { kinetic: part * kinetic, ..Entry::default() }).to_vec();
        let (potentials, works, accounts, changed) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ledger { potentials, works, entries, in_contact, accounts, changed }
    }

    #[test]
    fn advice_against_losses_names_integrators_that_can_step_the_scene() {
        let advice = |integrator: &str, in_contact: bool| {
            let warning = losing(1.0, in_contact).loss(integrator).unwrap();
            warning.split_once("A smaller dt loses less").unwrap().1.to_owned()
        };
        let both = ", and so do the integrators `bdf2` and `implicit-midpoint`";
        assert_eq!([advice("newton", false), advice("implicit-euler", false)], [both, both]);
        assert_eq!(advice("newton", true), "", "certified contact needs newton");
        assert_eq!(advice("bdf2", false), ", and so does the integrator `implicit-midpoint`");
        assert_eq!(losing(1e-31, false).loss("newton"), None);
    }
}
