//! The second half of a governed launch: the torque falls with the remaining slip.
//!
//! T = T_l + (T_h − T_l) u (2 − u), u = s/s_h within [0, 1], T_l = b_c ω̂ + T_L(ω̂) + d̂ + J_c ω̇_l.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | s, s_h | slip predicted for the time when the bearing will have moved; its value at the beginning of the landing | rad/s |
//! | T_h | torque that the clutch actually carried at that point, regardless of the map | N·m |
//! | T_l | torque that the load and the landing need | N·m |
//! | ω̇_l | acceleration of the disc that is retained for the landing | rad/s² |
//!
//! While the slip closes, the torque falls and never rises: a plan over time would request more again wherever car, map or load are not as planned.

/// Slip and torque at the beginning of the landing.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Landing {
    /// s_h, rad/s; 0 while no landing has begun.
    pub slip: f64,
    /// T_h, N·m.
    pub torque: f64,
}

impl Landing {
    /// Whether the landing has begun.
    #[inline]
    pub fn has_begun(&self) -> bool {
        self.slip > 0.0
    }

    /// Torque in N·m at a slip of `slip` rad/s, where `last` is T_l, the torque at the end of the slip, N·m.
    #[inline]
    pub fn torque_at(&self, slip: f64, last: f64) -> f64 {
        let u = (slip / self.slip).clamp(0.0, 1.0);
        last + (self.torque - last) * u * (2.0 - u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_torque_falls_with_the_slip_and_ends_where_it_should() {
        let landing = Landing { slip: 50.0, torque: 90.0 };
        assert_eq!((landing.torque_at(50.0, 30.0), landing.torque_at(0.0, 30.0)), (90.0, 30.0));
        assert_eq!((landing.torque_at(70.0, 30.0), landing.torque_at(25.0, 30.0)), (90.0, 75.0));
        assert!((0..50).all(|k| landing.torque_at(f64::from(k), 30.0) < landing.torque_at(f64::from(k + 1), 30.0)));
        assert!(!Landing::default().has_begun());
    }
}
