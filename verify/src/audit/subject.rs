use std::path::Path;

use anyhow::Context;
use energy_compiler::{Interpreted, Textbook};
use energy_dsl::{AnyElement, Declaration, Inputs, Kind, Outputs, RestError};

use crate::blocks::{Answer, NoAnswer, evaluate};
use crate::sample::Sample;

/// A function or closure that evaluates an element.
pub type EvaluateAny = Box<dyn Fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>>;

/// An element to audit: from the catalogue, or from a text read at run time.
#[derive(Clone, Debug)]
pub struct Target(Origin);

#[derive(Clone, Debug)]
enum Origin {
    Catalogue(&'static AnyElement),
    /// With the claims of its text, which its source is without.
    Text(Box<Interpreted>),
}

impl Target {
    /// Creates the target of an element of the catalogue.
    #[must_use]
    pub fn of_element(entry: &'static AnyElement) -> Self {
        Self(Origin::Catalogue(entry))
    }

    /// Returns every declaration of a text in the format of an `.energy` file; messages call it `name`.
    ///
    /// # Errors
    /// If the text has errors.
    pub fn of_text(text: &str, name: &str) -> Result<Vec<Self>, energy_compiler::Diagnostics> {
        let elements = Interpreted::from_file(text, name)?;
        Ok(elements.into_iter().map(|element| Self(Origin::Text(Box::new(element)))).collect())
    }

    /// Returns every declaration of a file.
    ///
    /// # Errors
    /// If the file cannot be read, or the text has errors.
    pub fn of_file(path: &Path) -> anyhow::Result<Vec<Self>> {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let targets =
            Self::of_text(&text, &path.display().to_string()).map_err(|errors| anyhow::anyhow!("{errors}"))?;
        anyhow::ensure!(!targets.is_empty(), "{} contains no declaration", path.display());
        Ok(targets)
    }

    /// Returns the name of the element.
    #[must_use]
    pub fn name(&self) -> &str {
        self.declaration().name
    }

    fn declaration(&self) -> &'static Declaration {
        match &self.0 {
            Origin::Catalogue(entry) => entry.declaration,
            Origin::Text(element) => element.declaration(),
        }
    }

    /// Returns the element in the form that audits need.
    ///
    /// # Errors
    /// If the declaration does not compile.
    pub fn subject(&self) -> Result<Subject, String> {
        let declaration = self.declaration();
        match &self.0 {
            Origin::Catalogue(entry) => {
                // A declaration's source includes the functions that it uses, so it compiles on its own.
                let mut declared = Interpreted::from_source(declaration.source).map_err(|errors| errors.to_string())?;
                let interpreted = declared.pop();
                Subject::new(declaration, Box::new(entry.evaluate), interpreted)
            }
            Origin::Text(element) => {
                let (runs, interpreted) = (element.clone(), element.as_ref().clone());
                Subject::new(declaration, Box::new(move |inputs| runs.evaluate(inputs)), Some(interpreted))
            }
        }
    }
}

/// An element under audit.
pub struct Subject {
    /// The declaration.
    pub declaration: &'static Declaration,
    /// Evaluates all blocks of the element.
    pub evaluate: EvaluateAny,
    /// The textbook form.
    pub formula: Textbook,
    /// The compiled routines, in which faults are planted; `None` if the source is not available.
    pub interpreted: Option<Interpreted>,
}

impl Subject {
    /// Creates the subject of an audit.
    ///
    /// # Errors
    /// If the source of the declaration does not compile.
    pub fn new(
        declaration: &'static Declaration,
        evaluate: EvaluateAny,
        interpreted: Option<Interpreted>,
    ) -> Result<Self, String> {
        let formula = Textbook::from_source(declaration.source).map_err(|errors| errors.to_string())?;
        Ok(Self { declaration, evaluate, formula, interpreted })
    }

    /// Evaluates all blocks at an input.
    ///
    /// # Errors
    /// If the rest shape is degenerate or a block has the wrong size.
    pub fn answer(&self, sample: &Sample) -> Result<Answer, NoAnswer> {
        evaluate(self.declaration, &self.evaluate, &sample.inputs())
    }

    /// Returns whether the element depends on velocities.
    #[must_use]
    pub fn has_velocities(&self) -> bool {
        matches!(self.declaration.kind, Kind::Force | Kind::Constraint)
    }
}
