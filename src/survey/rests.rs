//! Channels that rest at a few values only: a pedal that consists of switches shows no position.

use crate::campaign::{Log, Quantity};

/// Shortest rest, samples.
const SHORTEST: usize = 4;
/// Least share of the samples that must be at rest.
const MOST: f64 = 0.9;
/// Largest number of values of a switch.
const FEW: usize = 4;

/// A channel that is a switch.
#[derive(Clone, Debug)]
pub struct Switch {
    /// Its index in the log.
    pub channel: usize,
    /// Values at which it rests, in its unit.
    pub levels: Vec<f64>,
}

/// All percentages that are switches; a channel that never changes is not one.
pub fn switches(log: &Log) -> Vec<Switch> {
    let shares = (0..log.channels.len()).filter(|&k| log.channels[k].quantity == Some(Quantity::Share));
    shares.filter_map(|channel| Some(Switch { channel, levels: levels(&log.channels[channel].values)? })).collect()
}

/// The values of a switch in increasing order; `None` if the channel is not a switch.
fn levels(values: &[f64]) -> Option<Vec<f64>> {
    let (mut levels, mut resting) = (Vec::<f64>::new(), 0);
    for run in values.chunk_by(|a, b| a == b).filter(|run| run.len() >= SHORTEST) {
        resting += run.len();
        if !levels.contains(&run[0]) {
            levels.push(run[0]);
        }
    }
    levels.sort_by(f64::total_cmp);
    let is_switch = (2..=FEW).contains(&levels.len()) && resting as f64 > MOST * values.len() as f64;
    is_switch.then_some(levels)
}

#[cfg(test)]
mod tests {
    use super::levels;

    #[test]
    fn a_pedal_of_switches_and_one_with_a_travel() {
        let mut steps: Vec<f64> = [0.0, 50.0, 100.0, 50.0].iter().flat_map(|v| [*v; 30]).collect();
        steps.insert(30, 28.5);
        assert_eq!(levels(&steps), Some(vec![0.0, 50.0, 100.0]));
        let travel: Vec<f64> = (0..200).map(|k| f64::from(k % 50)).collect();
        assert_eq!(levels(&travel), None);
        assert_eq!(levels(&[0.0; 50]), None);
    }
}
