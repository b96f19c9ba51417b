//! What a retuned plant says of itself: where it was validated, and how well its clutch torque is known.
#![cfg(feature = "cli")]

use kisspoint::campaign::{self, ReadOptions};
use kisspoint::cli::blind::predicted;
use kisspoint::gap::diagnosis::diagnose;
use realcar::{Place, draw_car};

#[test]
fn the_predicted_deviation_of_the_torque_is_that_of_unseen_recordings() {
    let n: usize = std::env::var("CARS").map_or(4, |v| v.parse().unwrap());
    let seed: u64 = std::env::var("SEED").map_or(11, |v| v.parse().unwrap());
    let road = std::env::var("ROAD").is_ok();
    let (mut count, mut within) = (0, 0);
    let mut ratios = vec![];
    for k in 0..n {
        let place = if road { Place::Road } else { Place::Bench };
        let car = match std::env::var("KIND").as_deref() {
            Ok("healthy") => realcar::draw_car_of(place, seed, k, realcar::Kind::Healthy),
            Ok(id) => realcar::draw_car_of(place, seed, k, realcar::Kind::Single(Box::leak(id.to_owned().into_boxed_str()))),
            _ => draw_car(place, seed, k),
        };
        let folder = tempfile::tempdir().unwrap();
        car.write(folder.path()).unwrap();
        let campaign = campaign::read(folder.path(), &ReadOptions::default()).unwrap();
        let t = std::time::Instant::now();
        let found = diagnose(&campaign, &|_, _| {}).unwrap();
        let p = predicted::on(&car.unseen, &car.campaign.vehicle_json, &found.json, &car.real);
        println!(
            "car {k} {:?} {} bench {} rate {} places {} ({:.1} s)",
            car.truth.effects.iter().map(|e| e.id).collect::<Vec<_>>(),
            found.json["verdict"],
            car.campaign.recordings[0].bench.is_some(),
            car.campaign.recordings[0].sample_rate_hz,
            found.validated.places().len(),
            t.elapsed().as_secs_f64()
        );
        println!("    tolerances {}", found.json["which"]["tolerances"]);
        println!(
            "    named {:?}",
            found.json["which"]["effects"].as_array().unwrap().iter().map(|e| e["id"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
        );
        for r in p {
            let rms = |e: &predicted::Errors| (e.squares / e.count as f64).sqrt();
            let s = |e: &predicted::Errors| (e.variances / e.count as f64).sqrt();
            println!(
                "    in mean {:+.3} of {:.1} {} within {} rms {:.3} sigma {:.3} ratio {:.2}; out {} within {} rms {:.3} sigma {:.3}",
                r.inside.sum / r.inside.count as f64,
                r.inside.torque / r.inside.count as f64,
                r.inside.count,
                r.inside.within,
                rms(&r.inside),
                s(&r.inside),
                r.inside.ratio(),
                r.outside.count,
                r.outside.within,
                rms(&r.outside),
                s(&r.outside)
            );
            count += r.inside.count;
            within += r.inside.within;
            if r.inside.count > 0 {
                ratios.push(r.inside.ratio());
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "within 2σ {within} of {count}: {:.3}; recordings with rms below 2σ {} of {}; median ratio {:.2} max {:.2}",
        within as f64 / count as f64,
        ratios.iter().filter(|r| **r < 2.0).count(),
        ratios.len(),
        ratios[ratios.len() / 2],
        ratios.last().unwrap()
    );
}
