//! Where a campaign has validated the plant that it retuned, and how well the clutch torque of this plant is known.
//!
//! A [`Place`] is the operating point of the clutch at one instant. Two numbers are computed from it:
//!
//! | number | equation |
//! |---|---|
//! | validity | 1 up to a distance d = 1 from the nearest place that the campaign covered, exp(−½ (d − 1)²) beyond |
//! | σ of the clutch torque | a table over closing, temperature and slip, linear in between and held constant outside |
//!
//! | quantity | what it is | unit | scale of d |
//! |---|---|---|---|
//! | slip | flywheel minus disc speed; its magnitude is transformed to ln(1 + slip/10 rad/s), its sign is kept | rad/s | 0.35 of that: 4 rad/s near lock-up, 16 at 30 rad/s |
//! | temperature | of the disc | °C | 20 K |
//! | closing | travel of the bearing beyond the true contact, relative to the travel from there to the closed point; −0.1 and less count as −0.1 (open) | 1 | 0.05 |
//! | torque | of the clutch, positive from engine to disc | N·m | 10 N·m |
//!
//! The quantities are covered jointly: a hot clutch at low torque and a cold clutch at high torque do not cover a hot clutch at high torque. While the clutch is locked, its torque
//! is determined by the load, and σ is the standard deviation of the capacity at which it would break away.

use serde_json::{Value, json};

/// Number of quantities of a place.
const N: usize = 4;

/// Slip at which the scale of the slip is twice that at zero slip, rad/s.
const SLIP: f64 = 10.0;

/// Lower limit of the closing. At this value and below, the clutch is open.
const OPEN: f64 = -0.1;

/// Difference that counts as a distance of one, in slip (transformed), temperature in K, closing, and torque in N·m.
const SCALE: [f64; N] = [0.35, 20.0, 0.05, 10.0];

/// Maximum number of places that are kept; it bounds the computing time of a step.
pub const MOST_PLACES: usize = 512;

/// Breakpoints of the table of σ: closing, disc temperature in °C, slip in rad/s.
pub const CLOSING: [f64; 10] = [OPEN, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0];
/// See [`CLOSING`].
pub const THETA: [f64; 6] = [20.0, 60.0, 100.0, 150.0, 200.0, 260.0];
/// See [`CLOSING`].
pub const SLIPS: [f64; 7] = [0.0, 4.0, 12.0, 30.0, 60.0, 110.0, 180.0];

/// Number of values in the table.
pub const TABLE: usize = CLOSING.len() * THETA.len() * SLIPS.len();

/// Upper limit of σ, N·m, which is more than such a clutch transmits. It is also the σ of a plant that no campaign has retuned.
pub const UNKNOWN_NM: f64 = 1000.0;

/// Operating point of the clutch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Slip, rad/s.
    pub slip: f64,
    /// Disc temperature, °C.
    pub theta: f64,
    /// Travel beyond the true contact, relative to the travel from there to the closed point.
    pub closing: f64,
    /// Clutch torque, N·m.
    pub torque: f64,
}

impl Place {
    /// The quantities, each divided by the difference that counts as a distance of one.
    #[inline]
    fn scaled(&self) -> [f64; N] {
        let slip = (self.slip.abs() / SLIP).ln_1p().copysign(self.slip);
        [slip / SCALE[0], self.theta / SCALE[1], self.closing.max(OPEN) / SCALE[2], self.torque / SCALE[3]]
    }

    /// Slip, temperature, closing, torque.
    pub fn numbers(&self) -> [f64; N] {
        [self.slip, self.theta, self.closing, self.torque]
    }
}

/// Places at which a retuned plant was validated, and the table of σ of its clutch torque.
#[derive(Clone, Debug, PartialEq)]
pub struct Validated {
    places: Vec<Place>,
    scaled: Vec<[f64; N]>,
    /// σ in N·m by closing, temperature and slip.
    sigma: Vec<f64>,
}

/// Error in the `validated` of a vehicle document.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ValidatedError {
    /// The places are not a list of at most [`MOST_PLACES`] places of four numbers.
    #[error(
        "validated.places are no list of at most {MOST_PLACES} places, each slip in rad/s, temperature in °C, closing and torque in N·m"
    )]
    Places,
    /// The table does not have [`TABLE`] numbers, or some of them cannot be standard deviations.
    #[error("validated.sigma_Nm is no list of {TABLE} numbers between 0 and {UNKNOWN_NM} N·m")]
    Sigma,
}

impl Validated {
    /// Thins out the visited places and takes a table of σ in N·m by closing, temperature and slip. A place is kept if no place kept before is within a distance of one, so that
    /// the kept places cover all visited ones. If there are more than [`MOST_PLACES`], the least visited are left out, which understates the coverage.
    ///
    /// # Panics
    /// If the table does not have [`TABLE`] values.
    pub fn new(visited: impl Iterator<Item = Place>, sigma: impl Iterator<Item = f64>) -> Self {
        let mut kept: Vec<(Place, [f64; N], usize)> = Vec::new();
        for place in visited {
            let place = rounded_place(&place);
            let at = place.scaled();
            match kept.iter_mut().find(|k| squared(&k.1, &at) <= 1.0) {
                Some(near) => near.2 += 1,
                None => kept.push((place, at, 1)),
            }
        }
        // The sort is stable: of places that were visited equally often, the first are kept.
        kept.sort_by_key(|k| std::cmp::Reverse(k.2));
        kept.truncate(MOST_PLACES);
        let sigma: Vec<f64> = sigma.map(|s| rounded(s.min(UNKNOWN_NM))).collect();
        assert_eq!(sigma.len(), TABLE, "a table has its size");
        Self { places: kept.iter().map(|k| k.0).collect(), scaled: kept.iter().map(|k| k.1).collect(), sigma }
    }

    /// Reads the `validated` of a vehicle document; none if it is absent (null).
    ///
    /// # Errors
    /// A list of the wrong size, or one that contains anything but numbers within their bounds.
    pub fn from_value(document: &Value) -> Result<Option<Self>, ValidatedError> {
        if document.is_null() {
            return Ok(None);
        }
        let place = |v: &Value| {
            let n: [f64; N] = numbers(v)?.try_into().ok()?;
            Some(Place { slip: n[0], theta: n[1], closing: n[2], torque: n[3] })
        };
        let places = document["places"].as_array().filter(|all| all.len() <= MOST_PLACES);
        let places: Vec<Place> = places.and_then(|all| all.iter().map(place).collect()).ok_or(ValidatedError::Places)?;
        let sigma = numbers(&document["sigma_Nm"]).filter(|s| s.len() == TABLE && s.iter().all(|x| (0.0..=UNKNOWN_NM).contains(x)));
        Ok(Some(Self { scaled: places.iter().map(Place::scaled).collect(), places, sigma: sigma.ok_or(ValidatedError::Sigma)? }))
    }

    /// The document from which [`Validated::from_value`] reads the same places and table.
    pub fn to_value(&self) -> Value {
        json!({"places": self.places.iter().map(Place::numbers).collect::<Vec<_>>(), "sigma_Nm": self.sigma})
    }

    /// All numbers of the places and of the table, for comparisons.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.places.iter().flat_map(Place::numbers).chain(self.sigma.iter().copied())
    }

    /// The kept places, which represent all places that were visited.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The table of σ, N·m.
    pub fn sigmas(&self) -> &[f64] {
        &self.sigma
    }

    /// Validity at a place, from 0 to 1. `near` is the index of the kept place that is compared first; if that place is farther than one, the index of the nearest kept place is
    /// stored in it. This saves computing time and does not affect the result.
    #[inline]
    pub fn validity(&self, place: &Place, near: &mut usize) -> f64 {
        let at = place.scaled();
        if self.scaled.get(*near).is_some_and(|first| squared(first, &at) <= 1.0) {
            return 1.0;
        }
        let mut least = f64::INFINITY;
        for (k, other) in self.scaled.iter().enumerate() {
            let distance = squared(other, &at);
            if distance < least {
                (least, *near) = (distance, k);
            }
        }
        let beyond = (least.sqrt() - 1.0).max(0.0);
        (-0.5 * beyond * beyond).exp()
    }

    /// Standard deviation of the clutch torque at a place, N·m.
    #[inline]
    pub fn sigma(&self, place: &Place) -> f64 {
        let (i, a) = between(&CLOSING, place.closing);
        let (j, b) = between(&THETA, place.theta);
        let (k, c) = between(&SLIPS, place.slip.abs());
        let line = |i: usize, j: usize| {
            let at = (i * THETA.len() + j) * SLIPS.len() + k;
            self.sigma[at] + c * (self.sigma[at + 1] - self.sigma[at])
        };
        let plane = |i: usize| {
            let (low, high) = (line(i, j), line(i, j + 1));
            low + b * (high - low)
        };
        let (low, high) = (plane(i), plane(i + 1));
        low + a * (high - low)
    }
}

/// Rounds to four significant digits, those that a file has, so that the numbers are the same before they are written and after they are read.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

fn rounded_place(p: &Place) -> Place {
    Place { slip: rounded(p.slip), theta: rounded(p.theta), closing: rounded(p.closing.max(OPEN)), torque: rounded(p.torque) }
}

fn numbers(list: &Value) -> Option<Vec<f64>> {
    list.as_array()?.iter().map(|v| v.as_f64().filter(|x| x.is_finite())).collect()
}

/// Squared distance between two places in scaled coordinates.
#[inline]
fn squared(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

/// Index of the interval between breakpoints that contains `x`, and the position of `x` in it, limited to 0 to 1.
#[inline]
fn between(breakpoints: &[f64], x: f64) -> (usize, f64) {
    let mut k = 0;
    while k + 2 < breakpoints.len() && x > breakpoints[k + 1] {
        k += 1;
    }
    (k, ((x - breakpoints[k]) / (breakpoints[k + 1] - breakpoints[k])).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(slip: f64, theta: f64, closing: f64, torque: f64) -> Place {
        Place { slip, theta, closing, torque }
    }

    /// σ is 1 + closing + 10 · temperature/100 °C + 100 · slip/180 rad/s, which linear interpolation reproduces.
    fn plane() -> Validated {
        let of = |(u, t, s): (f64, f64, f64)| u + 1.0 + 0.1 * t + s / 1.8;
        let grid = CLOSING.iter().flat_map(|u| THETA.iter().flat_map(move |t| SLIPS.iter().map(move |s| (*u, *t, *s))));
        Validated::new([at(0.0, 40.0, 0.5, 30.0), at(80.0, 40.0, 0.3, 20.0), at(80.5, 41.0, 0.3, 20.0)].into_iter(), grid.map(of))
    }

    #[test]
    fn a_table_is_linear_in_between_and_held_outside() {
        let v = plane();
        for (u, t, s) in [(0.33, 77.0, 41.0), (0.0, 20.0, 0.0), (0.99, 259.0, -179.0)] {
            let expected = u + 1.0 + 0.1 * t + f64::abs(s) / 1.8;
            assert!((v.sigma(&at(s, t, u, 0.0)) - expected).abs() < 0.02 * expected, "{u} {t} {s}");
        }
        assert_eq!(v.sigma(&at(500.0, 900.0, 2.0, 0.0)), v.sigma(&at(180.0, 260.0, 1.0, 0.0)));
    }

    #[test]
    fn places_are_covered_jointly_and_validity_falls_outside() {
        let v = plane();
        assert_eq!(v.places().len(), 2, "the third lies beside the second");
        let mut near = 0;
        let mut of = |p: Place| v.validity(&p, &mut near);
        assert_eq!([of(at(0.0, 40.0, 0.5, 30.0)), of(at(82.0, 50.0, 0.3, 22.0))], [1.0, 1.0]);
        // Each number alone was covered, all four together were not.
        assert!(of(at(0.0, 40.0, 0.3, 20.0)) < 0.01);
        // Two scales away in one quantity: exp(−½).
        assert!((of(at(80.0, 80.0, 0.3, 20.0)) - (-0.5_f64).exp()).abs() < 1e-12);
        assert!(of(at(-80.0, 40.0, 0.3, -20.0)) < 1e-9);
        for first in 0..3 {
            let mut near = first;
            assert_eq!(v.validity(&at(80.0, 80.0, 0.3, 20.0), &mut near), of(at(80.0, 80.0, 0.3, 20.0)));
        }
    }

    #[test]
    fn a_plant_that_was_validated_nowhere_says_so() {
        let v = Validated::new(std::iter::empty(), std::iter::repeat_n(2e3, TABLE));
        assert_eq!((v.validity(&at(0.0, 20.0, 0.0, 0.0), &mut 0), v.sigma(&at(0.0, 20.0, 0.0, 0.0))), (0.0, UNKNOWN_NM));
    }

    #[test]
    fn a_document_gives_back_what_was_written_and_refuses_what_is_unsound() {
        let v = plane();
        let text = v.to_value().to_string();
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(Validated::from_value(&read), Ok(Some(v)));
        assert_eq!(Validated::from_value(&Value::Null), Ok(None));
        let mut short = read.clone();
        short["places"][0] = json!([1.0, 2.0, 3.0]);
        assert_eq!(Validated::from_value(&short), Err(ValidatedError::Places));
        let mut negative = read;
        negative["sigma_Nm"][7] = json!(-1.0);
        assert_eq!(Validated::from_value(&negative), Err(ValidatedError::Sigma));
        assert!(ValidatedError::Sigma.to_string().contains(&TABLE.to_string()));
    }
}
