//! What is promised about cars on the road.

use realcar::{Kind, Place, Recording, draw_car_of, write};

fn healthy(index: usize) -> realcar::Car {
    draw_car_of(Place::Road, 21, index, Kind::Healthy)
}

fn drives(cars: usize) -> impl Iterator<Item = (usize, Recording)> {
    (0..cars).flat_map(|i| healthy(i).campaign.recordings.into_iter().map(move |r| (i, r)))
}

#[test]
fn a_campaign_holds_drives_as_a_logger_gives_them() {
    for i in 0..4 {
        let car = healthy(i);
        assert!((2..=5).contains(&car.campaign.recordings.len()));
        let file: serde_json::Value = serde_json::from_str(&car.campaign.vehicle_json).unwrap();
        let tolerance = &file["tolerance"];
        for name in ["sensors.omega_f_latency", "sensors.omega_c_latency", "engine.T_e_wander", "driveline.grade"] {
            assert!(tolerance[name]["abs"].as_f64().unwrap() > 0.0, "{name}");
        }
        assert!(tolerance["engine.T_e_wander"]["time_s"].is_number());
        assert_eq!(tolerance["driveline.grade"]["per"], "recording");
        for r in &car.campaign.recordings {
            assert_eq!((r.manoeuvre, r.bench.is_none(), r.theta_sigma_k), ("drive", true, Some([12.0; 2])));
            assert!([50.0, 100.0].contains(&r.sample_rate_hz));
            let length = r.time_s.last().unwrap();
            assert!((19.9..80.1).contains(length), "{length}");
            let dt = 1.0 / r.sample_rate_hz;
            let uneven = r.time_s.windows(2).map(|t| ((t[1] - t[0]) / dt - 1.0).abs()).fold(0.0, f64::max);
            assert!(uneven > 0.005 && uneven < 0.2, "stamps jitter by {uneven}");
            assert!(write::csv(r).starts_with("time_s,omega_f_rad_s,omega_c_rad_s,T_e_Nm,x_to_cmd_mm,theta_h_degC,brake\n"));
        }
    }
}

#[test]
fn drives_stop_and_go() {
    let (mut engagements, mut count) = (0, 0);
    for (i, r) in drives(4) {
        let brake = r.brake.as_ref().unwrap();
        let closed = r.x_to_cmd_mm.iter().copied().fold(0.0, f64::max);
        let locked = |k: usize| r.x_to_cmd_mm[k] > closed - 0.05 && (r.omega_f_rad_s[k] - r.omega_c_rad_s[k]).abs() < 6.0;
        let n = r.time_s.len();
        let braking = (0..n).filter(|&k| brake[k] && r.omega_c_rad_s[k] > 20.0).count();
        let resting = (0..n).filter(|&k| r.omega_c_rad_s[k].abs() < 1.0).count();
        assert!((0..n).filter(|&k| locked(k)).count() > n / 20, "car {i} hardly locks");
        assert!(braking > 0 && resting > n / 100, "car {i}: {braking} {resting} of {n}");
        engagements += (1..n).filter(|&k| brake[k - 1] && !brake[k]).count();
        count += 1;
        let fastest = r.omega_f_rad_s.iter().chain(&r.omega_c_rad_s).copied().fold(0.0, f64::max);
        assert!(fastest < 340.0, "car {i}: {fastest} rad/s");
        // Held by the brake, with idling engine: what turns is what the sensors add.
        let held: Vec<f64> =
            (100..n).filter(|&k| (k - 60..k).all(|j| brake[j] && r.omega_c_rad_s[j].abs() < 2.0)).map(|k| r.omega_c_rad_s[k]).collect();
        let mean = held.iter().sum::<f64>() / held.len().max(1) as f64;
        assert!(mean.abs() < 0.2, "car {i} rolls at {mean} rad/s against its brake");
    }
    assert!(engagements > 3 * count, "{engagements} engagements in {count} drives");
}

/// All that could tell a car's answer but its behaviour: names, order, sizes and noise.
#[test]
fn the_answer_is_not_in_the_files() {
    for i in 0..2 {
        let plain = healthy(i);
        for id in ["friction_level", "clutch_speed_delay"] {
            let car = draw_car_of(Place::Road, 21, i, Kind::Single(id));
            assert_eq!(car.campaign.vehicle_json, plain.campaign.vehicle_json);
            assert_eq!(car.campaign.recordings.len(), plain.campaign.recordings.len());
            for (a, b) in car.campaign.recordings.iter().zip(&plain.campaign.recordings) {
                assert_eq!((a.theta_c0_deg_c, a.theta_b0_deg_c, a.sample_rate_hz), (b.theta_c0_deg_c, b.theta_b0_deg_c, b.sample_rate_hz));
                assert_eq!(a.time_s, b.time_s);
                // At rest, nothing has acted yet: the same noise on the same speeds.
                assert_eq!((a.omega_f_rad_s[0], a.omega_c_rad_s[0], a.t_e_nm[0]), (b.omega_f_rad_s[0], b.omega_c_rad_s[0], b.t_e_nm[0]));
            }
            let files = [&car, &plain].map(|c| c.campaign.recordings.iter().map(write::csv).collect::<String>());
            assert!(!files[0].contains(id) && !car.campaign.vehicle_json.contains(id));
            let [a, b] = files.map(|f| f.len() as f64);
            assert!((a / b - 1.0).abs() < 0.02, "{id}: {a} bytes against {b}");
        }
    }
}

/// The car itself, replayed from what its files tell, is nearer to its drive than another car.
#[test]
fn the_true_car_leaves_the_floor() {
    let (car, other) = (healthy(2), draw_car_of(Place::Road, 21, 2, Kind::Single("vehicle_mass")));
    let r = &car.unseen[0];
    let gap = |real: &realcar::Real| {
        let mut motion = real.at_start_of(r, 0);
        let brakes = r.brake.as_ref().unwrap();
        let end = (1..r.time_s.len()).find(|&k| brakes[k] && !brakes[k - 1]).unwrap_or(r.time_s.len() - 1);
        let begin = (0..end).find(|&k| !brakes[k]).unwrap();
        let mut sum = 0.0;
        for k in 0..end.min(begin + 300) {
            let [f, c] = motion.sensed(0.0);
            if k <= begin {
                motion.push([r.omega_f_rad_s[k] - f, r.omega_c_rad_s[k] - c]);
            } else {
                sum += (r.omega_f_rad_s[k] - f).powi(2) + (r.omega_c_rad_s[k] - c).powi(2);
            }
            motion.drive(r.time_s[k + 1] - r.time_s[k], r.t_e_nm[k], r.x_to_cmd_mm[k]);
        }
        sum.sqrt()
    };
    let (own, foreign) = (gap(&car.real), gap(&other.real));
    assert!(own < 0.6 * foreign, "{own} against {foreign}");
}
