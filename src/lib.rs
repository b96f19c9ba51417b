//! Kisspoint: a dry clutch for co-simulation, and a diagnosis of where its simulation departs from a car.
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "campaign")]
pub mod campaign;
#[cfg(feature = "cli")]
pub mod cli;
pub mod control;
pub mod effects;
pub mod faults;
// The one module that may be unsafe: it is spoken to from C.
#[allow(unsafe_code)]
pub mod fmi2;
#[cfg(feature = "cli")]
pub mod fmu;
#[cfg(feature = "cli")]
pub mod gap;
pub mod launch;
pub mod physics;
pub mod plant;
#[cfg(feature = "cli")]
pub mod plots;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod survey;
pub mod validated;
pub mod vehicle;
