//! The residual map: the innovations of each balance, by phase and operating region, compared with what noise would leave.
//!
//! Innovations of a corrected replay are white with unit variance if the model is right. A cell collects those of one phase and region, and tests whether their mean, their sums
//! over half a second (because the error of a law lasts), and their scatter are those of noise. The scale of noise is that of the final explanation, so that no cell is marked
//! because the noise of a sensor was estimated slightly too small. Cells are marked by Holm's procedure.

use super::infer::density::{Point, Problem};
use super::model::replay;
use super::model::track::Channel;

/// Family-wise error: probability that any cell is marked for a car without a gap.
pub const FAMILY_WISE_ERROR: f64 = 0.01;

/// Disc temperature that separates cold from hot, °C.
pub const HOT_DEGC: f64 = 70.0;

/// Magnitude of the clutch torque that separates low from high, N·m.
pub const HIGH_TORQUE_NM: f64 = 25.0;

/// Length of the windows over which innovations are summed, s.
const WINDOW_S: f64 = 0.5;

/// One cell of the residual map.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Balance.
    pub equation: &'static str,
    /// Phase.
    pub phase: &'static str,
    /// Operating region.
    pub region: &'static str,
    /// Gap in standard deviations of its noise: of the mean, of the sums over windows, or of the scatter, whichever is furthest out.
    pub sigma: f64,
    /// Root mean square of the innovations.
    pub rms: f64,
    /// Unit of `rms`.
    pub unit: &'static str,
    /// Number of observations.
    pub samples: usize,
    /// Whether the gap is statistically significant by Holm's procedure.
    pub significant: bool,
}

const EQUATIONS: [(&str, Channel); 5] = [
    ("engine balance", Channel::OmegaF),
    ("driveline balance", Channel::OmegaC),
    ("bearing position", Channel::XTo),
    ("clutch torque", Channel::TFc),
    ("disc temperature", Channel::ThetaC),
];
const PHASES: [&str; 3] = ["open", "slipping", "locked"];
const REGIONS: [&str; 4] = ["cold, low torque", "cold, high torque", "hot, low torque", "hot, high torque"];

/// Innovations of one cell: in standard deviations, their sums over windows in standard deviations, and the sum of their squares in the channel's unit.
#[derive(Clone, Debug, Default)]
struct Gathered {
    whitened: Vec<f64>,
    windows: Vec<f64>,
    squares: f64,
}

/// Cells at `point`; `final_point` is that of the explanation, whose innovations set the scale of noise.
pub fn cells(problem: &Problem, point: &Point, final_point: &Point) -> Vec<Cell> {
    let scale = scales(&gather(problem, final_point));
    let all = gather(problem, point);
    let mut cells = Vec::new();
    for (e, (equation, channel)) in EQUATIONS.iter().enumerate() {
        for (p, phase) in PHASES.iter().enumerate() {
            for (r, region) in REGIONS.iter().enumerate() {
                let g = &all[e][p][r];
                if g.whitened.len() < 20 {
                    continue;
                }
                let n = g.whitened.len() as f64;
                let mean_square = |v: &[f64]| v.iter().map(|x| (x / scale[e]).powi(2)).sum::<f64>() / v.len() as f64;
                let scatter = deviate(mean_square(&g.whitened), n * 2.0 / SCATTER_VARIANCE);
                let windows = if g.windows.is_empty() { 0.0 } else { deviate(mean_square(&g.windows), g.windows.len() as f64) };
                let mean = g.whitened.iter().sum::<f64>() / (n.sqrt() * scale[e]);
                let sigma = mean.abs().max(scatter).max(windows);
                let rms = (g.squares / n).sqrt();
                cells.push(Cell {
                    equation,
                    phase,
                    region,
                    sigma,
                    rms,
                    unit: channel.unit(),
                    samples: g.whitened.len(),
                    significant: false,
                });
            }
        }
    }
    mark_significant(&mut cells);
    cells
}

/// Assumed variance of a squared innovation: 2 for a normal innovation, more for one that is quantised or has heavy tails.
const SCATTER_VARIANCE: f64 = 3.0;

type Cells = Vec<[[Gathered; 4]; 3]>;

fn gather(problem: &Problem, point: &Point) -> Cells {
    let mut all: Cells = vec![Default::default(); 5];
    for (k, (track, filter)) in problem.tracks.iter().zip(&problem.filters).enumerate() {
        let car = problem.car(point, Some(k));
        let n = track.observations();
        let (mut phase, mut region) = (vec![0; n], vec![0; n]);
        let innovations = replay::corrected(track, filter, &car, problem.temperatures(point, k), None, |row, now, _| {
            let j = track.observation_of(row);
            phase[j] = now.phase as usize - 1;
            region[j] = 2 * usize::from(now.theta_c > HOT_DEGC) + usize::from(now.t_fc.abs() > HIGH_TORQUE_NM);
        });
        let window = (WINDOW_S / track.observation_interval()).round().max(1.0) as usize;
        let mut offset = 2 * n;
        for e in 0..5 {
            if e >= 2 && filter.bench[e - 2].is_empty() {
                continue;
            }
            let read = |j: usize| if e < 2 { innovations[2 * j + e] } else { innovations[offset + j] };
            let weight = |j: usize| if e < 2 { filter.gains[j].weight[e] } else { filter.bench[e - 2][j].weight };
            let mut sums: [[(f64, usize); 4]; 3] = Default::default();
            for j in (0..n).filter(|&j| weight(j) > 0.0) {
                let (p, r) = (phase[j], region[j]);
                let x = read(j).clamp(-OUTLIER, OUTLIER);
                let g = &mut all[e][p][r];
                g.whitened.push(x);
                g.squares += (read(j) / weight(j)).powi(2);
                let s = &mut sums[p][r];
                *s = (s.0 + x, s.1 + 1);
                if s.1 == window {
                    g.windows.push(s.0 / (window as f64).sqrt());
                    *s = (0.0, 0);
                }
            }
            if e >= 2 {
                offset += n;
            }
        }
    }
    all
}

/// Innovations are clipped at this many standard deviations, because a lock-up that comes one sample early is a single event.
const OUTLIER: f64 = 6.0;

/// Root mean square of each equation's whitened innovations under the explanation, but at least one, which is the estimated noise.
fn scales(all: &Cells) -> [f64; 5] {
    std::array::from_fn(|e| {
        let (sum, count) =
            all[e].iter().flatten().fold((0.0, 0), |(s, n), g| (s + g.whitened.iter().map(|x| x * x).sum::<f64>(), n + g.whitened.len()));
        if count == 0 { 1.0 } else { (sum / count as f64).sqrt().max(1.0) }
    })
}

/// The standard normal deviate with the same tail probability as the mean of `degrees` squared standard normal deviates (Wilson and Hilferty 1931: the cube root of this mean is
/// nearly normal). The mean itself has a long tail if the squares are few.
fn deviate(mean_square: f64, degrees: f64) -> f64 {
    let variance = 2.0 / (9.0 * degrees);
    (mean_square.cbrt() - (1.0 - variance)) / variance.sqrt()
}

/// Two-sided p-value of a standard normal deviate.
fn two_sided_p(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// Marks cells by Holm's procedure over all cells. The p-value of a cell is multiplied by three, because it is the smallest of three tests.
fn mark_significant(cells: &mut [Cell]) {
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| cells[b].sigma.total_cmp(&cells[a].sigma));
    let questions = 3.0;
    let all = cells.len();
    for (rank, &k) in order.iter().enumerate() {
        if questions * two_sided_p(cells[k].sigma) > FAMILY_WISE_ERROR / (all - rank) as f64 {
            return;
        }
        cells[k].significant = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(sigma: f64) -> Cell {
        Cell { equation: "", phase: "", region: "", sigma, rms: 0.0, unit: "", samples: 0, significant: false }
    }

    fn marked(sigmas: &[f64]) -> Vec<bool> {
        let mut cells: Vec<Cell> = sigmas.iter().map(|s| cell(*s)).collect();
        mark_significant(&mut cells);
        cells.iter().map(|c| c.significant).collect()
    }

    /// Holm's procedure at 1 % with three tests per cell: the largest of sixty cells has to exceed 4.030, a single cell 2.935.
    #[test]
    fn cells_are_marked_where_chance_does_so_once_in_a_hundred_maps() {
        let among = |sigma: f64| (0..60).map(|k| if k == 7 { sigma } else { 1.0 }).collect::<Vec<f64>>();
        assert_eq!(marked(&among(4.04)).iter().filter(|m| **m).count(), 1);
        assert!(marked(&among(4.04))[7] && !marked(&among(4.02))[7]);
        assert_eq!([marked(&[2.94]), marked(&[2.93])], [[true], [false]]);
        // The threshold of the second cell is lower once the first is marked, and not before.
        assert_eq!(marked(&[3.10, 5.0]), [true, true]);
        assert_eq!(marked(&[3.0, 3.10]), [false, false]);
        assert_eq!(marked(&[2.94, 9.0, 3.15]), [true; 3]);
        assert!((two_sided_p(1.959_964) - 0.05).abs() < 1e-7 && (two_sided_p(-1.959_964) - 0.05).abs() < 1e-7);
    }

    /// From tables: 10.828, 18.467 and 149.449 are the quantiles of χ² with 1, 4 and 100 degrees of freedom that are exceeded with the probability 1e-3, and 3.090 is that of a
    /// standard normal deviate.
    #[test]
    fn a_mean_of_few_squares_has_a_long_tail() {
        for (chi_square, degrees) in [(10.828, 1.0), (18.467, 4.0), (149.449, 100.0)] {
            let z = deviate(chi_square / degrees, degrees);
            assert!((z - 3.090).abs() < 0.1, "{chi_square} of {degrees}: {z}");
        }
        assert!(deviate(49.335 / 50.0, 50.0).abs() < 0.01, "the median");
    }

    #[test]
    fn the_scale_of_noise_is_that_of_the_innovations_and_at_least_one() {
        let mut all: Cells = vec![Default::default(); 5];
        all[0][0][1].whitened = vec![2.0, -2.0];
        all[0][2][3].whitened = vec![4.0, 4.0];
        all[1][1][0].whitened = vec![0.5; 4];
        let expected = [10.0_f64.sqrt(), 1.0, 1.0, 1.0, 1.0];
        scales(&all).iter().zip(expected).for_each(|(s, e)| assert!((s - e).abs() < 1e-12, "{s} {e}"));
    }
}
