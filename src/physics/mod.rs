//! The equations of the nominal plant, each implemented once, as pure functions of numbers.
//!
//! Nothing here depends on effects, FMI or files. Units: s, rad/s, N·m, N, mm for throwout position, °C, J.

pub mod approach;
pub mod cushion;
pub mod driveline;
pub mod friction;
pub mod lag;
pub mod map;
pub mod phase;
pub mod thermal;
