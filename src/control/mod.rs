//! The controller of the paper's Figure 3, its estimators and its performance figures.
//!
//! A [`Controller`] is a plain value: [`Controller::step`] holds its inputs over a step, whatever its length, and
//! [`Controller::outputs`] depend on the past alone.
//!
//! - [`settings`]: every number that is the designer's choice
//! - [`reference`]: the two speed references
//! - [`pi`]: PI controller with anti-windup
//! - [`observer`]: clutch torque by (8a), (8b) and (9)
//! - [`temperature`]: disc and body temperature by (5), (6)
//! - [`held`]: exact solution that both estimators share
//! - [`performance`]: engagement time, dissipated energy (10), slip acceleration (11)
//! - [`guard`]: which inputs are believed
//! - [`figure_3`]: the paper's law while engaging
//! - [`governed`]: the governed law while engaging; [`governor`]: how fast its plan may run; [`bearing`]: where it sends the bearing
//! - [`approach`]: until the facings bite; [`landing`]: the second half of the launch; [`hill`]: hill holder
//! - [`filter`], [`load`]: lags that references share with measurements, load observer
//! - [`learning`]: touch point and friction over launches
//! - [`state`]: outputs, and all that changes while it runs
//! - [`controller`]: phases and estimates that both laws share

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
