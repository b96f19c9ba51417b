//! What a library's effect of the same id would have to be, by least squares over what the car went through.

/// Sums of a weighted fit of y by one basis function or two.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    names: Vec<&'static str>,
    squares: [f64; 3],
    with: [f64; 2],
}

impl Seen {
    /// A fit of these parameters.
    pub fn of(names: &[&'static str]) -> Self {
        Self { names: names.to_vec(), ..Self::default() }
    }

    /// Whether anything is to be fitted.
    pub fn wanted(&self) -> bool {
        !self.names.is_empty()
    }

    /// Counts a value of the law with its weight; of one parameter, the basis is 1.
    pub fn count(&mut self, basis: [f64; 2], y: f64, weight: f64) {
        let [a, b] = basis;
        for (sum, term) in self.squares.iter_mut().zip([a * a, a * b, b * b]) {
            *sum += weight * term;
        }
        self.with[0] += weight * a * y;
        self.with[1] += weight * b * y;
    }

    /// Counts a value of a law of one parameter.
    pub fn mean(&mut self, y: f64, weight: f64) {
        self.count([1.0, 0.0], y, weight);
    }

    /// Adds what another recording saw.
    pub fn add(&mut self, other: &Self) {
        if self.names.is_empty() {
            self.names.clone_from(&other.names);
        }
        self.squares.iter_mut().zip(other.squares).for_each(|(s, o)| *s += o);
        self.with.iter_mut().zip(other.with).for_each(|(s, o)| *s += o);
    }

    /// Name and value of the parameters; none if nothing was seen of them.
    pub fn parameters(&self) -> Vec<(&'static str, f64)> {
        let [aa, ab, bb] = self.squares;
        let [ay, by] = self.with;
        match self.names[..] {
            [one] if aa > 0.0 => vec![(one, ay / aa)],
            [one, two] if aa * bb - ab * ab > 1e-9 * aa * bb => {
                let d = aa * bb - ab * ab;
                vec![(one, (ay * bb - by * ab) / d), (two, (by * aa - ay * ab) / d)]
            }
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_again() {
        let mut seen = Seen::of(&["level", "slope"]);
        (0..9).map(f64::from).for_each(|x| seen.count([1.0, x], 3.0 - 0.5 * x, 1.0 + x));
        let found = seen.parameters();
        assert!((found[0].1 - 3.0).abs() < 1e-12 && (found[1].1 + 0.5).abs() < 1e-12);
        assert!(Seen::of(&["level"]).parameters().is_empty());
    }
}
