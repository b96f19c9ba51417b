//! Limits of what is read: anything larger ends with a message instead of using up the machine's memory.
//!
//! A row of a campaign takes 0.6 kB of memory in a replay and 3 to 5 kB in a diagnosis, so that a campaign at its limit takes up to 10 GB; where less
//! is available, the commands that diagnose say so and stop.

/// Largest size of one line of a text file, and of vehicle.json and recordings.json, bytes.
pub(crate) const TEXT_BYTES: usize = 16 << 20;

/// Largest number of rows in one file, which are lines of a text file or records of an MDF group: five hours at 1 kHz.
pub(crate) const FILE_ROWS: u64 = 20_000_000;

/// Largest number of recordings in one campaign.
pub(crate) const RECORDINGS: usize = 1_000;

/// Largest number of rows in all recordings of one campaign together: five hours at 100 Hz.
pub(crate) const CAMPAIGN_ROWS: usize = 2_000_000;
