//! Transfer of the state when effects are set while the plant runs.

use super::State;
use super::actuation::Presliding;
use super::clutch::{Branch, FaceCache};
use super::config::Config;
use super::motion::{self, index};
use super::{events, sensed};
use crate::physics::driveline;

/// Torque in N·m that the old, rigid driveline transmits behind the disc's share of the inertia in the new configuration.
fn carried_behind_disc(old: &Config, new: &Config, state: &State) -> f64 {
    let (d, y) = (&old.constants.driveline, &state.y);
    let t_fc = events::clutch_torque(old, &FaceCache::EMPTY, state);
    let acceleration =
        driveline::driveline_acceleration(d.J_c, t_fc, motion::resistance(old, y, state.inputs.t_load, state.rest.braking()));
    let acceleration = if state.rest.car { 0.0 } else { acceleration };
    t_fc - new.disc_inertia() * acceleration
}

/// Joins disc and car, and a flywheel that sticks to the disc, at the common speed that conserves momentum. Whether car and engine stand is decided anew.
fn stiffen(old: &Config, state: &mut State) {
    let (d, disc) = (&old.constants.driveline, old.disc_inertia());
    let before = if state.stuck { disc + d.J_f } else { disc };
    let y = &mut state.y;
    let common = events::common_speed([before, d.J_c - disc], [y[index::OMEGA_C], y[index::OMEGA_V]]);
    (y[index::OMEGA_C], y[index::OMEGA_V]) = (common, common);
    if state.stuck {
        y[index::OMEGA_F] = common;
    }
    events::correct_speeds(state, 0.0, 0.0);
}

/// Adapts the state when effects are set while the plant runs. A state that was not in use starts at its signal's current value; shafts that become elastic take the twist of
/// the torque that they transmit; shafts that become rigid give disc and car a common speed.
pub fn carry_over(old: &Config, new: &Config, state: &mut State) {
    let springs = |config: &Config| [config.constants.compliance, config.constants.tyre.softness].map(|soft| soft > 0.0);
    if old.compliant() && !new.compliant() {
        stiffen(old, state);
    }
    if new.compliant() && !old.compliant() {
        state.y[index::OMEGA_V] = state.y[index::OMEGA_C];
        state.y[index::TWIST] = motion::twist_under(new, carried_behind_disc(old, new, state));
    } else if new.compliant() && springs(new) != springs(old) {
        state.y[index::TWIST] = motion::twist_under(new, motion::spring_torque(old, &state.y));
    }
    for (k, place) in sensed::PLACES.into_iter().enumerate() {
        if !sensed::filters(old, k) && sensed::filters(new, k) {
            state.filtered[k] = state.y[place];
        }
    }
    if old.constants.release.width <= 0.0 {
        state.presliding = Presliding { x: state.led, ..Presliding::default() };
    }
    if new.constants.surface.resistance == 0.0 {
        state.y[index::SURFACE] = 0.0;
    }
    if !old.remembers() && new.remembers() {
        state.memory = Branch { x: state.bearing, z: 0.0 };
    }
}
