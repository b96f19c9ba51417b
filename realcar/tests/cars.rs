//! What is promised about drawn cars.

use realcar::car::Start;
use realcar::catalogue::{LIBRARY, NEW, OUTSIDE};
use realcar::effects::{Deviation, Dice};
use realcar::vehicle::Vehicle;
use realcar::{Kind, Motion, Place, Recording, draw_car, draw_car_of, draw_car_sized, kind};

/// A car with all manoeuvres, slow samples and a quiet bench: the same numbers for every effect.
fn index_with_everything(seed: u64) -> usize {
    (0..400)
        .find(|&i| {
            let c = draw_car_of(Place::Bench, seed, i, Kind::Healthy).campaign.recordings;
            c.len() == 10 && c[0].bench.is_some() && c[0].sample_rate_hz < 500.0
        })
        .expect("one of 400 cars has it all")
}

fn kinds() -> impl Iterator<Item = Kind> {
    LIBRARY.iter().map(|e| Kind::Single(e.0)).chain(OUTSIDE.iter().chain(&NEW).map(|e| Kind::Outside(e.0)))
}

/// RMS change of the two speeds over a recording, rad/s.
fn change(a: &Recording, b: &Recording) -> f64 {
    let pairs = a.omega_f_rad_s.iter().zip(&b.omega_f_rad_s).chain(a.omega_c_rad_s.iter().zip(&b.omega_c_rad_s));
    let sum: f64 = pairs.map(|(x, y)| (x - y).powi(2)).sum();
    (sum / (2 * a.time_s.len()) as f64).sqrt()
}

#[test]
fn a_car_is_drawn_again_bit_for_bit() {
    for place in [Place::Bench, Place::Road] {
        let (once, again) = (draw_car(place, 5, 3), draw_car(place, 5, 3));
        assert_eq!((once.campaign, once.unseen, once.truth), (again.campaign, again.unseen, again.truth));
    }
    assert_ne!(draw_car(Place::Bench, 5, 3).campaign, draw_car(Place::Bench, 6, 3).campaign);
}

/// A launch, a shift of load and an opening, step by step, as bits.
fn ride(deviation: &Deviation) -> Vec<u64> {
    let vehicle = Vehicle::reference();
    let start = Start { omega: [130.0, 0.0], theta: [95.0, 60.0], air: 25.0, torque: 20.0, position: 3.6, length_s: 2.4 };
    let mut car = Motion::start(&vehicle, deviation, 1e-4, start, 3);
    let mut bits = Vec::new();
    for k in 0..240 {
        let t = 0.01 * f64::from(k);
        let position = if t < 2.0 { 3.6 + 2.6 * t.min(1.1) + 0.2 * (7.0 * t).sin() } else { 3.4 };
        car.drive(0.01, 35.0 + 15.0 * (3.0 * t).sin(), position);
        let [f, c] = car.sensed(0.01);
        bits.extend([f, c, car.x, car.t_fc, car.theta[0], car.theta[1]].map(f64::to_bits));
    }
    bits
}

#[test]
fn an_effect_of_no_size_leaves_the_healthy_car() {
    let healthy = ride(&Deviation::default());
    for (id, _) in LIBRARY.iter().chain(&OUTSIDE).chain(&NEW) {
        for seed in 0..4 {
            let mut null = Deviation::default();
            null.set(id, &mut Dice::new(seed, 0.0));
            assert!(ride(&null) == healthy, "{id}");
        }
    }
    let null = draw_car_sized(Place::Road, 11, 1, Kind::Single("vehicle_mass"), 0.0);
    assert_eq!(null.campaign, draw_car_of(Place::Road, 11, 1, Kind::Healthy).campaign);
}

#[test]
fn every_effect_changes_what_is_recorded() {
    let i = index_with_everything(11);
    let healthy = draw_car_of(Place::Bench, 11, i, Kind::Healthy);
    let mut faint = Vec::new();
    for k in kinds() {
        let car = draw_car_of(Place::Bench, 11, i, k);
        let pairs = healthy.campaign.recordings.iter().zip(&car.campaign.recordings);
        let largest = pairs.map(|(a, b)| change(a, b)).fold(0.0, f64::max);
        println!("{k:?}: {largest:.3} rad/s; {:?} {:?}", car.truth.effects[0].shape, car.truth.effects[0].parameters);
        // The largest noise of a car's speeds is 0.26 rad/s.
        if largest < 0.5 {
            faint.push(format!("{k:?}: {largest:.3} rad/s"));
        }
    }
    assert!(faint.is_empty(), "{faint:?}");
}

/// All that could tell a car's answer but its behaviour: names, order, sizes and noise.
#[test]
fn the_answer_is_not_in_the_files() {
    for i in 0..3 {
        let plain = draw_car_of(Place::Bench, 31, i, Kind::Healthy);
        for id in ["friction_level", "actuator_backlash", "engine_speed_delay"] {
            let car = draw_car_of(Place::Bench, 31, i, Kind::Single(id));
            assert_eq!(car.campaign.vehicle_json, plain.campaign.vehicle_json);
            assert_eq!(car.campaign.recordings.len(), plain.campaign.recordings.len());
            for (a, b) in car.campaign.recordings.iter().zip(&plain.campaign.recordings) {
                assert_eq!((a.manoeuvre, a.sample_rate_hz, a.bench.is_some()), (b.manoeuvre, b.sample_rate_hz, b.bench.is_some()));
                assert_eq!((a.theta_c0_deg_c, a.theta_b0_deg_c, &a.time_s), (b.theta_c0_deg_c, b.theta_b0_deg_c, &b.time_s));
                // Nothing has acted yet: the same noise on the same speeds.
                assert_eq!((a.omega_f_rad_s[0], a.omega_c_rad_s[0]), (b.omega_f_rad_s[0], b.omega_c_rad_s[0]));
            }
        }
    }
}

#[test]
fn columns_are_whole_and_finite() {
    for i in 0..12 {
        let car = draw_car(Place::Bench, 2, i);
        assert_eq!(car.unseen.len(), 3);
        for r in car.campaign.recordings.iter().chain(&car.unseen) {
            let mut columns = vec![&r.time_s, &r.omega_f_rad_s, &r.omega_c_rad_s, &r.t_e_nm, &r.x_to_cmd_mm, &r.theta_h_deg_c];
            if let Some(b) = &r.bench {
                columns.extend([&b.x_to_mm, &b.t_fc_nm, &b.theta_c_deg_c]);
            }
            for c in columns {
                assert_eq!(c.len(), r.time_s.len());
                assert!(c.iter().all(|x| x.is_finite() && x.abs() < 1000.0), "car {i}, {}", r.manoeuvre);
            }
        }
    }
}

#[test]
fn launches_of_healthy_cars_lock_up() {
    for i in 0..25 {
        let car = draw_car_of(Place::Bench, 4, i, Kind::Healthy);
        for (k, r) in car.campaign.recordings.iter().enumerate().filter(|(_, r)| r.manoeuvre == "launch") {
            // The fifth slips once more on purpose; all are closed after seven tenths of a launch and at 3 s.
            let at = ((0.88 * r.time_s.len() as f64).min(3.2 * r.sample_rate_hz)) as usize;
            let slip: f64 = (at..at + 8).map(|n| r.omega_f_rad_s[n] - r.omega_c_rad_s[n]).sum::<f64>() / 8.0;
            let late = k == 0 && r.time_s[at] < 3.3;
            assert!(late || slip.abs() < 0.6, "car {i}, launch {k}: {slip:.2} rad/s");
        }
    }
}

#[test]
fn the_mix_is_kept() {
    let (mut healthy, mut pairs, mut triples, mut outside) = (0, 0, 0, 0);
    let mut singles = std::collections::BTreeMap::new();
    for i in 0..480 {
        match kind(Place::Bench, 8, i) {
            Kind::Healthy => healthy += 1,
            Kind::Single(id) => *singles.entry(id).or_insert(0) += 1,
            Kind::Pair(a, b) => {
                assert_ne!(a, b);
                pairs += 1;
            }
            Kind::Triple(a, b, c) => {
                assert!(a != b && b != c && c != a);
                triples += 1;
            }
            Kind::Outside(_) => outside += 1,
        }
    }
    assert_eq!((healthy, pairs, triples, outside), (72, 96, 48, 72));
    assert_eq!(singles.len(), 24);
    assert!(singles.values().all(|&n| n == 8), "{singles:?}");
}

#[test]
fn a_campaign_is_written_in_the_contract_s_form() {
    let dir = std::env::temp_dir().join(format!("realcar_{}", std::process::id()));
    let car = draw_car(Place::Bench, 1, 0);
    car.write(&dir).expect("a temporary folder can be written");
    let vehicle: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(dir.join("vehicle.json")).unwrap()).unwrap();
    assert!(vehicle["tolerance"]["friction.mu"]["rel"].is_number());
    let index: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(dir.join("recordings.json")).unwrap()).unwrap();
    assert_eq!(index.as_object().unwrap().len(), car.campaign.recordings.len());
    let text = std::fs::read_to_string(dir.join("r01.csv")).unwrap();
    assert!(text.starts_with("time_s,omega_f_rad_s,omega_c_rad_s,T_e_Nm,x_to_cmd_mm,theta_h_degC"));
    assert_eq!(text.lines().count(), 1 + car.campaign.recordings[0].time_s.len());
    std::fs::remove_dir_all(dir).unwrap();
}
