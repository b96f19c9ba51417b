//! The engagement controller with its two laws (the governed one and the paper's Figure 3), its estimators and its performance figures.
//!
//! A [`Controller`] is a plain value: [`Controller::step`] holds its inputs over a step of any length, and [`Controller::outputs`] depend only on the past.
//!
//! - [`settings`]: all design parameters
//! - [`mod@reference`]: the two speed references
//! - [`pi`]: PI controller with anti-windup
//! - [`observer`]: clutch torque by (8a), (8b) and (9)
//! - [`temperature`]: disc and body temperature by (5), (6)
//! - [`held`]: exact solution of a linear system with held inputs, shared by both estimators
//! - [`performance`]: engagement time, dissipated energy (10), slip acceleration (11)
//! - [`guard`]: which inputs are believed
//! - [`figure_3`]: the paper's law while engaging
//! - [`governed`]: the governed law while engaging; [`governor`]: how fast its plan may run; [`bearing`]: its position command
//! - [`approach`]: phase before the facings bite; [`landing`]: the second half of the launch; [`hill`]: hill holder
//! - [`filter`], [`load`]: lags that delay references like the measurements, load observer
//! - [`learning`]: touch point and friction as learned over launches
//! - [`state`]: outputs, and everything that changes while the controller runs
//! - [`controller`]: phases and estimates shared by both laws

pub mod approach;
pub mod bearing;
pub mod controller;
pub mod figure_3;
pub mod filter;
pub mod governed;
pub mod governor;
pub mod guard;
pub mod held;
pub mod hill;
pub mod landing;
pub mod learning;
pub mod load;
pub mod observer;
pub mod performance;
pub mod pi;
pub mod reference;
pub mod settings;
pub mod state;
pub mod temperature;

pub use controller::Controller;
pub use guard::{Fault, Inputs, Wish};
pub use settings::Settings;
pub use state::Outputs;
