//! The controller of the paper's Figure 3, its estimators and its performance figures.
//!
//! - [`settings`]: every number that is the designer's choice

pub mod settings;

pub use settings::Settings;
