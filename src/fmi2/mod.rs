//! FMI 2.0 for co-simulation: the C boundary of both FMUs.
//!
//! One shared library serves both models; the GUID that the importer passes to `fmi2Instantiate` says which.
//!
//! | layer | files |
//! |---|---|
//! | C interface | [`types`], [`exports`] (every function), [`model_exchange`] (those that always refuse), [`calibration`], [`guard`] (the one way in) |
//! | any model | [`instance`] (life cycle, values, steps), [`call`] (what may be called when), [`refusal`], [`log`], [`words`] and [`saved`] (FMU states), [`resource`] |
//! | the two models | [`model`] (what is asked of one), [`guid`] (which one is meant, and with which start values), [`plant`], [`controller`], [`variables`] (tables made from the XML) |
//!
//! Instances share nothing that changes what they compute: globals are the vehicle file that was read last ([`resource`]), the paper's plant ([`plant`]), and how
//! many instances there are, with the last of which the file is forgotten ([`guard`]). After initialization, getting, setting, stepping and saving into an existing
//! state allocate nothing, take no lock and make no system call; the importer's allocator is never used.

pub mod calibration;
pub mod call;
pub mod controller;
pub mod exports;
pub mod guard;
pub mod guid;
pub mod instance;
pub mod log;
pub mod model;
pub mod model_exchange;
pub mod plant;
pub mod refusal;
pub mod resource;
pub mod saved;
#[cfg(target_arch = "wasm32")]
pub mod sources;
pub mod types;
pub mod variables;
pub mod words;
