//! Diagnosis of the sim-to-real gap: where the simulation departs from a car, which effect causes it, how far it shrinks.

pub mod answer;
pub mod balance;
pub mod coordinate;
pub mod decide;
pub mod derivatives;
pub mod diagnosis;
pub mod fit;
pub mod freeform;
pub mod locate;
pub mod measure;
pub mod mechanisms;
pub mod nuisance;
pub mod predict;
pub mod problem;
pub mod pulsation;
pub mod screen;
pub mod select;
pub mod series;
