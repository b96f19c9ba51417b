//! What a model description states about its variables; `build.rs` fills the tables from the XML.

/// Type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Kind {
    Real,
    Integer,
    Boolean,
    Enumeration,
}

/// Causality of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Causality {
    Input,
    Output,
    Parameter,
    Local,
}

/// Variability of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Variability {
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

/// One `ScalarVariable`.
#[derive(Debug, PartialEq)]
pub struct Variable {
    /// Name.
    pub name: &'static str,
    /// Value reference.
    pub value_reference: u32,
    /// Type.
    pub kind: Kind,
    /// Causality.
    pub causality: Causality,
    /// Variability.
    pub variability: Variability,
    /// Unit.
    pub unit: &'static str,
    /// Start value; 0 or 1 for a Boolean.
    pub start: f64,
    /// Least value accepted.
    pub min: f64,
    /// Greatest value accepted.
    pub max: f64,
}

impl Variable {
    /// Whether this is an input without bounds: a measurement, whose plausibility the model itself judges. It takes any value, also NaN.
    #[inline]
    pub fn is_measurement(&self) -> bool {
        self.causality == Causality::Input && self.kind == Kind::Real && self.min == f64::NEG_INFINITY && self.max == f64::INFINITY
    }
}

/// A model description.
#[derive(Debug)]
pub struct Description {
    /// Name of the model.
    pub name: &'static str,
    /// GUID: a hash of the XML; FMUs with other start values have different last characters, see [`super::guid`].
    pub guid: &'static str,
    /// All variables, in the order of the XML.
    pub variables: &'static [Variable],
    /// Index of the variable by value reference; [`NOWHERE`] where there is none.
    pub lookup: &'static [u16],
}

/// Marks a value reference that belongs to no variable.
pub const NOWHERE: u16 = u16::MAX;

impl Description {
    /// Whether the model has effects, which faults can drive.
    pub fn has_effects(&self) -> bool {
        self.variables.iter().any(|v| v.name.starts_with("effect."))
    }

    /// Index of the variable with this value reference.
    #[inline]
    pub fn find(&self, value_reference: u32) -> Option<usize> {
        let index = *self.lookup.get(value_reference as usize)?;
        (index != NOWHERE).then_some(index as usize)
    }
}
