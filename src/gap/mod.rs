//! Diagnosis of the sim-to-real gap: where the simulation departs from a car, which effect causes it, how far it shrinks.
//!
//! The way of the data:
//!
//! 1. [`held_out`]: what takes no part in choosing or fitting, and judges at the end
//! 2. [`model`]: recordings as tracks of real samples; noise; tolerances as priors; a replay that a Kalman filter corrects, whose innovations are white
//!    where the model is right; laws that no effect holds
//! 3. [`infer`]: one joint density of recordings and unknowns; its mode and evidence; the search over sets of effects; the posterior over these and over
//!    missing laws
//! 4. [`verdict`]: what the posterior says; [`map`]: where the balances do not close; [`measure`]: how far off free replays are, before and after
//! 5. [`plan`]: what to measure so that what is open splits, and how large an effect shows
//! 6. [`compose`]: the [`answer`], in its words; [`joint`]: the posterior itself, for those who pool cars; [`domain`]: where the retuned plant was validated, and how
//!    well its clutch torque is known; [`diagnosis`] runs all of it, and [`progress`] says how far
//!    it is

pub mod answer;
pub mod compose;
pub mod diagnosis;
pub mod domain;
pub mod empirical;
pub mod held_out;
pub mod infer;
pub mod joint;
pub mod map;
pub mod measure;
pub mod model;
pub mod plan;
pub mod progress;
pub mod verdict;
