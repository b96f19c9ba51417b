//! Inference: the joint density, its mode and its evidence, and the search over sets of effects and missing laws.

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
