//! A column of the linear model: the change that one unknown or candidate causes in the innovations of one recording, one value per innovation.

use std::collections::HashSet;
use std::sync::Arc;

/// A column. An empty column changes nothing. Copies and multiples share the values, which are stored in single precision: differences of replays have fewer significant digits
/// than that, and there may be hundreds of columns as long as a drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    values: Arc<[f32]>,
    by: f64,
}

impl Column {
    /// Creates a column from these values; if all are zero, the column is empty.
    pub fn new(values: &[f64]) -> Self {
        let values = if values.iter().all(|x| *x == 0.0) { Arc::default() } else { values.iter().map(|x| *x as f32).collect() };
        Self { values, by: 1.0 }
    }

    /// Returns this column times `by`; both share the values.
    pub fn times(&self, by: f64) -> Self {
        Self { values: self.values.clone(), by: self.by * by }
    }

    /// Whether the column changes nothing.
    pub fn is_zero(&self) -> bool {
        self.values.is_empty() || self.by == 0.0
    }

    /// The values, of which an empty column has none.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        self.values.iter().map(|x| self.by * f64::from(*x))
    }

    /// Sum of the values' squares.
    pub fn square(&self) -> f64 {
        self.values().map(|x| x * x).sum()
    }

    /// Adds `times` times this column to `sum`, which has the same length; an empty column adds nothing.
    pub fn add_to(&self, sum: &mut [f64], times: f64) {
        sum.iter_mut().zip(self.values()).for_each(|(s, x)| *s += times * x);
    }

    /// Writes the values at `places`, each times its weight, to `to`. The column must not be empty.
    pub fn gather(&self, places: &[usize], weights: &[f64], to: &mut [f64]) {
        for ((to, &i), w) in to.iter_mut().zip(places).zip(weights) {
            *to = self.by * f64::from(self.values[i]) * w;
        }
    }

    /// Memory of the values in bytes, or 0 if they are among those already `seen`.
    pub fn bytes(&self, seen: &mut HashSet<*const f32>) -> usize {
        if seen.insert(self.values.as_ptr()) { size_of_val(&*self.values) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_share_their_values() {
        let column = Column::new(&[1.0, -2.5, 0.0]);
        let twice = column.times(2.0);
        assert_eq!(twice.values().collect::<Vec<_>>(), [2.0, -5.0, 0.0]);
        assert_eq!((column.square(), twice.square()), (7.25, 29.0));
        let mut sum = [1.0; 3];
        twice.add_to(&mut sum, -1.0);
        assert_eq!(sum, [-1.0, 6.0, 1.0]);
        let mut some = [0.0; 2];
        twice.gather(&[1, 0], &[10.0, 0.5], &mut some);
        assert_eq!(some, [-50.0, 1.0]);
        let mut seen = HashSet::new();
        assert_eq!((column.bytes(&mut seen), twice.bytes(&mut seen)), (12, 0));
    }

    #[test]
    fn nothing_takes_no_memory() {
        let none = Column::new(&[0.0; 5]);
        assert!(none.is_zero() && Column::default().is_zero() && Column::new(&[0.0, 1.0]).times(0.0).is_zero());
        assert!(!Column::new(&[0.0, 1.0]).is_zero());
        assert_eq!((none.values().count(), none.bytes(&mut HashSet::new())), (0, 0));
    }
}
