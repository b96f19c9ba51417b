//! The channels that a recording holds, as one table: name, unit, how a value lasts, how long a gap may be bridged.
//!
//! | held how | meaning | onto another grid |
//! |---|---|---|
//! | `Held` | an input, constant from its sample to the next | the previous value |
//! | `Sensed` | a signal at the sample's instant | a straight line between neighbours |
//! | `Slow` | the housing air | a straight line, and the edge value beyond the ends |

use super::units::Quantity;

/// One of the channels of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Channel {
    /// Time, s.
    Time,
    /// Flywheel speed.
    OmegaF,
    /// Disc speed.
    OmegaC,
    /// Engine torque as reported.
    TE,
    /// Throwout position as commanded.
    XToCmd,
    /// Housing air temperature.
    ThetaH,
    /// Throwout position as sensed (bench).
    XTo,
    /// Clutch torque transducer (bench).
    TFc,
    /// Disc thermocouple (bench).
    ThetaC,
}

/// How a channel's value lasts between its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Zero-order hold.
    Held,
    /// Valid at its instant.
    Sensed,
    /// Slow enough for its edge value to hold beyond the ends.
    Slow,
}

/// What the contract says about one channel.
pub struct Spec {
    /// Which channel.
    pub channel: Channel,
    /// Column name, its unit last.
    pub column: &'static str,
    /// The name without the unit.
    pub stem: &'static str,
    /// Unit as shown.
    pub unit: &'static str,
    /// Physical quantity that the unit measures.
    pub quantity: Quantity,
    /// How a value lasts.
    pub lasting: Lasting,
    /// False for bench channels.
    pub required: bool,
    /// Longest gap that a straight line may bridge, s. Inputs allow none: a replay needs what was really commanded.
    pub bridge_s: f64,
}

/// Every channel, in the order of the columns.
pub const CHANNELS: [Spec; 9] = [
    spec(Channel::Time, "time_s", "time", "s", Quantity::Time, Lasting::Sensed, true, 0.0),
    spec(Channel::OmegaF, "omega_f_rad_s", "omega_f", "rad/s", Quantity::Speed, Lasting::Sensed, true, 0.05),
    spec(Channel::OmegaC, "omega_c_rad_s", "omega_c", "rad/s", Quantity::Speed, Lasting::Sensed, true, 0.05),
    spec(Channel::TE, "T_e_Nm", "T_e", "N·m", Quantity::Torque, Lasting::Held, true, 0.0),
    spec(Channel::XToCmd, "x_to_cmd_mm", "x_to_cmd", "mm", Quantity::Length, Lasting::Held, true, 0.0),
    spec(Channel::ThetaH, "theta_h_degC", "theta_h", "°C", Quantity::Temperature, Lasting::Slow, true, 10.0),
    spec(Channel::XTo, "x_to_mm", "x_to", "mm", Quantity::Length, Lasting::Sensed, false, 0.05),
    spec(Channel::TFc, "T_fc_Nm", "T_fc", "N·m", Quantity::Torque, Lasting::Sensed, false, 0.05),
    spec(Channel::ThetaC, "theta_c_degC", "theta_c", "°C", Quantity::Temperature, Lasting::Sensed, false, 0.05),
];

impl Channel {
    /// The contract's entry for this channel.
    pub fn spec(self) -> &'static Spec {
        &CHANNELS[self as usize]
    }

    /// The channel whose column is called `name`.
    pub fn from_column(name: &str) -> Option<Channel> {
        CHANNELS.iter().find(|s| s.column == name).map(|s| s.channel)
    }
}

#[allow(clippy::too_many_arguments)]
const fn spec(
    channel: Channel,
    column: &'static str,
    stem: &'static str,
    unit: &'static str,
    quantity: Quantity,
    lasting: Lasting,
    required: bool,
    bridge_s: f64,
) -> Spec {
    Spec { channel, column, stem, unit, quantity, lasting, required, bridge_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_is_in_the_order_of_the_enum() {
        for (i, s) in CHANNELS.iter().enumerate() {
            assert_eq!(s.channel as usize, i);
            assert_eq!(Channel::from_column(s.column), Some(s.channel));
            assert!(s.column.starts_with(s.stem));
        }
    }
}
