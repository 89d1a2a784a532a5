use std::fmt;
use std::time::Duration;

use energy_dsl::{Element, Vector3};
use energy_elements::{DistanceBarrier, SlidingFriction};
use energy_solve::{Counts, EvaluationError, State, Tally};
use serde::{Deserialize, Serialize};

use super::{Island, Simulation, Totals};
use crate::Body;
use crate::integrator::{Phases, SolvedBy};
use crate::model::{Model, TermLabel};
use crate::scene::{ContactChoice, Scene};

/// The outcome of a simulation. `Display` prints it as a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Summary {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of pinned vertices.
    pub pinned: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of islands.
    #[serde(default)]
    pub islands: usize,
    /// Number of islands asleep at the end.
    #[serde(default)]
    pub asleep: usize,
    /// The integrator's name.
    pub integrator: String,
    /// Time step, in s.
    pub dt: f64,
    /// The time step of the scene, in s; `None` if it was not shortened to end steps with frames.
    #[serde(default)]
    pub shortened_from: Option<f64>,
    /// Totals over all steps.
    #[serde(flatten)]
    pub totals: Totals,
    /// One entry per term of the scene.
    pub terms: Vec<TermSummary>,
    /// Terms that were left out, with the reason.
    pub left_out: Vec<String>,
    /// Descriptions of the garments from files: their pieces and welded vertices.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Warnings about the scene and the run.
    pub warnings: Vec<String>,
    /// Number of edges of cloth and hair that touch or cross a triangle at the end.
    #[serde(default)]
    pub crossings: usize,
    /// Number of places where cloth or hair crosses an obstacle at the end.
    #[serde(default)]
    pub obstacle_crossings: usize,
    /// ½ Σ m v², in J.
    pub kinetic_energy: f64,
    /// Σ m v, in kg m/s.
    pub momentum: Vector3<f64>,
    /// Σ m x × v about the origin, in kg m²/s.
    pub angular_momentum: Vector3<f64>,
    /// The total force of the cloth on its pins, in N.
    pub pin_force: Vector3<f64>,
}

/// The work done by one term, and its energy at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TermSummary {
    /// The term's name.
    pub name: String,
    /// The name of its declared element.
    pub element: String,
    /// Number of elements; `None` for certified contact, whose pairs change all the time.
    #[serde(default)]
    pub elements: Option<usize>,
    /// Energy at the end, in J; `None` for a force law.
    pub energy: Option<f64>,
    /// Numbers of evaluated and skipped elements, per routine; `None` for certified contact, whose work is in
    /// [`Totals::contact`].
    #[serde(default, with = "super::saved::saved_counts")]
    pub counts: Option<Counts>,
    /// Constant Hessians that were reused instead of evaluated; `None` for certified contact.
    #[serde(default)]
    pub reused: Option<u64>,
}

impl Summary {
    /// The summary before the first step.
    pub(super) fn at_start(scene: &Scene, model: &Model, islands: usize) -> Self {
        Self {
            vertices: model.pinned.len(),
            pinned: model.pinned_at_start.iter().filter(|&&pinned| pinned).count(),
            triangles: model.triangles.len(),
            islands,
            integrator: scene.stepper().name().to_owned(),
            dt: scene.time_grid().step,
            shortened_from: Some(scene.dt).filter(|&dt| dt != scene.time_grid().step),
            left_out: model.left_out.clone(),
            notes: model.notes.clone(),
            warnings: model.warnings.clone(),
            ..Self::default()
        }
    }

    /// The phases of a step, in order, with the total time of each.
    #[must_use]
    pub fn named_phases(&self) -> [(&'static str, Duration); 8] {
        let Phases { assembly, factorisation, solve, line_search, collision, .. } = self.totals.phases;
        let Phases { contact, preparation, ledger, .. } = self.totals.phases;
        [
            ("assembly", assembly),
            ("factorisation", factorisation),
            ("linear solves", solve),
            ("line search", line_search),
            ("collision", collision),
            ("contact", contact),
            ("preparation", preparation),
            ("ledger", ledger),
        ]
    }

    /// Describes the number of islands and the steps that they slept through.
    #[must_use]
    pub fn sleep(&self) -> String {
        let all = self.totals.steps * self.islands as u64;
        let islands = if self.islands == 1 { "1 island".to_owned() } else { format!("{} islands", self.islands) };
        match (self.totals.slept, self.asleep) {
            (0, 0) => islands,
            (slept, asleep) => format!("{islands}, {asleep} asleep; {slept} of their {all} steps slept through"),
        }
    }
}

impl Simulation {
    /// Returns the totals so far and the current energies, forces and momenta.
    ///
    /// # Errors
    /// Returns an error if an energy is not finite.
    pub fn summary(&mut self) -> Result<Summary, EvaluationError> {
        let mut summary = self.summary.clone();
        let mut energies: Vec<Option<f64>> = vec![None; self.labels.len()];
        let add = |sum: &mut Vector3<f64>, part: Vector3<f64>| (0..3).for_each(|axis| sum[axis] += part[axis]);
        for island in &mut self.islands {
            let labels = island.labels().to_vec();
            let body = island.body_mut();
            for (&label, term) in labels.iter().zip(body.system.energies(&body.x)?) {
                energies[label] = term.energy.map(|energy| energies[label].unwrap_or(0.0) + energy).or(energies[label]);
            }
            let force = body.system.forces(State { x: &body.x, v: &body.v })?;
            summary.kinetic_energy += body.kinetic_energy();
            add(&mut summary.momentum, body.momentum());
            add(&mut summary.angular_momentum, body.angular_momentum());
            add(&mut summary.pin_force, pin_force(body, &force));
            summary.asleep += usize::from(island.is_asleep());
        }
        summary.terms = self.term_summaries(&energies);
        summary.terms.extend(self.contact_terms());
        self.add_findings(&mut summary);
        Ok(summary)
    }

    /// Returns the totals so far without energies, forces and momenta, for a state whose energies are not finite.
    #[must_use]
    pub fn summary_without_energies(&self) -> Summary {
        let mut summary = self.summary.clone();
        summary.terms = self.term_summaries(&vec![None; self.labels.len()]);
        self.add_findings(&mut summary);
        summary.warnings.push("the energies at the end are not finite".to_owned());
        summary
    }

    /// Returns the terms of the scene, with the energy of each.
    fn term_summaries(&self, energies: &[Option<f64>]) -> Vec<TermSummary> {
        let mut elements = vec![0; self.labels.len()];
        for island in &self.islands {
            for (&label, (term, _)) in island.labels().iter().zip(island.body().system.terms()) {
                elements[label] += term.stencils().len();
            }
        }
        let term = |(number, counts): (usize, Counts)| {
            let TermLabel { name, element } = self.labels[number].clone();
            let (element, energy, elements) = (element.to_owned(), energies[number], Some(elements[number]));
            TermSummary { name, element, elements, energy, reused: Some(counts.reused), counts: Some(counts) }
        };
        self.counts().into_iter().enumerate().map(term).collect()
    }

    /// Returns the elements of certified contact, which is not a term: the energy of the pairs at the end, friction
    /// included.
    fn contact_terms(&self) -> Vec<TermSummary> {
        let energies: Vec<f64> = self.islands.iter().filter_map(Island::contact_energy).collect();
        if energies.is_empty() {
            return Vec::new();
        }
        // Starting at 0 turns −0, the sum of no pairs, into 0.
        let energy = energies.iter().fold(0.0, |sum, energy| sum + energy);
        let named = [
            ("contact", &*<DistanceBarrier as Element>::DECLARATION.name, Some(energy)),
            ("friction of contact", &*<SlidingFriction as Element>::DECLARATION.name, None),
        ];
        let term = |(name, element, energy): (&str, &str, Option<f64>)| {
            let (name, element) = (name.to_owned(), element.to_owned());
            TermSummary { name, element, elements: None, energy, counts: None, reused: None }
        };
        named.map(term).into()
    }

    /// Says why cloth can pass through itself, or what prevents it.
    fn cause_of_crossings(&self) -> &'static str {
        match self.contact {
            ContactChoice::Off => OFF,
            ContactChoice::On => PINNED,
            ContactChoice::Obstacles if self.summary.integrator == "newton" => "`contact = \"on\"` prevents this",
            ContactChoice::Obstacles => "`integrator = \"newton\"` with `contact = \"on\"` prevents this",
        }
    }

    /// Says why cloth can cross obstacles, or what prevents it.
    fn cause_of_obstacle_crossings(&self) -> &'static str {
        let is_certified = self.islands.iter().any(|island| island.body().system.has_contact());
        match (self.contact, is_certified) {
            (ContactChoice::Off, _) => OFF,
            (_, true) => PINNED,
            (_, false) => "The integrator `newton` keeps edges and triangles out of obstacles, others only vertices",
        }
    }

    /// Adds the crossings at the end and the balance of energy.
    fn add_findings(&self, summary: &mut Summary) {
        summary.crossings = self.crossings().len();
        summary.obstacle_crossings = self.obstacle_crossings();
        if summary.crossings > 0 {
            summary.warnings.push(format!(
                "the cloth passes through itself: at the end, edges cross triangles in {} places. {}",
                summary.crossings,
                self.cause_of_crossings()
            ));
        }
        if summary.obstacle_crossings > 0 {
            summary.warnings.push(format!(
                "the cloth crosses obstacles in {} places at the end. {}",
                summary.obstacle_crossings,
                self.cause_of_obstacle_crossings()
            ));
        }
        if let Totals { crossed_frames: crossed @ 1.., checked_frames, .. } = summary.totals {
            summary.warnings.push(format!("there are crossings in {crossed} of {checked_frames} checked frames"));
        }
        summary.warnings.extend(summary.totals.passages.iter().map(ToString::to_string));
        let Some(ledger) = &self.ledger else { return };
        let integrator = &summary.integrator;
        let of_energy = ledger.imbalance(integrator).or_else(|| ledger.gain(integrator));
        summary.warnings.extend(of_energy.or_else(|| ledger.loss(integrator)));
    }
}

/// The cause of crossings without contact.
const OFF: &str = "Nothing collides with `contact = \"off\"`";
/// The cause of crossings with certified contact.
const PINNED: &str = "Contact moves free vertices only, and all vertices there are pinned: change the pins or their \
                      motions";

/// Returns the total force of the cloth on its pins, in N.
fn pin_force(body: &Body, force: &[Vector3<f64>]) -> Vector3<f64> {
    let mut total = [0.0; 3];
    for (vertex, force) in force.iter().enumerate() {
        if body.system.dofs().row(vertex).is_none() {
            (0..3).for_each(|axis| total[axis] += force[axis]);
        }
    }
    total
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} vertices ({} pinned), {} triangles", self.vertices, self.pinned, self.triangles)?;
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        let Totals { steps, solves, solved_by, iterations, projected, rejected, stepping_time, .. } = &self.totals;
        let Totals { local_solves, local_vertices, energies, .. } = &self.totals;
        let simulated = *steps as f64 * self.dt;
        writeln!(f, "{}: {steps} steps of {} s = {simulated:.3} s", self.integrator, self.dt)?;
        if let Some(dt) = self.shortened_from {
            writeln!(f, "steps were shortened from {dt} s to end with the frames")?;
        }
        writeln!(f, "{}", self.sleep())?;
        let seconds = stepping_time.as_secs_f64();
        writeln!(f, "{seconds:.2} s of computing, {:.2} ms per step", 1e3 * seconds / (*steps).max(1) as f64)?;
        if *solves > 0 {
            let mean = *iterations as f64 / *solves as f64;
            writeln!(f, "{solves} linear solves, {iterations} iterations ({mean:.1} each)")?;
            if *local_solves > 0 {
                let mean = *local_vertices as f64 / *local_solves as f64;
                writeln!(f, "{local_solves} local solves of {mean:.0} vertices on average, not among them")?;
            }
            if *solved_by != SolvedBy::default() {
                writeln!(f, "by {solved_by}")?;
            }
            if *energies > 0 {
                writeln!(f, "{energies} evaluations of the energy along search directions")?;
            }
            writeln!(f, "{projected} steps with projected Hessians")?;
        }
        if *rejected > 0 {
            writeln!(f, "{rejected} steps rejected and retried with a smaller step size")?;
        }
        writeln!(f)?;
        writeln!(f, "{:<20} {:<20} {:>12}   evaluated (skipped) per routine", "term", "element", "energy, J")?;
        for term in &self.terms {
            let energy = term.energy.map_or("–".to_owned(), |energy| format!("{energy:.4e}"));
            let routines = term.counts.as_ref().map_or("–".to_owned(), routines);
            writeln!(f, "{:<20} {:<20} {energy:>12}   {routines}", term.name, term.element)?;
        }
        for reason in &self.left_out {
            writeln!(f, "left out: {reason}")?;
        }
        writeln!(f)?;
        writeln!(f, "kinetic energy     {:.4e} J", self.kinetic_energy)?;
        writeln!(f, "momentum           {} kg m/s", vector(&self.momentum))?;
        writeln!(f, "angular momentum   {} kg m²/s", vector(&self.angular_momentum))?;
        write!(f, "force on the pins  {} N", vector(&self.pin_force))?;
        for warning in &self.warnings {
            write!(f, "\nwarning: {warning}")?;
        }
        Ok(())
    }
}

fn routines(counts: &Counts) -> String {
    let one = |name: &str, tally: &Tally| {
        let flagged = if tally.flagged > 0 { format!(", {} flagged", tally.flagged) } else { String::new() };
        (tally.evaluated + tally.skipped > 0)
            .then(|| format!("{name} {} ({}{flagged})", tally.evaluated, tally.skipped))
    };
    let all = [("value", &counts.value), ("first", &counts.gradient), ("second", &counts.hessian)];
    all.iter().filter_map(|(name, tally)| one(name, tally)).collect::<Vec<_>>().join(" · ")
}

fn vector(v: &Vector3<f64>) -> String {
    format!("({:.4e}, {:.4e}, {:.4e})", v[0], v[1], v[2])
}
