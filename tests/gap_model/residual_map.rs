//! The residual map agrees with its definition, evaluated here from the innovations alone.

use crate::made_up::{example, made_up_under, prepared};
use kisspoint::effects::param;
use kisspoint::gap::infer::density::{Point, Problem};
use kisspoint::gap::map::cells;
use kisspoint::gap::model::{prepare, replay};
use std::collections::BTreeMap;

/// Innovations of a speed by phase (open, slipping, locked) and region (cold or hot, low or high torque): the normalised innovations clipped at ±6, their normalised sums over
/// half a second each, and the sum of squares in (rad/s)².
type Gathered = BTreeMap<(usize, usize), (Vec<f64>, Vec<f64>, f64)>;

fn gathered(problem: &Problem, point: &Point, speed: usize) -> Gathered {
    let mut all = Gathered::new();
    for (k, (track, filter)) in problem.tracks.iter().zip(&problem.filters).enumerate() {
        assert!(!track.averages());
        let mut places = Vec::new();
        let e = replay::corrected(track, filter, &problem.car(point, Some(k)), problem.temperatures(point, k), None, |_, now, _| {
            let region = if now.theta_c > 70.0 { 2 } else { 0 } + if now.t_fc.abs() > 25.0 { 1 } else { 0 };
            places.push((now.phase as usize - 1, region));
        });
        let half_a_second = (0.5 / track.interval()).round() as usize;
        let mut sums: BTreeMap<(usize, usize), (f64, usize)> = BTreeMap::new();
        for j in 0..track.observations() {
            let weight = filter.gains[j].weight[speed];
            if weight == 0.0 {
                continue;
            }
            let cut = e[2 * j + speed].clamp(-6.0, 6.0);
            let cell = all.entry(places[j]).or_default();
            cell.0.push(cut);
            cell.2 += (e[2 * j + speed] / weight).powi(2);
            let sum = sums.entry(places[j]).or_default();
            (sum.0, sum.1) = (sum.0 + cut, sum.1 + 1);
            if sum.1 == half_a_second {
                cell.1.push(sum.0 / (half_a_second as f64).sqrt());
                *sum = (0.0, 0);
            }
        }
    }
    all
}

#[test]
fn a_cell_is_as_far_out_as_its_mean_its_scatter_or_its_half_seconds() {
    let torque = |t: f64| 4.0 + if (t / 0.7) as u64 % 2 == 0 { 5.0 } else { -5.0 };
    let problem = made_up_under(|e| e[param::engine_torque_bias::torque] = 3.0, torque);
    let nominal = problem.nominal();
    let mut explained = nominal.clone();
    explained.effects[param::engine_torque_bias::torque] = 3.0;
    let map = cells(&problem, &nominal, &explained);
    let mut seen = 0;
    for (speed, equation) in ["engine balance", "driveline balance"].into_iter().enumerate() {
        // The scale accounts for the sensor noise and is taken from the explanation's innovations.
        let explained = gathered(&problem, &explained, speed);
        let (sum, count) = explained.values().flat_map(|c| &c.0).fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
        let scale = f64::sqrt(sum / count).max(1.0);
        for ((phase, region), (all, halves, squares)) in gathered(&problem, &nominal, speed) {
            let (phase, region) = (
                ["open", "slipping", "locked"][phase],
                ["cold, low torque", "cold, high torque", "hot, low torque", "hot, high torque"][region],
            );
            let found = map.iter().find(|c| (c.equation, c.phase, c.region) == (equation, phase, region));
            if all.len() < 20 {
                assert!(found.is_none(), "{} samples are too few", all.len());
                continue;
            }
            let (found, n, m) = (found.unwrap(), all.len() as f64, halves.len() as f64);
            let square = |v: &[f64]| v.iter().map(|x| (x / scale).powi(2)).sum::<f64>();
            let mean = all.iter().sum::<f64>().abs() / scale / n.sqrt();
            // Wilson–Hilferty deviates. The mean square of the samples has two thirds of their number as degrees of freedom, because squared sensor errors vary by half as much
            // again as those of normal errors.
            let deviate = |mean: f64, degrees: f64| (mean.cbrt() - 1.0 + 2.0 / 9.0 / degrees) * (4.5 * degrees).sqrt();
            let scatter = deviate(square(&all) / n, n / 1.5);
            let lasting = if halves.is_empty() { 0.0 } else { deviate(square(&halves) / m, m) };
            let expected = mean.max(scatter).max(lasting);
            assert!((found.sigma - expected).abs() < 1e-9 * expected.abs().max(1.0), "{equation} {phase}: {} {expected}", found.sigma);
            assert!((found.rms - (squares / n).sqrt()).abs() < 1e-9 && (found.samples, found.unit) == (all.len(), "rad/s"));
            seen += 1;
        }
    }
    assert!(seen > 6 && map.len() == seen && map.iter().any(|c| c.significant), "{seen} of {}", map.len());
}

/// A bench whose thermometer reads 20 K too high, beside a correct position sensor: the map shows the gap for the thermometer alone.
#[test]
fn each_sensor_of_a_bench_has_cells_of_its_own() {
    let (mut recordings, vehicle_json) = example();
    let r = &mut recordings[0];
    (r.x_to, r.t_fc, r.theta_c) = (None, None, None);
    let bare = prepared(r);
    let (car, theta) = (bare.car(&bare.nominal(), Some(0)), bare.temperatures(&bare.nominal(), 0));
    let [mut position, mut temperature] = [vec![0.0; r.time.len()], vec![0.0; r.time.len()]];
    replay::corrected(&bare.tracks[0], &bare.filters[0], &car, theta, None, |row, now, _| {
        (position[row], temperature[row]) = (now.x_to_actual, now.theta_c + 20.0);
    });
    (r.x_to, r.theta_c) = (Some(position), Some(temperature));
    let (tracks, tolerances) = prepare::read(&[&*r], &vehicle_json).unwrap();
    let with = prepare::disturbances(&tracks, &tolerances);
    let problem = prepare::problem(tracks, &bare.vehicle, &tolerances, &with);
    let map = cells(&problem, &problem.nominal(), &problem.nominal());
    let rms = |equation: &str| map.iter().filter(|c| c.equation == equation).map(|c| c.rms).collect::<Vec<f64>>();
    let (thermometer, bearing) = (rms("disc temperature"), rms("bearing position"));
    assert!(!thermometer.is_empty() && thermometer.iter().all(|x| (x - 20.0).abs() < 0.1), "{thermometer:?} K");
    assert!(!bearing.is_empty() && bearing.iter().all(|x| *x < 0.05), "{bearing:?} mm");
}
