//! FMI 2.0 for co-simulation: the C boundary of both FMUs.
//!
//! One shared library serves both models; the GUID that the importer passes to `fmi2Instantiate` selects one.
//!
//! | layer | files |
//! |---|---|
//! | C interface | [`types`], [`exports`] (every function), [`model_exchange`] (those that always refuse), [`calibration`], [`guard`] (the single entry point) |
//! | any model | [`instance`] (life cycle, values, steps), [`call`] (which calls are allowed when), [`refusal`], [`log`], [`words`] and [`saved`] (FMU states), [`resource`] |
//! | the two models | [`model`] (their interface), [`guid`] (model and start values), [`plant`], [`controller`], [`variables`] (tables made from the XML) |
//!
//! Instances share nothing that changes what they compute. The only globals are the vehicle file that was read last ([`resource`]), the paper's plant
//! ([`plant`]), and the number of instances ([`guard`]); when the last instance is freed, the file is forgotten. After initialization, getting, setting,
//! stepping and saving into an existing state allocate nothing, take no lock and make no system call; the importer's allocator is never used.

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
