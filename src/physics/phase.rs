//! Phase of the clutch, as plant and controller report it.

/// Phase of the clutch, numbered as the FMUs' enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Phase {
    /// No contact.
    #[default]
    Open = 1,
    /// Contact with slip.
    Slipping = 2,
    /// Contact without slip.
    Locked = 3,
}
