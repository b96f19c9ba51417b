//! The model of the data, tested with cars simulated by the plant itself.

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
