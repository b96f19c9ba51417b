//! Smooth random functions: what no formula of a library was written for.
//!
//! A curve is a sum of cosines with normal frequencies, which in the limit is a Gaussian process with a squared-exponential covariance. It is
//! tabulated, brought to mean 0 and root mean square 1 over its interval, read by straight lines and constant beyond the ends.

use super::Dice;
use std::f64::consts::TAU;

const CELLS: usize = 48;
const WAVES: usize = 9;

/// A smooth random function of one variable; zero everywhere until it is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    from: f64,
    per_cell: f64,
    nodes: Vec<f64>,
}

impl Curve {
    /// Draws a curve over an interval; `length` is its correlation length as a share of it.
    pub fn draw(dice: &mut Dice, from: f64, to: f64, length: f64) -> Self {
        let waves: Vec<_> = (0..WAVES).map(|_| (dice.normal() / length, dice.within(0.0, TAU))).collect();
        let raw = |z: f64| waves.iter().map(|(w, phase)| (w * z + phase).cos()).sum::<f64>();
        let mut nodes: Vec<f64> = (0..=CELLS).map(|i| raw(i as f64 / CELLS as f64)).collect();
        let mean = nodes.iter().sum::<f64>() / nodes.len() as f64;
        nodes.iter_mut().for_each(|y| *y -= mean);
        let rms = (nodes.iter().map(|y| y * y).sum::<f64>() / nodes.len() as f64).sqrt();
        nodes.iter_mut().for_each(|y| *y /= rms.max(1e-9));
        Self { from, per_cell: (to - from) / CELLS as f64, nodes }
    }

    /// Draws a curve that rises from 0 to 1, the more unevenly the rougher.
    pub fn rising(dice: &mut Dice, from: f64, to: f64, roughness: f64) -> Self {
        let slope = Self::draw(dice, from, to, 0.35);
        let mut sum = 0.0;
        let mut nodes = vec![0.0];
        for pair in slope.nodes.windows(2) {
            sum += (0.5 * roughness * (pair[0] + pair[1])).exp();
            nodes.push(sum);
        }
        nodes.iter_mut().for_each(|y| *y /= sum);
        Self { nodes, ..slope }
    }

    /// Its value.
    pub fn at(&self, x: f64) -> f64 {
        if self.nodes.is_empty() {
            return 0.0;
        }
        let z = ((x - self.from) / self.per_cell).clamp(0.0, CELLS as f64);
        let i = (z as usize).min(CELLS - 1);
        self.nodes[i] + (self.nodes[i + 1] - self.nodes[i]) * (z - i as f64)
    }
}

/// A smooth random function of two variables, of root mean square about 1: two curves, and a product of two more.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    along: [Curve; 2],
    across: [Curve; 2],
}

impl Surface {
    /// Draws a surface over two intervals.
    pub fn draw(dice: &mut Dice, x: [f64; 2], y: [f64; 2], length: f64) -> Self {
        let mut curve = |[from, to]: [f64; 2]| Curve::draw(dice, from, to, length);
        Self { along: [curve(x), curve(x)], across: [curve(y), curve(y)] }
    }

    /// Its value.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let (a, b) = (&self.along, &self.across);
        (a[0].at(x) + b[0].at(y) + a[1].at(x) * b[1].at(y)) / 3f64.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_smooth_and_of_unit_size() {
        let mut dice = Dice::new(5, 1.0);
        for _ in 0..50 {
            let c = Curve::draw(&mut dice, 10.0, 90.0, 0.4);
            let values: Vec<f64> = (0..=800).map(|i| c.at(10.0 + 0.1 * f64::from(i))).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let rms = (values.iter().map(|y| y * y).sum::<f64>() / values.len() as f64).sqrt();
            assert!(mean.abs() < 0.1 && (rms - 1.0).abs() < 0.1, "{mean} {rms}");
            let steepest = values.windows(2).map(|p| (p[1] - p[0]).abs()).fold(0.0, f64::max);
            assert!(steepest < 0.05, "{steepest}");
            assert_eq!((c.at(0.0), c.at(200.0)), (c.at(10.0), c.at(90.0)));
        }
        assert_eq!(Curve::default().at(3.0), 0.0);
    }

    #[test]
    fn a_rising_curve_rises_from_0_to_1() {
        let mut dice = Dice::new(6, 1.0);
        let c = Curve::rising(&mut dice, 0.0, 1.0, 0.8);
        assert_eq!((c.at(0.0), c.at(1.0)), (0.0, 1.0));
        assert!((0..100).all(|i| c.at(f64::from(i) * 0.01) < c.at(f64::from(i + 1) * 0.01)));
    }
}
