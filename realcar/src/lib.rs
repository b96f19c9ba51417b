//! Cars whose effects are withheld from the diagnosis.
//!
//! A diagnosis that is only ever tried on its own plant finds its own formulas again. This crate draws cars of another
//! make: it shares no code with the plant, integrates with another scheme, and gives every effect a law of its own, most of them smooth random
//! functions of slip, position, temperature, speed or time, so that no library can hold their formulas. Some cars carry
//! an effect that no library holds, and some none at all; every car differs from its vehicle file within the tolerances.
//!
//! | layer | module | what it holds |
//! |---|---|---|
//! | numbers | [`vehicle`], [`map`] | the vehicle file, the real car's numbers, friction and cushion |
//! | what is withheld | [`effects`], [`catalogue`] | one deviation per subsystem, drawn by its id |
//! | motion on a bench | [`car`], [`tcu`], [`manoeuvre`], [`channels`] | the car, its controller, what is driven, what is recorded |
//! | motion on the road | [`drive`], [`driver`] | legs of stop and go, driver and controller |
//! | a fleet | [`fleet`] | cars of one type, with a population that the file does not declare |
//! | motion on order | [`ordered`] | a further recording, driven as somebody else commands |
//! | campaigns | [`draw`](mod@draw), [`altered`], [`write`](mod@write) | a whole campaign with its truth, what a worse logger makes of it, its files |
//!
//! ```
//! let car = realcar::draw_car_of(realcar::Place::Bench, 7, 0, realcar::Kind::Single("friction_level"));
//! assert_eq!(car.truth.effects[0].subsystem, "friction");
//! assert!(car.campaign.recordings.len() >= 5);
//! ```

pub mod altered;
mod bed;
pub mod car;
pub mod catalogue;
pub mod channels;
pub mod draw;
pub mod drive;
pub mod driver;
pub mod effects;
pub mod fleet;
pub mod manoeuvre;
pub mod map;
pub mod ordered;
mod street;
pub mod tcu;
pub mod vehicle;
pub mod write;

/// Version of what is drawn: equal versions and seeds draw equal cars. It changes only with a line and a reason in CHANGELOG.md.
pub const VERSION: u32 = 6;

pub use car::Motion;
pub use channels::Recording;
pub use draw::{
    Campaign, Car, Driven, Kind, Place, Real, TrueEffect, Truth, draw_car, draw_car_of, draw_car_sized, draw_long, draw_new, kind,
};
