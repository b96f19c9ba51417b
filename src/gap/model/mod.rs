//! The model of the data: recordings, noise, tolerances, and the corrected replay that computes innovations from them.

pub mod clock;
pub mod column;
pub mod course;
pub mod filter;
pub mod lock_up;
pub mod missing;
pub mod noise;
pub mod prepare;
pub mod replay;
pub mod stale;
pub mod tolerance;
pub mod track;
pub mod unknown_clutch;
pub mod unseen;
