//! Diagnosis of the sim-to-real gap: where the simulation departs from a car, which effect causes it, and how far adding that effect closes the gap.
//!
//! The modules, in the order in which the data pass through them:
//!
//! 1. [`held_out`]: the data that take no part in selection or fitting, and by which the result is judged
//! 2. [`ready`]: a campaign prepared for the fit, without stale samples and with inputs as its control unit makes them; [`divide`] and [`enough`]: the part of a long campaign
//!    that is fitted; [`model`]: recordings as tracks of real samples; noise; tolerances as priors; a replay corrected by a Kalman filter, whose innovations (measurement minus prediction)
//!    are white where the model is right; smooth laws that no effect of the library covers
//! 3. [`infer`]: one joint density of recordings and unknowns; its mode and evidence; the search over sets of effects; the posterior over these sets and over
//!    missing laws
//! 4. [`verdict`]: what the posterior says; [`mistaken`]: whether channels are mapped wrongly; [`map`]: where the balances do not close; [`free`]: replays without corrections by a
//!    filter; [`measure`]: how far off they are, before and after retuning; [`drive`]: when the driver of a recorded drive braked and the clutch engaged
//! 5. [`plan`]: what to measure to settle what is open, and how small an effect would still show; [`advice`]: the same in words
//! 6. [`retune`]: the numbers of the car that is handed back
//! 7. [`empirical`]: laws learned from the recordings for what the library does not explain; [`domain`]: where the retuned plant was validated, and how well its
//!    clutch torque is known
//! 8. [`compose`]: the [`answer`]; [`sentence`], [`notes`] and [`prose`]: its words; [`joint`]: the posterior itself, for pooling many cars
//!
//! [`diagnosis`] runs all of it, and [`progress`] reports how far it is.

pub mod advice;
pub mod answer;
pub mod compose;
pub mod diagnosis;
pub mod divide;
pub mod domain;
pub mod drive;
pub mod empirical;
pub mod enough;
pub mod free;
pub mod held_out;
pub mod infer;
pub mod joint;
pub mod map;
pub mod measure;
pub mod mistaken;
pub mod model;
pub mod notes;
pub mod plan;
pub mod progress;
pub mod prose;
pub mod ready;
pub mod retune;
pub mod sentence;
pub mod verdict;
