//! Kisspoint: a dry clutch for co-simulation, and a diagnosis of where its simulation departs from a car.
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "cli")]
pub mod campaign;
pub mod effects;
#[cfg(feature = "cli")]
pub mod gap;
pub mod physics;
pub mod plant;
#[cfg(feature = "cli")]
pub mod report;
pub mod vehicle;
