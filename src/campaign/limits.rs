//! How much is read: what is larger ends with a message and not with a machine that is out of memory.
//!
//! A row of a campaign takes 0.6 kB of memory in a replay and 3 to 5 kB in a diagnosis, so that a campaign at its limit takes up to 10 GB; where there is less, the commands that diagnose say so and end.

/// Bytes of one line of a text file, and of vehicle.json or recordings.json, at most.
pub(crate) const TEXT_BYTES: usize = 16 << 20;

/// Rows of one file, at most: lines of a text file, records of an MDF group; five hours at a kilohertz.
pub(crate) const FILE_ROWS: u64 = 20_000_000;

/// Recordings of one campaign, at most.
pub(crate) const RECORDINGS: usize = 1_000;

/// Rows of all recordings of one campaign together, at most: five hours at 100 Hz.
pub(crate) const CAMPAIGN_ROWS: usize = 2_000_000;
