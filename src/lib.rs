//! Kisspoint: a dry clutch for co-simulation, and a diagnosis of where its simulation departs from a car.
#[cfg(feature = "cli")]
pub mod campaign;
