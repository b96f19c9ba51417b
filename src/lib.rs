//! Kisspoint: a dry clutch for co-simulation, and a diagnosis of where its simulation departs from a real car.
//!
//! The modules build on each other, from the equations up:
//!
//! - [`physics`]: the equations of the paper, as pure functions; [`vehicle`]: the numbers that go with them, read from `vehicle.json`; [`json`]: how such files are read
//! - [`effects`]: what the nominal plant may be missing; [`faults`]: parameters of effects that change at given times
//! - [`plant`]: clutch and driveline in time, with exact stick and slip; [`control`]: the launch controller
//! - [`validated`]: where measurements have validated a plant
//! - [`fmi2`]: the C interface of the FMUs, and `fmu`, which packs them
//! - [`launch`]: plant and controller coupled; `plots`: its figures
//! - `campaign` reads measurements, `survey` takes a first look at a log, `gap` diagnoses, `report` shows the answer as a page
//! - `cli`: the command
//!
//! `docs/architecture.md` has the layers and their invariants. Without the feature `cli`, only what the shared library inside the FMUs needs is built.
#![deny(unsafe_code)]

#[cfg(feature = "campaign")]
pub mod campaign;
#[cfg(feature = "cli")]
pub mod cli;
pub mod control;
pub mod effects;
pub mod faults;
// The only module that may contain unsafe code, because it is called from C.
#[allow(unsafe_code)]
pub mod fmi2;
#[cfg(feature = "cli")]
pub mod fmu;
#[cfg(feature = "cli")]
pub mod gap;
pub mod json;
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
