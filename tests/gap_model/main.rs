//! The model of the data against cars that the plant itself makes up.

mod filter;
mod inference;
mod laws;
mod logger;
mod long_drive;
mod made_up;
mod residual_map;
#[path = "../thinned/mod.rs"]
mod thinned;
mod uncertainty;
