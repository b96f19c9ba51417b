//! Inference: one density, its mode, its evidence, and the search over what may be missing.

pub mod belief;
pub mod coordinate;
pub mod density;
pub mod exchange;
pub mod fit;
pub mod form;
pub mod information;
pub mod irregular;
pub mod learned;
pub mod limit;
pub mod linear;
pub mod posterior;
pub mod prior;
pub mod pulsation;
pub mod screen;
pub mod search;
pub mod sensors;
pub mod strained;
pub mod unknown;
pub mod weigh;
