//! Writes the campaign that ships with the repository: `example_campaign DIR [EFFECT]`.
//!
//! It is the first car of its seed that was recorded on the road, without bench channels, at 100 Hz, with all manoeuvres.

use realcar::{Car, Kind, Place, catalogue, draw_car_of};
use std::error::Error;
use std::path::Path;

const SEED: u64 = 20_111;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let dir = args.next().ok_or("name the directory to write, e.g. tests/data/campaigns/example")?;
    let effect = args.next().unwrap_or_else(|| "kiss_point_thermal".into());
    let (id, ..) = catalogue::find(&effect).ok_or_else(|| format!("no effect is called {effect}"))?;
    let car = (0..1000)
        .map(|index| draw_car_of(Place::Bench, SEED, index, Kind::Single(id)))
        .find(small_and_whole)
        .ok_or("none of 1000 cars is small and whole")?;
    car.write(Path::new(&dir))?;
    for effect in &car.truth.effects {
        println!("{dir}: {} ({})", effect.id, effect.shape);
    }
    Ok(())
}

fn small_and_whole(car: &Car) -> bool {
    let recordings = &car.campaign.recordings;
    let small = recordings.iter().all(|r| r.bench.is_none() && r.sample_rate_hz < 500.0);
    small && recordings.len() == 9
}
