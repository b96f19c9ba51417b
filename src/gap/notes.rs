//! Notes of an answer on the data, their filter and the search.

use super::infer::density::{Point, Problem};
use super::model::filter::Disturbances;
use super::model::noise::Noise;
use super::model::unknown_clutch;
use super::progress::MOST_ROWS;
use super::prose::three_digits;
use crate::campaign::Campaign;

/// Note on what recordings without a position can show, and how; none if all recordings have one.
pub(super) fn position(campaign: &Campaign) -> Option<String> {
    let without: Vec<&str> = campaign.recordings.iter().filter(|r| r.x_to_cmd.is_empty()).map(|r| r.name.as_str()).collect();
    let bench = campaign.recordings.iter().any(|r| r.x_to_cmd.is_empty() && (r.x_to.is_some() || r.t_fc.is_some() || r.theta_c.is_some()));
    let left_out =
        if bench { "; what a bench measured of position, clutch torque or disc temperature beside them is not used" } else { "" };
    (!without.is_empty()).then(|| {
        format!(
            "x_to_cmd_mm is not recorded in {}: there the clutch torque is an unknown input, estimated from the balances of flywheel and disc, which speak together of engine, \
             driveline and sensors; {} are not assessable by them{left_out}. Record the position that the TCU commands; what to measure next supposes that it is",
            without.join(", "),
            unknown_clutch::hidden()
        )
    })
}

/// Note on how the noise of the sensors is correlated in time.
pub(super) fn correlated_noise(with: &Disturbances) -> String {
    let channels = [("omega_f", "rad/s"), ("omega_c", "rad/s"), ("x_to", "mm"), ("T_fc", "N·m")];
    let one = |((name, unit), n): ((&str, &str), &Noise)| {
        (n.coloured > 0.0).then(|| format!("{name} {} {unit} for {:.2} s", three_digits(n.coloured), n.memory_s))
    };
    let all: Vec<String> = channels.into_iter().zip(&with.noise).filter_map(one).collect();
    format!("sensor noise is correlated in time, which is allowed for: {}", all.join(", "))
}

/// Note that the control unit does not have the usual interval, but this one in s; infinite if the recordings miss none of its commands.
pub(super) fn control_unit(interval: f64) -> String {
    let said = if interval.is_infinite() {
        "the commands seem to change only as often as they are logged: inputs are taken as held from sample to sample, which these data make likelier than a logger that misses some"
    } else {
        "the commands seem to change more often than they are logged: inputs are taken to go straight from sample to sample, which these data make likelier than commands that are held. Feed the retuned plant likewise. Play in the actuator can look the same; a log as fast as the control unit would tell"
    };
    said.to_owned()
}

/// Note that another recording was held out than at first, because only the first one shows the gap.
pub(super) fn judge_changed(first: &str, now: &str) -> String {
    format!("{first} was to be held out, but the others show no gap and it does: it is part of the fit, and {now} is held out instead")
}

/// Note that the search ended early, because it reached the maximum number of replayed rows.
pub(super) fn cut_short() -> String {
    format!(
        "the search ended after {} million replayed rows, the most that it takes: further combinations of effects are not compared. To compare more of \
         them, diagnose fewer or shorter recordings in which the gap shows",
        MOST_ROWS / 1_000_000
    )
}

/// Number of standard deviations by which a start temperature may be pulled before there is a note.
const PULLED: f64 = 4.0;

/// Notes on start temperatures that the recordings contradict. As long as the file declares them to be known that well, effects have to compensate for their errors.
pub(super) fn temperatures(problem: &Problem, point: &Point) -> Vec<String> {
    let of_node = |node: usize| {
        let (what, key) = [("disc", "theta_c0_sigma_K"), ("body", "theta_b0_sigma_K")][node];
        let pulled = |k: &usize| point.own[*k][node].abs() > PULLED;
        let all: Vec<usize> = (0..problem.tracks.len()).filter(pulled).collect();
        let off = |k: &usize| (point.own[*k][node] * problem.tracks[*k].theta_0_sigma[node]).abs();
        let most = all.iter().map(off).fold(0.0, f64::max);
        let names: Vec<&str> = all.iter().map(|&k| problem.tracks[k].name.as_str()).collect();
        (!all.is_empty()).then(|| {
            format!(
                "the start temperature of the {what} would have to be up to {most:.0} K off in {}: if it is not known as well as given, \
                 say so by {key}",
                names.join(", ")
            )
        })
    };
    (0..2).filter_map(of_node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gap::model::prepare::Example;
    use crate::gap::ready::Ready;

    /// The note lists the position or torque of a bench as well as speeds, each with its unit.
    #[test]
    fn noise_with_a_memory_is_said_of_every_channel_that_has_it() {
        let example = Example::read();
        let (_, with) = example.problem(&[&example.campaign.recordings[0]]);
        let noise = |coloured: f64, memory_s: f64| Noise { white: 0.1, coloured, memory_s };
        let said = |noise: [Noise; 5]| correlated_noise(&Disturbances { noise, ..with });
        let none = noise(0.0, 1.0);
        assert!(said([none, none, noise(0.012, 0.01), none, none]).ends_with("allowed for: x_to 0.0120 mm for 0.01 s"));
        let all = said([none, noise(0.15, 0.1), none, noise(0.5, 0.01), none]);
        assert!(all.ends_with("allowed for: omega_c 0.150 rad/s for 0.10 s, T_fc 0.500 N·m for 0.01 s"), "{all}");
    }

    /// There is a note beyond four standard deviations in either direction; it says how far off the temperature is in K, and in which recordings.
    #[test]
    fn a_start_temperature_that_is_pulled_far_is_said() {
        let Example { campaign, vehicle } = Example::read();
        let mut problem = Ready::judged_by(None, &campaign, &vehicle, &Default::default()).unwrap().problem;
        problem.tracks.iter_mut().for_each(|track| track.theta_0_sigma = [2.0, 5.0]);
        let mut point = problem.nominal();
        (point.own[0][0], point.own[1][1]) = (3.9, -3.9);
        assert!(temperatures(&problem, &point).is_empty());
        (point.own[0][0], point.own[1][0], point.own[1][1]) = (4.1, -6.0, -4.1);
        let said = temperatures(&problem, &point);
        let [first, second] = [0, 1].map(|k| problem.tracks[k].name.clone());
        assert!(
            said.len() == 2 && said[0].contains("disc") && said[0].contains("12 K off in") && said[0].contains("theta_c0_sigma_K"),
            "{said:?}"
        );
        assert!(said[0].contains(&format!("{first}, {second}")), "{said:?}");
        assert!(said[1].contains("body") && said[1].contains("20 K off") && !said[1].contains(&first), "{said:?}");
    }
}
