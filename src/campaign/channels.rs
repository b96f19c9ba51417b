//! The channels of a recording as one table: name, unit, whether the channel is required, and how long a value holds.
//!
//! | [`Lasting`] | meaning | in a row without a sample |
//! |---|---|---|
//! | `Held` | an input, constant from its sample to the next | the previous value, for at most 100 ms of missing samples |
//! | `Sensed` | a signal at the sample's instant | NaN |
//! | `Slow` | a signal that changes seldom: housing air, brake, validity | the previous value |

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
    /// Whether the driver brakes.
    Brake,
    /// Whether the row's samples can be trusted.
    Valid,
}

/// How long a channel's value holds between its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Zero-order hold.
    Held,
    /// Valid at the sample's instant only.
    Sensed,
    /// Holds until the next sample, however long that takes; the first value also holds before it.
    Slow,
}

/// Which recordings have a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// A recording cannot be used without it.
    Always,
    /// Most recordings have it; less can be assessed without it.
    Usual,
    /// On the test bench only.
    Bench,
    /// In drives only.
    Road,
}

/// The contract's entry for one channel.
pub struct Spec {
    /// The channel.
    pub channel: Channel,
    /// Column name, which ends with the unit.
    pub column: &'static str,
    /// The name without the unit.
    pub stem: &'static str,
    /// Unit as shown.
    pub unit: &'static str,
    /// Physical quantity that the unit measures.
    pub quantity: Quantity,
    /// How long a value holds.
    pub lasting: Lasting,
    /// Which recordings have it.
    pub presence: Presence,
}

/// Every channel, in the order of the columns.
pub const CHANNELS: [Spec; 11] = {
    use Lasting::{Held, Sensed, Slow};
    use Presence::{Always, Bench, Road, Usual};
    [
        spec(Channel::Time, "time_s", "time", Quantity::Time, Sensed, Always),
        spec(Channel::OmegaF, "omega_f_rad_s", "omega_f", Quantity::Speed, Sensed, Always),
        spec(Channel::OmegaC, "omega_c_rad_s", "omega_c", Quantity::Speed, Sensed, Always),
        spec(Channel::TE, "T_e_Nm", "T_e", Quantity::Torque, Held, Always),
        spec(Channel::XToCmd, "x_to_cmd_mm", "x_to_cmd", Quantity::Length, Held, Usual),
        spec(Channel::ThetaH, "theta_h_degC", "theta_h", Quantity::Temperature, Slow, Usual),
        spec(Channel::XTo, "x_to_mm", "x_to", Quantity::Length, Sensed, Bench),
        spec(Channel::TFc, "T_fc_Nm", "T_fc", Quantity::Torque, Sensed, Bench),
        spec(Channel::ThetaC, "theta_c_degC", "theta_c", Quantity::Temperature, Sensed, Bench),
        spec(Channel::Brake, "brake", "brake", Quantity::Flag, Slow, Road),
        spec(Channel::Valid, "valid", "valid", Quantity::Flag, Slow, Road),
    ]
};

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

const fn spec(
    channel: Channel,
    column: &'static str,
    stem: &'static str,
    quantity: Quantity,
    lasting: Lasting,
    presence: Presence,
) -> Spec {
    Spec { channel, column, stem, unit: quantity.unit(), quantity, lasting, presence }
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
